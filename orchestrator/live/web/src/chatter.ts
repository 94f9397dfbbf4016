// Signals that chatter: charts show them as figures do, by their mean with a band.

/** A signal chatters if it changes direction at more than this share of its rows. */
const TURNS = 0.2;

/** Changes below this share of the signal's range do not count. */
const NEGLIGIBLE = 1e-3;

/** Window of a moving mean, as a share of the run. */
const WINDOW = 0.01;

/** Returns the least and the largest value. */
export function extremes(values: Float64Array): [number, number] {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

/** Tells whether a signal changes direction so often that its line would be a smear. */
export function chatters(values: Float64Array): boolean {
  const [low, high] = extremes(values);
  const least = NEGLIGIBLE * (high - low);
  let [before, turns] = [0, 0];
  for (let k = 1; k < values.length; k++) {
    const change = values[k] - values[k - 1];
    if (!(Math.abs(change) > least)) continue;
    if (change * before < 0) turns += 1;
    before = change;
  }
  return turns > TURNS * values.length;
}

/** Returns the mean of a signal, linear between rows, over a window around each row. */
export function movingMean(time: Float64Array, values: Float64Array): Float64Array {
  const n = values.length;
  const [start, end] = [time[0], time[n - 1]];
  const half = 0.5 * WINDOW * (end - start);
  const integral = new Float64Array(n);
  for (let k = 1; k < n; k++) {
    integral[k] = integral[k - 1] + 0.5 * (values[k] + values[k - 1]) * (time[k] - time[k - 1]);
  }
  /** Returns the integral up to times that increase from call to call. */
  const upTo = () => {
    let k = 0;
    return (at: number) => {
      while (k < n - 2 && time[k + 1] < at) k += 1;
      const share = (at - time[k]) / (time[k + 1] - time[k]);
      return integral[k] + share * (integral[k + 1] - integral[k]);
    };
  };
  const [lower, upper] = [upTo(), upTo()];
  return time.subarray(0, n).map((t) => {
    const [from, to] = [Math.max(t - half, start), Math.min(t + half, end)];
    return (upper(to) - lower(from)) / (to - from);
  });
}
