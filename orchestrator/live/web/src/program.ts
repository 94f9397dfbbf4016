// A program in a module: its memory, its functions, and what it has refused.

import type { Metrics } from "./types";

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

/** An index of the rows of a run. */
export interface Reducer {
  readonly name: string;
  /** Where in a row each number is that it takes; -1: among the constants. */
  readonly from: readonly number[];
  readonly constants: readonly number[];
  /** In which row what acts in a step stands: 0, that of its beginning, or 1, that of its end. */
  readonly actingRow: number;
  /** Only the rows of so many seconds before the last one count [s]. */
  readonly last: number;
  /** How many numbers each of its indices is, by its name. */
  readonly results: Readonly<Record<string, number>>;
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
  /** Indices of each vehicle. */
  readonly metrics: readonly Metrics[];
}

type Function = (...args: number[]) => number;

function sum(numbers: readonly number[]): number {
  return numbers.reduce((a, b) => a + b, 0);
}

/** Addresses one after the other for so many doubles each. */
function addresses(from: number, sizes: readonly number[]): number[] {
  let end = from;
  return sizes.map((n) => {
    end += n * REAL;
    return end - n * REAL;
  });
}

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
    vehicles: readonly (readonly Reducer[])[],
  ): Run {
    const call = (name: string) => this.call(`p${number}_${name}`);
    const size = Math.ceil(call("size_of_simulation")() / REAL);
    const { n, events, actions, listed } = agenda;
    const sizes = [size, size, 2, components, values.length, events.length, actions.length, listed];
    const room = Math.max(0, ...vehicles.flat().map((one) => sum(this.sizesFor(one))));
    const places = this.lay([...sizes, room, (steps + 1) * width]);
    const [simulation, ahead, failure, restarts, given, first, second, happened, free, rows] =
      places;
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
    const table = this.doubles(rows, shown * width);
    const metrics = vehicles.map((reducers) =>
      reducers.map((one) => this.reduced(one, table, width, stopTime, free)),
    );
    return {
      outcome: OUTCOMES[outcome],
      refused: { component, call: CALLS[kind], port, made },
      rows: shown,
      table,
      happened: this.doubles(happened, listed),
      restarts: this.doubles(restarts, components),
      metrics: metrics.map((found) => Object.assign({}, ...found)),
    };
  }

  private call(name: string): Function {
    return this.exports[name] as Function;
  }

  /** Doubles for what an index keeps, where its numbers come from, constants, and what it gives. */
  private sizesFor({ name, from, constants, results }: Reducer): number[] {
    const kept = Math.ceil(this.call(`${name}_size_of_rows`)() / REAL);
    return [kept, from.length, constants.length, sum(Object.values(results))];
  }

  /** The indices that are made of rows in the memory, with room for what that takes. */
  private reduced(
    reducer: Reducer,
    table: Float64Array,
    width: number,
    end: number,
    free: number,
  ): Metrics {
    const { name, from, constants, actingRow, last, results } = reducer;
    const sizes = this.sizesFor(reducer);
    const [kept, sources, fixed, given] = addresses(free, sizes);
    this.doubles(kept, sizes[0]).fill(0);
    new Int32Array(this.memory.buffer, sources, from.length).set(from);
    this.doubles(fixed, constants.length).set(constants);
    const since = table[table.length - width] - last;
    let first = 0;
    while (table[first] < since) first += width;
    const rows = [table.byteOffset + REAL * first, (table.length - first) / width, width];
    this.call(`${name}_take_rows`)(kept, ...rows, sources, fixed, actingRow, 0, end);
    if (this.call(`${name}_give_numbers`)(kept, 0, end, given)) return {};
    const numbers = [...this.doubles(given, sizes[3])];
    const found = Object.entries(results).map(
      ([index, n]) => [index, numbers.splice(0, n)] as const,
    );
    return Object.fromEntries(found.filter(([, values]) => !values.every(Number.isNaN)));
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
    const base = (this.exports.__heap_base as WebAssembly.Global).value as number;
    const found = addresses(Math.ceil(base / REAL) * REAL, [...sizes, 0]);
    const end = found.pop() as number;
    const missing = Math.ceil((end - this.memory.buffer.byteLength) / PAGE);
    if (missing > 0) this.memory.grow(missing);
    return found;
  }
}
