// FMUs in the module: memory, texts, and one instance with the calls that a run makes.
import type { FmiType, Fmu, Value, Variable } from "./types";

/** FMI's statuses up to the first one with which a call has not done what it should. */
const WARNING = 1;
export const DISCARD = 2;

const CO_SIMULATION = 1;
/** Bytes of a double. */
export const REAL = 8;
const INT = 4;

/** What FMI calls the functions of a type: enumerations have those of integers. */
const called = (type: FmiType): FmiType => (type === "Enumeration" ? "Integer" : type);

/** Types of ports, in the order of their columns. */
const PORT_TYPES: readonly FmiType[] = ["Real", "Integer", "Boolean"];

/** An FMU has not done what it was asked to; the text names the component and says why. */
export class ComponentFailed extends Error {}

type Call = (...args: number[]) => number;
type Hearer = (status: number, text: string) => void;

/** The compiled module with all FMUs. */
export class Machine {
  private readonly hearers = new Map<number, Hearer>();
  private readonly encoder = new TextEncoder();
  private readonly decoder = new TextDecoder();
  private environments = 0;
  /** The whole memory; both are empty when it has grown. */
  private words = new Int32Array(0);
  private numbers = new Float64Array(0);

  private constructor(
    private readonly exports: WebAssembly.Exports,
    private readonly memory: WebAssembly.Memory,
  ) {}

  static async load(bytes: BufferSource): Promise<Machine> {
    let machine: Machine | undefined;
    // Nothing here reads files or waits: only what the C library is linked with.
    const nothing = () => 0;
    const { instance } = await WebAssembly.instantiate(bytes, {
      wasi_snapshot_preview1: {
        fd_close: nothing,
        fd_seek: nothing,
        fd_write: nothing,
        poll_oneoff: nothing,
      },
      host: {
        heard: (environment: number, status: number, text: number) =>
          machine?.hearers.get(environment)?.(status, machine.text(text).replaceAll("%%", "%")),
      },
    });
    const { memory, _initialize } = instance.exports;
    machine = new Machine(instance.exports, memory as WebAssembly.Memory);
    (_initialize as Call)();
    return machine;
  }

  call(name: string): Call {
    return this.exports[name] as Call;
  }

  allocate(bytes: number): number {
    const address = this.call("malloc")(Math.max(bytes, 1));
    if (address === 0) throw new ComponentFailed("out of memory");
    return address;
  }

  release(address: number): void {
    this.call("free")(address);
  }

  /** Doubles in the memory; the view is lost when the memory grows. */
  doubles(address: number, n: number): Float64Array {
    return new Float64Array(this.memory.buffer, address, n);
  }

  integers(address: number, n: number): Int32Array {
    return new Int32Array(this.memory.buffer, address, n);
  }

  /** Copy integers to doubles, without a view of either: it happens in every step. */
  widen(integers: number, n: number, doubles: number): void {
    if (this.words.length === 0) {
      this.words = new Int32Array(this.memory.buffer);
      this.numbers = new Float64Array(this.memory.buffer);
    }
    for (let i = 0; i < n; i++) this.numbers[doubles / REAL + i] = this.words[integers / INT + i];
  }

  text(address: number): string {
    const bytes = new Uint8Array(this.memory.buffer, address);
    return this.decoder.decode(bytes.slice(0, bytes.indexOf(0)));
  }

  /** A text in the memory, which whoever asks for it releases. */
  store(text: string): number {
    const bytes = this.encoder.encode(text);
    const address = this.allocate(bytes.length + 1);
    const place = new Uint8Array(this.memory.buffer, address, bytes.length + 1);
    place.set(bytes);
    place[bytes.length] = 0;
    return address;
  }

  /** A number that an instance hands back with its messages. */
  listen(hear: Hearer): number {
    this.environments += 1;
    this.hearers.set(this.environments, hear);
    return this.environments;
  }

  forget(environment: number): void {
    this.hearers.delete(environment);
  }
}

/** Ports that have the same causality and type: neighbours in the row, moved by one call. */
interface Block {
  readonly type: FmiType;
  readonly references: number;
  readonly n: number;
  /** Of the first of them, in the row. */
  readonly column: number;
  /** Where the FMU reads or writes: in the row itself, or beside it where they are no doubles. */
  place: number;
  readonly call: Call;
}

/** An instance, whose inputs and outputs live in a row of doubles in the module's memory. */
export class Instance {
  private readonly component: number;
  private readonly environment: number;
  private readonly variables: ReadonlyMap<string, Variable>;
  private readonly inputs: Block[] = [];
  private readonly outputs: Block[] = [];
  private readonly owned: number[] = [];
  private readonly scratch: number;
  private readonly stepped: Call;
  private complaint = "";
  private worst = 0;
  private row = 0;

  /**
   * @param name of the component
   * @param type of it: the prefix of its functions
   * @param hear takes what it says, with its name and FMI's status
   */
  constructor(
    private readonly machine: Machine,
    readonly name: string,
    private readonly type: string,
    private readonly fmu: Fmu,
    hear: Hearer,
  ) {
    this.variables = new Map(fmu.variables.map((variable) => [variable.name, variable]));
    this.environment = machine.listen((status, text) => {
      const said = `${name}: ${text.split("\n").join("; ")}`;
      if (status >= Math.min(this.worst, DISCARD)) {
        this.complaint = said;
        this.worst = status;
      }
      hear(status, said);
    });
    this.scratch = this.own(machine.allocate(2 * REAL));
    this.stepped = this.function("DoStep");
    const [known, guid] = [machine.store(name), machine.store(fmu.guid)];
    const callbacks = this.own(machine.call("host_callbacks")(this.environment));
    this.component = this.function("Instantiate")(known, CO_SIMULATION, guid, 0, callbacks, 0, 1);
    machine.release(known);
    machine.release(guid);
    if (this.component === 0) {
      this.free();
      throw new ComponentFailed(this.complaint || `${name}: cannot be instantiated`);
    }
  }

