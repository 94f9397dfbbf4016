// A run of a loop: its parameters, events and times for its program, and its rows.
import { agendaOf, occurrences, type Places, parted, whyEnded } from "./events";
import { Experiment, Refusal } from "./experiment";
import { Module, REAL, type Reducer, type Refused } from "./program";
import { general } from "./text";
import type {
  Data,
  LoopData,
  Metrics,
  Occurrence,
  Options,
  Parameter,
  Result,
  Value,
  Values,
} from "./types";

/** Runs loops by programs in modules. */
export class Engine {
  private readonly layouts = new WeakMap<LoopData, Layout>();

  private constructor(
    private readonly modules: readonly Module[],
    private readonly data: Data,
  ) {}

  /** Make one of the compiled modules and what Python has written. */
  static async load(modules: readonly BufferSource[], data: Data): Promise<Engine> {
    return new Engine(await Promise.all(modules.map((bytes) => Module.load(bytes))), data);
  }

  /**
   * Runs a loop with its own values except for `values`; names that it lacks are left out.
   *
   * Throws `Refusal`, whose message says why, if a value or a time is not usable.
   */
  run(loop: LoopData, values: Values, { stopTime, step, events = [], spare }: Options): Result {
    const mostSteps = Math.floor(this.data.mostSteps / loop.vehicles.length);
    const experiment = new Experiment(stopTime, step, mostSteps);
    if (loop.fixedStep !== undefined && step !== loop.fixedStep)
      throw new Refusal(
        `step ${step} s: a component takes longer steps, which are multiples of ${loop.fixedStep} s`,
      );
    const layout = this.layoutOf(loop);
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
    if (found.rows === 0 && found.outcome === "refused")
      throw new Refusal(whyRefused(found.refused, loop));
    const happened = occurrences(events, found.happened, experiment);
    const last = `t = ${general(experiment.time(found.refused.made), 12)} s`;
    return new Table(
      loop.actingRow,
      layout,
      copied(found.table, spare),
      parameters,
      happened,
      found.metrics,
      messages(loop, found.restarts),
      found.outcome === "refused"
        ? `stopped at ${last}: ${whyRefused(found.refused, loop)}`
        : undefined,
      found.outcome === "ended" ? `ended at ${last}: ${whyEnded(events, happened)}` : undefined,
    );
  }

  /** What makes the indices of a vehicle, in numbers. */
  private reducers(
    place: number,
    { columns, parameters }: Layout,
    values: readonly number[],
    actingRow: number,
  ): Reducer[] {
    return this.data.measured[place].map(({ name, takes, gives }) => ({
      name,
      // A row begins with the time.
      from: takes.map((one) => 1 + (columns.get(`${one}`) ?? -2)),
      constants: takes.map((one) => values[parameters.get(`${one}`) ?? -1] ?? Number(one)),
      actingRow,
      gives,
    }));
  }

  private layoutOf(loop: LoopData): Layout {
    const known = this.layouts.get(loop) ?? layoutOf(loop);
    this.layouts.set(loop, known);
    return known;
  }
}

/** The names of a loop, and their numbers. */
interface Layout extends Places {
  /** Of the columns. */
  readonly names: readonly string[];
  /** Outputs of no program, which are 0 in every row that is kept: after so many columns. */
  readonly faults: ReadonlyMap<number, string>;
}

function layoutOf({ ports, parameters }: LoopData): Layout {
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

/** The number that a value of a parameter is. */
function numberOf({ name, type, choices, min, max }: Parameter, value: Value, layout: Layout) {
  const wanted = { Real: "number", Integer: "number", Boolean: "boolean", Enumeration: "string" }[
    type
  ];
  if (choices && !Object.hasOwn(choices, `${value}`))
    throw new Refusal(`${name} = ${value}: not one of ${Object.keys(choices).join(", ")}`);
  if (Number.isNaN(value)) throw new Refusal(`${name}: not a number`);
  // Integers have 32 bits: a larger one would become another without a word.
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

/** Which component has refused what, in words. */
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

/** What components say of states that were started over. */
function messages({ restarted }: LoopData, restarts: Float64Array): string[] {
  return Object.entries(restarted).flatMap(([name, text], i) =>
    restarts[i] < 0 ? [] : [`${name}: ${text.replace("{}", general(restarts[i]))}`],
  );
}

/** Rows of their own, in the memory of a result that nothing shows any more. */
function copied(rows: Float64Array, spare: Result | undefined): Float64Array {
  // Megabytes that were never written take longer than all steps.
  const free = spare?.table.buffer;
  const isFit = free instanceof ArrayBuffer && free.byteLength === REAL * rows.length;
  const table = isFit ? new Float64Array(free) : new Float64Array(rows.length);
  table.set(rows);
  return table;
}

/** The rows of a run. */
class Table implements Result {
  readonly columns: readonly string[];
  readonly faults: ReadonlyMap<number, string>;
  readonly rows: number;
  private readonly places: ReadonlyMap<string, number>;
  private readonly made = new Map<string, Float64Array>();
  readonly failure?: string;
  readonly remark?: string;

  constructor(
    readonly actingRow: number,
    layout: Layout,
    readonly table: Float64Array,
    readonly parameters: Values,
    readonly happened: readonly Occurrence[],
    readonly metrics: readonly Metrics[],
    readonly messages: readonly string[],
    failure: string | undefined,
    remark: string | undefined,
  ) {
    this.columns = layout.names;
    this.faults = layout.faults;
    this.rows = table.length / (1 + this.columns.length);
    this.places = layout.columns;
    if (failure !== undefined) this.failure = failure;
    if (remark !== undefined) this.remark = remark;
  }

  get time(): Float64Array {
    return this.column("time");
  }

  has(name: string): boolean {
    return this.places.has(name);
  }

  column(name: string): Float64Array {
    const known = this.made.get(name);
    if (known !== undefined) return known;
    const place = name === "time" ? 0 : 1 + (this.places.get(name) ?? Number.NaN);
    if (Number.isNaN(place)) throw new Error(`there is no column ${name}`);
    const [width, column] = [1 + this.columns.length, new Float64Array(this.rows)];
    for (let k = 0; k < this.rows; k++) column[k] = this.table[k * width + place];
    this.made.set(name, column);
    return column;
  }
}
