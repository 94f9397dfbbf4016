// Signals that are computed from the rows of a run.

import type { Vector } from "./space";
import type { Metrics, Run, VehicleData } from "./types";

const AXES = ["x", "y", "z"];

type Columns = Float64Array[];

/** Signals of runs that were computed before: errors by vehicle, and smallest distances. */
const errors = new WeakMap<Run, Map<string, Columns>>();
const gaps = new WeakMap<Run, Float64Array>();

/** Points or angles in each row. */
export interface Rows {
  readonly rows: number;
  at(row: number): Vector;
}

/** Returns three columns row by row. */
export function rowsOf([x, y, z]: Columns): Rows {
  return { rows: x.length, at: (row) => [x[row], y[row], z[row]] };
}

/** Returns roll, pitch and yaw [rad]. */
export function attitude(result: Run, { vehicle }: VehicleData): Rows {
  return rowsOf(["phi", "theta", "psi"].map((angle) => result.column(`${vehicle}.eta.${angle}`)));
}

/** Returns the control point without noise [m]: (9) for the vehicle's posture. */
export function controlPoint(result: Run, { vehicle }: VehicleData): Rows {
  const [x, y, z, theta, psi] = [...AXES, "theta", "psi"].map((name) =>
    result.column(`${vehicle}.eta.${name}`),
  );
  const ell = Number(result.parameters[`${vehicle}.ell`]);
  return {
    rows: result.rows,
    at(row) {
      // The first column of the rotation is the direction of the nose.
      const ahead = ell * Math.cos(theta[row]);
      return [
        x[row] + ahead * Math.cos(psi[row]),
        y[row] + ahead * Math.sin(psi[row]),
        z[row] - ell * Math.sin(theta[row]),
      ];
    },
  };
}

/** Returns the coordinates of the reference y_d [m]; undefined: there is no reference. */
export function reference(result: Run, { planner }: VehicleData): Columns | undefined {
  if (!result.has(`${planner}.y_d.x`)) return undefined;
  return AXES.map((axis) => result.column(`${planner}.y_d.${axis}`));
}

/** Returns e = y - y_d with the true control point [m]; undefined: there is no reference. */
export function trackingError(result: Run, vehicle: VehicleData): Columns | undefined {
  const wanted = reference(result, vehicle);
  if (wanted === undefined) return undefined;
  const known = errors.get(result)?.get(vehicle.vehicle);
  if (known) return known;
  const { rows, at } = controlPoint(result, vehicle);
  const found = AXES.map(() => new Float64Array(rows));
  for (let row = 0; row < rows; row++) {
    at(row).forEach((value, i) => {
      found[i][row] = value - wanted[i][row];
    });
  }
  errors.set(result, (errors.get(result) ?? new Map()).set(vehicle.vehicle, found));
  return found;
}

/** Returns the smallest distance of two centres of mass [m]; undefined: there is one vehicle. */
export function smallestDistance(
  result: Run,
  fleet: readonly VehicleData[],
): Float64Array | undefined {
  if (fleet.length < 2) return undefined;
  const known = gaps.get(result);
  if (known !== undefined) return known;
  const places = fleet.map(({ vehicle }) =>
    AXES.map((axis) => result.column(`${vehicle}.eta.${axis}`)),
  );
  const squares = new Float64Array(result.rows).fill(Infinity);
  places.forEach(([x, y, z], i) => {
    for (const [a, b, c] of places.slice(i + 1)) {
      for (let k = 0; k < squares.length; k++) {
        const [u, v, w] = [x[k] - a[k], y[k] - b[k], z[k] - c[k]];
        squares[k] = Math.min(squares[k], u * u + v * v + w * w);
      }
    }
  });
  const found = squares.map(Math.sqrt);
  gaps.set(result, found);
  return found;
}

/** Returns a column by steps: the value that acts in a step or follows from its first inputs. */
export function inSteps(result: Run, name: string): Float64Array {
  return result.column(name).subarray(result.actingRow, result.rows - 1 + result.actingRow);
}

/** Returns the column of a command: an input of the vehicle, or of its allocation. */
export function commandName(result: Run, vehicle: VehicleData, actuator: string): string {
  const taken = `${vehicle.vehicle}.tau.${actuator}`;
  return result.has(taken) ? taken : `${vehicle.allocation}.tau.${actuator}`;
}

/** Returns the limits of an actuator; undefined: they are not parameters of the vehicle. */
export function limits(
  result: Run,
  { vehicle }: VehicleData,
  actuator: string,
): readonly [number, number] | undefined {
  const of = (end: string) => result.parameters[`${vehicle}.tau_${end}.${actuator}`];
  const [lower, upper] = [of("min"), of("max")];
  return lower === undefined || upper === undefined ? undefined : [Number(lower), Number(upper)];
}

/**
 * Returns the indices of a vehicle.
 *
 * @param place number of the vehicle.
 * @param fleet all vehicles, for the indices of several together.
 */
export function metrics(result: Run, place: number, fleet: readonly VehicleData[]): Metrics {
  const found = result.metrics[place];
  const apart = smallestDistance(result, fleet);
  if (apart === undefined) return found;
  return { smallest_distance: [apart.reduce((a, b) => Math.min(a, b))], ...found };
}
