// Numbers and runs as text.
import type { Result } from "./types";

/** Writes a number with at most so many digits and no trailing zeros, as `%g` does. */
export function general(value: number, digits = 6): string {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "nan" : value > 0 ? "inf" : "-inf";
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  const power = Number(exponent);
  const trimmed = (text: string) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
  if (power >= -4 && power < digits) return trimmed(value.toFixed(digits - 1 - power));
  const sign = power < 0 ? "-" : "+";
  return `${trimmed(mantissa)}e${sign}${String(Math.abs(power)).padStart(2, "0")}`;
}

/** Writes a number in few characters. */
export function short(value: number): string {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(1).replace("-", "−");
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  return value.toFixed(digits).replace("-", "−");
}

/** Writes a number on an axis: all its digits in few characters. */
export function tick(value: number): string {
  const rounded = Number(value.toPrecision(6));
  const size = Math.abs(rounded);
  const isLong = size !== 0 && (size < 1e-4 || size >= 1e5);
  const text = isLong ? rounded.toExponential().replace("e+", "e") : rounded.toString();
  return text.replaceAll("-", "−");
}

/** Writes four digits without trailing zeros, as the terminal does. */
export function fourDigits(value: number | undefined): string {
  if (value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const isShort = size === 0 || (size >= 1e-4 && size < 1e5);
  const text = isShort ? String(Number(value.toPrecision(4))) : value.toExponential(3);
  return text.replace("-", "−").replace("e+", "e");
}

/** Escapes a text for HTML. */
export function escaped(text: string): string {
  return text.replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);
}

/** Reads a number; NaN: the text is not a number. */
export function numberOf(text: string): number {
  return text.trim() === "" ? Number.NaN : Number(text);
}

/** Reads a number from a field, with a decimal point or comma. */
export function entered(text: string): number {
  return numberOf(text.replace(/^([^.,]*),([^.,]*)$/, "$1.$2"));
}

/** Writes the shortest text that reads back as the same number. */
function written(value: number): string {
  return Object.is(value, -0) ? "-0" : String(value);
}

/** Returns the lines of result.csv for a run: the same columns, numbers that read back exactly. */
export function csvLines(result: Result): string[] {
  const columns = [result.time, ...result.columns.map((name) => result.column(name))];
  // From the last to the first, so that earlier places stay valid.
  const faults = [...result.faults].reverse();
  const line = (cells: string[], of: (fault: string) => string) => {
    for (const [place, fault] of faults) cells.splice(1 + place, 0, of(fault));
    return cells.join(",");
  };
  const lines = [line(["time", ...result.columns], (fault) => fault)];
  for (let k = 0; k < result.rows; k++) {
    const cells = columns.map((column) => written(column[k]));
    lines.push(line(cells, () => "0"));
  }
  return lines.map((line) => `${line}\n`);
}

/** Returns the same as one text. */
export function csv(result: Result): string {
  return csvLines(result).join("");
}
