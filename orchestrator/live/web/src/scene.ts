// The scene: paths in space, with the vehicles on them at their attitudes.

import { Camera, type Mesh, Renderer, Transform } from "ogl";
import { make } from "./dom";
import { PathLine, POINTS, Primitives, paintVehicle, vehicleMesh } from "./meshes";
import type { Rows } from "./signals";
import {
  axesOf,
  type Box,
  boxOf,
  distanceFor,
  drawn,
  extents,
  eyeAxes,
  grid,
  type Label,
  rotation,
  type Vector,
} from "./space";
import { mixed, type Palette, vehicleColour } from "./theme";
import { Turning } from "./turning";
import type { Hull } from "./types";

/** Path and attitudes of a vehicle in a run. */
interface Track {
  /** Control point [m], earth frame. */
  path: Rows;
  /** Roll, pitch and yaw [rad]. */
  attitude: Rows;
}

/** Content of a scene. */
interface Shown {
  /** Tracks of all vehicles, by controller; empty: the controller is hidden. */
  tracks: readonly (readonly Track[])[];
  /** References of the vehicles; undefined: no reference. */
  references: readonly (Rows | undefined)[];
  /** Colours of the vehicles; empty: each controller has its colour. */
  colours: readonly string[];
  /** Colours of the references. */
  referenceColours: readonly string[];
  /** Waypoints of the reference: three numbers each [m]. */
  waypoints: readonly number[];
  /** Distance of the control point from the centre of mass [m]. */
  ell: number;
  /** Smallest distance between two vehicles [m]. */
  apart: number;
  zUp: boolean;
}

/** Half the angle of view [rad]. */
const HALF = 0.3;

/** Length of a vehicle, a multiple of ell: the control point is the nose. */
const LENGTH = 2;

/** Length at which a vehicle is drawn, unless it is longer: shares of the two largest extents. */
const OF_LARGEST = 0.09;
const OF_SECOND = 0.2;

/** Most of the smallest distance between two vehicles, and least of the largest extent. */
const OF_DISTANCE = 0.6;
const LEAST = 0.045;

/** Most marks of references. */
const MOST_TARGETS = 1000;

/** Half the length of the lines of a waypoint's cross, as a share of the scene. */
const CROSS = 0.015;

/** Half the width of a title [px]. */
const HALF_TITLE = 40;

/** Room for the numbers around the box [px]. */
const MARGIN = 25;

/** Numbers along an axis that are closer together than this are left out [px]. */
const CROWDED = 24;

/** Makes a note in place of a missing scene. */
export function missing(text: string): HTMLElement {
  return make("p", "missing", text);
}

/** Shares of the background in a path after the current time, of grey in a vehicle's reference. */
const LATER = 0.68;
const FAINT = 0.5;

/** Share of the text's colour in a vehicle's colour with the second controller. */
const OTHER = 0.5;

/** Path and mesh of a vehicle with a controller. */
interface Drawing {
  readonly controller: number;
  readonly vehicle: number;
  readonly path: PathLine;
  readonly mesh: Mesh;
}

