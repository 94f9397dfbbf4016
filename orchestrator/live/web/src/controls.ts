// Controls of parameters: sliders under headings, and a list of all parameters.

import { make, numberField } from "./dom";
import { type Changes, parametersOf, type Settings } from "./settings";
import {
  firstWords,
  GROUPS,
  POSITIONS,
  positionOf,
  type Slider,
  sliderOf,
  valueAt,
} from "./sliders";
import { entered } from "./text";
import type { Parameter, Preset, Value, Values, VehicleData } from "./types";

type Changed = (values: Changes) => void;

/** Describes a parameter: its meaning, range and value in the preset. */
function explained(parameter: Parameter): string {
  const { name, description, unit, min, max, value, choices } = parameter;
  const range = [
    min === undefined ? "" : `at least ${min}`,
    max === undefined ? "" : `at most ${max}`,
    choices ? `one of ${Object.keys(choices).join(", ")}` : "",
  ].filter(Boolean);
  const lines = [
    name,
    description,
    [unit ? `in ${unit}` : "", ...range].filter(Boolean).join(", "),
    `preset: ${value}`,
  ];
  return lines.filter(Boolean).join("\n");
}

/** A field for one parameter. */
class Field {
  readonly element: HTMLInputElement | HTMLSelectElement;
  readonly parameter: Parameter;
  /** Last argument of `show`; null: the user has changed the field since. */
  #shown: Value | undefined | null = null;
  #wrong = "";

