// The controllers: a switch for each, and what the colours mean.

import type { LoopData } from "./types";

/** A sample of a line. */
export function swatch(kind: string): string {
  return `<span class="swatch of-${kind}"></span>`;
}

/** A switch for each controller; `changed` gets the labels of those that are hidden. */
export function buildSwitches(
  host: HTMLElement,
  loops: readonly LoopData[],
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

/** What the colours mean: of the controllers, and of `others`, such as `reference`. */
export function fillLegend(
  host: HTMLElement,
  loops: readonly LoopData[],
  others: readonly string[],
): void {
  const items = loops.map(({ label }, place) => [String(place), label]);
  items.push(...others.map((name) => [name, name]));
  host.replaceChildren(
    ...items.map(([kind, label]) => {
      const item = document.createElement("li");
      item.innerHTML = swatch(kind);
      item.append(label);
      return item;
    }),
  );
}
