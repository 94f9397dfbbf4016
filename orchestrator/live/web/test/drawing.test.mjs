// Results of sliders, axes and number formats, against numbers worked out by hand.
import assert from "node:assert/strict";
import test from "node:test";
import { load } from "./load.mjs";

const { valueAt, positionOf, POSITIONS } = await load("sliders");
const { tick } = await load("text");
const { columnLines, columnSections } = await load("panels");
const { boxOf, distanceFor, drawn, eyeAxes, rotation, ticks } = await load("space");

const near = (found, wanted, tolerance = 1e-12) =>
  assert.ok(Math.abs(found - wanted) <= tolerance, `${found} is not ${wanted}`);

test("a slider's ends and middle", () => {
  const scale = { low: -20, high: 20 };
  assert.deepEqual(
    [0, 500, 1000].map((p) => valueAt(scale, p)),
    [-20, 0, 20],
  );
  const decades = { low: 0.1, high: 1000, log: true };
  assert.deepEqual(
    [0, 250, 500, 750, 1000].map((p) => valueAt(decades, p)),
    [0.1, 1, 10, 100, 1000],
  );
  assert.deepEqual(
    [0, 1000].map((p) => valueAt({ low: 1e-5, high: 1, log: true, zero: true }, p)),
    [0, 1],
  );
  assert.equal(valueAt({ low: 1, high: 100, whole: true }, 505), 51);
});

test("positions follow values, and stay on the slider", () => {
  const scale = { low: 0.1, high: 1000, log: true };
  assert.deepEqual(
    [0, 0.1, 10, 1000, 1e9].map((v) => positionOf(scale, v)),
    [0, 0, 500, POSITIONS, POSITIONS],
  );
});

test("a quarter turn takes x to y, and pitch lifts the nose", () => {
  const yaw = rotation(0, 0, Math.PI / 2);
  for (const [row, wanted] of [0, 1, 0].entries()) near(yaw[3 * row], wanted);
  const pitch = rotation(0, Math.PI / 2, 0);
  // z is down: a nose that points up has z = -1.
  for (const [row, wanted] of [0, 0, -1].entries()) near(pitch[3 * row], wanted);
});

test("axes are right-handed as they are drawn", () => {
  for (const zUp of [true, false]) {
    const [x, y, z] = [
      [1, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
    ].map((p) => drawn(...p, zUp));
    const cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    assert.deepEqual(
      cross.map((v) => v + 0),
      z.map((v) => v + 0),
    );
    assert.equal(z[1], zUp ? 1 : -1);
  }
});

test("round numbers between the ends", () => {
  assert.deepEqual(ticks(-2.1, 6.2, 5), [-2, 0, 2, 4, 6]);
  assert.deepEqual(ticks(0, 100, 5), [0, 20, 40, 60, 80, 100]);
  assert.deepEqual(ticks(1, 1, 5), []);
});

test("a box contains all points, and has a size without any", () => {
  assert.deepEqual(boxOf([Float64Array.of(0, 1, 2, 4, -3, 2)], 1), {
    low: [-1, -4, 1],
    high: [5, 2, 3],
  });
  assert.deepEqual(boxOf([], 0), { low: [-1, -1, -1], high: [1, 1, 1] });
});

test("at the distance of the eye a cube just fits", () => {
  const box = { low: [-1, -1, -1], high: [1, 1, 1] };
  // From the front, the near face is at distance 1 from the middle, with half height 1.
  near(distanceFor(box, { azimuth: 0, elevation: 0 }, Math.PI / 4, 1), 2);
  near(distanceFor(box, { azimuth: 0, elevation: 0 }, Math.PI / 4, 0.5), 3);
  const [right, up, back] = eyeAxes({ azimuth: 0, elevation: 0 });
  assert.deepEqual(
    [right, up, back].map((axis) => axis.map((v) => v + 0)),
    [
      [1, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
    ],
  );
});

test("labels of an axis are short, distinct, and keep all digits", () => {
  const labels = [0, 1, -0.5, 99999, 1e5, -1e6, 1.5e6, 2e9, 2.5e-5, 0.001].map(tick);
  const wanted = ["0", "1", "−0.5", "99999", "1e5", "−1e6", "1.5e6", "2e9", "2.5e−5", "0.001"];
  assert.deepEqual(labels, wanted);
});

test("columns without a vehicle have a chart each, in sections by their names", () => {
  const columns = { "a.y.x": "m", "b.w[1]": "", "a.y.z": "m/s", "b.<i>": "K", "b.w[2]": "" };
  const sections = columnSections(["one", "two"], columns);
  assert.deepEqual(
    sections.map(({ title, panels }) => [title, panels.map((panel) => [panel.title, panel.unit])]),
    [
      ["a.y", [["x", "m"], ["z", "m/s"]]],
      ["b.w", [["[1]", ""], ["[2]", ""]]],
      ["b", [["&#60;i&#62;", "K"]]],
    ],
  ); // biome-ignore format: a table
  const values = { "a.y.x": [1, 2, 3] };
  const run = {
    rows: 3,
    time: [0, 1, 2],
    has: (name) => name in values,
    column: (name) => values[name],
  };
  const [[x, z]] = columnLines([undefined, run], columns);
  assert.deepEqual([x.time, x.values], [run.time, [undefined, [1, 2, 3]]]);
  assert.deepEqual(z.values, [undefined, undefined]);
});
