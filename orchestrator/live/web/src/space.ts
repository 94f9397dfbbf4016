// Geometry of the scene: attitudes, axes, and how far away the eye stands.

export type Vector = [number, number, number];

/** Rows of the rotation from body to earth, of roll, pitch and yaw [rad]. */
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
 * A point of the earth frame as it is drawn: x to the right, y up, z to the viewer.
 *
 * The paper draws z up and y to the west; other scenarios have z down and y to the east. Either
 * way the axes are right-handed.
 */
export function drawn(x: number, y: number, z: number, zUp: boolean): Vector {
  return zUp ? [x, z, -y] : [x, -z, y];
}

export interface Box {
  low: Vector;
  high: Vector;
}

/** A box that holds points, with a margin around them. */
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

/** How far a box reaches along its axes, the farthest first. */
export function extents({ low, high }: Box): number[] {
  return high.map((value, k) => value - low[k]).sort((a, b) => b - a);
}

/** Round numbers within a range, about as many as wanted. */
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

/** Where the eye is: angles around the vertical and above the horizon [rad]. */
export interface View {
  azimuth: number;
  elevation: number;
}

/** Right, up and backward as the eye sees them. */
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
 * The least distance from the middle of a box at which all of it is in sight.
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
