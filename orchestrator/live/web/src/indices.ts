// The indices of metrics.json; orchestrator/vehicle/indices.py says what each is.
import type { Metrics, Result } from "./types";

const ACTUATORS = ["u", "q", "r"];
const AXES = ["x", "y", "z"];

/** What has been made of a run: the page asks more than once. */
const points = new WeakMap<Result, Float64Array[]>();
const errors = new WeakMap<Result, Float64Array[]>();

/** The control point without noise, a coordinate each [m]: (9) on the vehicle's posture. */
export function controlPoint(result: Result): Float64Array[] {
  const known = points.get(result);
  if (known !== undefined) return known;
  const [phi, theta, psi] = ["phi", "theta", "psi"].map((name) =>
    result.column(`plant.eta.${name}`),
  );
  const ell = Number(result.parameters["plant.ell"]);
  const [x, y, z] = AXES.map((axis) => result.column(`plant.eta.${axis}`).slice());
  for (let k = 0; k < phi.length; k++) {
    // The first column of the rotation: the direction of the vehicle's nose.
    x[k] += ell * Math.cos(psi[k]) * Math.cos(theta[k]);
    y[k] += ell * Math.sin(psi[k]) * Math.cos(theta[k]);
    z[k] -= ell * Math.sin(theta[k]);
  }
  points.set(result, [x, y, z]);
  return [x, y, z];
}

/** e = y - y_d with the true control point [m]; undefined: the loop has no reference. */
export function trackingError(result: Result): Float64Array[] | undefined {
  if (!result.has("planner.y_d.x")) return undefined;
  const error =
    errors.get(result) ??
    controlPoint(result).map((y, i) => {
      const wanted = result.column(`planner.y_d.${AXES[i]}`);
      return y.map((value, k) => value - wanted[k]);
    });
  errors.set(result, error);
  return error;
}

/** What is commanded: what the vehicle takes, or the allocation of one that takes no tau. */
export function commandName(result: Result, actuator: string): string {
  const taken = `plant.tau.${actuator}`;
  return result.has(taken) ? taken : `allocation.tau.${actuator}`;
}

/** Lower and upper limits of an actuator; undefined: they are no parameters of the vehicle. */
export function limits(result: Result, actuator: string): readonly [number, number] | undefined {
  const of = (end: string) => result.parameters[`plant.tau_${end}.${actuator}`];
  const [lower, upper] = [of("min"), of("max")];
  return lower === undefined || upper === undefined ? undefined : [Number(lower), Number(upper)];
}

/** The indices of a run that has made a step, with its end of so many seconds; of none, nothing. */
export function metrics(result: Result, lastSeconds: number): Metrics {
  const { time, rows } = result;
  const steps = rows - 1;
  if (steps === 0) return {};
  const end = time[steps];
  const [square, peak, outside, variation] = [0, 0, 0, 0].map(() => new Array<number>(3).fill(0));
  ACTUATORS.forEach((actuator, i) => {
    const applied = result.column(`plant.tau_applied.${actuator}`);
    const commanded = result.column(commandName(result, actuator));
    const [lower, upper] = limits(result, actuator) ?? [-Infinity, Infinity];
    for (let k = 1; k < rows; k++) {
      square[i] += applied[k] ** 2 * (time[k] - time[k - 1]);
      peak[i] = Math.max(peak[i], Math.abs(commanded[k]));
      if (commanded[k] < lower || commanded[k] > upper) outside[i] += 1;
      // Before the first step nothing was applied.
      if (k > 1) variation[i] += Math.abs(applied[k] - applied[k - 1]);
    }
  });
  const error = trackingError(result);
  const late = (values: Float64Array) => values.filter((_, k) => time[k] >= end - lastSeconds);
  const largest = (values: Float64Array) => values.reduce((a, b) => Math.max(a, Math.abs(b)), 0);
  return {
    l2_effort: square.map(Math.sqrt),
    rms_effort: square.map((sum) => Math.sqrt(sum / end)),
    peak_command: peak,
    ...(limits(result, ACTUATORS[0]) ? { saturated_fraction: outside.map((n) => n / steps) } : {}),
    total_variation: variation,
    ...(error === undefined ? {} : { final_error: error.map((values) => largest(late(values))) }),
  };
}
