// The page of stored runs: reads their rows from its data, and draws them.

import { Display } from "./display";
import { element, sayFailure, unpacked } from "./dom";
import { buildSwitches } from "./legend";
import { longest } from "./panels";
import { fleetOf } from "./settings";
import type { Metrics, Occurrence, Run, StoredData, StoredRun, Values } from "./types";

/** Rows of a stored run. */
class Stored implements Run {
  readonly actingRow: number;
  readonly columns: readonly string[];
  readonly rows: number;
  readonly parameters: Values;
  readonly happened: readonly Occurrence[];
  readonly metrics: readonly Metrics[];
  readonly time: Float64Array;
  readonly #known = new Map<string, Float64Array>();

  constructor(run: StoredRun, content: ArrayBuffer) {
    const { rows, doubles, singles } = run;
    this.actingRow = run.actingRow;
    this.columns = [...doubles, ...singles];
    this.rows = rows;
    this.parameters = run.parameters;
    this.happened = run.happened;
    this.metrics = run.metrics;
    this.time = new Float64Array(content, 0, rows);
    const start = (1 + doubles.length) * this.time.byteLength;
    doubles.forEach((name, k) => {
      this.#known.set(name, new Float64Array(content, (1 + k) * this.time.byteLength, rows));
    });
    singles.forEach((name, k) => {
      const values = new Float32Array(content, start + 4 * k * rows, rows);
      this.#known.set(name, Float64Array.from(values));
    });
  }

  has(name: string): boolean {
    return this.#known.has(name);
  }

  column(name: string): Float64Array {
    const found = this.#known.get(name);
    if (found === undefined) throw new Error(`there is no column ${name}`);
    return found;
  }
}

async function start(): Promise<void> {
  const [[text], contents] = await Promise.all([unpacked("data"), unpacked("binary")]);
  const data: StoredData = JSON.parse(new TextDecoder().decode(text));
  const runs = data.loops.map((loop, k) => new Stored(loop, contents[k]));
  const display = new Display(data, longest(runs)?.time[0]);
  const labels = data.loops.map(({ label }) => label);
  const fleet = fleetOf(data);
  const select = element<HTMLSelectElement>("vehicle");
  let hidden: readonly string[] = [];
  const show = () => {
    const chosen = Math.max(0, select.selectedIndex);
    display.paint(data.colours[chosen]);
    const shown = runs.map((run, k) => (hidden.includes(labels[k]) ? undefined : run));
    display.show(data, data.loops, shown, chosen);
  };
  select.addEventListener("change", show);
  buildSwitches(element("loops"), data.loops, hidden, (labels) => {
    hidden = labels;
    show();
  });
  display.build(data, data.loops);
  show();
  element("toolbar").hidden = data.loops.length < 2 && fleet.length < 2;
  element("stage").hidden = fleet.length === 0;
  element("results").hidden = element("indices").querySelector("td") === null;
  document.body.classList.add("started");
}

start().catch(sayFailure);