  /** Names of the ports, in the order of their columns, and where each type begins. */
  static layout(fmu: Fmu): { causality: "input" | "output"; type: FmiType; ports: Variable[] }[] {
    return (["input", "output"] as const)
      .flatMap((causality) =>
        PORT_TYPES.map((type) => ({
          causality,
          type,
          ports: fmu.variables.filter((v) => v.causality === causality && v.type === type),
        })),
      )
      .filter(({ ports }) => ports.length > 0);
  }

  /** Say where the row is, and in which of its columns this component's ports begin. */
  tie(row: number, first: number): void {
    this.row = row;
    let column = first;
    for (const { causality, type, ports } of Instance.layout(this.fmu)) {
      const references = this.own(this.machine.allocate(INT * ports.length));
      this.machine.integers(references, ports.length).set(ports.map((port) => port.reference));
      const place =
        type === "Real" ? row + REAL * column : this.own(this.machine.allocate(INT * ports.length));
      const call = this.function(`${causality === "input" ? "Set" : "Get"}${type}`);
      const block = { type, references, n: ports.length, column, place, call };
      (causality === "input" ? this.inputs : this.outputs).push(block);
      column += ports.length;
    }
  }

  /** Set values and enter that mode; times are in seconds. */
  enterInitialization(values: ReadonlyMap<string, Value>, start: number): void {
    this.set(values);
    // No stop time: k h ends beyond it by a rounding error.
    this.done(
      "setupExperiment",
      this.function("SetupExperiment")(this.component, 0, 0, start, 0, 0),
    );
    this.done("enterInitializationMode", this.plain("EnterInitializationMode"));
  }

  exitInitialization(): void {
    this.done("exitInitializationMode", this.plain("ExitInitializationMode"));
  }

  reset(): void {
    this.done("reset", this.plain("Reset"));
  }

  /** Set all inputs, then read all outputs. */
  exchange(): void {
    this.setInputs();
    this.getOutputs();
  }

  setInputs(): void {
    for (const block of this.inputs) {
      if (block.type !== "Real") {
        const { row, machine } = this;
        const values = machine.doubles(row + REAL * block.column, block.n);
        machine.integers(block.place, block.n).set(values);
      }
      this.done(
        "setting inputs",
        block.call(this.component, block.references, block.n, block.place),
      );
    }
  }

  /** Make a step; times are in seconds. */
  doStep(time: number, length: number): void {
    this.done("doStep", this.stepped(this.component, time, length, 1));
  }

  getOutputs(): void {
    for (const block of this.outputs) {
      this.done(
        "getting outputs",
        block.call(this.component, block.references, block.n, block.place),
      );
      if (block.type !== "Real") {
        this.machine.widen(block.place, block.n, this.row + REAL * block.column);
      }
    }
  }

  /** Set variables, one after the other. */
  set(values: ReadonlyMap<string, Value>): void {
    for (const [port, value] of values) {
      const { type, reference, choices } = this.variable(port);
      const at = this.scratch + REAL;
      const number = choices ? choices[`${value}`] : Number(value);
      this.machine.integers(this.scratch, 1)[0] = reference;
      if (type === "Real") this.machine.doubles(at, 1)[0] = number;
      else this.machine.integers(at, 1)[0] = number;
      const name = called(type);
      const status = this.function(`Set${name}`)(this.component, this.scratch, 1, at);
      this.done(`set${name}`, status);
    }
  }

  /** The value of a variable, as the FMU holds it. */
  read(port: string): Value {
    const { type, reference, choices } = this.variable(port);
    const at = this.scratch + REAL;
    this.machine.integers(this.scratch, 1)[0] = reference;
    const name = called(type);
    this.done(`get${name}`, this.function(`Get${name}`)(this.component, this.scratch, 1, at));
    if (type === "Real") return this.machine.doubles(at, 1)[0];
    const number = this.machine.integers(at, 1)[0];
    for (const [choice, of] of Object.entries(choices ?? {})) if (of === number) return choice;
    return type === "Boolean" ? number !== 0 : number;
  }

  free(): void {
    if (this.component) this.function("FreeInstance")(this.component);
    for (const address of this.owned) this.machine.release(address);
    this.machine.forget(this.environment);
  }

  private variable(port: string): Variable {
    const found = this.variables.get(port);
    if (found === undefined) throw new ComponentFailed(`${this.name} has no port ${port}`);
    return found;
  }

  private own(address: number): number {
    this.owned.push(address);
    return address;
  }

  private function(name: string): Call {
    return this.machine.call(`${this.type}_fmi2${name}`);
  }

  private plain(name: string): number {
    return this.function(name)(this.component);
  }

  private done(what: string, status: number): void {
    if (status > WARNING) {
      throw new ComponentFailed(
        this.complaint || `${this.name}: ${what} failed (status ${status})`,
      );
    }
  }
}
