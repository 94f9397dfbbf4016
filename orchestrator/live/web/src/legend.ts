// The controllers: a switch for each, and a legend of the colours.

import { make } from "./dom";
import type { Comparison, ShownLoop } from "./types";

/** Makes a sample of a line. */
export function swatch(kind: string): HTMLElement {
  return make("span", `swatch of-${kind}`);
}

/** Makes a sample of each vehicle's lines, with its name; of a single vehicle, nothing. */
function vehicles({ loops, colours }: Comparison): HTMLElement[] {
  return colours.map((colour, k) => {
    const sample = swatch("vehicle");
    sample.style.setProperty("--vehicle", colour);
    return make("li", "", sample, loops[0].vehicles[k].name);
  });
}

/** Makes a switch for each controller; `changed` gets the labels of hidden ones. */
export function buildSwitches(
  host: HTMLElement,
  loops: readonly ShownLoop[],
  hidden: readonly string[],
  changed: (hidden: readonly string[]) => void,
): void {
  const labels = loops.map(({ label }, place) => {
    const box = document.createElement("input");
    box.type = "checkbox";
    box.value = label;
    box.checked = !hidden.includes(label);
    box.addEventListener("change", () => {
      const boxes = [...host.querySelectorAll("input")];
      changed(boxes.filter(({ checked }) => !checked).map(({ value }) => value));
    });
    return make("label", "", box, make("span", "", swatch(String(place)), label));
  });
  // A single controller cannot be hidden.
  host.hidden = loops.length < 2;
  const legend = host.querySelector("legend");
  host.replaceChildren(...(legend ? [legend] : []), ...labels);
}

/**
 * Makes the legend of vehicles, controllers, and `others`, such as `reference`.
 *
 * If each vehicle has its own colour, controllers differ only in the style of their lines.
 */
export function fillLegend(
  host: HTMLElement,
  comparison: Comparison,
  loops: readonly ShownLoop[],
  others: readonly string[],
): void {
  const style = comparison.colours.length === 0 ? "" : " of-all";
  const compared = loops.length > 1 ? loops : [];
  const items = compared.map(({ label }, place) => [`${place}${style}`, label]);
  items.push(...others.map((name) => [name, name]));
  host.replaceChildren(
    ...vehicles(comparison),
    ...items.map(([kind, label]) => make("li", "", swatch(kind), label)),
  );
}
