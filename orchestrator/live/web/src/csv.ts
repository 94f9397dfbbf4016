// A run as result.csv has it: the same columns, numbers that read back exactly.
import type { Result } from "./types";

/** The shortest text that reads back as the same number. */
function written(value: number): string {
  return Object.is(value, -0) ? "-0" : String(value);
}

export function csv(result: Result): string {
  const width = 1 + result.columns.length;
  const lines = [["time", ...result.columns].join(",")];
  for (let k = 0; k < result.rows; k++) {
    const row = result.table.subarray(k * width, (k + 1) * width);
    lines.push(Array.from(row, written).join(","));
  }
  return `${lines.join("\n")}\n`;
}
