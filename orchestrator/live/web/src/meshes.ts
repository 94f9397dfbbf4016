// Shapes for WebGL: paths with a width in pixels, points, lines of one pixel, and the vehicle.

import { Geometry, Mesh, type OGLRenderingContext, Polyline, Program, Vec3 } from "ogl";
import type { Hull } from "./types";

/** Red, green and blue from 0 to 1. */
export type Colour = readonly [number, number, number];

/** Number of points of a drawn path. */
export const POINTS = 1000;

/** Length of a dash with its gap, as a share of the largest extent of the scene. */
const DASH = 0.028;

const PATH_VERTEX = /* glsl */ `
  precision highp float;
  attribute vec3 position, next, prev;
  attribute vec2 uv;
  attribute float side, run;
  uniform mat4 modelViewMatrix, projectionMatrix;
  uniform vec2 uResolution;
  uniform float uDPR, uThickness;
  varying float vTime, vRun;

  vec2 onScreen(vec4 p) { return p.xy / p.w * vec2(uResolution.x / uResolution.y, 1.0); }

  void main() {
    mat4 all = projectionMatrix * modelViewMatrix;
    vec4 here = all * vec4(position, 1.0);
    vec2 middle = onScreen(here);
    vec2 ahead = onScreen(all * vec4(next, 1.0)) - middle;
    vec2 behind = middle - onScreen(all * vec4(prev, 1.0));
    // A vehicle at rest has no direction.
    vec2 along = normalize(ahead + behind + vec2(1e-7, 0.0));
    vec2 across = vec2(-along.y, along.x) / vec2(uResolution.x / uResolution.y, 1.0);
    here.xy += across * side * uThickness * uDPR / uResolution.y * here.w;
    vTime = uv.y;
    vRun = run;
    gl_Position = here;
  }
`;

const PATH_FRAGMENT = /* glsl */ `
  precision highp float;
  uniform vec3 uColour, uLater;
  uniform float uProgress, uDash;
  varying float vTime, vRun;
  void main() {
    if (uDash > 0.0 && fract(vRun / uDash) > 0.62) discard;
    gl_FragColor = vec4(vTime <= uProgress ? uColour : uLater, 1.0);
  }
`;

/** A path in space, fainter after the current time. */
export class PathLine {
  readonly mesh: Mesh;
  readonly #line: Polyline;
  readonly #run = new Float32Array(2 * POINTS);

  constructor(gl: OGLRenderingContext, width: number, dashed: boolean) {
    const uniforms = {
      uColour: { value: [0, 0, 0] },
      uLater: { value: [0, 0, 0] },
      uProgress: { value: 1 },
      uDash: { value: dashed ? DASH : 0 },
      uThickness: { value: width },
    };
    this.#line = new Polyline(gl, {
      points: Array.from({ length: POINTS }, () => new Vec3()),
      vertex: PATH_VERTEX,
      fragment: PATH_FRAGMENT,
      uniforms,
      attributes: { run: { size: 1, data: this.#run } },
    });
    this.mesh = this.#line.mesh;
    this.mesh.frustumCulled = false;
    this.mesh.program.cullFace = false;
  }

  /** Sets the points, which are equally spaced in time: three numbers each. */
  place(points: Float32Array): void {
    let run = 0;
    for (let i = 0; i < POINTS; i++) {
      const [x, y, z] = [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
      const before = this.#line.points[Math.max(i - 1, 0)];
      if (i > 0) run += Math.hypot(x - before.x, y - before.y, z - before.z);
      this.#line.points[i].set(x, y, z);
      this.#run[2 * i] = this.#run[2 * i + 1] = run;
    }
    this.#line.updateGeometry();
    this.mesh.geometry.attributes.run.needsUpdate = true;
  }

  paint(colour: Colour, later: Colour): void {
    this.mesh.program.uniforms.uColour.value = colour;
    this.mesh.program.uniforms.uLater.value = later;
  }

  /** Sets the share of the time that has passed. */
  set progress(share: number) {
    this.mesh.program.uniforms.uProgress.value = share;
  }

  resize(): void {
    this.#line.resize();
  }
}

const PLAIN_VERTEX = /* glsl */ `
  precision highp float;
  attribute vec3 position;
  uniform mat4 modelViewMatrix, projectionMatrix;
  uniform float uSize;
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    gl_PointSize = uSize;
  }
`;

const PLAIN_FRAGMENT = /* glsl */ `
  precision highp float;
  uniform vec3 uColour;
  void main() { gl_FragColor = vec4(uColour, 1.0); }
`;

/** Single points, or pairs of points as lines of one pixel; at most `most` points. */
export class Primitives {
  readonly mesh: Mesh;
  readonly #data: Float32Array;