export class Scene {
  readonly #host: HTMLElement;
  readonly #hull: Hull;
  readonly #renderer: Renderer;
  readonly #camera: Camera;
  readonly #root = new Transform();
  readonly #drawings: Drawing[] = [];
  readonly #references: PathLine[] = [];
  readonly #target: Primitives;
  readonly #waypoints: Primitives;
  readonly #grid: Primitives;
  readonly #labels: HTMLElement;
  readonly #turning: Turning;
  #shown: Shown = {
    tracks: [],
    references: [],
    colours: [],
    referenceColours: [],
    waypoints: [],
    ell: 0.35,
    apart: Infinity,
    zUp: false,
  };
  #palette: Palette | undefined;
  #box: Box = { low: [-1, -1, -1], high: [1, 1, 1] };
  /** The scene is drawn with its largest extent as 1. */
  #scale = 1;
  #middle: Vector = [0, 0, 0];
  #length = 1;
  #times = 1;
  #row = 0;
  #rows = 1;
  #picture: HTMLCanvasElement | undefined;
  #asked = false;
  #lost = false;

  /** Throws if there is no WebGL. */
  constructor(host: HTMLElement, canvas: HTMLCanvasElement, hull: Hull) {
    this.#host = host;
    this.#hull = hull;
    if (!(canvas.getContext("webgl2", { antialias: true, alpha: true }) as unknown)) {
      throw new Error("no WebGL");
    }
    this.#renderer = new Renderer({
      canvas,
      alpha: true,
      antialias: true,
      premultipliedAlpha: true,
      dpr: Math.min(window.devicePixelRatio, 2),
    });
    const gl = this.#renderer.gl;
    this.#camera = new Camera(gl, { fov: (HALF * 360) / Math.PI, near: 0.05, far: 50 });
    this.#grid = new Primitives(gl, 400, gl.LINES);
    this.#target = new Primitives(gl, MOST_TARGETS, gl.POINTS, 5 * this.#renderer.dpr);
    this.#waypoints = new Primitives(gl, 400, gl.LINES);
    for (const { mesh } of [this.#grid, this.#target, this.#waypoints]) {
      mesh.setParent(this.#root);
    }
    this.#provide([], 1);
    this.#labels = make("div", "scene-labels");
    this.#labels.setAttribute("aria-hidden", "true");
    host.append(this.#labels);
    this.#turning = new Turning(canvas, () => this.draw());
    canvas.addEventListener("webglcontextlost", () => {
      this.#lost = true;
      host.append(missing("The browser has dropped the path in space. Reload the page to see it."));
    });
    new ResizeObserver(() => this.#resize()).observe(host);
    this.#resize();
  }

  /** Makes the drawings that these tracks and so many references need. */
  #provide(tracks: Shown["tracks"], references: number): void {
    const gl = this.#renderer.gl;
    while (this.#references.length < references) {
      const line = new PathLine(gl, 1.6, false);
      line.mesh.setParent(this.#root);
      this.#references.push(line);
    }
    tracks.forEach((vehicles, controller) => {
      for (let vehicle = 0; vehicle < vehicles.length; vehicle++) {
        if (this.#drawing(controller, vehicle)) continue;
        const path = new PathLine(gl, 2.6, controller > 0);
        const mesh = vehicleMesh(gl, this.#hull);
        path.mesh.setParent(this.#root);
        mesh.matrixAutoUpdate = false;
        mesh.setParent(this.#root);
        this.#drawings.push({ controller, vehicle, path, mesh });
      }
    });
  }

  #drawing(controller: number, vehicle: number): Drawing | undefined {
    return this.#drawings.find((one) => one.controller === controller && one.vehicle === vehicle);
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.#host;
    if (!width || !height) return;
    this.#renderer.setSize(width, height);
    this.#camera.perspective({ aspect: width / height });
    const paths = this.#drawings.map(({ path }) => path);
    for (const line of [...this.#references, ...paths]) line.resize();
    this.draw();
  }

  paint(palette: Palette): void {
    this.#palette = palette;
    const { background, controllers, reference, highlight, grid, text } = palette;
    const colours = this.#shown.colours.map(vehicleColour);
    for (const { controller, vehicle, path, mesh } of this.#drawings) {
      const own = colours[vehicle];
      const colour = own ? mixed(own, text, controller * OTHER) : controllers[controller];
      path.paint(colour, mixed(colour, background, LATER));
      paintVehicle(mesh, colour, highlight, reference);
    }
    this.#references.forEach((line, vehicle) => {
      const own = this.#shown.referenceColours[vehicle];
      const colour = own ? mixed(vehicleColour(own), reference, FAINT) : reference;
      line.paint(colour, mixed(colour, background, own ? LATER : 0.3));
    });
    this.#target.paint(reference);
    this.#waypoints.paint(reference);
    this.#grid.paint(grid);
    this.draw();
  }

  /** Ratio of the length at which vehicles are drawn to their own. */
  get times(): number {
    return this.#times;
  }

  /** Shows other runs or vehicles. */
  set(shown: Shown): void {
    this.#shown = shown;
    this.#provide(shown.tracks, shown.references.length);
    const paths = shown.tracks.map((tracks) => tracks.map(({ path }) => sampled(path)));
    const references = shown.references.map((points) => points && sampled(points));
    const lines = references.flatMap((points) => (points ? [points] : []));
    const held = [...paths.flat(), ...lines, shown.waypoints];
    const tight = boxOf(held, 0);
    const [largest, second] = extents(tight);
    const large = Math.max(OF_LARGEST * largest, OF_SECOND * second);
    const own = LENGTH * shown.ell;
    this.#length = Math.max(own, LEAST * largest, Math.min(large, OF_DISTANCE * shown.apart));
    this.#times = this.#length / own;
    const box = boxOf(held, 0.6 * this.#length);
    this.#box = this.#drawnBox(box);
    this.#scale = 1 / extents(this.#box)[0];
    this.#middle = this.#box.low.map((low, k) => (low + this.#box.high[k]) / 2) as Vector;
    this.#rows = 1;
    for (const { controller, vehicle, path, mesh } of this.#drawings) {
      const track = shown.tracks[controller]?.[vehicle];
      path.mesh.visible = mesh.visible = track !== undefined;
      if (track) {
        path.place(this.#placedAll(paths[controller][vehicle]));
        this.#rows = Math.max(this.#rows, track.path.rows);
      }
    }
    this.#references.forEach((line, vehicle) => {
      const points = references[vehicle];
      line.mesh.visible = points !== undefined;
      if (points) line.place(this.#placedAll(points));
    });
    this.#target.mesh.visible = lines.length > 0;
    this.#waypoints.place(this.#crosses(shown.waypoints));
    if (this.#palette) this.paint(this.#palette);
    this.show(this.#row);
  }

  /** Shows the vehicles at a row. */
  show(row: number): void {
    this.#row = Math.max(0, Math.min(row, this.#rows - 1));
    const { tracks, references } = this.#shown;
    for (const { controller, vehicle, path, mesh } of this.#drawings) {
      const track = tracks[controller]?.[vehicle];
      if (!track) continue;
      // A failed run has fewer rows.
      const last = track.path.rows - 1;
      path.progress = last > 0 ? this.#row / last : 1;
      this.#pose(mesh, track, Math.min(this.#row, last));
    }
    const targets = references.flatMap((points) => {
      if (!points) return [];
      return this.#placed(...points.at(Math.min(this.#row, points.rows - 1)));
    });
    this.#target.place(targets);
    this.draw();
  }

  #pose(mesh: Mesh, { path, attitude }: Track, row: number): void {
    const r = rotation(...attitude.at(row));
    const at = this.#placed(...path.at(row));
    // With z up, the body frame also has y to port and z up.
    const sign = this.#shown.zUp ? -1 : 1;
    const size = this.#length * this.#scale;
    const columns = [0, 1, 2].map((k) =>
      drawn(r[k], r[3 + k], r[6 + k], this.#shown.zUp).map(
        (value) => value * size * (k === 0 ? 1 : sign),
      ),
    );
    mesh.matrix.set(
      columns[0][0], columns[0][1], columns[0][2], 0,
      columns[1][0], columns[1][1], columns[1][2], 0,
      columns[2][0], columns[2][1], columns[2][2], 0,
      at[0], at[1], at[2], 1,
    ); // biome-ignore format: a matrix
    mesh.worldMatrixNeedsUpdate = true;
  }

  #drawnBox({ low, high }: Box): Box {
    const a = drawn(...low, this.#shown.zUp);
    const b = drawn(...high, this.#shown.zUp);
    return {
      low: a.map((value, k) => Math.min(value, b[k])) as Vector,
      high: a.map((value, k) => Math.max(value, b[k])) as Vector,
    };
  }

  #placed(x: number, y: number, z: number): Vector {
    const at = drawn(x, y, z, this.#shown.zUp);
    return at.map((value, k) => (value - this.#middle[k]) * this.#scale) as Vector;
  }

  #crosses(points: readonly number[]): number[] {
    const lines: number[] = [];
    for (let i = 0; i < points.length; i += 3) {
      const at = this.#placed(points[i], points[i + 1], points[i + 2]);
      for (const axis of [0, 1, 2]) {
        for (const reach of [-CROSS, CROSS]) {
          lines.push(...at.map((value, k) => (k === axis ? value + reach : value)));
        }
      }
    }
    return lines;
  }

  #placedAll(points: Float64Array): Float32Array {
    const placed = new Float32Array(points.length);
    for (let i = 0; i < points.length; i += 3) {
      placed.set(this.#placed(points[i], points[i + 1], points[i + 2]), i);
    }
    return placed;
  }

  /** Draws once before the next frame, even if it is called several times. */
  draw(): void {
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.#drawNow();
    });
  }

  /** Puts a picture of a size [px] into the scene: on paper a canvas with WebGL is empty. */
  print(width: number, height: number): void {
    const size = `width: ${width}px; height: ${height}px`;
    this.#host.style.cssText = `flex: none; min-height: 0; max-height: none; ${size}`;
    this.#resize();
    this.#drawNow();
    const { canvas } = this.#renderer.gl;
    const { width: columns, height: rows } = canvas;
    this.#picture = Object.assign(make("canvas", "picture"), { width: columns, height: rows });
    this.#picture.getContext("2d")?.drawImage(canvas, 0, 0);
    this.#labels.before(this.#picture);
  }

  /** Takes the picture away again. */
  fit(): void {
    this.#picture?.remove();
    this.#host.style.cssText = "";
    this.#resize();
  }

  #drawNow(): void {
    const { clientWidth: width, clientHeight: height } = this.#host;
    if (this.#lost || !width || !height) return;
    const { low, high } = this.#box;
    const unit: Box = {
      low: low.map((value, k) => (value - this.#middle[k]) * this.#scale) as Vector,
      high: high.map((value, k) => (value - this.#middle[k]) * this.#scale) as Vector,
    };
    const { view, zoom } = this.#turning;
    const [right, up, back] = eyeAxes(view);
    const aspect = width / height;
    const share = Math.max(0.5, 1 - (2 * MARGIN) / height);
    const distance = distanceFor(unit, view, HALF, aspect) / share / zoom;
    this.#camera.position.set(back[0] * distance, back[1] * distance, back[2] * distance);
    this.#camera.lookAt([0, 0, 0]);
    const onScreen = (place: Vector): [number, number] => {
      const at = place.map((value, k) => (value - this.#middle[k]) * this.#scale);
      const along = (axis: Vector) => at[0] * axis[0] + at[1] * axis[1] + at[2] * axis[2];
      const reach = (distance - along(back)) * Math.tan(HALF);
      return [
        (0.5 + (0.5 * along(right)) / (reach * aspect)) * width,
        (0.5 - (0.5 * along(up)) / reach) * height,
      ];
    };
    const pixel = (2 * distance * Math.tan(HALF)) / height / this.#scale;
    const { lines, labels } = grid(this.#box, axesOf(this.#shown.zUp), back, pixel, (a, b) =>
      onScreen(a)[0] <= onScreen(b)[0] ? a : b,
    );
    this.#grid.place(lines.map((value, i) => (value - this.#middle[i % 3]) * this.#scale));
    this.#write(labels, onScreen);
    this.#renderer.render({ scene: this.#root, camera: this.#camera });
  }

  #write(labels: readonly Label[], onScreen: (place: Vector) => [number, number]): void {
    const spans = this.#labels.children as HTMLCollectionOf<HTMLElement>;
    const before: [number, number][][] = [[], [], []];
    let used = 0;
    const width = this.#host.clientWidth;
    for (const { at, text, axis, isTitle } of labels) {
      const [left, y] = onScreen(at);
      const x = isTitle ? Math.min(width - HALF_TITLE, Math.max(HALF_TITLE, left)) : left;
      const crowded = before[axis].some(([a, b]) => Math.hypot(a - x, b - y) < CROWDED);
      if (crowded && !isTitle) continue;
      before[axis].push([x, y]);
      if (!spans[used]) this.#labels.append(document.createElement("span"));
      const span = spans[used++];
      if (span.textContent !== text) span.textContent = text;
      span.className = `${isTitle ? "title" : "number"} axis-${axis}`;
      span.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
    while (spans.length > used) spans[used].remove();
  }
}

/** Returns the points of a path that are drawn: three numbers each. */
function sampled({ rows, at }: Rows): Float64Array {
  const points = new Float64Array(3 * POINTS);
  for (let i = 0; i < POINTS; i++) {
    points.set(at(Math.round((i * (rows - 1)) / (POINTS - 1))), 3 * i);
  }
  return points;
}
