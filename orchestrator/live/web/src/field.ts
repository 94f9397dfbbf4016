// A number, choice or switch for one parameter, and a row of them with a slider.

import type { Changes } from "./settings";
import { POSITIONS, positionOf, type Slider, valueAt } from "./sliders";
import { entered } from "./text";
import type { Parameter, Value, Values } from "./types";

export type Changed = (values: Changes) => void;

/** What a parameter means, where it may lie and what it is without a change. */
export function explained(parameter: Parameter): string {
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
export class Field {
  readonly element: HTMLInputElement | HTMLSelectElement;
  readonly parameter: Parameter;
  /** What it shows, as `show` has got it; null: something else. */
  #shown: Value | undefined | null = null;
  #wrong = "";

  constructor(parameter: Parameter, label: string, changed: Changed) {
    this.parameter = parameter;
    const { name, type, choices } = parameter;
    if (choices) {
      const select = document.createElement("select");
      select.append(...Object.keys(choices).map((choice) => new Option(choice, choice)));
      this.element = select;
    } else {
      const input = document.createElement("input");
      input.type = type === "Boolean" ? "checkbox" : "text";
      if (type !== "Boolean") input.inputMode = "decimal";
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

  /** The value in the field; NaN: it cannot be read. */
  #entered(): Value {
    const { element, parameter } = this;
    if (element instanceof HTMLInputElement && element.type === "checkbox") return element.checked;
    return parameter.type === "Enumeration" ? element.value : entered(element.value);
  }

  /** Shows the value that is set; undefined: the preset's own. */
  show(given: Value | undefined): void {
    // Nearly all of them stay as they are while a slider moves.
    if (given === this.#shown && !this.#wrong) return;
    this.#shown = given;
    const { element } = this;
    const value = given ?? this.parameter.value;
    if (element instanceof HTMLInputElement && element.type === "checkbox") {
      element.checked = value === true;
    } else if (document.activeElement !== element || this.#entered() !== value) {
      // What cannot be read stays, so that it can be mended.
      if (!Number.isNaN(value)) element.value = String(value);
    }
    element.classList.toggle("changed", given !== undefined);
  }

  /** Marks it where a message names its parameter. */
  refuse(message: string): boolean {
    const isNamed = names(message, this.parameter.name);
    this.invalid = isNamed ? message : "";
    return isNamed;
  }

  /** Why the value cannot be used; empty: it can. */
  set invalid(why: string) {
    if (why === this.#wrong) return;
    this.#wrong = why;
    this.element.setAttribute("aria-invalid", String(why !== ""));
    this.element.title = why || explained(this.parameter);
  }
}

/** A slider that sets one or several parameters together, and a field for each. */
export class SliderRow {
  readonly root: HTMLElement;
  readonly fields: readonly Field[];
  readonly #row: Slider;
  readonly #slider: HTMLInputElement;
  readonly #reset: HTMLButtonElement;
  readonly #error: HTMLElement;

  constructor(row: Slider, parameters: readonly Parameter[], only: string, changed: Changed) {
    this.#row = row;
    this.root = document.createElement("div");
    this.root.className = "row";
    const [parameter] = parameters;
    const spoken = row.spoken ?? parameter.name;
    const label = document.createElement("span");
    label.className = "label";
    label.innerHTML = row.label;
    if (only) {
      // A scenario may name a controller as it likes: that is no HTML.
      const note = document.createElement("span");
      note.className = "only";
      note.textContent = only;
      label.append(" ", note);
    }
    label.title = explained(parameter);
    const unit = document.createElement("span");
    unit.className = "unit";
    unit.textContent = parameter.unit ?? "";
    this.#reset = document.createElement("button");
    this.#reset.type = "button";
    this.#reset.className = "reset";
    this.#reset.textContent = "reset";
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
    this.#slider.setAttribute("aria-label", spoken);
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
    const fields = document.createElement("span");
    fields.className = "fields";
    fields.append(...this.fields.map(({ element }) => element));
    this.#error = document.createElement("p");
    this.#error.className = "error";
    this.#error.setAttribute("role", "alert");
    this.#error.hidden = true;
    const head = document.createElement("div");
    head.className = "head";
    head.append(label, this.#reset, ...(parameters.length > 1 ? [unit] : [fields, unit]));
    this.root.append(head, this.#slider, ...(parameters.length > 1 ? [fields] : []), this.#error);
  }

  show(given: Values): void {
    for (const field of this.fields) field.show(given[field.parameter.name]);
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
    this.#reset.hidden = !isChanged;
    this.root.classList.toggle("changed", isChanged);
  }

  /** Marks it where a message names one of its parameters. */
  refuse(message: string): boolean {
    const isNamed = this.fields.map((field) => field.refuse(message)).includes(true);
    this.#error.hidden = !isNamed;
    this.#error.textContent = isNamed ? message : "";
    return isNamed;
  }
}

/** Positions from one press of an arrow key to the next. */
function stepOf({ scale }: Slider): number {
  return scale.whole ? POSITIONS / (scale.high - scale.low) : 10;
}

/** Whether a message says `component.parameter` or `component: parameter`. */
export function names(message: string, name: string): boolean {
  // The name of a component may have dots, too.
  const dots = [...name.matchAll(/\./g)].map(({ index }) => index);
  const said = dots.map((dot) => `${name.slice(0, dot)}: ${name.slice(dot + 1)}`);
  return [name, ...said].some((text) => {
    const at = message.indexOf(text);
    return at >= 0 && !/[\w[.]/.test(message[at + text.length] ?? "");
  });
}
