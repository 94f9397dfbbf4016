// Data that Python writes into the page, and results of runs.

/** A value of a port or parameter. */
export type Value = number | boolean | string;

/** Values by `component.parameter`. */
export type Values = Readonly<Record<string, Value>>;

type FmiType = "Real" | "Integer" | "Boolean" | "Enumeration";

/** A parameter or unconnected input that a user may change. */
export interface Parameter {
  /** `component.parameter` */
  readonly name: string;
  readonly type: FmiType;
  /** Printed form. */
  readonly unit?: string;
  readonly min?: number;
  readonly max?: number;
  /** Numbers of an Enumeration's items by name; the value is a name. */
  readonly choices?: Readonly<Record<string, number>>;
  /** Value in the FMU. */
  readonly default: Value;
  /** Value in this preset. */
  readonly value: Value;
  readonly description: string;
}

/** Pairs of port and value. */
type Assignments = readonly (readonly [string, Value])[];

/** Action of an event; names are `component.port`. */
export type Action =
  | { readonly kind: "alter"; readonly effect: "override" | "bias"; readonly values: Assignments }
  | { readonly kind: "freeze"; readonly targets: readonly string[] }
  | { readonly kind: "release"; readonly targets: readonly string[] }
  | { readonly kind: "set"; readonly parameters: Assignments; readonly inputs: Assignments }
  | { readonly kind: "reset"; readonly components: readonly string[] }
  | { readonly kind: "stop"; readonly why: string };

/** A signal compared with a number. */
interface Condition {
  readonly signal: string;
  readonly comparison: "<" | "<=" | ">" | ">=";
  readonly value: number;
}

/** An event, at a time or when a condition becomes true. */
export interface EventData {
  /** Its number among the scenario's events, from 0; some loops do not have all of them. */
  readonly number: number;
  /** Description. */
  readonly text: string;
  /** Name in figures. */
  readonly label: string;
  readonly action: Action;
  /** [s] */
  readonly at?: number;
  readonly when?: Condition;
  /** If set, it happens each time that the condition becomes true. */
  readonly repeat?: boolean;
  /** Duration [s]; absent: until the run ends. */
  readonly lasts?: number;
  /** True if it can have a duration. */
  readonly canEnd: boolean;
}

/** A vehicle: its components by role; a missing role has a name that no component has. */
export interface VehicleData {
  readonly name: string;
  readonly vehicle: string;
  readonly controller: string;
  readonly planner: string;
  readonly disturbance: string;
  /** Component that commands the actuators of a vehicle without the input tau. */
  readonly allocation: string;
}

/** Vehicles with their controllers. */
export interface ShownLoop {
  /** For legends: `proposed`, `PD`, ... */
  readonly label: string;
  /** Empty: only charts are shown. */
  readonly vehicles: readonly VehicleData[];
}

/** Vehicles with their controllers, ready to run. */
export interface LoopData extends ShownLoop {
  /** Its scenario for `auv-fmu run`; absent: it is only a comparison. */
  readonly scenario?: string;
  /** Indices of each vehicle: a place in `Data.measured`. */
  readonly measured: readonly number[];
  /** FMUs by component. */
  readonly components: Readonly<Record<string, string>>;
  /** Entries of a scenario file with this loop. */
  readonly head: {
    readonly order: string | readonly string[] | null;
    /** Number of closed loops in the scenario; null: one, without names of vehicles. */
    readonly vehicles: number | null;
    /** Components of the closed loop that the scenario leaves out. */
    readonly absent: readonly string[];
    /** Empty: all components. */
    readonly only: readonly string[];
    readonly wires: Readonly<Record<string, string | boolean>>;
  };
  /** Its program: numbers of the module, and in the module. */
  readonly program: readonly [number, number];
  /** Inputs and outputs of the components, in the order of the table's columns. */
  readonly ports: Readonly<
    Record<string, { readonly input: readonly string[]; readonly output: readonly string[] }>
  >;
  /** Message of each component when its state is reset, with `{}` for the time. */
  readonly restarted: Readonly<Record<string, string>>;
  /** The only step that its program can make [s]; absent: any step. */
  readonly fixedStep?: number;
  /** Row with the values that act in a step: 0: at its beginning, 1: at its end. */
  readonly actingRow: number;
  /** All parameters and unconnected inputs, in the order of the program. */
  readonly parameters: readonly Parameter[];
  /** Events by the name of the scenario that has them; `""`: none. */
  readonly events: Readonly<Record<string, readonly EventData[]>>;
}

/** Runs that are compared, and how they are drawn. */
export interface Comparison {
  /** The scenario's own loop, and its comparison, if it has one. */
  readonly loops: readonly ShownLoop[];
  /** If set, z is drawn upwards. */
  readonly zUp: boolean;
  /** Colours of several vehicles, `#rrggbb`; empty for one vehicle. */
  readonly colours: readonly string[];
  /** Colours of their references: grey if several vehicles follow the same one. */
  readonly references: readonly string[];
  /** Units of the columns that have charts, if there is no vehicle. */
  readonly columns?: Units;
}

