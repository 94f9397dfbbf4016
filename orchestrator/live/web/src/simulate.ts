// A run of a loop: its times, events and parameters for the program, and its rows.

import { type Agenda, Module, type Reducer, type Refused } from "./program";
import { namedFor } from "./settings";
import { general } from "./text";
import type {
  Action,
  Data,
  EventData,
  LoopData,
  Metrics,
  Occurrence,
  Options,
  Outcome,
  Parameter,
  Result,
  Run,
  Value,
  Values,
} from "./types";

/** A refused value or time, with the reason. */
export class Refusal extends Error {}

/** Shares of the run, and of a step, below which a remainder is a rounding error. */
const ROUNDING = 1e-9;
const MOST_OF_A_STEP = 1e-3;

/** Tells whether an event can happen at a time [s]: not before the start. */
export function isTime(time: number): boolean {
  return time >= 0 && time < Infinity;
}

/** Tells whether a duration is valid [s]. */
export function isDuration(time: number): boolean {
  return time > 0 && time < Infinity;
}

/** Rounds a number of steps if it is an integer apart from rounding errors. */
function rounded(n: number): number {
  const nearest = Math.round(n);
  return Math.abs(n - nearest) <= Math.min(ROUNDING * nearest, MOST_OF_A_STEP) ? nearest : n;
}

export class Experiment {
  /** Number of steps of full length. */
  readonly fullSteps: number;
  /** Number of all steps; the last is shorter if the run is not a multiple of the step. */
  readonly steps: number;

  /** Times are in seconds; more than `mostSteps` steps are refused. */
  constructor(
    readonly stopTime: number,
    readonly step: number,
    mostSteps: number,
  ) {
    for (const [name, time] of [
      ["step", step],
      ["stop time", stopTime],
    ] as const) {
      if (Number.isNaN(time)) throw new Refusal(`${name}: not a number`);
      if (!isDuration(time)) throw new Refusal(`${name} ${time} s must be positive, and finite`);
    }
    const inSteps = rounded(Math.max(stopTime / step, Number.MIN_VALUE));
    if (inSteps > mostSteps) {
      throw new Refusal(
        `${stopTime} s in steps of ${step} s are more than ${mostSteps} steps, too many for a page`,
      );
    }
    this.fullSteps = Math.floor(inSteps);
    this.steps = Math.ceil(inSteps);
  }

  /** Returns the time after k steps. */
  time(k: number): number {
    return k <= this.fullSteps ? k * this.step : this.stopTime;
  }
}

/** Most entries of the same event in the list: a condition may chatter. */
const MOST_LISTED = 1000;

/** Numbers of an event, of an action, and of an entry in the list of occurrences. */
const [EVENT, ACTION, LISTED] = [13, 4, 3];

/** Kinds of actions, and comparisons, in the order of their numbers in events.c. */
const KINDS = ["override", "bias", "freeze", "release", "set", "reset", "stop"];
const COMPARISONS = ["<", "<=", ">", ">="];

/** Numbers of the columns, inputs, parameters and components of a loop, by name. */
interface Places {
  readonly columns: ReadonlyMap<string, number>;
  readonly inputs: ReadonlyMap<string, number>;
  readonly parameters: ReadonlyMap<string, number>;
  readonly components: ReadonlyMap<string, number>;
}

/** Splits a name into component and port, which may have dots: the longest component counts. */
export function parted(
  name: string,
  components: { has(component: string): boolean },
): [string, string] {
  let dot = name.lastIndexOf(".");
  while (dot > 0 && !components.has(name.slice(0, dot))) dot = name.lastIndexOf(".", dot - 1);
  return [name.slice(0, dot), name.slice(dot + 1)];
}

function placeOf(places: ReadonlyMap<string, number>, name: string): number {
  const found = places.get(name);
  if (found === undefined) throw new Error(`there is no ${name}`);
  return found;
}

