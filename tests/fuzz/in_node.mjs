// Runs programs of a module of the page: `node in_node.mjs MODULE < RUNS`, each with its number, its
// parameters, its times and steps, and the width of its rows. On the output: what each comes to.
import { readFileSync } from "node:fs";

const { instance } = await WebAssembly.instantiate(readFileSync(process.argv[2]));
const { memory, __heap_base, _initialize, ...functions } = instance.exports;
_initialize();

// Memory for so many doubles, where nothing else is.
let end = Math.ceil(__heap_base.value / 8) * 8;
function doubles(n) {
  const place = end;
  end += n * 8;
  const missing = Math.ceil((end - memory.buffer.byteLength) / 65536);
  if (missing > 0) memory.grow(missing);
  return place;
}

const runs = JSON.parse(readFileSync(0, "utf8"));
const found = runs.map(({ number, values, times, fullSteps, steps, width }) => {
  const call = (name, ...given) => functions[`p${number}_${name}`](...given);
  const size = Math.ceil(call("size_of_simulation") / 8);
  const sizes = [size, size, 2, values.length, 1, (steps + 1) * width];
  const [simulation, ahead, said, given, happened, rows] = sizes.map(doubles);
  new Float64Array(memory.buffer, given, values.length).set(values);
  const hasBegun = !call("begin", simulation, given, ...times, fullSteps, steps);
  const isWhole =
    hasBegun &&
    !call("run_with_events", simulation, ahead, steps, rows, given, 0, 0, 0, happened);
  call("failure", simulation, said);
  const [component, , , made] = new Int32Array(memory.buffer, said, 4);
  const shown = call("rows_shown", simulation) * width * 8;
  const bytes = Buffer.from(memory.buffer, rows, shown).toString("base64");
  return { hasBegun, isWhole, component, made, rows: bytes };
});
console.log(JSON.stringify(found));
