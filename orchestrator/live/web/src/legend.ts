// The controllers: a switch for each, and what the colours mean.

import type { Comparison, ShownLoop } from "./types";

/** A sample of a line. */
export function swatch(kind: string): string {
  return `<span class="swatch of-${kind}"></span>`;
}

/** A sample of each vehicle's lines, with its name; of a single vehicle, nothing. */
function vehicles({ loops, colours }: Comparison): HTMLElement[] {
  return colours.map((colour, k) => {
    const item = document.createElement("li");
    item.innerHTML = swatch("vehicle");
    (item.firstChild as HTMLElement).style.setProperty("--vehicle", colour);
    item.append(loops[0].vehicles[k].name);
    return item;
  });
}

/** A switch for each controller; `changed` gets the labels of those that are hidden. */
export function buildSwitches(
  host: HTMLElement,
  loops: readonly ShownLoop[],
  hidden: readonly string[],
  changed: (hidden: readonly string[]) => void,
): void {
  const labels = loops.map(({ label }, place) => {
    const whole = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.value = label;
    box.checked = !hidden.includes(label);
    box.addEventListener("change", () => {
      const boxes = [...host.querySelectorAll("input")];
      changed(boxes.filter(({ checked }) => !checked).map(({ value }) => value));
    });
    const words = document.createElement("span");
    words.innerHTML = swatch(String(place));
    words.append(label);
    whole.append(box, words);
    return whole;
  });
  const legend = host.querySelector("legend");
  host.replaceChildren(...(legend ? [legend] : []), ...labels);
}

/**
 * What the colours mean: of the vehicles, of the controllers, and of `others`, such as `reference`.
 *
 * Where each vehicle has its colour, a controller has only its style of line.
 */
export function fillLegend(
  host: HTMLElement,
  comparison: Comparison,
  loops: readonly ShownLoop[],
  others: readonly string[],
): void {
  const [first] = comparison.colours;
  const style = first === undefined ? "" : " of-all";
  const items = loops.map(({ label }, place) => [`${place}${style}`, label]);
  items.push(...others.map((name) => [name, name]));
  host.replaceChildren(
    ...vehicles(comparison),
    ...items.map(([kind, label]) => {
      const item = document.createElement("li");
      item.innerHTML = swatch(kind);
      item.append(label);
      return item;
    }),
  );
}
