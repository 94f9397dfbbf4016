// Ask the site's search: `node search.mjs SITE < questions`, a question a line. Prints a line of
// JSON each: the locations that it finds, page by page, as the site lists them.
import { readdirSync, readFileSync } from "node:fs";
import { runInThisContext } from "node:vm";

const [site] = process.argv.slice(2);
const { config, docs } = JSON.parse(readFileSync(`${site}/search/search_index.json`, "utf8"));
const workers = `${site}/assets/javascripts/workers`;
const [worker] = readdirSync(workers).filter((name) => /^search\..*\.js$/.test(name));

// What the worker of the page finds around it.
let handle;
let answered;
Object.assign(globalThis, {
  self: globalThis,
  addEventListener: (_, listener) => {
    handle = listener;
  },
  postMessage: (message) => answered(message.data),
  Worker: class {
    postMessage(data) {
      handle({ data });
    }
  },
});
runInThisContext(readFileSync(`${workers}/${worker}`, "utf8"));
runInThisContext(readFileSync(`${site}/javascripts/questions.js`, "utf8"));

const search = new Worker();
const ask = (type, data) =>
  new Promise((resolve) => {
    answered = resolve;
    search.postMessage({ type, data });
  });

const SETUP = 0;
const QUERY = 2;
await ask(SETUP, { config, docs, options: { suggest: true } });
for (const question of readFileSync(0, "utf8").trim().split("\n")) {
  const { items } = await ask(QUERY, question);
  console.log(JSON.stringify(items.map((page) => page.map(({ location }) => location))));
}
