// The vehicle as WebGL draws it: a hull and four fins, of length 1, its nose in the origin.

import { Geometry, Mesh, type OGLRenderingContext, Program } from "ogl";
import type { Colour } from "./lines";
import type { Hull } from "./types";

interface Body {
  /** Body frame: x ahead, y to starboard, z down. */
  positions: Float32Array;
  normals: Float32Array;
  /** 0: hull, 1: upper fin, which shows the roll, 2: other fins. */
  parts: Float32Array;
}

const SIDES = 20;

/** Up, to starboard, down, to port: y and z. */
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

const VERTEX = /* glsl */ `
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

const FRAGMENT = /* glsl */ `
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
    vertex: VERTEX,
    fragment: FRAGMENT,
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
