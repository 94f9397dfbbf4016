// Geometry of the scene: attitudes, boxes, the viewer's eye, and the grid with its labels.

export type Vector = [number, number, number];

/** Returns the rows of the rotation from body to earth for roll, pitch and yaw [rad]. */
export function rotation(phi: number, theta: number, psi: number): number[] {
  const [cf, sf] = [Math.cos(phi), Math.sin(phi)];
  const [ct, st] = [Math.cos(theta), Math.sin(theta)];
  const [cp, sp] = [Math.cos(psi), Math.sin(psi)];
  return [
    cp * ct,
    cp * st * sf - sp * cf,
    cp * st * cf + sp * sf,
    sp * ct,
    sp * st * sf + cp * cf,
    sp * st * cf - cp * sf,
    -st,
    ct * sf,
    ct * cf,
  ];
}

/**
 * Returns a point of the earth frame as it is drawn: x to the right, y up, z to the viewer.
 *
 * The paper draws z up and y to the west; other scenarios have z down and y to the east. Both
 * frames are right-handed.
 */
export function drawn(x: number, y: number, z: number, zUp: boolean): Vector {
  return zUp ? [x, z, -y] : [x, -z, y];
}

export interface Box {
  low: Vector;
  high: Vector;
}

/** Returns the box around points, with a margin. */
export function boxOf(sets: readonly ArrayLike<number>[], margin: number): Box {
  const low: Vector = [Infinity, Infinity, Infinity];
  const high: Vector = [-Infinity, -Infinity, -Infinity];
  for (const points of sets) {
    for (let i = 0; i < points.length; i++) {
      const value = points[i];
      const k = i % 3;
      if (value < low[k]) low[k] = value;
      if (value > high[k]) high[k] = value;
    }
  }
  for (let k = 0; k < 3; k++) {
    // A run that fails at once has no finite point.
    if (!Number.isFinite(high[k] - low[k])) [low[k], high[k]] = [-1, 1];
    low[k] = low[k] - margin;
    high[k] = high[k] + margin;
  }
  return { low, high };
}

/** Returns the extents of a box, the largest first. */
export function extents({ low, high }: Box): number[] {
  return high.map((value, k) => value - low[k]).sort((a, b) => b - a);
}

/** Returns round numbers within a range, about as many as wanted. */
export function ticks(low: number, high: number, wanted: number): number[] {
  const rough = (high - low) / wanted;
  if (!(rough > 0) || !Number.isFinite(rough)) return [];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough * 0.999) ?? 10);
  const found: number[] = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    found.push(k * step + 0);
  }
  return found;
}

/** Direction of the eye: angles around the vertical and above the horizon [rad]. */
export interface View {
  azimuth: number;
  elevation: number;
}

/** Returns the directions to the right, up and backward for the eye. */
export function eyeAxes({ azimuth, elevation }: View): [Vector, Vector, Vector] {
  const [ca, sa] = [Math.cos(azimuth), Math.sin(azimuth)];
  const [ce, se] = [Math.cos(elevation), Math.sin(elevation)];
  return [
    [ca, 0, -sa],
    [-sa * se, ce, -ca * se],
    [sa * ce, se, ca * ce],
  ];
}

const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/**
 * Returns the least distance from the middle of a box at which all of it is in sight.
 *
 * @param half angle of view, from the middle upward [rad].
 * @param aspect width over height of the picture.
 */
export function distanceFor(box: Box, view: View, half: number, aspect: number): number {
  const [right, up, back] = eyeAxes(view);
  const tall = Math.tan(half);
  const wide = tall * aspect;
  let distance = 0;
  for (let corner = 0; corner < 8; corner++) {
    const p = box.high.map((high, k) => {
      const reach = (high - box.low[k]) / 2;
      return corner & (1 << k) ? reach : -reach;
    }) as Vector;
    const needed =
      dot(p, back) + Math.max(Math.abs(dot(p, right)) / wide, Math.abs(dot(p, up)) / tall);
    distance = Math.max(distance, needed);
  }
  return distance;
}

/** A number, or the title of an axis, at a place in the scene. */
export interface Label {
  at: Vector;
  text: string;
  axis: number;
  isTitle: boolean;
}

interface Grid {
  /** Ends of lines, one after another. */
  lines: number[];
  labels: Label[];
}

/** An axis of the scene. */
interface Axis {
  title: string;
  /** If set, its numbers decrease. */
  reversed: boolean;
}

/** Distance of numbers and titles from the box [px]. */
const NUMBER = 18;
const TITLE = 48;

/** Returns the axes as they are drawn: to the right, up, and to the viewer. */
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
 * Returns grid lines on the far walls of a box and labels on its near edges, seen from above.
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
    // A line at each mark on both walls along the axis.
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
