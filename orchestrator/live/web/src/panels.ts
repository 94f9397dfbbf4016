// The sections and lines of the charts.

import { commandName, inSteps, limits, smallestDistance, trackingError } from "./signals";
import { escaped } from "./text";
import type { Common, Run, Units, VehicleData } from "./types";

/** Colour and style of a line: of a controller, a true value, or all vehicles. */
export type Style = "first" | "second" | "true" | "first-of-all" | "second-of-all";

export interface Panel {
  /** HTML. */
  readonly title: string;
  readonly unit: string;
  readonly styles: readonly Style[];
  /** Names of the lines, for screen readers and for the legend. */
  readonly names: readonly string[];
}

export interface Section {
  readonly title: string;
  readonly note: string;
  /** If set, the heading names the lines, which are not the controllers'. */
  readonly named?: boolean;
  readonly panels: readonly Panel[];
}

/** Values of a panel's lines, with the times of their rows. */
export interface Lines {
  readonly time: Float64Array;
  /** End of the chart [s], if it is later than the last row. */
  readonly until?: number;
  readonly values: readonly (Float64Array | undefined)[];
  /** Limits of a command, if it has any. */
  readonly limits?: readonly [number, number];
}

/** Returns the sections for controllers with these names, for one vehicle or several. */
export function sections(
  labels: readonly string[],
  units: Common["units"],
  vehicles: number,
): readonly Section[] {
  const both: Style[] = ["first", "second"];
  const compared = { styles: both.slice(0, labels.length), names: labels };
  const together: Style[] = ["first-of-all", "second-of-all"];
  const distances: Section = {
    title: "Smallest distance between two vehicles",
    note: "of their centres of mass",
    panels: [
      { styles: together.slice(0, labels.length), names: labels, title: "distance", unit: "m" },
    ],
  };
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
        styles: ["first", "true"],
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
    ...(vehicles > 1 ? [distances] : []),
  ];
}

/** Returns the result with the most rows: a failed run is shorter than the other. */
export function longest(results: readonly (Run | undefined)[]): Run | undefined {
  return results.reduce(
    (best, one) => (one && one.rows > (best?.rows ?? 0) ? one : best),
    undefined,
  );
}

/** The vehicles of a loop, and the chosen one. */
interface Chosen {
  readonly vehicle: VehicleData;
  readonly fleet: readonly VehicleData[];
}

/**
 * Returns the lines of all panels, section by section.
 *
 * @param results runs of the loops.
 * @param chosen vehicles of each loop.
 * @param units printed units of the groups of signals.
 */
export function lines(
  results: readonly (Run | undefined)[],
  chosen: readonly Chosen[],
  units: Common["units"],
): readonly (readonly Lines[])[] {
  const whole = longest(results);
  const time = whole?.time ?? new Float64Array(0);
  const rows = Math.max(0, (whole?.rows ?? 0) - 1);
  /** Times at which steps begin, and the end of the last one. */
  const inEachStep = { time: time.subarray(0, rows), until: time[rows] ?? 0 };
  const ofEach = <T>(make: (result: Run, chosen: Chosen) => T): (T | undefined)[] =>
    results.map((result, place) => result && make(result, chosen[place]));
  const errors = ofEach((result, { vehicle }) => trackingError(result, vehicle));
  const steps = (result: Run | undefined, name: string) =>
    result?.has(name) ? inSteps(result, name) : undefined;
  const observed = results.findIndex((result, place) =>
    result?.has(`${chosen[place].vehicle.controller}.dy_hat.x`),
  );
  const moving = observed < 0 ? results.indexOf(whole) : observed;
  const { vehicle } = chosen[Math.max(moving, 0)];
  return [
    Object.keys(units.e).map((_, k) => ({ time, values: errors.map((error) => error?.[k]) })),
    Object.keys(units.tau).map((member) => {
      const values = ofEach((result, { vehicle }) =>
        steps(result, commandName(result, vehicle, member)),
      );
      const ends = whole && limits(whole, chosen[results.indexOf(whole)].vehicle, member);
      return { ...inEachStep, values, ...(ends ? { limits: ends } : {}) };
    }),
    Object.keys(units.dy).map((axis) => ({
      ...inEachStep,
      values: [
        steps(results[observed], `${vehicle.controller}.dy_hat.${axis}`),
        known(results[moving], `${vehicle.vehicle}.dy.${axis}`)?.subarray(0, rows),
      ],
    })),
    Object.keys(units.theta_hat).map((k) => ({
      ...inEachStep,
      values: ofEach((result, { vehicle }) =>
        steps(result, `${vehicle.controller}.theta_hat[${k}]`),
      ),
    })),
    [{ time, values: ofEach((result, { fleet }) => smallestDistance(result, fleet)) }],
  ];
}

/** Returns a section for each group of columns, for runs without vehicles. */
export function columnSections(labels: readonly string[], columns: Units): readonly Section[] {
  const styles = (["first", "second"] as const).slice(0, labels.length);
  return groupsOf(columns).map(([title, names]) => ({
    title,
    note: "",
    panels: names.map((name) => ({
      title: escaped(name.slice(title.length).replace(/^\./, "")),
      unit: escaped(columns[name]),
      styles,
      names: labels,
    })),
  }));
}

/** Returns the lines of these charts. */
export function columnLines(
  results: readonly (Run | undefined)[],
  columns: Units,
): readonly (readonly Lines[])[] {
  const whole = longest(results);
  const time = whole?.time ?? new Float64Array(0);
  return groupsOf(columns).map(([, names]) =>
    names.map((name) => ({ time, values: results.map((result) => known(result, name)) })),
  );
}

/** Groups columns by prefix: `plant.eta` of `plant.eta.x`, `plant.u` of `plant.u[1]`. */
function groupsOf(columns: Units): [string, string[]][] {
  const groups = new Map<string, string[]>();
  for (const name of Object.keys(columns)) {
    const group = name.replace(/(\.[^.[]*|\[[^[]*)$/, "");
    groups.set(group, [...(groups.get(group) ?? []), name]);
  }
  return [...groups];
}

function known(result: Run | undefined, name: string): Float64Array | undefined {
  return result?.has(name) ? result.column(name) : undefined;
}
