// The live page: its settings, the runs with these, and their display.

import { commandLine } from "./command";
import { Controls } from "./controls";
import { Display } from "./display";
import { element, make } from "./dom";
import { EventsForm } from "./events_form";
import { buildSwitches } from "./legend";
import { fromHash, suggested, toHash } from "./link";
import {
  eventsOf,
  fleetOf,
  presetOf,
  type Settings,
  untouched,
  withEdit,
  withValues,
} from "./settings";
import { Refusal, type Runner } from "./simulate";
import { csvLines, entered } from "./text";
import type { Data, LoopData, Preset, Result } from "./types";

/** Delay of a new link after the last change [ms], as browsers limit the rate of changes. */
const LINK_AFTER = 300;

/** Duration of a notice [ms]. */
const NOTICE = 4000;

/** Most unknown parts of a link in a notice. */
const NAMED = 5;

/** Waits for the next frame; a hidden page draws none, and continues at once. */
function nextFrame(): Promise<unknown> {
  return document.hidden
    ? Promise.resolve()
    : new Promise((resolve) => requestAnimationFrame(resolve));
}

export class Page {
  /** Kept once the first runs are shown. */
  readonly shown: Promise<void>;
  readonly #data: Data;
  readonly #engine: Runner;
  readonly #display: Display;
  readonly #controls: Controls;
  readonly #events: EventsForm;
  #settings: Settings;
  #preset: Preset;
  /** Preset of the present controls and charts. */
  #built: Preset | undefined;
  /** Vehicle of the present sliders. */
  #vehicle = "";
  /** Loops of the preset, in the order of their colours. */
  #loops: readonly LoopData[] = [];
  /** Last successful runs, in the order of the loops. */
  #results: (Result | undefined)[] = [];
  /** Tables of results that are no longer shown. */
  #spare: ArrayBuffer[] = [];
  /** Why the settings are refused; empty: they were run. */
  #refusal = "";
  /** True if the settings have changed since the last run began. */
  #isAsked = false;
  #running: Promise<void> | undefined;
  #link: ReturnType<typeof setTimeout> | undefined;
  #notice: ReturnType<typeof setTimeout> | undefined;

