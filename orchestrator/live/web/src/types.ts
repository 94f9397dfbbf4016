// What Python hands to the page, and what the engine hands to those who draw.

/** A value of a port or parameter. */
export type Value = number | boolean | string;

/** Values by `component.parameter`. */
export type Values = Readonly<Record<string, Value>>;

export type FmiType = "Real" | "Integer" | "Boolean" | "Enumeration";

/** A parameter that a user may change. */
export interface Parameter {
  /** `component.parameter` */
  readonly name: string;
  readonly type: FmiType;
  /** As it is printed. */
  readonly unit?: string;
  readonly min?: number;
  readonly max?: number;
  /** Of an Enumeration: the numbers of its names, of which its value is one. */
  readonly choices?: Readonly<Record<string, number>>;
  /** The FMU's own value. */
  readonly default: Value;
  /** The value in this preset. */
  readonly value: Value;
  readonly description: string;
}

/** Names of ports with values. */
export type Assignments = readonly (readonly [string, Value])[];

/** What an event does; names are `component.port`. */
export type Action =
  | { readonly kind: "alter"; readonly effect: "override" | "bias"; readonly values: Assignments }
  | { readonly kind: "freeze"; readonly targets: readonly string[] }
  | { readonly kind: "release"; readonly targets: readonly string[] }
  | { readonly kind: "set"; readonly parameters: Assignments; readonly inputs: Assignments }
  | { readonly kind: "reset"; readonly components: readonly string[] }
  | { readonly kind: "stop"; readonly why: string };

/** A signal compared with a number. */
export interface Condition {
  readonly signal: string;
  readonly comparison: "<" | "<=" | ">" | ">=";
  readonly value: number;
}

/** Something that happens from outside, at a time or when a condition becomes true. */
export interface EventData {
  /** Its place among the scenario's events, from 0; not all of them can happen to every loop. */
  readonly number: number;
  /** What happens, in words. */
  readonly text: string;
  /** Its name in figures. */
  readonly label: string;
  readonly action: Action;
  /** [s] */
  readonly at?: number;
  readonly when?: Condition;
  /** Whether it happens each time that the condition becomes true. */
  readonly repeat?: boolean;
  /** For how long [s]; absent: for good. */
  readonly lasts?: number;
  /** Whether there is something that can end. */
  readonly canEnd: boolean;
}

/** A vehicle: its components by their roles; what it lacks has a name that no component has. */
export interface VehicleData {
  readonly name: string;
  readonly vehicle: string;
  readonly controller: string;
  readonly planner: string;
  readonly disturbance: string;
  /** What commands the actuators of a vehicle that takes no tau. */
  readonly allocation: string;
}

/** Vehicles with their controllers. */
export interface ShownLoop {
  /** For legends: `proposed`, `PD`, ... */
  readonly label: string;
  /** At least one; none: only charts are shown. */
  readonly vehicles: readonly VehicleData[];
}

/** Vehicles with their controllers, ready to be run. */
export interface LoopData extends ShownLoop {
  /** The scenario that `auv-fmu run` knows it by; absent: it has none of its own. */
  readonly scenario?: string;
  /** What is measured of each vehicle, by its place in `Data.measured`. */
  readonly measured: readonly number[];
  /** FMUs by the names of the components. */
  readonly components: Readonly<Record<string, string>>;
  /** Entries of a scenario file with this loop. */
  readonly head: {
    readonly order: string | readonly string[] | null;
    /** How many times the scenario has the closed loop; null: once, without names of vehicles. */
    readonly vehicles: number | null;
    /** Components that the scenario takes out of the closed loop. */
    readonly absent: readonly string[];
    /** Empty: all components. */
    readonly only: readonly string[];
    readonly wires: Readonly<Record<string, string | boolean>>;
  };
  /** The place of its program: a module, and a number there. */
  readonly program: readonly [number, number];
  /** Inputs and outputs of the components, in the order of the table's columns. */
  readonly ports: Readonly<
    Record<string, { readonly input: readonly string[]; readonly output: readonly string[] }>
  >;
  /** What each component says when its state is started over, with `{}` for the time. */
  readonly restarted: Readonly<Record<string, string>>;
  /** The only step that its program can make [s]; absent: any. */
  readonly fixedStep?: number;
  /** In which row what acts in a step stands: 0, that of its beginning, or 1, that of its end. */
  readonly actingRow: number;
  /** All parameters, and inputs that nothing feeds, in the order in which the program takes them. */
  readonly parameters: readonly Parameter[];
  /** Events by the name of the scenario that has them; `""`: none. */
  readonly events: Readonly<Record<string, readonly EventData[]>>;
}