/** Returns kind, place and value of each part of an action. */
function actionsOf(action: Action, { inputs, parameters, components }: Places): number[][] {
  const { kind } = action;
  const known = (name: string) => KINDS.indexOf(name);
  switch (kind) {
    case "alter":
      return action.values.map(([target, value]) => [
        known(action.effect),
        placeOf(inputs, target),
        Number(value),
      ]);
    case "freeze":
    case "release":
      return action.targets.map((target) => [known(kind), placeOf(inputs, target), 0]);
    case "set":
      return [...action.parameters, ...action.inputs].map(([target, value]) => [
        known(kind),
        placeOf(parameters, target),
        Number(value),
      ]);
    case "reset":
      return action.components.map((name) => [known(kind), placeOf(components, name), 0]);
    case "stop":
      return [[known(kind), 0, 0]];
  }
}

/** Returns events as numbers, in the order in which they act at the same time. */
function agendaOf(events: readonly EventData[], places: Places): Agenda {
  const rows = new Float64Array(events.length * EVENT);
  const actions: number[] = [];
  events.forEach(({ at, when, repeat, lasts, label, action }, i) => {
    if (!isTime(at ?? 0)) throw new Refusal(`${label}: its time must be a number, 0 or more`);
    if (!isDuration(lasts ?? 1)) throw new Refusal(`${label}: it must last for more than 0 s`);
    const first = actions.length / ACTION;
    for (const one of actionsOf(action, places)) actions.push(...one, 0);
    const condition = when
      ? [placeOf(places.columns, when.signal), COMPARISONS.indexOf(when.comparison), when.value]
      : [0, 0, 0];
    const timed = [Number(at !== undefined), at ?? 0];
    const last = actions.length / ACTION;
    rows.set([...timed, ...condition, Number(repeat ?? false), lasts ?? 0, first, last], i * EVENT);
  });
  const listed = 1 + events.length * MOST_LISTED * LISTED;
  return { n: events.length, events: rows, actions: Float64Array.from(actions), listed };
}

/** Returns what has happened, in words. */
export function occurrences(
  events: readonly EventData[],
  happened: Float64Array,
  experiment: Experiment,
): Occurrence[] {
  const listed = events.map(() => 0);
  return Array.from({ length: happened[0] }, (_, k) => {
    const [event, step, ends] = happened.subarray(1 + k * LISTED);
    listed[event] += 1;
    const rest = listed[event] === MOST_LISTED ? "; later occurrences are not listed" : "";
    const { text, label } = events[event];
    return {
      time: experiment.time(step),
      text: (ends ? `${text}, ended` : text) + rest,
      label: ends ? "" : label,
      event,
    };
  });
}

/** Returns why an event has ended a run. */
function whyEnded(events: readonly EventData[], happened: readonly Occurrence[]): string {
  const { action } = events[happened[happened.length - 1].event];
  return action.kind === "stop" ? action.why : "";
}

/** A field in the text of a rule: a name, and the digits of its value. */
const FIELD = /\{([\w.]+)(?::\.?(\d*)g)?\}/g;

/** Runs loops, here or in a worker; throws `Refusal` if a value or a time is not usable. */
export interface Runner {
  run(loop: LoopData, values: Values, options: Options): Result | Promise<Result>;
}

/** Runs loops by programs in modules. */
export class Engine implements Runner {
  private constructor(
    private readonly modules: readonly Module[],
    private readonly data: Data,
  ) {}

  /** Makes an engine from the compiled modules and the page's data. */
  static async load(modules: readonly BufferSource[], data: Data): Promise<Engine> {
    return new Engine(await Promise.all(modules.map((bytes) => Module.load(bytes))), data);
  }

  /** Runs a loop with its own values except for `values`; unknown names are ignored. */
  run(loop: LoopData, values: Values, options: Options): Result {
    return resultOf(loop, this.outcome(loop, values, options));
  }

