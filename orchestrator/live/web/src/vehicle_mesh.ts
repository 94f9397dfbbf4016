// The vehicle as WebGL draws it.

import { Geometry, Mesh, type OGLRenderingContext, Program } from "ogl";
import { body } from "./body";
import type { Colour } from "./lines";

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

export function vehicleMesh(gl: OGLRenderingContext): Mesh {
  const { positions, normals, parts } = body();
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
