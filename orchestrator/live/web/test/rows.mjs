// Writes the rows of presets: `node rows.mjs ENGINE MODULES DATA FOLDER`, with commas between the
// modules. Writes a file of doubles for each loop, column by column, and all else about the runs to
// the output.
import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [engine, modules, data, folder] = process.argv.slice(2);
const { Engine, metrics } = await import(pathToFileURL(engine).href);
const content = JSON.parse(readFileSync(data, "utf8"));
const made = await Engine.load(
  modules.split(",").map((module) => readFileSync(module)),
  content,
);
const found = {};
for (const { name, stopTime, step, events, loops } of content.presets) {
  for (const [i, loop] of loops.entries()) {
    const result = made.run(loop, {}, { stopTime, step, events: loop.events[events] ?? [] });
    writeFileSync(`${folder}/${name}.${i}`, result.table);
    const { columns, happened, failure, remark, messages, cautions } = result;
    found[`${name}.${i}`] = {
      columns,
      happened,
      failure,
      remark,
      messages,
      cautions,
      metrics: loop.vehicles.map((_, place) => metrics(result, place, loop.vehicles)),
    };
  }
}
console.log(JSON.stringify(found));
