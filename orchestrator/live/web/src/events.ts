// What happens to a run from outside: at a time, or when a signal crosses a value.
//
// An event acts between two steps, at the first t_k that its time is not after, or after the first
// step at whose end its condition has become true. Several events may act on one signal or
// parameter: the latest counts, and when it ends, the one before it counts again.
import { type Experiment, isDuration, isTime, Refusal } from "./experiment";
import { ComponentFailed, type Instance } from "./fmi";
import type { Overrides, Row } from "./row";
import type { Condition, EventData, Occurrence, Value } from "./types";

/** After more steps than any run has. */
export const NEVER = Number.POSITIVE_INFINITY;

/** How often the same event is listed: a condition may chatter for ever. */
const MOST_LISTED = 1000;

/** An FMU may keep a value in another unit, and round it by such a share. */
const ROUNDING = 1e-9;

/** The run ends here, and well. */
export class Ended extends Error {}

/** What events act on. */
export interface Run {
  readonly experiment: Experiment;
  readonly instances: ReadonlyMap<string, Instance>;
  readonly row: Row;
  readonly overrides: Overrides;
  /** Values that were set in each component before the run. */
  readonly values: ReadonlyMap<string, ReadonlyMap<string, Value>>;
  /** How many steps have been made. */
  made: number;
}

type Effect = "override" | "bias" | "release" | "supply" | "tune";

/** What an event does at one place; no event has the number of the ground. */
interface Layer {
  readonly event: number;
  readonly effect: Effect;
  readonly value: Value;
}

const GROUND = -1;

const COMPARISONS: Readonly<Record<Condition["comparison"], (a: number, b: number) => boolean>> = {
  "<=": (a, b) => a <= b,
  ">=": (a, b) => a >= b,
  "<": (a, b) => a < b,
  ">": (a, b) => a > b,
};

/** The component and the port of a name: either may have dots, the longest component counts. */
export function parted(
  name: string,
  components: { has(component: string): boolean },
): [string, string] {
  let dot = name.lastIndexOf(".");
  while (dot > 0 && !components.has(name.slice(0, dot))) dot = name.lastIndexOf(".", dot - 1);
  return [name.slice(0, dot), name.slice(dot + 1)];
}

function instanceOf(run: Run, name: string): Instance {
  const found = run.instances.get(name);
  if (found === undefined) throw new Error(`there is no component ${name}`);
  return found;
}

function same(wanted: Value, held: Value): boolean {
  if (typeof wanted !== "number" || typeof held !== "number") return wanted === held;
  const largest = Math.max(Math.abs(wanted), Math.abs(held));
  return wanted === held || Math.abs(wanted - held) <= ROUNDING * largest;
}

function tune(run: Run, target: string, value: Value): void {
  const [component, port] = parted(target, run.instances);
  const instance = instanceOf(run, component);
  instance.set(new Map([[port, value]]));
  const held = instance.read(port);
  if (!same(value, held)) {
    throw new ComponentFailed(`${target} was set to ${value}, but the FMU holds ${held}`);
  }
}

function doEffect(run: Run, effect: Effect, target: string, value: Value): void {
  if (effect === "tune") tune(run, target, value);
  else run.overrides[effect](target, value);
}

function ground(run: Run, target: string, effect: Effect): Layer {
  const [component, port] = parted(target, run.instances);
  if (effect === "tune") {
    return { event: GROUND, effect, value: instanceOf(run, component).read(port) };
  }
  if (effect === "supply") return { event: GROUND, effect, value: run.overrides.supplied(target) };
  return { event: GROUND, effect: "release", value: 0 };
}

/** What events do at all places, one upon the other. */
class Layers {
  /** Kinds that give an input or a parameter its value are apart from those that alter it. */
  private readonly setting = new Map<string, Layer[]>();
  private readonly altering = new Map<string, Layer[]>();

  /** Lay something upon whatever acts at a place. */
  put(run: Run, target: string, layer: Layer): void {
    const sets = layer.effect === "supply" || layer.effect === "tune";
    const at = sets ? this.setting : this.altering;
    const layers = at.get(target) ?? [ground(run, target, layer.effect)];
    at.set(target, [...layers.filter(({ event }) => event !== layer.event), layer]);
    doEffect(run, layer.effect, target, layer.value);
  }

  /** Undo what an event does. */
  take(run: Run, event: number): void {
    for (const at of [this.setting, this.altering]) {
      for (const [target, layers] of at) {
        const left = layers.filter((layer) => layer.event !== event);
        if (layers[layers.length - 1].event === event) {
          const { effect, value } = left[left.length - 1];
          doEffect(run, effect, target, value);
        }
        at.set(target, left);
      }
    }
  }

  /** Take away all that alters a signal. */
  release(run: Run, target: string): void {
    if (this.altering.delete(target)) run.overrides.release(target);
  }

