// The box around a scene: grid lines on its far walls, and numbers along its near edges.

import { type Box, extents, ticks, type Vector } from "./space";

/** A number, or the title of an axis, at a place in the scene. */
export interface Label {
  at: Vector;
  text: string;
  axis: number;
  isTitle: boolean;
}

export interface Grid {
  /** Ends of lines, one after another. */
  lines: number[];
  labels: Label[];
}

/** An axis of the scene: what is written along it, and whether its numbers run backwards. */
export interface Axis {
  title: string;
  reversed: boolean;
}

/** How far outside the box numbers and titles stand [px]. */
const NUMBER = 18;
const TITLE = 48;

/** What is written along the axes as they are drawn: to the right, up, and to the viewer. */
export function axesOf(zUp: boolean): readonly [Axis, Axis, Axis] {
  return zUp
    ? [
        { title: "x north [m]", reversed: false },
        { title: "z up [m]", reversed: false },
        { title: "y west [m]", reversed: true },
      ]
    : [
        { title: "x north [m]", reversed: false },
        { title: "z down [m]", reversed: true },
        { title: "y east [m]", reversed: false },
      ];
}

/**
 * Grid and labels for an eye that looks from above.
 *
 * @param back direction from the middle to the eye.
 * @param pixel the size of a pixel in the middle of the scene.
 * @param leftmost of two places, the one further to the left on the screen.
 */
export function grid(
  box: Box,
  axes: readonly [Axis, Axis, Axis],
  back: Vector,
  pixel: number,
  leftmost: (a: Vector, b: Vector) => Vector,
): Grid {
  const [largest] = extents(box);
  const near = back.map((b, k) => (b > 0 ? box.high[k] : box.low[k])) as Vector;
  const far = back.map((b, k) => (b > 0 ? box.low[k] : box.high[k])) as Vector;
  far[1] = box.low[1];
  const marks = box.high.map((high, k) =>
    ticks(box.low[k], high, Math.max(2, (5 * (high - box.low[k])) / largest)),
  );
  const lines: number[] = [];
  const labels: Label[] = [];
  for (let k = 0; k < 3; k++) {
    // A line at each mark on both walls that the axis lies in.
    for (const wall of [0, 1, 2].filter((other) => other !== k)) {
      const along = 3 - k - wall;
      for (const mark of [box.low[k], ...marks[k], box.high[k]]) {
        const [from, to] = [[...far], [...far]];
        from[k] = to[k] = mark;
        from[along] = box.low[along];
        to[along] = box.high[along];
        lines.push(...from, ...to);
      }
    }
    const outward = (distance: number): Vector => {
      const at: Vector = [near[0], box.low[1], near[2]];
      if (k === 1) return at;
      const across = 2 - k;
      at[across] += Math.sign(back[across]) * distance * pixel;
      return at;
    };
    const corner = leftmost([far[0], box.low[1], near[2]], [near[0], box.low[1], far[2]]);
    const place = (mark: number, distance: number): Vector => {
      const at: Vector = k === 1 ? [...corner] : outward(distance);
      at[k] = mark;
      return at;
    };
    for (const mark of marks[k]) {
      const number = axes[k].reversed ? -mark : mark;
      labels.push({
        at: place(mark, NUMBER),
        text: String(Number(number.toPrecision(6)) + 0),
        axis: k,
        isTitle: false,
      });
    }
    const middle = k === 1 ? box.high[1] + NUMBER * pixel : (box.low[k] + box.high[k]) / 2;
    labels.push({ at: place(middle, TITLE), text: axes[k].title, axis: k, isTitle: true });
  }
  return { lines, labels };
}
