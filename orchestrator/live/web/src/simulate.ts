// A run of a loop, from the first exchange of values to the last step.
import { Ended, Events, parted, type Run } from "./events";
import { Experiment, Refusal } from "./experiment";
import { ComponentFailed, DISCARD, Instance, Machine, REAL } from "./fmi";
import { Gathering, Overrides, Row } from "./row";
import { general } from "./text";
import type {
  Data,
  LoopData,
  Occurrence,
  Options,
  Parameter,
  Result,
  Stage,
  Value,
  Values,
} from "./types";

/** Messages that are kept: an FMU says each once, and again after a reset. */
const MOST_MESSAGES = 100;

/** A stage with its values and instances. */
interface LinkedStage {
  readonly gathering: Gathering;
  readonly members: readonly Instance[];
}

/** Some of a stage's instances take their inputs in it, and some are read. */
interface Stepping extends LinkedStage {
  readonly taking: ReadonlySet<Instance>;
  readonly read: readonly Instance[];
}

/** Runs loops in the compiled module. */
export class Engine {
  private constructor(
    private readonly machine: Machine,
    private readonly data: Data,
  ) {}

  /** Make one of the compiled module and what Python has written. */
  static async load(bytes: BufferSource, data: Data): Promise<Engine> {
    return new Engine(await Machine.load(bytes), data);
  }

  /**
   * Runs a loop with its own values except for `values`; names that it lacks are left out.
   *
   * Throws `Refusal`, whose message is the FMU's own line, if a value or a time is not usable.
   */
  run(loop: LoopData, values: Values, options: Options): Result {
    const mostSteps = Math.floor(this.data.mostSteps / loop.vehicles.length);
    const experiment = new Experiment(options.stopTime, options.step, mostSteps);
    const simulation = new Simulation(this.machine, this.data, loop, values, experiment);
    try {
      return simulation.result(options.events ?? [], options.spare);
    } finally {
      simulation.free();
    }
  }
}

/** One run. */
class Simulation {
  private readonly parameters: Record<string, Value> = {};
  /** Values that differ from the FMUs' own, by the names of the components. */
  private readonly given = new Map<string, Map<string, Value>>();
  private readonly messages: string[] = [];
  private heard = 0;
  private readonly refusals: string[] = [];
  private readonly instances = new Map<string, Instance>();
  private readonly row: Row;
  /** FMUs by the names of the components. */
  private readonly components: ReadonlyMap<string, string>;

  constructor(
    private readonly machine: Machine,
    private readonly data: Data,
    private readonly loop: LoopData,
    values: Values,
    private readonly experiment: Experiment,
  ) {
    this.components = new Map(Object.entries(loop.components));
    for (const parameter of loop.parameters) this.take(parameter, values[parameter.name]);
    this.row = new Row(machine, loop, data.fmus);
    for (const [name, value] of Object.entries(this.parameters)) {
      const column = this.row.columns.get(name);
      if (column !== undefined) this.row.values[column] = Number(value);
    }
  }

  free(): void {
    for (const instance of this.instances.values()) instance.free();
    this.row.free();
  }

  result(events: Options["events"] & object, spare: Result | undefined): Result {
    try {
      this.instantiate();
      this.initialise();
    } catch (error) {
      if (error instanceof ComponentFailed) throw new Refusal(error.message);
      throw error;
    }
    return this.advance(new Events(events), spare);
  }

  /** Take the value of a parameter: the user's, or the loop's. */
  private take(parameter: Parameter, changed: Value | undefined): void {
    const { name, type, choices } = parameter;
    const value = changed ?? parameter.value;
    const wanted = { Real: "number", Integer: "number", Boolean: "boolean", Enumeration: "string" }[
      type
    ];
    if (choices && !choices.includes(`${value}`))
      throw new Refusal(`${name} = ${value}: not one of ${choices.join(", ")}`);
    if (Number.isNaN(value)) throw new Refusal(`${name}: not a number`);
    // Integers have 32 bits: a larger one would become another without a word.
    const fits = typeof value === wanted && (type !== "Integer" || (Number(value) | 0) === value);
    if (!fits) throw new Refusal(`${name} = ${value}: not a value of type ${type}`);
    this.parameters[name] = value;
    if (Object.is(value, parameter.default)) return;
    const [component, port] = parted(name, this.components);
    const values = this.given.get(component) ?? new Map<string, Value>();
    this.given.set(component, values.set(port, value));
  }

