// What the charts show of a run.

import { commandName, limits, trackingError } from "./engine";
import type { Data, Result } from "./types";

/** Colour and style of a line: of a controller, or of what is true or wanted. */
export type Style = "first" | "second" | "reference";

export interface Panel {
  /** HTML. */
  readonly title: string;
  readonly unit: string;
  readonly styles: readonly Style[];
  /** Names of the lines, for readers of the screen and for the legend. */
  readonly names: readonly string[];
}

export interface Section {
  readonly title: string;
  readonly note: string;
  /** Whether the heading names the lines: they are not the controllers'. */
  readonly named?: boolean;
  readonly panels: readonly Panel[];
}

/** The values of a panel's lines, with the times of their rows. */
export interface Lines {
  readonly time: Float64Array;
  readonly values: readonly (Float64Array | undefined)[];
  /** The limits of a command, if there are any. */
  readonly limits?: readonly [number, number];
}

/** The sections of a page whose controllers have these names. */
export function sections(labels: readonly string[], units: Data["units"]): readonly Section[] {
  const both: Style[] = ["first", "second"];
  const compared = { styles: both.slice(0, labels.length), names: labels };
  return [
    {
      title: "Tracking errors",
      note: "control point minus reference",
      panels: Object.entries(units.e).map(([axis, unit]) => ({
        ...compared,
        title: `<i>e<sub>${axis}</sub></i>`,
        unit,
      })),
    },
    {
      title: "Commands",
      note: "with their limits, where they are near",
      panels: Object.entries(units.tau).map(([member, unit]) => ({
        ...compared,
        title: `&tau;<sub>${member}</sub>`,
        unit,
      })),
    },
    {
      title: "Velocity of the control point",
      note: "",
      named: true,
      panels: Object.entries(units.dy).map(([axis, unit]) => ({
        styles: ["first", "reference"],
        names: ["estimated by the observer", "true"],
        title: `<i>y&#775;<sub>${axis}</sub></i>`,
        unit,
      })),
    },
    {
      title: "Estimated parameters",
      note: "",
      panels: Object.entries(units.theta_hat).map(([k, unit]) => ({
        ...compared,
        title: `&theta;&#770;<sub>${k}</sub>`,
        unit,
      })),
    },
  ];
}

/** The result with the most rows: a run that failed is shorter than the other. */
export function longest(results: readonly (Result | undefined)[]): Result | undefined {
  return results.reduce(
    (best, one) => (one && one.rows > (best?.rows ?? 0) ? one : best),
    undefined,
  );
}

/** The lines of all panels, section by section. */
export function lines(
  results: readonly (Result | undefined)[],
  units: Data["units"],
): readonly (readonly Lines[])[] {
  const whole = longest(results);
  const time = whole?.time ?? new Float64Array(0);
  const rows = Math.max(0, (whole?.rows ?? 0) - 1);
  /** Times at which steps begin: the row at whose end they stand has their signals. */
  const starts = time.subarray(0, rows);
  const errors = results.map((result) => result && trackingError(result));
  const steps = (result: Result | undefined, name: string) =>
    result?.has(name) ? result.column(name).subarray(1) : undefined;
  const observed = results.find((result) => result?.has("controller.dy_hat.x"));
  const moving = observed ?? whole;
  return [
    Object.keys(units.e).map((_, k) => ({ time, values: errors.map((error) => error?.[k]) })),
    Object.keys(units.tau).map((member) => {
      const values = results.map(
        (result) => result && steps(result, commandName(result, member)),
      );
      const ends = whole && limits(whole, member);
      return { time: starts, values, ...(ends ? { limits: ends } : {}) };
    }),
    Object.keys(units.dy).map((axis) => ({
      time: starts,
      values: [
        steps(observed, `controller.dy_hat.${axis}`),
        moving?.column(`plant.dy.${axis}`).subarray(0, rows),
      ],
    })),
    Object.keys(units.theta_hat).map((k) => ({
      time: starts,
      values: results.map((result) => steps(result, `controller.theta_hat[${k}]`)),
    })),
  ];
}

/** Columns beside each other: as many numbers for each row. */
export function interleaved(columns: readonly Float64Array[]): Float64Array {
  const width = columns.length;
  const values = new Float64Array(width * columns[0].length);
  columns.forEach((column, k) => {
    for (let row = 0; row < column.length; row++) values[width * row + k] = column[row];
  });
  return values;
}
