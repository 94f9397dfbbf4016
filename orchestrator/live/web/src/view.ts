// The page of stored runs: reads their rows from its data, and draws them.

import { Display } from "./display";
import { element, sayFailure, unpacked } from "./dom";
import { buildSwitches } from "./legend";
import { longest } from "./panels";
import { fleetOf } from "./settings";
import type { Run, StoredData, StoredRun } from "./types";

/** Reads a stored run: its columns one after the other, the time first. */
function runOf(stored: StoredRun, content: ArrayBuffer): Run {
  const { rows, doubles, singles } = stored;
  const columns = new Map<string, Float64Array>();
  const time = new Float64Array(content, 0, rows);
  doubles.forEach((name, k) => {
    columns.set(name, new Float64Array(content, (1 + k) * time.byteLength, rows));
  });
  const start = (1 + doubles.length) * time.byteLength;
  singles.forEach((name, k) => {
    columns.set(name, Float64Array.from(new Float32Array(content, start + 4 * k * rows, rows)));
  });
  return {
    ...stored,
    columns: [...doubles, ...singles],
    time,
    has: (name) => columns.has(name),
    column(name) {
      const found = columns.get(name);
      if (found === undefined) throw new Error(`there is no column ${name}`);
      return found;
    },
  };
}

async function start(): Promise<void> {
  const [[text], contents] = await Promise.all([unpacked("data"), unpacked("binary")]);
  const data: StoredData = JSON.parse(new TextDecoder().decode(text));
  const runs = data.loops.map((loop, k) => runOf(loop, contents[k]));
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
