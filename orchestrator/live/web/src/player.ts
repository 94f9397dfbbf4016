// The player: the current time of the scene and of all charts.

import type { Mark } from "./charts";
import { general } from "./text";

/** Elements of the bar below the scene. */
interface Bar {
  toggle: HTMLButtonElement;
  slider: HTMLInputElement;
  output: HTMLOutputElement;
  speed: HTMLSelectElement;
  marks: HTMLElement;
}

/** Seconds in which a run is played, if one of the speeds allows it. */
const PATIENCE = 25;

/** Least number of positions of the slider, which also has at least ten per second. */
const POSITIONS = 100;

export class Player {
  readonly #bar: Bar;
  readonly #show: (time: number) => void;
  #start = 0;
  #end = 0;
  #time = 0;
  #started: { time: number; now: number } | undefined;
  #frame = 0;

  constructor(bar: Bar, show: (time: number) => void) {
    this.#bar = bar;
    this.#show = show;
    bar.toggle.addEventListener("click", () => this.toggle());
    bar.slider.addEventListener("input", () => this.seek(bar.slider.valueAsNumber / this.#fine));
    bar.speed.addEventListener("change", () => this.#restart());
    document.addEventListener("keydown", (event) => {
      const { target } = event;
      if (event.key !== " " || !(target instanceof Element)) return;
      if (target.closest("input:not([type=range]), button, select, summary, textarea, a")) return;
      event.preventDefault();
      if (!event.repeat) this.toggle();
    });
  }

  /** Positions of the slider per second, a power of ten. */
  get #fine(): number {
    return 10 ** Math.max(1, Math.ceil(Math.log10(POSITIONS / (this.#end - this.#start || 1))));
  }

  get isAtStart(): boolean {
    return this.#time <= this.#start;
  }

  get isPlaying(): boolean {
    return this.#started !== undefined;
  }

  /** Sets the start and end of a run [s], and its events. */
  set(start: number, end: number, marks: readonly Mark[]): void {
    const isOther = start !== this.#start || end !== this.#end;
    const length = end - start;
    // A player that rests at the end of a run rests at the end of the next.
    const isAtEnd = this.#time >= this.#end && !this.isPlaying;
    this.#start = start;
    this.#end = end;
    this.#bar.slider.min = String(Math.round(start * this.#fine));
    this.#bar.slider.max = String(Math.round(end * this.#fine));
    this.#bar.marks.replaceChildren(
      ...marks.map(({ from, until, label }) => {
        const mark = document.createElement("span");
        mark.style.left = `${(100 * (from - start)) / length}%`;
        mark.style.width = `${(100 * (Math.min(until, end) - from)) / length}%`;
        mark.title = `${label}, at ${general(from)} s`;
        return mark;
      }),
    );
    if (isOther) {
      const speeds = [...this.#bar.speed.options].map(({ value }) => Number(value));
      const speed = speeds.find((s) => length / s <= PATIENCE) ?? speeds.at(-1);
      this.#bar.speed.value = String(speed);
    }
    if (isAtEnd || this.#time > end) this.#time = end;
    this.#time = Math.max(start, this.#time);
    this.#restart();
    this.#update();
  }

  /** Moves to a time, and keeps playing from there. */
  seek(time: number): void {
    this.#time = Math.min(this.#end, Math.max(this.#start, time));
    this.#restart();
    this.#update();
  }

  toggle(): void {
    cancelAnimationFrame(this.#frame);
    if (this.#started) {
      this.#started = undefined;
    } else {
      if (this.#time >= this.#end) this.#time = this.#start;
      this.#started = { time: this.#time, now: performance.now() };
      this.#frame = requestAnimationFrame((now) => this.#tick(now));
    }
    this.#bar.toggle.dataset.playing = String(this.isPlaying);
    this.#bar.toggle.setAttribute("aria-label", this.isPlaying ? "Pause" : "Play");
  }

  #restart(): void {
    if (this.#started) this.#started = { time: this.#time, now: performance.now() };
  }

  #tick(now: number): void {
    if (!this.#started) return;
    const passed = Math.max(0, now - this.#started.now) / 1000;
    this.#time = Math.min(this.#end, this.#started.time + Number(this.#bar.speed.value) * passed);
    this.#update();
    if (this.#time >= this.#end) this.toggle();
    else this.#frame = requestAnimationFrame((next) => this.#tick(next));
  }

  #update(): void {
    const fine = this.#fine;
    const time = this.#time.toFixed(Math.log10(fine));
    this.#bar.slider.value = String(Math.round(this.#time * fine));
    this.#bar.slider.setAttribute("aria-valuetext", `${time} seconds`);
    this.#bar.output.textContent = `${time} s`;
    this.#show(this.#time);
  }
}
