// Settings of the user: a preset and its changes.

import type {
  Comparison,
  Data,
  EventData,
  LoopData,
  Parameter,
  Preset,
  Value,
  Values,
  VehicleData,
} from "./types";

/** Changed time or duration of an event [s]; `lasts` null: until the run ends. */
export interface Edit {
  readonly at?: number;
  readonly lasts?: number | null;
}

/** Values by `component.parameter`; undefined: back to the preset's value. */
export type Changes = Readonly<Record<string, Value | undefined>>;

export interface Settings {
  readonly preset: string;
  /** Values that differ from the preset's. */
  readonly values: Values;
  /** [s] */
  readonly stopTime: number;
  /** [s] */
  readonly step: number;
  /** Scenario whose events happen; `""`: none. */
  readonly events: string;
  /** Changes of these events, by number from 0. */
  readonly edits: Readonly<Record<number, Edit>>;
  /** Labels of hidden controllers. */
  readonly hidden: readonly string[];
  /** Vehicle of the charts, indices and sliders. */
  readonly vehicle: string;
}

export function presetOf(data: Data, name: string): Preset | undefined {
  return data.presets.find((preset) => preset.name === name);
}

/** Returns the names of the vehicles in a comparison. */
export function fleetOf({ loops }: Comparison): readonly string[] {
  return loops[0].vehicles.map(({ name }) => name);
}

/** Returns the names in a text for the components of a vehicle; the text has a single vehicle's. */
export function namedFor(vehicle: VehicleData, text: string): string {
  const names = { ...vehicle, plant: vehicle.vehicle };
  return text.replace(
    /\b(plant|controller|planner|disturbance)(?=\.)/,
    (role) => names[role as keyof typeof names],
  );
}

/** Returns the settings of a preset without changes. */
export function untouched(preset: Preset): Settings {
  const { name, stopTime, step, events } = preset;
  return {
    preset: name,
    values: {},
    stopTime,
    step,
    events,
    edits: {},
    hidden: [],
    vehicle: fleetOf(preset)[0],
  };
}

/** Returns the parameters of all loops of a preset, each once with the value of the first loop. */
export function parametersOf(preset: Preset): ReadonlyMap<string, Parameter> {
  const found = new Map<string, Parameter>();
  for (const loop of preset.loops) {
    for (const parameter of loop.parameters) {
      if (!found.has(parameter.name)) found.set(parameter.name, parameter);
    }
  }
  return found;
}

/** Returns settings with changed values; undefined, or the value of all loops, undoes a change. */
export function withValues(settings: Settings, preset: Preset, changed: Changes): Settings {
  const values: Record<string, Value> = { ...settings.values };
  const all = preset.loops.flatMap(({ parameters }) => parameters);
  for (const [name, value] of Object.entries(changed)) {
    const isOwn = all.filter((one) => one.name === name).every((one) => one.value === value);
    if (value === undefined || isOwn) delete values[name];
    else values[name] = value;
  }
  return { ...settings, values };
}

/** Returns an event of a scenario by its number, from the preset's own loop. */
export function eventOf(preset: Preset, events: string, number: number): EventData | undefined {
  return preset.loops[0].events[events]?.find((event) => event.number === number);
}

/** Returns settings with a change of an event; its own times undo a change. */
export function withEdit(settings: Settings, preset: Preset, number: number, edit: Edit): Settings {
  const event = eventOf(preset, settings.events, number);
  if (!event) return settings;
  const kept: { at?: number; lasts?: number | null } = { ...settings.edits[number], ...edit };
  if (kept.at === event.at) delete kept.at;
  if (kept.lasts === (event.lasts ?? null)) delete kept.lasts;
  const edits: Record<number, Edit> = { ...settings.edits, [number]: kept };
  if (Object.keys(kept).length === 0) delete edits[number];
  return { ...settings, edits };
}

/** Returns the events of a loop with their edited times. */
export function eventsOf(settings: Settings, loop: LoopData): readonly EventData[] {
  const events = loop.events[settings.events] ?? [];
  return events.map((event) => {
    const { at, lasts } = settings.edits[event.number] ?? {};
    const edited = { ...event, ...(at === undefined ? {} : { at }) };
    if (lasts === null) {
      const { lasts: _, ...forGood } = edited;
      return forGood;
    }
    return lasts === undefined ? edited : { ...edited, lasts };
  });
}

/** Tells whether the events differ from the preset's. */
export function hasOtherEvents(settings: Settings, preset: Preset): boolean {
  return settings.events !== preset.events || Object.keys(settings.edits).length > 0;
}
