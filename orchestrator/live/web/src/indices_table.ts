// The indices of section 4.2 as a table, with a row for each controller.

import { make } from "./dom";
import { swatch } from "./legend";
import { fourDigits } from "./text";
import type { IndexData, Metrics } from "./types";

/** A controller in the table. */
interface Measured {
  readonly label: string;
  /** Its number among the controllers, for its colour. */
  readonly place: number;
  readonly metrics: Metrics;
}

function heading(scope: string, html: string): HTMLTableCellElement {
  const made = make("th", "");
  made.innerHTML = html;
  made.scope = scope;
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
    // Only numbers change while a slider moves.
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
      const distinct = [...new Set(Object.values(units).filter(Boolean))].join(", ");
      const unit = distinct && ` <span class="unit">${distinct}</span>`;
      const head = make(
        "tr",
        "index",
        heading("rowgroup", `${label}${unit}`),
        ...Object.keys(units).map((member) =>
          member ? heading("col", `<i>${member}</i>`) : make("td", ""),
        ),
      );
      head.title = meaning;
      const values = measured.map(({ label: controller, place }) => {
        const cells = Object.keys(units).map(() => make("td", ""));
        this.#cells.push(...cells);
        const name = heading("row", "");
        name.append(swatch(String(place)), controller);
        return make("tr", "", name, ...cells);
      });
      return [head, ...values];
    });
    this.#body.replaceChildren(...rows);
  }
}