  private instantiate(): void {
    const { machine, data, loop, row } = this;
    for (const [name, type] of Object.entries(loop.components)) {
      const hear = (status: number, text: string) => this.hear(status, text);
      const instance = new Instance(machine, name, type, data.fmus[type], hear);
      this.instances.set(name, instance);
      instance.tie(row.address, row.firsts.get(name) ?? 0);
    }
  }

  private hear(status: number, text: string): void {
    this.heard += 1;
    if (this.heard <= MOST_MESSAGES) this.messages.push(text);
    if (status === DISCARD) this.refusals.push(text);
  }

  /** Set parameters, exchange values in initialisation mode until they rest, leave that mode. */
  private initialise(): void {
    const { instances, loop } = this;
    for (const [name, instance] of instances) {
      instance.enterInitialization(this.given.get(name) ?? new Map(), 0);
    }
    const stages = loop.initial.map((stage) => this.linked(stage));
    this.readAhead();
    const handOn = (everything: boolean): boolean => {
      let changed = false;
      for (const { gathering, members } of stages) {
        const moved = gathering.gather();
        if (!moved && !everything) continue;
        for (const instance of members) instance.exchange();
        changed = true;
      }
      return changed;
    };
    handOn(true);
    // It comes to rest: no loop has a ring.
    while (handOn(false));
    this.checkFinite();
    for (const instance of instances.values()) instance.exitInitialization();
    handOn(true);
    this.checkFinite();
    if (this.refusals.length > 0) throw new Refusal(this.refusals.join("; "));
  }

  /** Read outputs that feed a component before it is their own component's turn. */
  private readAhead(): void {
    const turn = new Map(
      this.loop.initial.flatMap(({ components }, i) => components.map((c) => [c, i])),
    );
    for (const { connections } of this.loop.initial) {
      for (const [target, source] of connections) {
        const [component, port] = parted(source, turn);
        if ((turn.get(component) ?? 0) < (turn.get(parted(target, turn)[0]) ?? 0)) continue;
        const value = Number(this.instances.get(component)?.read(port));
        if (Number.isFinite(value)) this.row.values[this.row.column(source)] = value;
      }
    }
  }

  private checkFinite(): void {
    const wrong = this.wrong(Object.keys(this.loop.components));
    if (wrong !== undefined) throw new Refusal(`stopped at t = 0 s: ${wrong}`);
  }

  private linked({ connections, components }: Stage): LinkedStage {
    return { gathering: new Gathering(this.row, connections), members: this.named(components) };
  }

  private stepping(stage: Stage): Stepping {
    const { passing, read } = this.loop;
    const passed = new Set(passing.flatMap(({ components }) => components));
    return {
      ...this.linked(stage),
      taking: new Set(this.named(stage.components.filter((name) => !passed.has(name)))),
      read: this.named(stage.components.filter((name) => read.includes(name))),
    };
  }

  private named(components: readonly string[]): readonly Instance[] {
    return components.map((name) => this.instances.get(name)).filter((one) => one !== undefined);
  }

