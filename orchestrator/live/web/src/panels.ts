// What the charts show of a run.

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
      note: "the observer's estimate, and the true one",
      panels: AXES.map((axis) => ({
        styles: ["reference", "first"],
        names: ["true", "estimated"],
        title: `velocity in <i>${axis}</i>`,
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
  const errors = shown.map((one) => one && errorsOf(one.result));
  const steps = (result: Result | undefined, name: string) =>
    result?.has(name) ? result.column(name).subarray(1) : undefined;
  const observed = shown.find((one) => one?.result.has("controller.dy_hat.x"))?.result;
  return [
    AXES.map((_, k) => ({ time, values: errors.map((error) => error?.[k]) })),
    Object.keys(ACTUATORS).map((member) => {
      const values = shown.map((one) => steps(one?.result, `plant.tau.${member}`));
      const limits = limitsOf(shown, member);
      return { time: starts, values, ...(limits ? { limits } : {}) };
    }),
    AXES.map((axis) => ({
      time: starts,
      values: [
        observed?.column(`plant.dy.${axis}`).subarray(0, rows),
        steps(observed, `controller.dy_hat.${axis}`),
      ],
    })),
    THETA.map((_, k) => ({
      time: starts,
      values: shown.map((one) => steps(one?.result, `controller.theta_hat[${k + 1}]`)),
    })),
  ];
}

function limitsOf(shown: readonly (Shown | undefined)[], member: string) {
  const values = shown.find((one) => one)?.result.parameters;
  const [low, high] = [values?.[`plant.tau_min.${member}`], values?.[`plant.tau_max.${member}`]];
  return typeof low === "number" && typeof high === "number" ? ([low, high] as const) : undefined;
}

/** y - y_d with the true control point, along each axis; none without a reference. */
function errorsOf(result: Result): Float64Array[] | undefined {
  if (!result.has("planner.y_d.x")) return undefined;
  const path = controlPoint(result);
  return AXES.map((axis, k) => {
    const wanted = result.column(`planner.y_d.${axis}`);
    return wanted.map((value, row) => path[3 * row + k] - value);
  });
}

/** The true control point in each row: three numbers [m]. */
export function controlPoint(result: Result): Float64Array {
  const [x, y, z] = AXES.map((axis) => result.column(`plant.eta.${axis}`));
  const [theta, psi] = ["theta", "psi"].map((angle) => result.column(`plant.eta.${angle}`));
  const ell = Number(result.parameters["plant.ell"]);
  const path = new Float64Array(3 * x.length);
  for (let row = 0; row < x.length; row++) {
    const ahead = ell * Math.cos(theta[row]);
    path[3 * row] = x[row] + ahead * Math.cos(psi[row]);
    path[3 * row + 1] = y[row] + ahead * Math.sin(psi[row]);
    path[3 * row + 2] = z[row] - ell * Math.sin(theta[row]);
  }
  return path;
}

/** Columns beside each other: as many numbers for each row. */
export function interleaved(result: Result, names: readonly string[]): Float64Array {
  const columns = names.map((name) => result.column(name));
  const values = new Float64Array(names.length * result.rows);
  columns.forEach((column, k) => {
    for (let row = 0; row < column.length; row++) values[names.length * row + k] = column[row];
  });
  return values;
}
