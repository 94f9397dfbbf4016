// Numbers and runs as texts.
import type { Result } from "./types";

/** A number with so many digits at most, and no zeros at its end, as `%g` writes it. */
export function general(value: number, digits = 6): string {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "nan" : value > 0 ? "inf" : "-inf";
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  const power = Number(exponent);
  const trimmed = (text: string) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
  if (power >= -4 && power < digits) return trimmed(value.toFixed(digits - 1 - power));
  const sign = power < 0 ? "-" : "+";
  return `${trimmed(mantissa)}e${sign}${String(Math.abs(power)).padStart(2, "0")}`;
}

/** A text in HTML. */
export function escaped(text: string): string {
  return text.replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);
}

/** The number that a text is; NaN: it is none. */
export function numberOf(text: string): number {
  return text.trim() === "" ? Number.NaN : Number(text);
}

/** The number in a field, in which a comma may stand for the point. */
export function entered(text: string): number {
  return numberOf(text.replace(/^([^.,]*),([^.,]*)$/, "$1.$2"));
}

/** The shortest text that reads back as the same number. */
function written(value: number): string {
  return Object.is(value, -0) ? "-0" : String(value);
}

/** A run as the lines of result.csv: the same columns, numbers that read back exactly. */
export function csvLines(result: Result): string[] {
  const width = 1 + result.columns.length;
  // From the last on: those before it stay where they are.
  const faults = [...result.faults].reverse();
  const line = (cells: string[], of: (fault: string) => string) => {
    for (const [place, fault] of faults) cells.splice(1 + place, 0, of(fault));
    return cells.join(",");
  };
  const lines = [line(["time", ...result.columns], (fault) => fault)];
  for (let k = 0; k < result.rows; k++) {
    const row = result.table.subarray(k * width, (k + 1) * width);
    lines.push(line(Array.from(row, written), () => "0"));
  }
  return lines.map((line) => `${line}\n`);
}

/** The same as one text. */
export function csv(result: Result): string {
  return csvLines(result).join("");
}
