// The indices of section 4.2 as a table, with a row for each controller.

import type { IndexData, Metrics } from "./types";

/** A controller in the table. */
export interface Measured {
  readonly label: string;
  /** Its place among the controllers, which gives it its colour. */
  readonly place: number;
  readonly metrics: Metrics;
}

/** Four digits, as the terminal has them, and no zeros at the end. */
export function fourDigits(value: number | undefined): string {
  if (value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const isShort = size === 0 || (size >= 1e-4 && size < 1e5);
  const text = isShort ? String(Number(value.toPrecision(4))) : value.toExponential(3);
  return text.replace("-", "−").replace("e+", "e");
}

function cell(kind: "td" | "th", html: string, scope?: string): HTMLTableCellElement {
  const made = document.createElement(kind);
  made.innerHTML = html;
  if (scope) made.scope = scope;
  return made;
}

export class IndicesTable {
  readonly #body: HTMLTableSectionElement;
  readonly #indices: readonly IndexData[];
  #shown = "";
  #cells: HTMLElement[] = [];

  constructor(table: HTMLTableElement, indices: readonly IndexData[]) {
    this.#body = table.tBodies[0];
    this.#indices = indices;
  }

  show(measured: readonly Measured[]): void {
    const there = this.#indices.filter(({ name }) => measured.some(({ metrics }) => metrics[name]));
    const names = [...measured.map(({ label }) => label), ...there.map(({ name }) => name)];
    // While a slider moves only numbers change.
    if (names.join() !== this.#shown) this.#build(there, measured);
    this.#shown = names.join();
    const values = there.flatMap(({ name, units }) =>
      measured.flatMap(({ metrics }) => Object.keys(units).map((_, k) => metrics[name]?.[k])),
    );
    values.forEach((value, k) => {
      this.#cells[k].textContent = fourDigits(value);
    });
  }

  #build(there: readonly IndexData[], measured: readonly Measured[]): void {
    this.#cells = [];
    const rows = there.flatMap(({ label, units, meaning }) => {
      const found = [...new Set(Object.values(units).filter(Boolean))].join(", ");
      const heading = document.createElement("tr");
      heading.className = "index";
      heading.title = meaning;
      heading.append(
        cell("th", `${label}${found ? ` <span class="unit">${found}</span>` : ""}`, "rowgroup"),
        ...Object.keys(units).map((member) => cell("th", `<i>${member}</i>`, "col")),
      );
      const values = measured.map(({ label: controller, place }) => {
        const row = document.createElement("tr");
        const cells = Object.keys(units).map(() => cell("td", ""));
        this.#cells.push(...cells);
        row.append(cell("th", `<span class="swatch of-${place}"></span>`, "row"), ...cells);
        row.cells[0].append(controller);
        return row;
      });
      return [heading, ...values];
    });
    this.#body.replaceChildren(...rows);
  }
}