  constructor(data: Data, engine: Runner) {
    this.#data = data;
    this.#engine = engine;
    const { settings, unknown, time } = fromHash(location.hash, data);
    this.#settings = settings;
    this.#preset = presetOf(data, settings.preset) ?? data.presets[0];
    this.#display = new Display(data);
    this.#controls = new Controls(element("groups"), element("all"), element("search"), (values) =>
      this.#take(withValues(this.#settings, this.#preset, values)),
    );
    this.#events = new EventsForm(element("events"), element("event-list"), {
      take: (events) => this.#take({ ...this.#settings, events, edits: {} }),
      edit: (number, edit) => this.#take(withEdit(this.#settings, this.#preset, number, edit)),
    });
    this.#wire();
    this.shown = this.#open().then(() => this.#display.start(time));
    this.#sayUnknown(unknown);
  }

  #wire(): void {
    const select = element<HTMLSelectElement>("preset");
    select.append(...this.#data.presets.map(({ name, title }) => new Option(title, name)));
    select.addEventListener("change", () => {
      const preset = presetOf(this.#data, select.value);
      if (preset) this.apply(untouched(preset));
    });
    const vehicle = element<HTMLSelectElement>("vehicle");
    vehicle.addEventListener("change", () =>
      this.apply({ ...this.#settings, vehicle: vehicle.value }),
    );
    element("whole").addEventListener("click", (event) => {
      (event.target as HTMLAnchorElement).href = toHash(this.#settings, this.#data);
    });
    element("copy-link").addEventListener("click", () => {
      this.#writeLink();
      this.#copy(location.href, "Link copied");
    });
    element("copy-command").addEventListener("click", () => this.#copyCommand());
    element("download").addEventListener("click", () => this.#download());
    element("reset-all").addEventListener("click", () => {
      const { hidden, vehicle } = this.#settings;
      this.#take({ ...untouched(this.#preset), hidden, vehicle });
    });
    for (const [id, key] of [
      ["stop-time", "stopTime"],
      ["step", "step"],
    ] as const) {
      const input = element<HTMLInputElement>(id);
      input.addEventListener("change", () => {
        this.#take({ ...this.#settings, [key]: entered(input.value) });
      });
    }
    const slider = element<HTMLInputElement>("stop-slider");
    slider.addEventListener("input", () =>
      this.#take({ ...this.#settings, stopTime: slider.valueAsNumber }),
    );
    addEventListener("hashchange", () => {
      if (location.hash === toHash(this.#settings, this.#data)) return;
      const { settings, unknown, time } = fromHash(location.hash, this.#data);
      this.#settings = settings;
      this.#open().then(() => time !== undefined && this.#display.player.seek(time));
      this.#sayUnknown(unknown);
    });
  }

  /** Replaces all settings, and runs. */
  apply(settings: Settings): Promise<void> {
    this.#settings = settings;
    this.#linkLater();
    return this.#open();
  }

  get settings(): Settings {
    return this.#settings;
  }

  /** Makes the elements for a preset, and runs it. */
  #open(): Promise<void> {
    this.#preset = presetOf(this.#data, this.#settings.preset) ?? this.#data.presets[0];
    this.#loops = this.#preset.drawn.map((place) => this.#preset.loops[place]);
    document.title = this.#preset.title;
    element<HTMLSelectElement>("preset").value = this.#preset.name;
    // Backquotes enclose the names of parameters.
    element("remark").replaceChildren(
      ...this.#preset.remark.split("`").map((text, k) => (k % 2 ? make("code", "", text) : text)),
    );
    buildSwitches(element("loops"), this.#loops, this.#settings.hidden, (hidden) =>
      this.#take({ ...this.#settings, hidden }),
    );
    if (this.#preset !== this.#built) {
      this.#display.build(this.#preset, this.#loops);
      this.#results = [];
    }
    this.#openVehicle();
    this.#built = this.#preset;
    return this.#run();
  }

  /** Makes the controls of the chosen vehicle. */
  #openVehicle(): void {
    const preset = this.#preset;
    const { vehicle } = this.#settings;
    if (preset !== this.#built || vehicle !== this.#vehicle) {
      this.#controls.build(preset, preset.loops[0].vehicles[this.#chosen]);
      this.#display.paint(preset.colours[this.#chosen]);
    }
    this.#vehicle = vehicle;
    element<HTMLSelectElement>("vehicle").value = vehicle;
  }

  /** Number of the chosen vehicle. */
  get #chosen(): number {
    return Math.max(0, fleetOf(this.#preset).indexOf(this.#settings.vehicle));
  }

  #take(settings: Settings): void {
    this.#settings = settings;
    this.#linkLater();
    this.#run();
  }

  /** Runs the settings, and shows the results; settings during a run wait, and the latest count. */
  #run(): Promise<void> {
    this.#isAsked = true;
    this.#running ??= this.#runAll().finally(() => {
      this.#running = undefined;
    });
    return this.#running;
  }

  async #runAll(): Promise<void> {
    while (this.#isAsked) {
      this.#isAsked = false;
      this.#showSettings();
      await this.#runOnce();
      // No more than one run per frame, even if a slider moves several times.
      if (this.#isAsked) await nextFrame();
    }
  }

  async #runOnce(): Promise<void> {
    const preset = this.#preset;
    let results: (Result | undefined)[];
    let refusal = "";
    try {
      results = await this.#runs(this.#settings);
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      refusal = error.message;
      results = this.#results;
      // The last successful runs stay; after a link, there may be none.
      if (results.length === 0) {
        const { hidden, vehicle } = this.#settings;
        results = await this.#runs({ ...untouched(preset), hidden, vehicle });
      }
    }
    if (preset !== this.#preset) return;
    this.#refusal = refusal;
    if (refusal) {
      this.#refuse(refusal);
    } else {
      const failures = this.#each(results, ({ failure }) => (failure ? [failure] : []));
      const said = this.#each(results, ({ remark, cautions, messages }) => [
        ...(remark ? [remark] : []),
        ...cautions,
        ...messages,
      ]);
      this.#refuse(failures.join("; "), said.join("\n"));
    }
    if (results === this.#results) return;
    this.#spare.push(...this.#results.flatMap((one) => one?.table.buffer ?? []));
    this.#results = results;
    this.#draw();
  }

  async #runs(settings: Settings): Promise<(Result | undefined)[]> {
    const { values, stopTime, step, hidden } = settings;
    const spare = this.#spare.splice(0);
    const runs = this.#loops.map((loop) => {
      if (hidden.includes(loop.label)) return undefined;
      const events = eventsOf(settings, loop);
      return this.#engine.run(loop, values, { stopTime, step, events, spare: spare.pop() });
    });
    return Promise.all(runs);
  }

  /** Returns texts about the results, each with the name of its controller. */
  #each(
    results: readonly (Result | undefined)[],
    texts: (result: Result) => readonly string[],
  ): string[] {
    return results.flatMap((result, k) =>
      result ? texts(result).map((text) => `${this.#loops[k].label}: ${text}`) : [],
    );
  }

  /** Shows why the settings cannot be run to the end, and other messages of the runs. */
  #refuse(message: string, messages = ""): void {
    const isSeen = this.#controls.refuse(message);
    for (const [id, text] of [
      ["error", isSeen ? "" : message],
      ["messages", messages],
    ]) {
      const place = element(id);
      place.hidden = text === "";
      // Screen readers repeat a text whenever it is set.
      if (place.textContent !== text) place.textContent = text;
    }
    document.body.classList.toggle("refused", message !== "");
  }

  #showSettings(): void {
    const { stopTime, step } = this.#settings;
    const preset = this.#preset;
    this.#controls.show(this.#settings);
    this.#events.show(this.#settings, preset);
    const fields = [
      [element<HTMLInputElement>("stop-time"), stopTime, preset.stopTime],
      [element<HTMLInputElement>("step"), step, preset.step],
    ] as const;
    for (const [input, value, own] of fields) {
      const isEntered = document.activeElement === input && Number(input.value) === value;
      if (!isEntered && !Number.isNaN(value)) input.value = String(value);
      input.classList.toggle("changed", value !== own);
      input.setAttribute("aria-invalid", String(!(value > 0)));
    }
    const slider = element<HTMLInputElement>("stop-slider");
    slider.value = String(stopTime);
    slider.setAttribute("aria-valuetext", `${stopTime} s`);
    const { hidden, vehicle } = this.#settings;
    const own = toHash({ ...untouched(preset), hidden, vehicle }, this.#data);
    const isTouched = toHash(this.#settings, this.#data) !== own;
    element("reset-all").hidden = !isTouched;
    // The remark has numbers of the preset without changes.
    element("remark-head").hidden = !isTouched;
    element("remark").classList.toggle("outdated", isTouched);
  }

  #draw(): void {
    this.#display.show(this.#preset, this.#loops, this.#results, this.#chosen);
  }

  #linkLater(): void {
    clearTimeout(this.#link);
    this.#link = setTimeout(() => this.#writeLink(), LINK_AFTER);
  }

  #writeLink(): void {
    clearTimeout(this.#link);
    history.replaceState(null, "", toHash(this.#settings, this.#data));
  }

  /** Returns the loop to copy and download: the scenario's own, if it is shown. */
  #exported(): LoopData {
    const { loops } = this.#preset;
    return loops.find(({ label }) => !this.#settings.hidden.includes(label)) ?? loops[0];
  }

  /** Returns the result of the loop to export; if there is none, a notice shows why. */
  async #result(): Promise<Result | undefined> {
    await this.#running;
    const result = this.#results[this.#loops.indexOf(this.#exported())];
    if (this.#refusal) this.#say(`Not run: ${this.#refusal}`);
    else if (!result) this.#say("Show a controller first");
    return this.#refusal ? undefined : result;
  }

  async #copyCommand(): Promise<void> {
    if (!(await this.#result())) return;
    const command = commandLine(this.#settings, this.#preset, this.#exported());
    this.#copy(command, "Command copied");
  }

  async #download(): Promise<void> {
    const result = await this.#result();
    if (!result) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(csvLines(result), { type: "text/csv" }));
    link.download = `${this.#preset.name}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href));
    this.#say(`Saved ${link.download}`);
  }

  async #copy(text: string, done: string): Promise<void> {
    try {
      await navigator.clipboard.writeText(text);
      this.#say(done);
    } catch {
      // Browsers may deny the clipboard to a page from a disk, and still let it copy a selection.
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      this.#say(document.execCommand("copy") ? done : "This browser blocks copying");
      area.remove();
    }
  }

  #sayUnknown(unknown: readonly string[]): void {
    const named = unknown
      .slice(0, NAMED)
      .map((field) => suggested(field, this.#settings, this.#data))
      .join(", ");
    const more = unknown.length > NAMED ? `, and ${unknown.length - NAMED} more` : "";
    this.#say(named && `Not understood in the link: ${named}${more}`);
  }

  #say(text: string): void {
    const notice = element("said");
    notice.textContent = text;
    clearTimeout(this.#notice);
    this.#notice = setTimeout(() => {
      notice.textContent = "";
    }, NOTICE);
  }
}
