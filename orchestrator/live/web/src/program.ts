// Programs in a WebAssembly module: memory, calls and refusals.

import type { Metrics } from "./types";

/** Bytes of a double. */
export const REAL = 8;
/** Bytes of a page of memory. */
const PAGE = 65536;

/** A refusal: numbers of the component and of the input or parameter, and the call. */
export interface Refused {
  readonly component: number;
  readonly call: Call;
  readonly port: number;
  /** Number of steps before. */
  readonly made: number;
}

/** Calls that a component may refuse, in the order of their numbers. */
const CALLS = ["start", "input", "outputs", "step", "set"] as const;
type Call = (typeof CALLS)[number];

/** Outcomes of a run, in the order of their numbers. */
const OUTCOMES = ["whole", "refused", "ended"] as const;
type Outcome = (typeof OUTCOMES)[number];

/** Steps and times of a run. */
export interface Times {
  readonly step: number;
  readonly stopTime: number;
  readonly fullSteps: number;
  readonly steps: number;
}

/** Events of a run, in the form of events.c. */
export interface Agenda {
  readonly n: number;
  readonly events: Float64Array;
  readonly actions: Float64Array;
  /** Numbers in the list of occurrences. */
  readonly listed: number;
}

/** A reducer, which makes indices from the rows of a run. */
export interface Reducer {
  readonly name: string;
  /** Place of each argument in a row; -1: a constant. */
  readonly from: readonly number[];
  readonly constants: readonly number[];
  /** Row with the values that act in a step: 0: at its beginning, 1: at its end. */
  readonly actingRow: number;
  /** Name of the index of each result. */
  readonly gives: readonly string[];
}

/** Results of a run. */
export interface Run {
  readonly outcome: Outcome;
  /** Refusal, if there is one. */
  readonly refused: Refused;
  /** Number of rows. */
  readonly rows: number;
  /** Rows, in memory that the next run overwrites. */
  readonly table: Float64Array;
  /** Occurrences, in memory that the next run overwrites. */
  readonly happened: Float64Array;
  /** Times at which guards of components first reset their states; less than 0: never. */
  readonly restarts: Float64Array;
  /** Indices of each vehicle. */
  readonly metrics: readonly Metrics[];
}

type Function = (...args: number[]) => number;

/** A module with several programs, which use its memory one at a time. */
export class Module {
  private constructor(private readonly exports: WebAssembly.Exports) {}

  static async load(bytes: BufferSource): Promise<Module> {
    const { instance } = await WebAssembly.instantiate(bytes);
    (instance.exports._initialize as Function)();
    return new Module(instance.exports);
  }

  /** Runs a program whose rows have a given width. */
  run(
    number: number,
    values: Float64Array,
    { step, stopTime, fullSteps, steps }: Times,
    width: number,
    components: number,
    agenda: Agenda,
    vehicles: readonly (readonly Reducer[])[],
  ): Run {
    const call = (name: string) => this.exports[`p${number}_${name}`] as Function;
    const size = Math.ceil(call("size_of_simulation")() / REAL);
    const { n, events, actions, listed } = agenda;
    const room = Math.max(
      0,
      ...vehicles.flat().map(({ from, gives }) => from.length + gives.length),
    );
    const sizes = [size, size, 2, components, values.length, events.length, actions.length, listed];
    const places = this.lay([...sizes, room, room, room, (steps + 1) * width]);
    const [simulation, ahead, failure, restarts, given, first, second, happened, ...rest] = places;
    const [from, constants, found, rows] = rest;
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
    const reduce = (one: Reducer) => {
      new Int32Array(this.memory.buffer, from, one.from.length).set(one.from);
      this.doubles(constants, one.constants.length).set(one.constants);
      const agreed = [from, constants, one.actingRow, 0, stopTime, found];
      const reducer = this.exports[`${one.name}_reduce`] as Function;
      if (reducer(rows, shown, width, ...agreed)) return [];
      return one.gives.map(
        (index, i) => [index, this.doubles(found, one.gives.length)[i]] as const,
      );
    };
    return {
      outcome: OUTCOMES[outcome],
      refused: { component, call: CALLS[kind], port, made },
      rows: shown,
      table: this.doubles(rows, shown * width),
      happened: this.doubles(happened, listed),
      restarts: this.doubles(restarts, components),
      metrics: vehicles.map((reducers) => named(reducers.flatMap(reduce))),
    };
  }

  private get memory(): WebAssembly.Memory {
    return this.exports.memory as WebAssembly.Memory;
  }

  /** Returns a view of the memory, valid until the memory grows. */
  private doubles(address: number, n: number): Float64Array {
    return new Float64Array(this.memory.buffer, address, n);
  }

  /** Returns addresses of free memory for given numbers of doubles. */
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

/** Groups results by index, without indices that are missing. */
function named(members: readonly (readonly [string, number])[]): Metrics {
  const found: Record<string, number[]> = {};
  for (const [index, value] of members) found[index] = [...(found[index] ?? []), value];
  return Object.fromEntries(
    Object.entries(found).filter(([, values]) => !values.every(Number.isNaN)),
  );
}
