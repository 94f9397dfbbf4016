// All that can be set: sliders under headings, and every parameter in a list.

import { type Changed, Field, SliderRow } from "./field";
import { parametersOf, type Settings } from "./settings";
import { GROUPS, of } from "./sliders";
import type { Preset, VehicleData } from "./types";

export class Controls {
  readonly #groups: HTMLElement;
  readonly #list: HTMLElement;
  readonly #search: HTMLInputElement;
  readonly #changed: Changed;
  #rows: SliderRow[] = [];
  #fields: Field[] = [];
  #entries: { element: HTMLElement; text: string }[] = [];

  constructor(groups: HTMLElement, list: HTMLElement, search: HTMLInputElement, changed: Changed) {
    this.#groups = groups;
    this.#list = list;
    this.#search = search;
    this.#changed = changed;
    search.addEventListener("input", () => this.#filter());
  }

  /** Makes the controls of a preset; the sliders are of one vehicle. */
  build(preset: Preset, vehicle: VehicleData): void {
    const parameters = parametersOf(preset);
    const known = new Map(
      [...this.#groups.querySelectorAll("details")].map((one) => [one.dataset.title, one.open]),
    );
    this.#rows = [];
    const groups = GROUPS.flatMap(({ title, open, rows }) => {
      const made = rows
        .map((row) => of(vehicle, row))
        .map((row) => ({ row, found: row.names.flatMap((name) => parameters.get(name) ?? []) }))
        .filter(({ row, found }) => found.length === row.names.length)
        .map(
          ({ row, found }) =>
            new SliderRow(row, found, onlyIn(preset, row.names[0]), this.#changed),
        );
      if (made.length === 0) return [];
      this.#rows.push(...made);
      const details = document.createElement("details");
      details.dataset.title = title;
      details.open = known.get(title) ?? open ?? false;
      const summary = document.createElement("summary");
      summary.textContent = title;
      details.append(summary, ...made.map(({ root }) => root));
      return [details];
    });
    this.#groups.replaceChildren(...groups);
    this.#fields = [...parameters.values()].map((one) => new Field(one, one.name, this.#changed));
    this.#entries = this.#fields.map((field) => entry(field));
    this.#list.replaceChildren(...this.#entries.map(({ element }) => element));
    this.#filter();
  }

  /** Shows the parameters that have all words of the search. */
  #filter(): void {
    const words = this.#search.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const { element, text: own } of this.#entries) {
      element.hidden = !words.every((word) => own.includes(word));
    }
  }

  show({ values }: Settings): void {
    for (const row of this.#rows) row.show(values);
    for (const field of this.#fields) field.show(values[field.parameter.name]);
  }

  /** Marks what a message names; empty: all is well. Returns whether the message can be seen. */
  refuse(message: string): boolean {
    for (const field of this.#fields) field.refuse(message);
    const said = this.#rows.filter((row) => row.refuse(message));
    return said.some(({ root }) => root.closest("details")?.open);
  }
}

/** The controller that has a parameter, if only one of them has it. */
function onlyIn({ loops }: Preset, name: string): string {
  const having = loops.filter(({ parameters }) => parameters.some((one) => one.name === name));
  return loops.length > 1 && having.length === 1 ? `${having[0].label} only` : "";
}

function entry(field: Field): { element: HTMLElement; text: string } {
  const { name, description, unit } = field.parameter;
  const element = document.createElement("label");
  const words = document.createElement("span");
  words.className = "words";
  const code = document.createElement("code");
  code.textContent = name;
  const meaning = document.createElement("small");
  meaning.textContent = description;
  words.append(code, meaning);
  const units = document.createElement("span");
  units.className = "unit";
  units.textContent = unit ?? "";
  element.append(words, field.element, units);
  return { element, text: `${name} ${description}`.toLowerCase() };
}
