// Writes whether signals chatter, and their means: `node chatter.mjs ENGINE`. Reads the time and the
// signals in JSON, a list of lists.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { chatters, movingMean } = await import(pathToFileURL(process.argv[2]).href);
const [time, ...signals] = JSON.parse(readFileSync(0, "utf8")).map((one) => Float64Array.from(one));
const found = signals.map((signal) => [chatters(signal), [...movingMean(time, signal)]]);
console.log(JSON.stringify(found));
