// Writes digests of tables after changes of settings: `node tables.mjs ENGINE MODULES DATA`, with
// commas between the modules. Reads a list of changes in JSON; writes a list with the digest of the
// table, or the refusal, after each.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [engine, modules, data] = process.argv.slice(2);
const { apiWithoutPage, Engine } = await import(pathToFileURL(engine).href);
const content = JSON.parse(readFileSync(data, "utf8"));
const loaded = modules.split(",").map((module) => readFileSync(module));
const { set, csv } = apiWithoutPage(content, await Engine.load(loaded, content));
const found = [];
for (const changes of JSON.parse(readFileSync(0, "utf8"))) {
  try {
    await set(changes);
    const digest = createHash("sha256")
      .update(await csv())
      .digest("hex");
    found.push({ digest });
  } catch (error) {
    found.push({ refusal: error.message });
  }
}
console.log(JSON.stringify(found));
