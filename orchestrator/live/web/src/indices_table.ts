// The indices of section 4.2 as a table, with a row for each controller.

import type { IndexData, Metrics } from "./types";

export interface Measured {
  readonly label: string;
  /** Its place among the controllers, which gives it its colour. */
  readonly place: number;
  readonly metrics: Metrics;
}

/** FMI writes N.m.s^1/2; people read N·m·√s. */
function printed(unit: string): string {
  return unit.replace("s^1/2", "√s").replaceAll(".", "·");
}

function number(value: number | undefined): string {
  if (value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const text = size >= 1e6 || (size > 0 && size < 1e-4) ? value.toExponential(3) : value.toPrecision(4);
  // As the terminal prints them: four digits, and no zeros at the end.
  return String(Number(text)).replace("-", "−");
}

function cell(kind: "td" | "th", html: string, scope?: string): HTMLTableCellElement {
  const made = document.createElement(kind);
  made.innerHTML = html;
  if (scope) made.scope = scope;
  return made;
}

export function fillIndices(
  table: HTMLTableElement,
  indices: readonly IndexData[],
  measured: readonly Measured[],
): void {
  table.tBodies[0].replaceChildren(
    ...indices
      .filter(({ name }) => measured.some(({ metrics }) => metrics[name]))
      .flatMap(({ name, label, units, meaning }) => {
        const found = [...new Set(Object.values(units).filter(Boolean))].map(printed).join(", ");
        const heading = document.createElement("tr");
        heading.className = "index";
        heading.title = meaning;
        heading.append(
          cell("th", `${label}${found ? ` <span class="unit">${found}</span>` : ""}`, "rowgroup"),
          ...Object.keys(units).map((member) => cell("th", `<i>${member}</i>`, "col")),
        );
        const rows = measured.map(({ label: name_, place, metrics }) => {
          const row = document.createElement("tr");
          row.append(
            cell("th", `<span class="swatch of-${place}"></span>${name_}`, "row"),
            ...Object.keys(units).map((_, k) => cell("td", number(metrics[name]?.[k]))),
          );
          return row;
        });
        return [heading, ...rows];
      }),
  );
}
