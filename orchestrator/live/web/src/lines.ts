// Lines of a width in pixels, which WebGL itself does not have, and lines of one pixel.

import { Geometry, Mesh, type OGLRenderingContext, Polyline, Program, Vec3 } from "ogl";

/** Red, green and blue from 0 to 1. */
export type Colour = readonly [number, number, number];

/** Points that a path is drawn with. */
export const POINTS = 1000;

/** The length of a dash with its gap, as a share of the largest extent of the scene. */
const DASH = 0.028;

const VERTEX = /* glsl */ `
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

const FRAGMENT = /* glsl */ `
  precision highp float;
  uniform vec3 uColour, uLater;
  uniform float uProgress, uDash;
  varying float vTime, vRun;
  void main() {
    if (uDash > 0.0 && fract(vRun / uDash) > 0.62) discard;
    gl_FragColor = vec4(vTime <= uProgress ? uColour : uLater, 1.0);
  }
`;

/** A path in space; what lies after a time is fainter. */
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
      vertex: VERTEX,
      fragment: FRAGMENT,
      uniforms,
      attributes: { run: { size: 1, data: this.#run } },
    });
    this.mesh = this.#line.mesh;
    this.mesh.frustumCulled = false;
    this.mesh.program.cullFace = false;
  }

  /** Points that are as far apart in time as each other: three numbers each. */
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

  /** The share of the time that has passed. */
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

/** Single points, or pairs of them as lines of one pixel, of which at most so many are drawn. */
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