  /** Runs a loop, and returns plain data. */
  outcome(
    loop: LoopData,
    values: Values,
    { stopTime, step, events = [], spare }: Options,
  ): Outcome {
    const mostSteps = Math.floor(this.data.mostSteps / loop.vehicles.length);
    const experiment = new Experiment(stopTime, step, mostSteps);
    if (loop.fixedStep !== undefined && step !== loop.fixedStep)
      throw new Refusal(
        `step ${step} s: a component takes longer steps, which are multiples of ${loop.fixedStep} s`,
      );
    const layout = layoutOf(loop);
    const parameters: Record<string, Value> = {};
    const numbers = loop.parameters.map((parameter) => {
      const value = values[parameter.name] ?? parameter.value;
      parameters[parameter.name] = value;
      return numberOf(parameter, value, layout);
    });
    const [module, number] = loop.program;
    const found = this.modules[module].run(
      number,
      Float64Array.from(numbers),
      experiment,
      1 + layout.names.length,
      layout.components.size,
      agendaOf(events, layout),
      loop.measured.map((place) => this.reducers(place, layout, numbers, loop.actingRow)),
    );
    const refusal = found.outcome === "refused" ? whyRefused(found.refused, loop) : "";
    if (refusal && found.rows === 0) throw new Refusal(refusal);
    const happened = occurrences(events, found.happened, experiment);
    const reducers = loop.measured.flatMap((place) => this.data.measured[place]);
    const indices = new Set(reducers.flatMap(({ isIndex, gives }) => (isIndex ? gives : [])));
    const last = `t = ${general(experiment.time(found.refused.made), 12)} s`;
    return {
      rows: found.rows,
      table: byColumns(found.table, found.rows, spare),
      parameters,
      happened,
      metrics: found.metrics.map((all) =>
        Object.fromEntries(Object.entries(all).filter(([name]) => indices.has(name))),
      ),
      messages: messages(loop, found.restarts),
      cautions: this.cautions(loop, found.metrics, parameters),
      ...(refusal && { failure: `stopped at ${last}: ${refusal}` }),
      ...(found.outcome === "ended" && {
        remark: `ended at ${last}: ${whyEnded(events, happened)}`,
      }),
    };
  }

  /** Returns the warnings of all rules, each once. */
  private cautions(loop: LoopData, found: readonly Metrics[], parameters: Values): string[] {
    const texts = this.data.rules.flatMap(({ number, above, text }) =>
      loop.vehicles.flatMap((vehicle, place) => {
        const numbers = found[place];
        if (!(numbers[number]?.[0] > above)) return [];
        const filled = text.replace(FIELD, (_, name: string, digits?: string) => {
          const own = namedFor(vehicle, name);
          if (digits === undefined) return own;
          return general(Number(numbers[name]?.[0] ?? parameters[own]), Number(digits) || 6);
        });
        return [filled];
      }),
    );
    return [...new Set(texts)];
  }

  /** Returns the reducers of a vehicle's indices. */
  private reducers(
    place: number,
    { columns, parameters }: Layout,
    values: readonly number[],
    actingRow: number,
  ): Reducer[] {
    return this.data.measured[place].map(({ name, takes, gives }) => ({
      name,
      // A row begins with the time; constants have -1.
      from: takes.map((one) => 1 + (columns.get(`${one}`) ?? -2)),
      constants: takes.map((one) => values[parameters.get(`${one}`) ?? -1] ?? Number(one)),
      actingRow,
      gives,
    }));
  }
}

/** Names of a loop, and their numbers. */
interface Layout extends Places {
  /** Names of the columns. */
  readonly names: readonly string[];
  /** Outputs that programs lack, as they are 0 in every row, by the number of columns before. */
  readonly faults: ReadonlyMap<number, string>;
}

const layouts = new WeakMap<LoopData, Layout>();

function layoutOf(loop: LoopData): Layout {
  const known = layouts.get(loop) ?? laidOut(loop);
  layouts.set(loop, known);
  return known;
}

function laidOut({ ports, parameters }: LoopData): Layout {
  const names: string[] = [];
  const inputs: string[] = [];
  const faults = new Map<number, string>();
  for (const [component, { input, output }] of Object.entries(ports)) {
    const named = (port: string) => `${component}.${port}`;
    inputs.push(...input.map(named));
    names.push(...input.map(named), ...output.map(named));
    faults.set(names.length, named("fault"));
  }
  const numbered = (all: readonly string[]) => new Map(all.map((name, i) => [name, i]));
  return {
    names,
    faults,
    columns: numbered(names),
    inputs: numbered(inputs),
    parameters: numbered(parameters.map(({ name }) => name)),
    components: numbered(Object.keys(ports)),
  };
}

