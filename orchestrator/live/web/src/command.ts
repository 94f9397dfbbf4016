// Settings as what a user types: `auv-fmu run`, and a file of events where they are changed.

import { eventsOf, hasOtherEvents, type Settings } from "./settings";
import type { Action, EventData, LoopData, Preset, Value } from "./types";

/** Marks the end of the file of events in the shell. */
const END = "EVENTS";

/** A command that makes the rows of a loop; a loop without a scenario has none. */
export function commandLine(settings: Settings, preset: Preset, loop: LoopData): string {
  const names = new Set(loop.parameters.map(({ name }) => name));
  const words = ["auv-fmu", "run", loop.scenario ?? preset.name];
  for (const [name, value] of Object.entries(settings.values)) {
    if (names.has(name)) words.push("--set", quoted(`${name}=${value}`));
  }
  if (settings.stopTime !== preset.stopTime) words.push("--stop-time", String(settings.stopTime));
  if (settings.step !== preset.step) words.push("--step", String(settings.step));
  if (!hasOtherEvents(settings, preset)) return words.join(" ");
  const file = `${preset.name}-events.toml`;
  const text = toToml(eventsOf(settings, loop));
  return `cat > ${file} <<'${END}'\n${text}${END}\n${[...words, "--events", file].join(" ")}`;
}

/** A word of a shell's command line. */
function quoted(word: string): string {
  return /^[\w.=+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

/** A file of events; without any it says so. */
export function toToml(events: readonly EventData[]): string {
  if (events.length === 0) return "events = []\n";
  return events.map(toTable).join("\n");
}

function toTable(event: EventData): string {
  const entries: [string, string][] = [];
  if (event.at !== undefined) entries.push(["at", literal(event.at)]);
  if (event.when) {
    const { signal, comparison, value } = event.when;
    entries.push(["when", literal(`${signal} ${comparison} ${value}`)]);
  }
  if (event.repeat) entries.push(["repeat", "true"]);
  if (event.lasts !== undefined) entries.push(["for", literal(event.lasts)]);
  entries.push(acting(event.action), ["label", literal(event.label)]);
  return `[[events]]\n${entries.map(([key, value]) => `${key} = ${value}\n`).join("")}`;
}

function acting(action: Action): [string, string] {
  switch (action.kind) {
    case "alter":
      return [action.effect, table(action.values)];
    case "set":
      return ["set", table([...action.parameters, ...action.inputs])];
    case "freeze":
    case "release":
      return [action.kind, list(action.targets)];
    case "reset":
      return ["reset", list(action.components)];
    case "stop":
      return ["stop", "true"];
  }
}

function table(values: readonly (readonly [string, Value])[]): string {
  return `{ ${values.map(([name, value]) => `"${name}" = ${literal(value)}`).join(", ")} }`;
}

function list(names: readonly string[]): string {
  return `[${names.map((name) => literal(name)).join(", ")}]`;
}

/** A value of TOML; JSON writes texts and truth values as TOML does. */
function literal(value: Value): string {
  return typeof value === "number" && value === 0 ? "0" : JSON.stringify(value);
}