  constructor(parameter: Parameter, label: string, changed: Changed) {
    this.parameter = parameter;
    const { name, type, choices } = parameter;
    if (choices) {
      const options = Object.keys(choices).map((choice) => new Option(choice, choice));
      this.element = make("select", "", ...options);
    } else {
      const input = numberField();
      if (type === "Boolean") input.type = "checkbox";
      input.autocomplete = "off";
      input.spellcheck = false;
      this.element = input;
    }
    this.element.title = explained(parameter);
    this.element.setAttribute("aria-label", label);
    this.element.dataset.name = name;
    this.element.addEventListener("change", () => {
      this.#shown = null;
      changed({ [name]: this.#entered() });
    });
  }

  /** Reads the value in the field; NaN: it is not a number. */
  #entered(): Value {
    const { element, parameter } = this;
    if (element instanceof HTMLInputElement && element.type === "checkbox") return element.checked;
    return parameter.type === "Enumeration" ? element.value : entered(element.value);
  }

  /** Shows a changed value; undefined: the preset's value. */
  show(given: Value | undefined): void {
    // Most fields do not change while a slider moves.
    if (given === this.#shown && !this.#wrong) return;
    this.#shown = given;
    const { element } = this;
    const value = given ?? this.parameter.value;
    if (element instanceof HTMLInputElement && element.type === "checkbox") {
      element.checked = value === true;
    } else if (document.activeElement !== element || this.#entered() !== value) {
      // An invalid number stays in the field, so that the user can correct it.
      if (!Number.isNaN(value)) element.value = String(value);
    }
    element.classList.toggle("changed", given !== undefined);
  }

  /** Marks the field if a message names its parameter; tells whether it does. */
  refuse(message: string): boolean {
    const isNamed = names(message, this.parameter.name);
    this.invalid = isNamed ? message : "";
    return isNamed;
  }

  /** Sets the reason for which the value is refused; empty: it is accepted. */
  set invalid(why: string) {
    if (why === this.#wrong) return;
    this.#wrong = why;
    this.element.setAttribute("aria-invalid", String(why !== ""));
    this.element.title = why || explained(this.parameter);
  }
}

/** A slider that sets one or several parameters together, and a field for each. */
class SliderRow {
  readonly root: HTMLElement;
  readonly fields: readonly Field[];
  readonly #row: Slider;
  readonly #slider: HTMLInputElement;
  readonly #reset: HTMLButtonElement;
  readonly #error: HTMLElement;
  #shown: string | undefined;

  constructor(row: Slider, parameters: readonly Parameter[], only: string, changed: Changed) {
    this.#row = row;
    const [parameter] = parameters;
    const spoken = row.spoken ?? parameter.name;
    const words = row.words ?? firstWords(parameter.description);
    const symbol = make("span", "symbol");
    symbol.innerHTML = row.symbol;
    const label = make("span", "label", words, "\u00a0", symbol);
    if (only) label.append(" ", make("span", "only", only));
    label.title = explained(parameter);
    const unit = make("span", "unit", parameter.unit ?? "");
    this.#reset = make("button", "reset", "↺");
    this.#reset.type = "button";
    this.#reset.title = `back to ${parameters.map(({ value }) => value).join(", ")}`;
    this.#reset.setAttribute("aria-label", `Reset ${spoken}`);
    this.#reset.addEventListener("click", () => {
      changed(Object.fromEntries(row.names.map((name) => [name, undefined])));
      this.#slider.focus();
    });
    this.#slider = document.createElement("input");
    this.#slider.type = "range";
    this.#slider.max = String(POSITIONS);
    this.#slider.step = String(stepOf(row));
    this.#slider.setAttribute("aria-label", `${words}: ${spoken}`);
    this.#slider.title = row.spoken
      ? `sets ${row.names.join(", ")} together`
      : explained(parameter);
    this.#slider.dataset.names = row.names.join(" ");
    this.#slider.addEventListener("input", () => {
      const value = valueAt(row.scale, this.#slider.valueAsNumber);
      changed(
        Object.fromEntries(row.names.map((name, k) => [name, (row.signs?.[k] ?? 1) * value + 0])),
      );
    });
    this.fields = parameters.map((one) => new Field(one, one.name, changed));
    const fields = make("span", "fields", ...this.fields.map(({ element }) => element));
    this.#error = make("p", "error");
    this.#error.setAttribute("role", "alert");
    this.#error.hidden = true;
    const isSingle = parameters.length === 1;
    const head = make("div", "head", label, this.#reset);
    const line = make("div", "line", this.#slider, ...(isSingle ? [fields] : []), unit);
    this.root = make("div", "row", head, line, ...(isSingle ? [] : [fields]), this.#error);
  }

  show(given: Values): void {
    // Most rows do not change while a slider moves.
    const shown = this.#row.names.map((name) => given[name]).join();
    for (const field of this.fields) field.show(given[field.parameter.name]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const values = this.fields.map(({ parameter }) => given[parameter.name] ?? parameter.value);
    const last = values.length - 1;
    const value = Number(values[last]) * (this.#row.signs?.[last] ?? 1);
    if (!Number.isNaN(value)) {
      this.#slider.step = "any";
      this.#slider.value = String(positionOf(this.#row.scale, value));
      this.#slider.step = String(stepOf(this.#row));
    }
    this.#slider.setAttribute("aria-valuetext", [...new Set(values)].join(", "));
    const isChanged = this.#row.names.some((name) => given[name] !== undefined);
    // It keeps its place, so that nothing moves while a slider does.
    this.#reset.style.visibility = isChanged ? "" : "hidden";
    this.root.classList.toggle("changed", isChanged);
  }

  /** Marks the row if a message names one of its parameters; tells whether it does. */
  refuse(message: string): boolean {
    const isNamed = this.fields.map((field) => field.refuse(message)).includes(true);
    this.#error.hidden = !isNamed;
    this.#error.textContent = isNamed ? message : "";
    return isNamed;
  }
}

/** Returns the step of the slider for an arrow key. */
function stepOf({ scale }: Slider): number {
  return scale.whole ? POSITIONS / (scale.high - scale.low) : 10;
}

/** Tells whether a message names a parameter: `component.parameter` or `component: parameter`. */
export function names(message: string, name: string): boolean {
  // The names of components and of parameters may have dots.
  const dots = [...name.matchAll(/\./g)].map(({ index }) => index);
  const forms = dots.map((dot) => `${name.slice(0, dot)}: ${name.slice(dot + 1)}`);
  return [name, ...forms].some((text) => {
    const at = message.indexOf(text);
    return at >= 0 && !/[\w[.]/.test(message[at + text.length] ?? "");
  });
}

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

  /** Makes the controls of a preset, with sliders for one vehicle. */
  build(preset: Preset, vehicle: VehicleData): void {
    const parameters = parametersOf(preset);
    const known = new Map(
      [...this.#groups.querySelectorAll("details")].map((one) => [one.dataset.title, one.open]),
    );
    this.#rows = [];
    const groups = GROUPS.flatMap(({ title, open, rows }) => {
      const made = rows
        .map((row) => sliderOf(vehicle, row))
        .map((row) => ({ row, found: row.names.flatMap((name) => parameters.get(name) ?? []) }))
        .filter(({ row, found }) => found.length === row.names.length)
        .map(
          ({ row, found }) =>
            new SliderRow(row, found, onlyIn(preset, row.names[0]), this.#changed),
        );
      if (made.length === 0) return [];
      this.#rows.push(...made);
      const roots = made.map(({ root }) => root);
      const details = make("details", "", make("summary", "", title), ...roots);
      details.dataset.title = title;
      details.open = known.get(title) ?? open ?? false;
      return [details];
    });
    this.#groups.replaceChildren(...groups);
    this.#fields = [...parameters.values()].map((one) => new Field(one, one.name, this.#changed));
    this.#entries = this.#fields.map((field) => entry(field));
    this.#list.replaceChildren(...this.#entries.map(({ element }) => element));
    this.#filter();
  }

  /** Shows the parameters that contain all words of the search. */
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

  /** Marks the parameters that a message names; tells whether it can be seen at a slider. */
  refuse(message: string): boolean {
    for (const field of this.#fields) field.refuse(message);
    const named = this.#rows.filter((row) => row.refuse(message));
    return named.some(({ root }) => root.closest("details")?.open);
  }
}

/** Returns a note if only one of several controllers has a parameter. */
function onlyIn({ loops }: Preset, name: string): string {
  const having = loops.filter(({ parameters }) => parameters.some((one) => one.name === name));
  return loops.length > 1 && having.length === 1 ? `${having[0].label} only` : "";
}

function entry(field: Field): { element: HTMLElement; text: string } {
  const { name, description, unit } = field.parameter;
  const words = make("span", "words", make("code", "", name), make("small", "", description));
  const element = make("label", "", words, field.element, make("span", "unit", unit ?? ""));
  return { element, text: `${name} ${description}`.toLowerCase() };
}