/** A scenario of `auv-fmu list` with its comparison. */
export interface Preset extends Comparison {
  readonly name: string;
  readonly title: string;
  readonly remark: string;
  /** [s] */
  readonly stopTime: number;
  /** Communication step [s]. */
  readonly step: number;
  /** Scenario whose events happen; `""`: none. */
  readonly events: string;
  readonly loops: readonly LoopData[];
  /** Numbers of the loops in the order in which they are drawn. */
  readonly drawn: readonly number[];
}

/** Printed units by member of a group; a single number has the member `""`. */
export type Units = Readonly<Record<string, string>>;

/** An index of metrics.json. */
export interface IndexData {
  readonly name: string;
  readonly label: string;
  readonly units: Units;
  readonly meaning: string;
}

/** A reducer, which makes indices of a vehicle from rows, or numbers for rules. */
export interface ReducerData {
  /** Name in the module. */
  readonly name: string;
  readonly isIndex: boolean;
  /** Names of columns and parameters, or constants. */
  readonly takes: readonly (string | number)[];
  /** Name of the index of each result. */
  readonly gives: readonly string[];
}

/** Shape of the drawn vehicle, in shares of its length. */
export interface Hull {
  /** Distance from the nose and radius of each ring. */
  readonly rings: readonly (readonly [number, number])[];
  /** Corners of the upper fin: distance from the nose, and height above the axis. */
  readonly fin: readonly (readonly [number, number])[];
}

/** Data of every page. */
export interface Common {
  /** Units of the groups of signals that have charts. */
  readonly units: Readonly<Record<"e" | "tau" | "dy" | "theta_hat", Units>>;
  readonly indices: readonly IndexData[];
  readonly hull: Hull;
}

/** A rule for a warning. */
interface RuleData {
  /** Result of a reducer. */
  readonly number: string;
  /** Value above which it warns. */
  readonly above: number;
  /** `{name}` is the name of a parameter; `{name:g}` its value, or another result. */
  readonly text: string;
}

/** Data of the live page, besides the script and modules. */
export interface Data extends Common {
  /** The preset that is shown first. */
  readonly opened: string;
  /** Most steps that the page runs, of all vehicles together. */
  readonly mostSteps: number;
  readonly presets: readonly Preset[];
  /** Indices of vehicles. */
  readonly measured: readonly (readonly ReducerData[])[];
  readonly rules: readonly RuleData[];
}

/** Beginning or end of an event in a run. */
export interface Occurrence {
  /** [s] */
  readonly time: number;
  readonly text: string;
  /** Empty: the end of an event. */
  readonly label: string;
  /** Number of the event in the loop. */
  readonly event: number;
}

/** A run to show: rows at the start and after steps. */
export interface Run {
  /** Row with the values that act in a step: 0: at its beginning, 1: at its end. */
  readonly actingRow: number;
  /** Names of all columns after the time. */
  readonly columns: readonly string[];
  /** Number of rows. */
  readonly rows: number;
  readonly time: Float64Array;
  /** Returns a column by its name. */
  column(name: string): Float64Array;
  has(name: string): boolean;
  readonly parameters: Values;
  readonly happened: readonly Occurrence[];
  /** Indices of each vehicle; missing ones are absent. */
  readonly metrics: readonly Metrics[];
}

/** Rows and messages of a run that the page has made, as plain data. */
export interface Outcome {
  readonly rows: number;
  /** Columns one after the other, the time first. */
  readonly table: Float64Array<ArrayBuffer>;
  readonly parameters: Values;
  readonly happened: readonly Occurrence[];
  readonly metrics: readonly Metrics[];
  /** Messages of components, `controller: ...`. */
  readonly messages: readonly string[];
  /** Warnings about valid but misleading numbers. */
  readonly cautions: readonly string[];
  /** Why the run failed; it keeps the rows before that. */
  readonly failure?: string;
  /** Why it ended early without a failure. */
  readonly remark?: string;
}

/** A run that the page has made: rows at t = 0 and after each step, and all ports but `faults`. */
export interface Result extends Run, Outcome {
  /** Outputs that are 0 in every row, by the number of columns before them in result.csv. */
  readonly faults: ReadonlyMap<number, string>;
}

/** Options of a run. */
export interface Options {
  /** [s] */
  readonly stopTime: number;
  /** [s] */
  readonly step: number;
  readonly events?: readonly EventData[];
  /** Memory of a table that is no longer shown, which the run may reuse. */
  readonly spare?: ArrayBuffer | undefined;
}

/** Members of each index, by index, in the order of `IndexData.units`. */
export type Metrics = Readonly<Record<string, readonly number[]>>;

/** A run whose rows are in the page: its columns one after the other, the time first. */
export interface StoredRun extends ShownLoop {
  readonly actingRow: number;
  readonly rows: number;
  /** Columns of doubles. */
  readonly doubles: readonly string[];
  /** Columns in single precision. */
  readonly singles: readonly string[];
  readonly parameters: Values;
  readonly happened: readonly Occurrence[];
  readonly metrics: readonly Metrics[];
}

/** Data of a page of stored runs, besides the script and rows. */
export interface StoredData extends Common, Comparison {
  readonly loops: readonly StoredRun[];
}
