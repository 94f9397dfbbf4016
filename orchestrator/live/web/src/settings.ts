// What a user has set: a preset, and what differs from it.

import type {
  Comparison,
  Data,
  EventData,
  LoopData,
  Parameter,
  Preset,
  Value,
  Values,
} from "./types";

/** A changed time or duration of an event; `lasts` null: for good [s]. */
export interface Edit {
  readonly at?: number;
  readonly lasts?: number | null;
}

/** Values by `component.parameter`; undefined: the preset's own again. */
export type Changes = Readonly<Record<string, Value | undefined>>;

export interface Settings {
  readonly preset: string;
  /** Values that differ from the preset's. */
  readonly values: Values;
  /** [s] */
  readonly stopTime: number;
  /** [s] */
  readonly step: number;
  /** The scenario whose events happen; `""`: none. */
  readonly events: string;
  /** Changes of these events, by their numbers from 0. */
  readonly edits: Readonly<Record<number, Edit>>;
  /** Labels of controllers that are not shown. */
  readonly hidden: readonly string[];
  /** The vehicle that charts, indices and sliders are of. */
  readonly vehicle: string;
}

export function presetOf(data: Data, name: string): Preset | undefined {
  return data.presets.find((preset) => preset.name === name);
}

/** The names of the vehicles of runs that are compared. */
export function fleetOf({ loops }: Comparison): readonly string[] {
  return loops[0].vehicles.map(({ name }) => name);
}

/** A preset as it is. */
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

/** All parameters that a preset's loops have, each once; the first loop's values count. */
export function parametersOf(preset: Preset): ReadonlyMap<string, Parameter> {
  const found = new Map<string, Parameter>();
  for (const loop of preset.loops) {
    for (const parameter of loop.parameters) {
      if (!found.has(parameter.name)) found.set(parameter.name, parameter);
    }
  }
  return found;
}

/** Settings with other values; undefined, and a value that every loop has anyway, is no change. */
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

/** An event of a scenario by its number, as the preset's own loop has it. */
export function eventOf(preset: Preset, events: string, number: number): EventData | undefined {
  return preset.loops[0].events[events]?.find((event) => event.number === number);
}

/** Settings with a change of an event; the event's own times are no change. */
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

/** The events of a loop, at the times that are set. */
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

/** Whether the events are other than the preset's. */
export function hasOtherEvents(settings: Settings, preset: Preset): boolean {
  return settings.events !== preset.events || Object.keys(settings.edits).length > 0;
}