/** Checks a value of a parameter, and returns it as a number. */
function numberOf({ name, type, choices, min, max }: Parameter, value: Value, layout: Layout) {
  const wanted = { Real: "number", Integer: "number", Boolean: "boolean", Enumeration: "string" }[
    type
  ];
  if (choices && !Object.hasOwn(choices, `${value}`))
    throw new Refusal(`${name} = ${value}: not one of ${Object.keys(choices).join(", ")}`);
  if (Number.isNaN(value)) throw new Refusal(`${name}: not a number`);
  // Integers have 32 bits: a larger one would change silently.
  const fits = typeof value === wanted && (type !== "Integer" || (Number(value) | 0) === value);
  if (!fits) throw new Refusal(`${name} = ${value}: not a value of type ${type}`);
  const number = choices ? choices[`${value}`] : Number(value);
  const [component, port] = parted(name, layout.components);
  const said = `${component}: ${port} = ${general(number)}`;
  if (!Number.isFinite(number)) throw new Refusal(`${said}: must be finite`);
  if (min !== undefined && number < min)
    throw new Refusal(`${said}: must be at least ${general(min)}`);
  if (max !== undefined && number > max)
    throw new Refusal(`${said}: must be at most ${general(max)}`);
  return number;
}

/** Describes a refusal. */
function whyRefused({ component, call, port }: Refused, { ports, parameters }: LoopData) {
  const [name, { input }] = Object.entries(ports)[component];
  switch (call) {
    case "start":
      return `${name} cannot start with its parameters`;
    case "input":
      return `${name} refused ${port < 0 ? "its inputs" : input[port]}`;
    case "outputs":
      return `${name} refused its outputs`;
    case "step":
      return `${name} refused its step`;
    case "set":
      return `${name} refused ${parameters[port].name}`;
  }
}

/** Returns the messages of components whose states were reset. */
function messages({ restarted }: LoopData, restarts: Float64Array): string[] {
  return Object.entries(restarted).flatMap(([name, text], i) =>
    restarts[i] < 0 ? [] : [`${name}: ${text.replace("{}", general(restarts[i]))}`],
  );
}

/** Number of rows that are sorted into columns together, which fit into a cache. */
const BLOCK = 32;

/** Sorts rows into columns, one after the other, if possible in memory that is no longer used. */
function byColumns(
  table: Float64Array,
  rows: number,
  spare?: ArrayBuffer,
): Float64Array<ArrayBuffer> {
  // Writing to fresh memory takes longer than all steps.
  const isFit = spare?.byteLength === table.byteLength;
  const columns = isFit ? new Float64Array(spare) : new Float64Array(table.length);
  const width = rows && table.length / rows;
  for (let first = 0; first < rows; first += BLOCK) {
    const last = Math.min(rows, first + BLOCK);
    for (let i = 0; i < width; i++) {
      for (let k = first; k < last; k++) columns[i * rows + k] = table[k * width + i];
    }
  }
  return columns;
}

/** Returns access by name to columns of a table that follow each other, the time first. */
export function columnsOf(
  names: readonly string[],
  placeOf: (name: string) => number | undefined,
  columns: (place: number) => Float64Array,
): Pick<Run, "columns" | "time" | "column" | "has"> {
  return {
    columns: names,
    time: columns(0),
    has: (name) => placeOf(name) !== undefined,
    column(name) {
      const place = placeOf(name);
      if (place === undefined) throw new Error(`there is no column ${name}`);
      return columns(1 + place);
    },
  };
}

/** Returns what a run of a loop has left, with access to its columns. */
export function resultOf(loop: LoopData, outcome: Outcome): Result {
  const { names, faults, columns } = layoutOf(loop);
  const { rows, table } = outcome;
  return {
    ...outcome,
    ...columnsOf(
      names,
      (name) => columns.get(name),
      (place) => table.subarray(place * rows, (place + 1) * rows),
    ),
    actingRow: loop.actingRow,
    faults,
  };
}
