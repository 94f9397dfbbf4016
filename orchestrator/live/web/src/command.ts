// Settings as a command line of `auv-fmu run`, with the files that it needs.

import { eventsOf, hasOtherEvents, type Settings } from "./settings";
import type { Action, EventData, LoopData, Preset, Value } from "./types";

/** Mark of the end of a file in the shell. */
const END = "END";

/** Returns the command that makes the rows of a loop. */
export function commandLine(settings: Settings, preset: Preset, loop: LoopData): string {
  if (loop.scenario === undefined) return ownScenario(settings, preset, loop);
  const names = new Set(loop.parameters.map(({ name }) => name));
  const words = ["auv-fmu", "run", quoted(loop.scenario)];
  for (const [name, value] of Object.entries(settings.values)) {
    if (names.has(name)) words.push("--set", quoted(`${name}=${value}`));
  }
  if (settings.stopTime !== preset.stopTime) words.push("--stop-time", String(settings.stopTime));
  if (settings.step !== preset.step) words.push("--step", String(settings.step));
  if (!hasOtherEvents(settings, preset)) return words.join(" ");
  const file = fileName(`${preset.name}-events`);
  const events = toToml(eventsOf(settings, loop));
  return written(file, events || "events = []\n", [...words, "--events", file]);
}

/** Returns the command for a loop that is only a comparison, with its own scenario file. */
function ownScenario(settings: Settings, preset: Preset, loop: LoopData): string {
  const file = fileName(`${preset.name}-${loop.label}`);
  const components = Object.entries(loop.components).map(
    ([name, type]) => `${key(name)} = ${literal(type)}\n`,
  );
  const { order, vehicles, absent, only, wires } = loop.head;
  components.push(...absent.map((name) => `${key(name)} = false\n`));
  const wired = Object.entries(wires).map(([to, from]) => `"${to}" = ${literal(from)}\n`);
  const parameters = loop.parameters.flatMap(({ name, value, default: own }) => {
    const wanted = settings.values[name] ?? value;
    return wanted === own ? [] : [`"${name}" = ${literal(wanted)}\n`];
  });
  const text = [
    `title = ${literal(`${preset.name} with the ${loop.label} controller`)}\n`,
    `stop_time = ${literal(settings.stopTime)}\n`,
    `step = ${literal(settings.step)}\n`,
    vehicles === null ? "" : `vehicles = ${vehicles}\n`,
    order === null ? "" : `order = ${typeof order === "string" ? literal(order) : list(order)}\n`,
    only.length > 0 ? `only = ${list(only)}\n` : "",
    `\n[components]\n${components.join("")}`,
    wired.length > 0 ? `\n[wires]\n${wired.join("")}` : "",
    `\n[parameters]\n${parameters.join("")}`,
    `\n${toToml(eventsOf(settings, loop))}`,
  ].join("");
  return written(file, text.trimEnd().concat("\n"), ["auv-fmu", "run", file]);
}

/** Returns shell commands that write a file, then run a command. */
function written(file: string, text: string, command: readonly string[]): string {
  return `cat > ${file} <<'${END}'\n${text}${END}\n${command.join(" ")}`;
}

/** Returns a file name that needs no quotes. */
function fileName(stem: string): string {
  return `${stem.replaceAll(/[^\w.-]+/g, "-").replace(/^-/, "")}.toml`;
}

/** Quotes a word for the shell, if needed. */
function quoted(word: string): string {
  return /^[\w.=+/-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

/** Returns events as tables of a scenario file. */
export function toToml(events: readonly EventData[]): string {
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
  return `[[events]]\n${entries.map(([name, value]) => `${name} = ${value}\n`).join("")}`;
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

/** Returns a name as a key of TOML, quoted if dots would make it a table. */
function key(name: string): string {
  return /^[\w-]+$/.test(name) ? name : literal(name);
}

/** Returns a value in TOML, which has the same texts and Booleans as JSON. */
function literal(value: Value): string {
  return typeof value === "number" && value === 0 ? "0" : JSON.stringify(value);
}
