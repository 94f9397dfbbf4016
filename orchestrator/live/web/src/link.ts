// Settings in the address of the page: the preset and its changes, after `#`.
import {
  type Edit,
  eventOf,
  fleetOf,
  parametersOf,
  presetOf,
  type Settings,
  untouched,
  withEdit,
  withValues,
} from "./settings";
import { isDuration, isTime } from "./simulate";
import { didYouMean } from "./suggest";
import { numberOf } from "./text";
import type { Data, EventData, Parameter, Value } from "./types";

const PRESET = "preset";
const STOP_TIME = "stop_time";
const STEP = "step";
const EVENTS = "events";
const HIDDEN = "hide";
const VEHICLE = "vehicle";
const TIME = "time";

/** Value of an unlimited duration in a link. */
const FOR_GOOD = "always";

/** Name of an edited time or duration of an event: `events.1.at`, counted from 1. */
const EDIT = /^events\.([1-9]\d*)\.(at|for)$/;

export function toHash(settings: Settings, data: Data): string {
  const preset = presetOf(data, settings.preset);
  if (!preset) return "";
  const fields: [string, string][] = [[PRESET, settings.preset]];
  for (const [name, value] of Object.entries(settings.values)) fields.push([name, String(value)]);
  if (settings.stopTime !== preset.stopTime) fields.push([STOP_TIME, String(settings.stopTime)]);
  if (settings.step !== preset.step) fields.push([STEP, String(settings.step)]);
  if (settings.events !== preset.events) fields.push([EVENTS, settings.events]);
  for (const [number, { at, lasts }] of Object.entries(settings.edits)) {
    const name = `${EVENTS}.${Number(number) + 1}`;
    if (at !== undefined) fields.push([`${name}.at`, String(at)]);
    if (lasts !== undefined) fields.push([`${name}.for`, lasts === null ? FOR_GOOD : `${lasts}`]);
  }
  for (const label of settings.hidden) fields.push([HIDDEN, label]);
  if (settings.vehicle !== fleetOf(preset)[0]) fields.push([VEHICLE, settings.vehicle]);
  // Invalid numbers in fields are left out.
  const sent = fields.filter(([, value]) => value !== "NaN");
  return `#${sent.map(([key, value]) => `${encode(key)}=${encode(value)}`).join("&")}`;
}

/** Settings of a link. */
interface Found {
  readonly settings: Settings;
  /** Time to show [s]; absent: the run is played from its start. */
  readonly time?: number;
  /** Fields that are not understood. */
  readonly unknown: string[];
}

/** Reads settings from a link. */
export function fromHash(hash: string, data: Data): Found {
  const fields = [...new URLSearchParams(hash.replace(/^#/, ""))];
  const presets = fields.filter(([key]) => key === PRESET).map(([, name]) => name);
  const [wanted = data.opened, ...others] = presets;
  const preset = presetOf(data, wanted) ?? presetOf(data, data.opened) ?? data.presets[0];
  const parameters = parametersOf(preset);
  const lost = wanted === preset.name ? others : presets;
  const unknown = lost.map((name) => `${PRESET}=${name}`);
  const values: Record<string, Value> = {};
  const edited: [string, string][] = [];
  const hidden: string[] = [];
  let { stopTime, step, events, vehicle } = untouched(preset);
  let time: number | undefined;
  for (const [key, text] of fields) {
    const parameter = parameters.get(key);
    const edit = EDIT.test(key);
    const number = numberOf(text);
    const value = parameter && parsed(parameter, text);
    if (key === PRESET) continue;
    if (parameter && value !== undefined) values[key] = value;
    else if (key === STOP_TIME && Number.isFinite(number)) stopTime = number;
    else if (key === STEP && Number.isFinite(number)) step = number;
    else if (key === TIME && isTime(number)) time = number;
    else if (key === EVENTS && (text === "" || Object.hasOwn(preset.loops[0].events, text)))
      events = text;
    else if (key === VEHICLE && fleetOf(preset).includes(text)) vehicle = text;
    else if (edit) edited.push([key, text]);
    else if (key === HIDDEN && (text === "" || hidden.includes(text))) continue;
    else if (key === HIDDEN && preset.loops.some(({ label }) => label === text)) hidden.push(text);
    else unknown.push(`${key}=${text}`);
  }
  const { name } = preset;
  const none = { values: {}, edits: {} };
  let settings: Settings = { preset: name, ...none, stopTime, step, events, hidden, vehicle };
  settings = withValues(settings, preset, values);
  // The set of events is known only after all fields were read.
  for (const [key, text] of edited) {
    const [, counted, kind] = EDIT.exec(key) ?? [];
    const number = Number(counted) - 1;
    const event = eventOf(preset, events, number);
    const edit = event && editOf(event, kind, text);
    if (edit) settings = withEdit(settings, preset, number, edit);
    else unknown.push(`${key}=${text}`);
  }
  return { settings, unknown, ...(time === undefined ? {} : { time }) };
}

/** Returns a field that is not understood, with names that it may have meant. */
export function suggested(field: string, settings: Settings, data: Data): string {
  const [key, text] = field.split("=", 2);
  const preset = presetOf(data, settings.preset) ?? data.presets[0];
  const texts: Record<string, Iterable<string>> = {
    [PRESET]: data.presets.map(({ name }) => name),
    [EVENTS]: Object.keys(preset.loops[0].events),
    [HIDDEN]: preset.loops.map(({ label }) => label),
    [VEHICLE]: fleetOf(preset),
  };
  const names = [...parametersOf(preset).keys(), ...Object.keys(texts), STOP_TIME, STEP, TIME];
  if (key in texts) return field + didYouMean(text, texts[key]);
  return names.includes(key) ? field : field + didYouMean(key, names);
}

/** Reads a change of an event's time or duration; undefined: it is not valid in a scenario file. */
function editOf(event: EventData, kind: string, text: string): Edit | undefined {
  const time = numberOf(text);
  if (kind === "at") return isTime(time) && event.at !== undefined ? { at: time } : undefined;
  if (!event.canEnd) return undefined;
  if (text === FOR_GOOD) return { lasts: null };
  return isDuration(time) ? { lasts: time } : undefined;
}

/** Reads a text in the type of a parameter; undefined: it is not of this type. */
export function parsed(parameter: Parameter, text: string): Value | undefined {
  if (parameter.choices) return Object.hasOwn(parameter.choices, text) ? text : undefined;
  if (parameter.type === "Boolean") {
    return text === "true" ? true : text === "false" ? false : undefined;
  }
  const number = numberOf(text);
  return Number.isFinite(number) ? number : undefined;
}

/** Encodes a text for a link; brackets and dots stay readable. */
function encode(text: string): string {
  return encodeURIComponent(text).replaceAll("%5B", "[").replaceAll("%5D", "]");
}
