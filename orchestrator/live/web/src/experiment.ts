// Start, stop and steps of a run, t_k = k h.

/** A value or a time with which no run can begin; the text says why. */
export class Refusal extends Error {}

/** A rest shorter than this share of the run, and of a step, is a rounding error. */
const ROUNDING = 1e-9;
const MOST_OF_A_STEP = 1e-3;

/** Whether an event can come then [s]: not before the start. */
export function isTime(time: number): boolean {
  return time >= 0 && time < Infinity;
}

/** Whether an event can last so long [s]. */
export function isDuration(time: number): boolean {
  return time > 0 && time < Infinity;
}

/** A number of steps; a whole number where it is one apart from rounding. */
function rounded(n: number): number {
  const nearest = Math.round(n);
  return Math.abs(n - nearest) <= Math.min(ROUNDING * nearest, MOST_OF_A_STEP) ? nearest : n;
}

export class Experiment {
  /** How many steps have the whole length. */
  readonly fullSteps: number;
  /** How many steps there are: the last one is shorter if the run is not a multiple of the step. */
  readonly steps: number;

  /** Times are in seconds; a page refuses more than so many steps. */
  constructor(
    readonly stopTime: number,
    readonly step: number,
    mostSteps: number,
  ) {
    for (const [name, time] of [
      ["step", step],
      ["stop time", stopTime],
    ] as const) {
      if (Number.isNaN(time)) throw new Refusal(`${name}: not a number`);
      if (!isDuration(time)) throw new Refusal(`${name} ${time} s must be positive, and finite`);
    }
    const inSteps = rounded(Math.max(stopTime / step, Number.MIN_VALUE));
    if (inSteps > mostSteps) {
      throw new Refusal(
        `${stopTime} s in steps of ${step} s are more than ${mostSteps} steps, too many for a page`,
      );
    }
    this.fullSteps = Math.floor(inSteps);
    this.steps = Math.ceil(inSteps);
  }

  /** The time after k steps. */
  time(k: number): number {
    return k <= this.fullSteps ? k * this.step : this.stopTime;
  }

  /** How long the step after the k-th lasts. */
  length(k: number): number {
    return k < this.fullSteps ? this.step : this.stopTime - this.time(k);
  }

  /** After how many steps a time has come: the first t_k that is not before it. */
  reaching(time: number): number {
    return Math.ceil(rounded(Math.max(time / this.step, 0)));
  }
}