  /** Values that events have given to parameters of a component, by the names of its ports. */
  tuned(run: Run, component: string): Map<string, Value> {
    const found = new Map<string, Value>();
    for (const [target, layers] of this.setting) {
      const [owner, port] = parted(target, run.instances);
      const { effect, value } = layers[layers.length - 1];
      if (owner === component && effect === "tune") found.set(port, value);
    }
    return found;
  }
}

/** How far an event has come. */
interface Progress {
  happened: boolean;
  /** Whether its condition was true when it was last looked at. */
  wasTrue: boolean;
  /** After how many steps it ends. */
  end: number;
  /** How often it has been listed. */
  listed: number;
}

/** Has events happen. */
export class Events {
  readonly happened: Occurrence[] = [];
  private readonly layers = new Layers();
  private readonly progress: Progress[];

  /** Take events, in the order in which they act at the same time. */
  constructor(private readonly events: readonly EventData[]) {
    for (const { at = 0, lasts = 1, label } of events) {
      if (!isTime(at)) throw new Refusal(`${label}: its time must be a number, 0 or more`);
      if (!isDuration(lasts)) throw new Refusal(`${label}: it must last for more than 0 s`);
    }
    this.progress = events.map(() => ({ happened: false, wasTrue: true, end: NEVER, listed: 0 }));
  }

  /** End what ends now, then begin what begins now; after how many steps to act again. */
  act(run: Run): number {
    // No step follows.
    if (run.made >= run.experiment.steps) return NEVER;
    const numbers = [...this.events.keys()];
    for (const number of numbers) if (this.progress[number].end <= run.made) this.end(run, number);
    for (const number of numbers) if (this.begins(run, number)) this.begin(run, number);
    return Math.min(NEVER, ...numbers.map((number) => this.next(run, number)));
  }

  private begins(run: Run, number: number): boolean {
    const { when } = this.events[number];
    const progress = this.progress[number];
    if (!this.waits(number)) return false;
    if (when === undefined) return this.due(run, number) <= run.made;
    const { wasTrue } = progress;
    progress.wasTrue = COMPARISONS[when.comparison](run.row.value(when.signal), when.value);
    return progress.wasTrue && !wasTrue;
  }

  private waits(number: number): boolean {
    return (this.events[number].repeat ?? false) || !this.progress[number].happened;
  }

  private begin(run: Run, number: number): void {
    const { text, label, lasts } = this.events[number];
    const progress = this.progress[number];
    progress.happened = true;
    this.say(run, number, text, label);
    this.do(run, number);
    if (lasts !== undefined) {
      const time = run.experiment.time(run.made) + lasts;
      progress.end = Math.max(run.experiment.reaching(time), run.made + 1);
    }
  }

  private do(run: Run, event: number): void {
    const { action } = this.events[event];
    const { layers } = this;
    switch (action.kind) {
      case "alter":
        for (const [target, value] of action.values) {
          layers.put(run, target, { event, effect: action.effect, value });
        }
        break;
      case "freeze":
        for (const target of action.targets) {
          layers.put(run, target, { event, effect: "override", value: run.row.value(target) });
        }
        break;
      case "release":
        for (const target of action.targets) layers.release(run, target);
        break;
      case "set":
        for (const [target, value] of action.parameters) {
          layers.put(run, target, { event, effect: "tune", value });
        }
        for (const [target, value] of action.inputs) {
          layers.put(run, target, { event, effect: "supply", value });
        }
        break;
      case "reset":
        for (const name of action.components) this.reset(run, name);
        break;
      case "stop":
        throw new Ended(action.why);
    }
  }

  /** Start a component over, with its current parameters. */
  private reset(run: Run, name: string): void {
    const instance = instanceOf(run, name);
    const values = new Map([...(run.values.get(name) ?? []), ...this.layers.tuned(run, name)]);
    instance.reset();
    instance.enterInitialization(values, run.experiment.time(run.made));
    run.overrides.refresh(name);
    instance.exchange();
    instance.exitInitialization();
    instance.exchange();
  }

  private end(run: Run, number: number): void {
    this.progress[number].end = NEVER;
    this.layers.take(run, number);
    this.say(run, number, `${this.events[number].text}, ended`);
  }

  private say(run: Run, event: number, text: string, label = ""): void {
    const progress = this.progress[event];
    progress.listed += 1;
    if (progress.listed > MOST_LISTED) return;
    const rest = progress.listed === MOST_LISTED ? "; later occurrences are not listed" : "";
    this.happened.push({ time: run.experiment.time(run.made), text: text + rest, label, event });
  }

  /** After how many steps an event needs action. */
  private next(run: Run, number: number): number {
    const begin = this.waits(number) ? this.due(run, number) : NEVER;
    return Math.min(begin, this.progress[number].end);
  }

  /** After how many steps to look at an event. */
  private due(run: Run, number: number): number {
    const { at } = this.events[number];
    return at === undefined ? run.made + 1 : run.experiment.reaching(at);
  }
}