  /** Step to the end, or to the first failure. */
  private advance(events: Events, spare: Result | undefined): Result {
    const { experiment, instances, row, loop } = this;
    const passing = loop.passing.map((stage) => this.linked(stage));
    const stages = loop.stages.map((stage) => this.stepping(stage));
    const overrides = new Overrides(
      row,
      [...passing, ...stages].map(({ gathering }) => gathering),
    );
    const run: Run = { experiment, instances, row, overrides, values: this.given, made: 0 };
    const width = 1 + row.names.length;
    // Megabytes that were never written take longer than all steps.
    const size = (experiment.steps + 1) * width;
    const free = spare?.table.buffer;
    const isFit = free instanceof ArrayBuffer && free.byteLength === REAL * size;
    const table = isFit ? new Float64Array(free) : new Float64Array(size);
    let rows = 0;
    /** Let values pass, and keep the row of now, unless something in it is not finite. */
    const show = (): boolean => {
      for (const { gathering, members } of passing) {
        gathering.gather();
        for (const instance of members) instance.exchange();
      }
      const { values } = row;
      const first = rows * width;
      table[first] = experiment.time(rows);
      // One by one: for so few values, `set` takes ten times as long. Times zero, what is finite is
      // zero and what is not is nan.
      let sum = 0;
      for (let k = 0; k < values.length; k++) {
        const value = values[k];
        table[first + 1 + k] = value;
        sum += value * 0;
      }
      if (sum !== 0) return false;
      rows += 1;
      return true;
    };
    if (loop.actingRow) show();
    let [failure, remark]: [string | undefined, string | undefined] = [undefined, undefined];
    const now = () => `t = ${general(experiment.time(run.made), 12)} s`;
    try {
      for (let due = 0; ; run.made += 1) {
        // What an event sets acts on the values that pass then.
        if (run.made >= due) due = events.act(run);
        if (!loop.actingRow && !show()) break;
        if (run.made === experiment.steps) break;
        const [time, length] = [experiment.time(run.made), experiment.length(run.made)];
        for (const { gathering, members, taking, read } of stages) {
          gathering.gather();
          for (const instance of members) {
            if (taking.has(instance)) instance.setInputs();
            instance.doStep(time, length);
          }
          for (const instance of read) instance.getOutputs();
        }
        if (loop.actingRow && !show()) break;
      }
    } catch (error) {
      if (error instanceof Ended) {
        if (!loop.actingRow) show();
        remark = `ended at ${now()}: ${error.message}`;
      } else if (error instanceof ComponentFailed)
        failure = `stopped at ${now()}: ${error.message}`;
      else throw error;
    }
    if (remark === undefined) {
      // Also where another component has refused it in the same step.
      const wrong = this.wrong(loop.stages.flatMap(({ components }) => components));
      const time = experiment.time(Math.min(rows, experiment.steps));
      if (wrong !== undefined) failure = `stopped at t = ${general(time, 12)} s: ${wrong}`;
    }
    const whole = table.subarray(0, rows * width);
    const more = this.heard - this.messages.length;
    if (more > 0) this.messages.push(`and ${more} more messages`);
    return new Table(
      loop.actingRow,
      row.names,
      whole,
      this.parameters,
      events.happened,
      this.messages,
      failure,
      remark,
    );
  }

  /** The first value that is not finite, and where it comes from, in words. */
  private wrong(components: readonly string[]): string | undefined {
    const { row, loop, data } = this;
    if (areFinite(row.values)) return undefined;
    const all = [...loop.passing, ...loop.stages];
    const sources = new Map(all.flatMap(({ connections }) => connections));
    let passedOn: string | undefined;
    for (const component of components) {
      const inputsFirst = Instance.layout(data.fmus[loop.components[component]]).flatMap(
        ({ ports }) => ports,
      );
      for (const { name, causality } of inputsFirst) {
        const port = `${component}.${name}`;
        if (Number.isFinite(row.value(port))) continue;
        const text = `${port} is ${general(row.value(port))}`;
        if (causality === "output") return text;
        const source = sources.get(port);
        const fed = `${text}, ${source ? `fed by ${source}` : "from a table or an event"}`;
        if (source === undefined || Number.isFinite(row.value(source))) return fed;
        passedOn ??= fed;
      }
    }
    return passedOn;
  }
}

/** Whether all values are numbers that can be computed with. */
function areFinite(values: Float64Array): boolean {
  // Times zero, what is finite is zero and what is not is nan. Sums that do not wait for each other
  // take less than half the time.
  let [a, b, c, d] = [0, 0, 0, 0];
  let i = values.length & 3;
  for (let k = 0; k < i; k++) a += values[k] * 0;
  for (; i < values.length; i += 4) {
    a += values[i] * 0;
    b += values[i + 1] * 0;
    c += values[i + 2] * 0;
    d += values[i + 3] * 0;
  }
  return a + b + c + d === 0;
}

/** The rows of a run. */
class Table implements Result {
  readonly rows: number;
  private readonly places: ReadonlyMap<string, number>;
  private readonly made = new Map<string, Float64Array>();
  readonly failure?: string;
  readonly remark?: string;

  constructor(
    readonly actingRow: number,
    readonly columns: readonly string[],
    readonly table: Float64Array,
    readonly parameters: Values,
    readonly happened: readonly Occurrence[],
    readonly messages: readonly string[],
    failure: string | undefined,
    remark: string | undefined,
  ) {
    this.rows = table.length / (1 + columns.length);
    this.places = new Map([["time", 0], ...columns.map((name, i) => [name, i + 1] as const)]);
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
    const [place, known] = [this.places.get(name), this.made.get(name)];
    if (known !== undefined) return known;
    if (place === undefined) throw new Error(`there is no column ${name}`);
    const [width, column] = [1 + this.columns.length, new Float64Array(this.rows)];
    for (let k = 0; k < this.rows; k++) column[k] = this.table[k * width + place];
    this.made.set(name, column);
    return column;
  }
}
