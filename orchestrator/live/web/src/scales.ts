// How the positions of a slider stand for values.

/** Positions of a slider, from 0. */
export const POSITIONS = 1000;

/** A range of values, evenly spaced, or by factors; `zero`: its first position is zero. */
export interface Scale {
  readonly low: number;
  readonly high: number;
  readonly log?: boolean;
  readonly zero?: boolean;
  readonly whole?: boolean;
}

/** The value at a position, with no more digits than the position tells apart. */
export function valueAt(scale: Scale, position: number): number {
  const { low, high, log, zero, whole } = scale;
  if (zero && position <= 0) return 0;
  const share = Math.min(1, Math.max(0, position / POSITIONS));
  if (log) return Number((low * (high / low) ** share).toPrecision(3));
  const value = low + (high - low) * share;
  if (whole) return Math.round(value);
  const step = 10 ** Math.floor(Math.log10((high - low) / 200));
  return Number((Math.round(value / step) * step).toPrecision(12));
}

export function positionOf(scale: Scale, value: number): number {
  const { low, high, log, zero } = scale;
  if (zero && value <= 0) return 0;
  const share = log
    ? Math.log(Math.max(value, low) / low) / Math.log(high / low)
    : (value - low) / (high - low);
  return Math.round(POSITIONS * Math.min(1, Math.max(0, share)));
}
