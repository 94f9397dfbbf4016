// What the charts show of a run.

import { limits, trackingError } from "./engine";
import type { LoopData, Result } from "./types";

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

/** A run that is shown, in the place of its controller. */
export interface Shown {
  readonly loop: LoopData;
  readonly result: Result;
}

const AXES = ["x", "y", "z"] as const;
const ACTUATORS = { u: "N", q: "N·m", r: "N·m" } as const;
const THETA = ["N", "kg/s", "kg/m", "kg"] as const;

/** The sections of a page whose controllers have these names. */
export function sections(labels: readonly string[]): readonly Section[] {
  const both: Style[] = ["first", "second"];
  const compared = { styles: both.slice(0, labels.length), names: labels };
  return [
    {
      title: "Tracking errors",
      note: "control point minus reference",
      panels: AXES.map((axis) => ({ ...compared, title: `<i>e<sub>${axis}</sub></i>`, unit: "m" })),
    },
    {
      title: "Commands",
      note: "with their limits, where they are near",
      panels: Object.entries(ACTUATORS).map(([member, unit]) => ({
        ...compared,
        title: `&tau;<sub>${member}</sub>`,
        unit,
      })),
    },
    {
      title: "Velocity of the control point",
      note: "",
      named: true,
      panels: AXES.map((axis) => ({
        styles: ["first", "reference"],
        names: ["estimated by the observer", "true"],
        title: `<i>y&#775;<sub>${axis}</sub></i>`,
        unit: "m/s",
      })),
    },
    {
      title: "Estimated parameters",
      note: "",
      panels: THETA.map((unit, k) => ({
        ...compared,
        title: `&theta;&#770;<sub>${k + 1}</sub>`,
        unit,
      })),
    },
  ];
}

/** The lines of all panels, section by section. */
export function lines(shown: readonly (Shown | undefined)[]): readonly (readonly Lines[])[] {
  // A run that failed is shorter than the other.
  const longest = shown.reduce<Result | undefined>(
    (best, one) => (one && one.result.rows > (best?.rows ?? 0) ? one.result : best),
    undefined,
  );
  const time = longest?.time ?? new Float64Array(0);
  const rows = Math.max(0, (longest?.rows ?? 0) - 1);
  /** Times at which steps begin: the row at whose end they stand has their signals. */
  const starts = time.subarray(0, rows);
  const errors = shown.map((one) => one && trackingError(one.result));
  const steps = (result: Result | undefined, name: string) =>
    result?.has(name) ? result.column(name).subarray(1) : undefined;
  const observed = shown.find((one) => one?.result.has("controller.dy_hat.x"))?.result;
  const moving = observed ?? longest;
  return [
    AXES.map((_, k) => ({ time, values: errors.map((error) => error?.[k]) })),
    Object.keys(ACTUATORS).map((member) => {
      const values = shown.map((one) => steps(one?.result, `plant.tau.${member}`));
      return { time: starts, values, ...(longest ? { limits: limits(longest, member) } : {}) };
    }),
    AXES.map((axis) => ({
      time: starts,
      values: [
        steps(observed, `controller.dy_hat.${axis}`),
        moving?.column(`plant.dy.${axis}`).subarray(0, rows),
      ],
    })),
    THETA.map((_, k) => ({
      time: starts,
      values: shown.map((one) => steps(one?.result, `controller.theta_hat[${k + 1}]`)),
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