  constructor(gl: OGLRenderingContext, most: number, mode: GLenum, size = 1) {
    this.#data = new Float32Array(3 * most);
    const geometry = new Geometry(gl, { position: { size: 3, data: this.#data } });
    const program = new Program(gl, {
      vertex: PLAIN_VERTEX,
      fragment: PLAIN_FRAGMENT,
      uniforms: { uColour: { value: [0, 0, 0] }, uSize: { value: size } },
    });
    this.mesh = new Mesh(gl, { geometry, program, mode, frustumCulled: false });
  }

  place(points: readonly number[]): void {
    const used = Math.min(points.length, this.#data.length);
    this.#data.set(points.slice(0, used));
    this.mesh.geometry.attributes.position.needsUpdate = true;
    this.mesh.geometry.setDrawRange(0, used / 3);
  }

  paint(colour: Colour): void {
    this.mesh.program.uniforms.uColour.value = colour;
  }
}

/** The vehicle as triangles: a hull and four fins, of length 1, its nose in the origin. */
interface Body {
  /** Body frame: x ahead, y to starboard, z down. */
  positions: Float32Array;
  normals: Float32Array;
  /** 0: hull, 1: upper fin, which shows the roll, 2: other fins. */
  parts: Float32Array;
}

const SIDES = 20;

/** Directions of the fins, y and z: up, to starboard, down, to port. */
const FINS: readonly (readonly [number, number])[] = [
  [0, -1],
  [1, 0],
  [0, 1],
  [-1, 0],
];

type Point = readonly [number, number, number];

function body({ rings, fin }: Hull): Body {
  const positions: number[] = [];
  const normals: number[] = [];
  const parts: number[] = [];
  const corner = (point: Point, normal: Point, part: number) => {
    positions.push(...point);
    normals.push(...normal);
    parts.push(part);
  };
  const ringPoint = (ring: number, side: number): [Point, Point] => {
    const [distance, radius] = rings[ring];
    const [before, wider] = rings[Math.max(ring - 1, 0)];
    const [after, narrower] = rings[Math.min(ring + 1, rings.length - 1)];
    const angle = (2 * Math.PI * side) / SIDES;
    const slope = (narrower - wider) / (after - before);
    const size = Math.hypot(1, slope);
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return [
      [-distance, radius * c, radius * s],
      [slope / size, c / size, s / size],
    ];
  };
  for (let ring = 0; ring + 1 < rings.length; ring++) {
    for (let side = 0; side < SIDES; side++) {
      const a = ringPoint(ring, side);
      const b = ringPoint(ring, side + 1);
      const c = ringPoint(ring + 1, side);
      const d = ringPoint(ring + 1, side + 1);
      for (const [point, normal] of [a, b, c, b, d, c]) corner(point, normal, 0);
    }
  }
  FINS.forEach(([y, z], i) => {
    const points = fin.map(([distance, height]): Point => [-distance, height * y, height * z]);
    for (const k of [0, 1, 2, 0, 2, 3]) corner(points[k], [0, z, y], i === 0 ? 1 : 2);
  });
  return {
    positions: new Float32Array(positions),
    normals: new Float32Array(normals),
    parts: new Float32Array(parts),
  };
}

const BODY_VERTEX = /* glsl */ `
  precision highp float;
  attribute vec3 position, normal;
  attribute float part;
  uniform mat4 modelViewMatrix, projectionMatrix;
  uniform mat3 normalMatrix;
  uniform vec3 uHull, uFin, uOther;
  varying vec3 vNormal, vColour;
  void main() {
    vNormal = normalMatrix * normal;
    vColour = part < 0.5 ? uHull : part < 1.5 ? uFin : uOther;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }
`;

const BODY_FRAGMENT = /* glsl */ `
  precision highp float;
  varying vec3 vNormal, vColour;
  void main() {
    // Fins are seen from both sides.
    vec3 n = normalize(vNormal);
    float light = 0.62 + 0.38 * abs(dot(n, normalize(vec3(0.3, 0.8, 0.6))));
    gl_FragColor = vec4(vColour * light, 1.0);
  }
`;

export function vehicleMesh(gl: OGLRenderingContext, hull: Hull): Mesh {
  const { positions, normals, parts } = body(hull);
  const geometry = new Geometry(gl, {
    position: { size: 3, data: positions },
    normal: { size: 3, data: normals },
    part: { size: 1, data: parts },
  });
  const program = new Program(gl, {
    vertex: BODY_VERTEX,
    fragment: BODY_FRAGMENT,
    cullFace: false,
    uniforms: {
      uHull: { value: [0, 0, 0] },
      uFin: { value: [0, 0, 0] },
      uOther: { value: [0, 0, 0] },
    },
  });
  return new Mesh(gl, { geometry, program, frustumCulled: false });
}

export function paintVehicle(mesh: Mesh, hull: Colour, fin: Colour, other: Colour): void {
  const { uniforms } = mesh.program;
  uniforms.uHull.value = hull;
  uniforms.uFin.value = fin;
  uniforms.uOther.value = other;
}
