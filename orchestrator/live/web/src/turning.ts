// Rotation and zoom of the scene by pointer, touch and keys.

import type { View } from "./space";

const START: View = { azimuth: -0.72, elevation: 0.36 };

/** Rotation per pixel, and per press of an arrow key [rad]. */
const DRAG = 0.009;
const KEY = 0.12;

const NEAREST = 6;
const FARTHEST = 0.5;

export class Turning {
  view: View = { ...START };
  zoom = 1;
  readonly #changed: () => void;
  readonly #pointers = new Map<number, PointerEvent>();

  constructor(canvas: HTMLCanvasElement, changed: () => void) {
    this.#changed = changed;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#pointers.set(event.pointerId, event);
    });
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const end of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(end, (event) => this.#pointers.delete(event.pointerId));
    }
    canvas.addEventListener("dblclick", () => this.#restart());
    canvas.addEventListener(
      "wheel",
      (event) => {
        // The wheel without a key scrolls the page; browsers report a pinch with ctrlKey.
        if (!event.ctrlKey && !event.metaKey) return;
        event.preventDefault();
        this.#zoomBy(Math.exp(-0.004 * event.deltaY));
      },
      { passive: false },
    );
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  #move(event: PointerEvent): void {
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    const other = [...this.#pointers.values()].find((p) => p.pointerId !== event.pointerId);
    this.#pointers.set(event.pointerId, event);
    if (other) {
      const distance = (p: PointerEvent) =>
        Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
      this.#zoomBy(distance(event) / Math.max(distance(before), 1));
    } else {
      this.#turn(-DRAG * (event.clientX - before.clientX), DRAG * (event.clientY - before.clientY));
    }
  }

  #key(event: KeyboardEvent): void {
    const turns: Record<string, [number, number]> = {
      ArrowLeft: [KEY, 0],
      ArrowRight: [-KEY, 0],
      ArrowUp: [0, KEY],
      ArrowDown: [0, -KEY],
    };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (turns[event.key]) this.#turn(...turns[event.key]);
    else if (event.key === "+" || event.key === "=") this.#zoomBy(1.15);
    else if (event.key === "-") this.#zoomBy(1 / 1.15);
    else if (event.key === "Home") this.#restart();
    else return;
    event.preventDefault();
  }

  #turn(azimuth: number, elevation: number): void {
    this.view.azimuth += azimuth;
    // The eye stays above the floor.
    this.view.elevation = Math.min(1.55, Math.max(0.02, this.view.elevation + elevation));
    this.#changed();
  }

  #zoomBy(factor: number): void {
    this.zoom = Math.min(NEAREST, Math.max(FARTHEST, this.zoom * factor));
    this.#changed();
  }

  #restart(): void {
    this.view = { ...START };
    this.zoom = 1;
    this.#changed();
  }
}
