// Signals that are computed from the rows of a run.
import type { Metrics, Run, VehicleData } from "./types";

const AXES = ["x", "y", "z"];

type Columns = Float64Array[];

/** Signals of runs that were computed before, by vehicle. */
const points = new WeakMap<Run, Map<string, Columns>>();
const errors = new WeakMap<Run, Map<string, Columns>>();
const gaps = new WeakMap<Run, Float64Array>();

function made(
  known: WeakMap<Run, Map<string, Columns>>,
  result: Run,
  vehicle: VehicleData,
  make: () => Columns,
): Columns {
  const all = known.get(result) ?? new Map<string, Columns>();
  const found = all.get(vehicle.vehicle) ?? make();
  known.set(result, all.set(vehicle.vehicle, found));
  return found;
}

/** Returns the coordinates of the control point without noise [m]: (9) for the vehicle's posture. */
export function controlPoint(result: Run, vehicle: VehicleData): Columns {
  return made(points, result, vehicle, () => {
    const name = vehicle.vehicle;
    const [phi, theta, psi] = ["phi", "theta", "psi"].map((angle) =>
      result.column(`${name}.eta.${angle}`),
    );
    const ell = Number(result.parameters[`${name}.ell`]);
    const [x, y, z] = AXES.map((axis) => result.column(`${name}.eta.${axis}`).slice());
    for (let k = 0; k < phi.length; k++) {
      // The first column of the rotation is the direction of the nose.
      x[k] += ell * Math.cos(psi[k]) * Math.cos(theta[k]);
      y[k] += ell * Math.sin(psi[k]) * Math.cos(theta[k]);
      z[k] -= ell * Math.sin(theta[k]);
    }
    return [x, y, z];
  });
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
  return made(errors, result, vehicle, () =>
    controlPoint(result, vehicle).map((y, i) => y.map((value, k) => value - wanted[i][k])),
  );
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
