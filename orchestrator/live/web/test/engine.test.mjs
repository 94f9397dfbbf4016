import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { general } = await load("text");
const { Experiment, Refusal } = await load("simulate");

const MOST = 200_000;

test("numbers are written as %g writes them", () => {
  // From C's printf.
  const wanted = [
    [0, 6, "0"],
    [0.02, 12, "0.02"],
    [100, 6, "100"],
    [1234567, 6, "1.23457e+06"],
    [0.0001, 6, "0.0001"],
    [0.00001, 6, "1e-05"],
    [-2.5, 6, "-2.5"],
    [999999.5, 6, "1e+06"],
    [1e300, 6, "1e+300"],
    [Number.NaN, 6, "nan"],
    [Number.NEGATIVE_INFINITY, 6, "-inf"],
  ];
  for (const [value, digits, text] of wanted) assert.equal(general(value, digits), text);
});

test("all steps but the last have the full length", () => {
  const whole = new Experiment(100, 0.02, MOST);
  assert.deepEqual([whole.fullSteps, whole.steps], [5000, 5000]);
  assert.equal(whole.time(4263), 4263 * 0.02);
  const short = new Experiment(1.05, 0.1, MOST);
  assert.deepEqual([short.fullSteps, short.steps, short.time(11)], [10, 11, 1.05]);

  // 0.3 / 0.1 is 2.9999999999999996.
  assert.equal(new Experiment(0.3, 0.1, MOST).steps, 3);
});

test("invalid times are refused", () => {
  for (const [stop, step] of [
    [0, 0.02],
    [Number.NaN, 0.02],
    [1, 0],
    [1, -1],
    [4000.02, 0.02],
  ]) {
    assert.throws(() => new Experiment(stop, step, MOST), Refusal);
  }
});
