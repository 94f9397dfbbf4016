// The page of stored runs: reads their rows from its data, and draws them.

import { Display } from "./display";
import { element, sayFailure, unpacked } from "./dom";
import { buildSwitches } from "./legend";
import { longest } from "./panels";
import { fleetOf } from "./settings";
import { columnsOf } from "./simulate";
import type { Run, StoredData, StoredRun } from "./types";

/** Reads a stored run: its columns one after the other, the time first. */
function runOf(stored: StoredRun, content: ArrayBuffer): Run {
  const { rows, doubles, singles } = stored;
  const names = [...doubles, ...singles];
  const places = new Map(names.map((name, place) => [name, place]));
  const wide = 1 + doubles.length;
  const start = 8 * wide * rows;
  const columns = [
    ...Array.from({ length: wide }, (_, k) => new Float64Array(content, 8 * k * rows, rows)),
    ...singles.map((_, k) =>
      Float64Array.from(new Float32Array(content, start + 4 * k * rows, rows)),
    ),
  ];
  return {
    ...stored,
    ...columnsOf(
      names,
      (name) => places.get(name),
      (place) => columns[place],
    ),
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
  display.start();
  document.body.classList.add("started");
}

start().catch(sayFailure);
