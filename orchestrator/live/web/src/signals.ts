// What follows from the rows of a run.
import type { Metrics, Run, VehicleData } from "./types";

const AXES = ["x", "y", "z"];

type Columns = Float64Array[];

/** What has been made of a run, by the names of the vehicles: the page asks more than once. */
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

/** The control point without noise, a coordinate each [m]: (9) on the vehicle's posture. */
export function controlPoint(result: Run, vehicle: VehicleData): Columns {
  return made(points, result, vehicle, () => {
    const name = vehicle.vehicle;
    const [phi, theta, psi] = ["phi", "theta", "psi"].map((angle) =>
      result.column(`${name}.eta.${angle}`),
    );
    const ell = Number(result.parameters[`${name}.ell`]);
    const [x, y, z] = AXES.map((axis) => result.column(`${name}.eta.${axis}`).slice());
    for (let k = 0; k < phi.length; k++) {
      // The first column of the rotation: the direction of the vehicle's nose.
      x[k] += ell * Math.cos(psi[k]) * Math.cos(theta[k]);
      y[k] += ell * Math.sin(psi[k]) * Math.cos(theta[k]);
      z[k] -= ell * Math.sin(theta[k]);
    }
    return [x, y, z];
  });
}

/** The reference y_d, a coordinate each [m]; undefined: the vehicle has none. */
export function reference(result: Run, { planner }: VehicleData): Columns | undefined {
  if (!result.has(`${planner}.y_d.x`)) return undefined;
  return AXES.map((axis) => result.column(`${planner}.y_d.${axis}`));
}

/** e = y - y_d with the true control point [m]; undefined: the vehicle has no reference. */
export function trackingError(result: Run, vehicle: VehicleData): Columns | undefined {
  const wanted = reference(result, vehicle);
  if (wanted === undefined) return undefined;
  return made(errors, result, vehicle, () =>
    controlPoint(result, vehicle).map((y, i) => y.map((value, k) => value - wanted[i][k])),
  );
}

/** Distance between the two centres of mass that are closest [m]; undefined: there is only one. */
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

/** What acts in each step, or follows from inputs of its beginning. */
export function inSteps(result: Run, name: string): Float64Array {
  return result.column(name).subarray(result.actingRow, result.rows - 1 + result.actingRow);
}

/** What is commanded: what the vehicle takes, or the allocation of one that takes no tau. */
export function commandName(result: Run, vehicle: VehicleData, actuator: string): string {
  const taken = `${vehicle.vehicle}.tau.${actuator}`;
  return result.has(taken) ? taken : `${vehicle.allocation}.tau.${actuator}`;
}

/** Lower and upper limits of an actuator; undefined: they are no parameters of the vehicle. */
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
 * The indices of a run.
 *
 * @param place of the vehicle that they are of.
 * @param fleet all vehicles, for what there is of several together.
 */
export function metrics(result: Run, place: number, fleet: readonly VehicleData[]): Metrics {
  const found = result.metrics[place];
  const apart = smallestDistance(result, fleet);
  if (apart === undefined) return found;
  return { smallest_distance: [apart.reduce((a, b) => Math.min(a, b))], ...found };
}
