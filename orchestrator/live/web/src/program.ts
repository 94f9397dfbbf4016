// A program in a module: its memory, its functions, and what it has refused.

/** Bytes of a double. */
export const REAL = 8;
/** Bytes of a page of memory. */
const PAGE = 65536;

/** What has been refused: a component, one of `CALLS`, and an input or parameter, by their numbers. */
export interface Refused {
  readonly component: number;
  readonly call: Call;
  readonly port: number;
  /** After how many steps. */
  readonly made: number;
}

/** What a component may refuse, in the order of their numbers. */
const CALLS = ["start", "input", "outputs", "step", "set"] as const;
export type Call = (typeof CALLS)[number];

/** What a run comes to, in the order of their numbers. */
const OUTCOMES = ["whole", "refused", "ended"] as const;
export type Outcome = (typeof OUTCOMES)[number];

/** Numbers of a run's experiment. */
export interface Times {
  readonly step: number;
  readonly stopTime: number;
  readonly fullSteps: number;
  readonly steps: number;
}

/** What is to happen, as events.c has it. */
export interface Agenda {
  readonly n: number;
  readonly events: Float64Array;
  readonly actions: Float64Array;
  /** How many numbers say what has happened. */
  readonly listed: number;
}

/** What a run has left. */
export interface Run {
  readonly outcome: Outcome;
  /** Why there is no row, or none after the last. */
  readonly refused: Refused;
  /** How many rows there are. */
  readonly rows: number;
  /** Rows and what has happened, in the memory: the next run overwrites them. */
  readonly table: Float64Array;
  readonly happened: Float64Array;
  /** When the guards of components first started their states over; less than 0: none did. */
  readonly restarts: Float64Array;
}

type Function = (...args: number[]) => number;

/** A module with several programs, of which one at a time uses its memory. */
export class Module {
  private constructor(private readonly exports: WebAssembly.Exports) {}

  static async load(bytes: BufferSource): Promise<Module> {
    const { instance } = await WebAssembly.instantiate(bytes);
    (instance.exports._initialize as Function)();
    return new Module(instance.exports);
  }

  /** A run of a program: so many numbers make a row. */
  run(
    number: number,
    values: Float64Array,
    { step, stopTime, fullSteps, steps }: Times,
    width: number,
    components: number,
    agenda: Agenda,
  ): Run {
    const call = (name: string) => this.exports[`p${number}_${name}`] as Function;
    const size = Math.ceil(call("size_of_simulation")() / REAL);
    const { n, events, actions, listed } = agenda;
    const sizes = [size, size, 2, components, values.length, events.length, actions.length, listed];
    const places = this.lay([...sizes, (steps + 1) * width]);
    const [simulation, ahead, failure, restarts, given, first, second, happened, rows] = places;
    this.doubles(given, values.length).set(values);
    this.doubles(first, events.length).set(events);
    this.doubles(second, actions.length).set(actions);
    this.doubles(happened, 1).fill(0);
    const hasBegun = !call("begin")(simulation, given, 0, step, stopTime, fullSteps, steps);
    const agreed = [given, n, first, second, happened];
    const outcome = hasBegun
      ? call("run_with_events")(simulation, ahead, steps, rows, ...agreed)
      : 1;
    call("failure")(simulation, failure);
    const [component, kind, port, made] = new Int32Array(this.memory.buffer, failure, 4);
    call("restarts")(simulation, restarts);
    const shown = call("rows_shown")(simulation);
    return {
      outcome: OUTCOMES[outcome],
      refused: { component, call: CALLS[kind], port, made },
      rows: shown,
      table: this.doubles(rows, shown * width),
      happened: this.doubles(happened, listed),
      restarts: this.doubles(restarts, components),
    };
  }

  private get memory(): WebAssembly.Memory {
    return this.exports.memory as WebAssembly.Memory;
  }

  /** Views are lost when the memory grows. */
  private doubles(address: number, n: number): Float64Array {
    return new Float64Array(this.memory.buffer, address, n);
  }

  /** Addresses for so many doubles each, where nothing else is. */
  private lay(sizes: readonly number[]): number[] {
    let end = (this.exports.__heap_base as WebAssembly.Global).value as number;
    end = Math.ceil(end / REAL) * REAL;
    const addresses = sizes.map((n) => {
      end += n * REAL;
      return end - n * REAL;
    });
    const missing = Math.ceil((end - this.memory.buffer.byteLength) / PAGE);
    if (missing > 0) this.memory.grow(missing);
    return addresses;
  }
}
