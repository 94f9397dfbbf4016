// The indices of metrics.json; orchestrator/vehicle/indices.py says what each is.
import type { Metrics, Result, VehicleData } from "./types";

const ACTUATORS = ["u", "q", "r"];
const AXES = ["x", "y", "z"];

type Columns = Float64Array[];

/** What has been made of a run, by the names of the vehicles: the page asks more than once. */
const points = new WeakMap<Result, Map<string, Columns>>();
const errors = new WeakMap<Result, Map<string, Columns>>();
const gaps = new WeakMap<Result, Float64Array>();

function made(
  known: WeakMap<Result, Map<string, Columns>>,
  result: Result,
  vehicle: VehicleData,
  make: () => Columns,
): Columns {
  const all = known.get(result) ?? new Map<string, Columns>();
  const found = all.get(vehicle.vehicle) ?? make();
  known.set(result, all.set(vehicle.vehicle, found));
  return found;
}

/** The control point without noise, a coordinate each [m]: (9) on the vehicle's posture. */
export function controlPoint(result: Result, vehicle: VehicleData): Columns {
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
export function reference(result: Result, { planner }: VehicleData): Columns | undefined {
  if (!result.has(`${planner}.y_d.x`)) return undefined;
  return AXES.map((axis) => result.column(`${planner}.y_d.${axis}`));
}

/** e = y - y_d with the true control point [m]; undefined: the vehicle has no reference. */
export function trackingError(result: Result, vehicle: VehicleData): Columns | undefined {
  const wanted = reference(result, vehicle);
  if (wanted === undefined) return undefined;
  return made(errors, result, vehicle, () =>
    controlPoint(result, vehicle).map((y, i) => y.map((value, k) => value - wanted[i][k])),
  );
}

/** Distance between the two centres of mass that are closest [m]; undefined: there is only one. */
export function smallestDistance(
  result: Result,
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
        const square = (x[k] - a[k]) ** 2 + (y[k] - b[k]) ** 2 + (z[k] - c[k]) ** 2;
        squares[k] = Math.min(squares[k], square);
      }
    }
  });
  const found = squares.map(Math.sqrt);
  gaps.set(result, found);
  return found;
}

/** What acts in each step, or follows from inputs of its beginning. */
export function inSteps(result: Result, name: string): Float64Array {
  return result.column(name).subarray(result.actingRow, result.rows - 1 + result.actingRow);
}

/** What is applied in each step: of actuators with a lag, what they give at its end. */
function applied(result: Result, { vehicle, allocation }: VehicleData, actuator: string) {
  const name = `${vehicle}.tau_applied.${actuator}`;
  const hasLag =
    allocation !== "" || Number(result.parameters[`${vehicle}.actuator.T.${actuator}`]);
  return hasLag ? result.column(name).subarray(1) : inSteps(result, name);
}

/** What is commanded: what the vehicle takes, or the allocation of one that takes no tau. */
export function commandName(result: Result, vehicle: VehicleData, actuator: string): string {
  const taken = `${vehicle.vehicle}.tau.${actuator}`;
  return result.has(taken) ? taken : `${vehicle.allocation}.tau.${actuator}`;
}

/** Lower and upper limits of an actuator; undefined: they are no parameters of the vehicle. */
export function limits(
  result: Result,
  { vehicle }: VehicleData,
  actuator: string,
): readonly [number, number] | undefined {
  const of = (end: string) => result.parameters[`${vehicle}.tau_${end}.${actuator}`];
  const [lower, upper] = [of("min"), of("max")];
  return lower === undefined || upper === undefined ? undefined : [Number(lower), Number(upper)];
}

/**
 * The indices of a run that has made a step; of none, nothing.
 *
 * @param vehicle that they are of.
 * @param fleet all vehicles, for what there is of several together.
 * @param lastSeconds the end of the run [s].
 */
export function metrics(
  result: Result,
  vehicle: VehicleData,
  fleet: readonly VehicleData[],
  lastSeconds: number,
): Metrics {
  const { time, rows } = result;
  const steps = rows - 1;
  if (steps === 0) return {};
  const end = time[steps];
  const [square, peak, outside, variation] = [0, 0, 0, 0].map(() => new Array<number>(3).fill(0));
  ACTUATORS.forEach((actuator, i) => {
    const force = applied(result, vehicle, actuator);
    const commanded = inSteps(result, commandName(result, vehicle, actuator));
    const [lower, upper] = limits(result, vehicle, actuator) ?? [-Infinity, Infinity];
    for (let k = 0; k < steps; k++) {
      square[i] += force[k] ** 2 * (time[k + 1] - time[k]);
      peak[i] = Math.max(peak[i], Math.abs(commanded[k]));
      if (commanded[k] < lower || commanded[k] > upper) outside[i] += 1;
      // Before the first step nothing was applied.
      if (k > 0) variation[i] += Math.abs(force[k] - force[k - 1]);
    }
  });
  const error = trackingError(result, vehicle);
  const apart = smallestDistance(result, fleet);
  const late = (values: Float64Array) => values.filter((_, k) => time[k] >= end - lastSeconds);
  const largest = (values: Float64Array) => values.reduce((a, b) => Math.max(a, Math.abs(b)), 0);
  return {
    l2_effort: square.map(Math.sqrt),
    rms_effort: square.map((sum) => Math.sqrt(sum / end)),
    peak_command: peak,
    ...(limits(result, vehicle, ACTUATORS[0])
      ? { saturated_fraction: outside.map((n) => n / steps) }
      : {}),
    total_variation: variation,
    ...(error === undefined ? {} : { final_error: error.map((values) => largest(late(values))) }),
    ...(apart === undefined ? {} : { smallest_distance: [apart.reduce((a, b) => Math.min(a, b))] }),
  };
}