/** Runs beside each other, and how they are drawn. */
export interface Comparison {
  /** The scenario's own loop, and the one that it is compared with, if there is one. */
  readonly loops: readonly ShownLoop[];
  /** Whether z is drawn upwards. */
  readonly zUp: boolean;
  /** A colour for each of several vehicles, `#rrggbb`; of a single one, none. */
  readonly colours: readonly string[];
  /** The same for their references: a grey where several vehicles follow the same one. */
  readonly references: readonly string[];
  /** Columns that have charts where there is no vehicle, with their units. */
  readonly columns?: Units;
}

/** A scenario of `auv-fmu list`, with its comparison beside it. */
export interface Preset extends Comparison {
  readonly name: string;
  readonly title: string;
  readonly remark: string;
  /** [s] */
  readonly stopTime: number;
  /** Communication step [s]. */
  readonly step: number;
  /** The scenario whose events happen; `""`: none. */
  readonly events: string;
  readonly loops: readonly LoopData[];
  /** Places of the loops, in the order in which they are drawn. */
  readonly drawn: readonly number[];
}

/** Units as they are printed, by the members of a group; a single number has the member `""`. */
export type Units = Readonly<Record<string, string>>;

/** An index of metrics.json. */
export interface IndexData {
  readonly name: string;
  readonly label: string;
  readonly units: Units;
  readonly meaning: string;
}

/** What makes indices of the rows of a vehicle. */
export interface ReducerData {
  /** In the module. */
  readonly name: string;
  /** Columns and parameters by their names, and what never changes. */
  readonly takes: readonly (string | number)[];
  /** The index that each number is a member of, by its name. */
  readonly gives: readonly string[];
}

/** The shape of the drawn vehicle, in shares of its length. */
export interface Hull {
  /** Distance from the nose and radius of each ring. */
  readonly rings: readonly (readonly [number, number])[];
  /** Corners of the upper fin: distance from the nose, and height above the axis. */
  readonly fin: readonly (readonly [number, number])[];
}

/** What Python writes into a page that shows runs, wherever they come from. */
export interface Common {
  /** Of the groups of signals that have charts. */
  readonly units: Readonly<Record<"e" | "tau" | "dy" | "theta_hat", Units>>;
  readonly indices: readonly IndexData[];
  readonly hull: Hull;
}

/** All that Python writes into the live page, besides script and modules. */
export interface Data extends Common {
  /** The preset that is shown first. */
  readonly opened: string;
  /** Rows of more steps than this, of all vehicles together, do not fit into a page. */
  readonly mostSteps: number;
  readonly presets: readonly Preset[];
  /** For vehicles. */
  readonly measured: readonly (readonly ReducerData[])[];
}

/** Something that has happened in a run. */
export interface Occurrence {
  /** [s] */
  readonly time: number;
  readonly text: string;
  /** Empty: it is only the end of an event. */
  readonly label: string;
  /** Which of the loop's events it is. */
  readonly event: number;
}

/** What is shown of a run: rows at the start and after steps. */
export interface Run {
  /** In which row what acts in a step stands: 0, that of its beginning, or 1, that of its end. */
  readonly actingRow: number;
  /** Names of all columns after the time. */
  readonly columns: readonly string[];
  /** How many rows there are. */
  readonly rows: number;
  readonly time: Float64Array;
  /** A column by its name; made once. */
  column(name: string): Float64Array;
  has(name: string): boolean;
  /** Values of parameters, as they were set. */
  readonly parameters: Values;
  readonly happened: readonly Occurrence[];
  /** Indices of each vehicle; what is not there is absent. */
  readonly metrics: readonly Metrics[];
}

/** A run that the page has made: rows at t = 0 and after each step, and all ports but `faults`. */
export interface Result extends Run {
  /** Outputs that are 0 in every row, and stand in result.csv after so many columns. */
  readonly faults: ReadonlyMap<number, string>;
  /** Row by row: the time, then the columns. */
  readonly table: Float64Array;
  /** What components say, `controller: ...`. */
  readonly messages: readonly string[];
  /** Why the run has not come to its end; the rows before that are there. */
  readonly failure?: string;
  /** Why it has ended early without a failure. */
  readonly remark?: string;
}

/** What a run is asked for besides its values. */
export interface Options {
  /** [s] */
  readonly stopTime: number;
  /** [s] */
  readonly step: number;
  readonly events?: readonly EventData[];
  /** A result that nothing shows any more: the run takes its memory. */
  readonly spare?: Result | undefined;
}

/** Members of each index by its name, in the order of `IndexData.units`. */
export type Metrics = Readonly<Record<string, readonly number[]>>;

/** A run whose rows stand in the page: its columns one after the other, the time first. */
export interface StoredRun extends ShownLoop {
  readonly actingRow: number;
  readonly rows: number;
  /** Columns of doubles; all others have single precision. */
  readonly doubles: readonly string[];
  readonly singles: readonly string[];
  readonly parameters: Values;
  readonly happened: readonly Occurrence[];
  readonly metrics: readonly Metrics[];
}

/** All that Python writes into a page of stored runs, besides script and rows. */
export interface StoredData extends Common, Comparison {
  readonly loops: readonly StoredRun[];
}
