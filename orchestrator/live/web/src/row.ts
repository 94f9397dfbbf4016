// The row of all values, what inputs take from outputs, and what events do to that.
import { Instance, type Machine, REAL } from "./fmi";
import type { Fmu, LoopData, Stage, Value } from "./types";

/** Times one, plus minus zero: every number stays what it is, minus zero, too. */
const FACTOR = 1;
const OFFSET = -0;

/** All inputs and outputs side by side, as doubles in the module's memory. */
export class Row {
  readonly address: number;
  readonly names: readonly string[];
  readonly columns: ReadonlyMap<string, number>;
  /** The column in which the ports of each component begin. */
  readonly firsts: ReadonlyMap<string, number>;
  private view: Float64Array;

  constructor(
    private readonly machine: Machine,
    loop: LoopData,
    fmus: Readonly<Record<string, Fmu>>,
  ) {
    const names: string[] = [];
    const starts: number[] = [];
    const firsts = new Map<string, number>();
    for (const [component, type] of Object.entries(loop.components)) {
      firsts.set(component, names.length);
      for (const { ports } of Instance.layout(fmus[type])) {
        for (const port of ports) {
          names.push(`${component}.${port.name}`);
          starts.push(Number(port.start ?? 0));
        }
      }
    }
    this.names = names;
    this.firsts = firsts;
    this.columns = new Map(names.map((name, i) => [name, i]));
    this.address = machine.allocate(REAL * names.length);
    this.view = machine.doubles(this.address, names.length);
    this.view.set(starts);
  }

  /** The values. */
  get values(): Float64Array {
    // The memory has grown: the values are where they were, and the view is empty.
    if (this.view.length !== this.names.length) {
      this.view = this.machine.doubles(this.address, this.names.length);
    }
    return this.view;
  }

  column(name: string): number {
    const found = this.columns.get(name);
    if (found === undefined) throw new Error(`there is no port ${name}`);
    return found;
  }

  value(name: string): number {
    return this.values[this.column(name)];
  }

  free(): void {
    this.machine.release(this.address);
  }
}

/** Values that inputs take from outputs at the same time, each times a factor, plus an offset. */
export class Gathering {
  readonly targets: Int32Array;
  readonly sources: Int32Array;
  readonly factors: Float64Array;
  readonly offsets: Float64Array;
  private plain = true;

  constructor(
    private readonly row: Row,
    connections: Stage["connections"],
  ) {
    this.targets = Int32Array.from(connections, ([target]) => row.column(target));
    this.sources = Int32Array.from(connections, ([, source]) => row.column(source));
    this.factors = new Float64Array(connections.length).fill(FACTOR);
    this.offsets = new Float64Array(connections.length).fill(OFFSET);
  }

  /** Move the values; whether any input has changed. */
  gather(): boolean {
    const { targets, sources, factors, offsets, plain } = this;
    const { values } = this.row;
    let changed = false;
    for (let i = 0; i < targets.length; i++) {
      const taken = values[sources[i]];
      const arriving = plain ? taken : factors[i] * taken + offsets[i];
      changed ||= !Object.is(values[targets[i]], arriving);
      values[targets[i]] = arriving;
    }
    return changed;
  }

  /** Set the change to one of the values. */
  set(place: number, factor: number, offset: number): void {
    this.factors[place] = factor;
    this.offsets[place] = offset;
    this.plain =
      this.factors.every((one) => one === FACTOR) &&
      this.offsets.every((one) => Object.is(one, OFFSET));
  }
}

/** Temporary changes to what inputs take. */
export class Overrides {
  private readonly fed = new Map<number, [Gathering, number][]>();
  /** Of inputs that nothing feeds: what they would have, and what is done to it. */
  private readonly open = new Map<number, [number, number, number]>();

  constructor(
    private readonly row: Row,
    gatherings: readonly Gathering[],
  ) {
    for (const gathering of gatherings) {
      gathering.targets.forEach((target, place) => {
        this.fed.set(target, [...(this.fed.get(target) ?? []), [gathering, place]]);
      });
    }
  }

  /** Let an input take a value, whatever feeds it. */
  override(target: string, value: Value): void {
    this.alter(target, 0, Number(value));
  }

  /** Let an input take the value that it would take, and something more. */
  bias(target: string, offset: Value): void {
    this.alter(target, FACTOR, OFFSET + Number(offset));
  }

  /** Let an input take what feeds it, or what it would have. */
  release(target: string): void {
    const column = this.row.column(target);
    const open = this.open.get(column);
    if (this.fed.has(column)) this.alter(target, FACTOR, OFFSET);
    else if (open !== undefined) {
      this.row.values[column] = open[0];
      this.open.delete(column);
    }
  }

  /** Let an input that nothing feeds have a value, which is altered as one that is fed is. */
  supply(target: string, value: Value): void {
    const column = this.row.column(target);
    const open = this.open.get(column);
    let number = Number(value);
    if (open !== undefined) {
      const [, factor, offset] = open;
      this.open.set(column, [number, factor, offset]);
      number = factor * number + offset;
    }
    this.row.values[column] = number;
  }

  /** What an input has that nothing feeds, before it is altered. */
  supplied(target: string): number {
    const column = this.row.column(target);
    return this.open.get(column)?.[0] ?? this.row.values[column];
  }

  /** Let the inputs of a component take at once what feeds them. */
  refresh(component: string): void {
    const { values, firsts, names } = this.row;
    const first = firsts.get(component) ?? names.length;
    const end = Math.min(names.length, ...[...firsts.values()].filter((other) => other > first));
    for (const [column, [[gathering, place]]] of this.fed) {
      if (first <= column && column < end) {
        const taken = values[gathering.sources[place]];
        values[column] = gathering.factors[place] * taken + gathering.offsets[place];
      }
    }
  }

  private alter(target: string, factor: number, offset: number): void {
    const column = this.row.column(target);
    const fed = this.fed.get(column);
    if (fed === undefined) {
      const value = this.supplied(target);
      this.open.set(column, [value, factor, offset]);
      this.row.values[column] = factor * value + offset;
    } else {
      for (const [gathering, place] of fed) gathering.set(place, factor, offset);
    }
  }
}
