// What happens to a run from outside, in numbers for its program, and in words.
import { type Experiment, isDuration, isTime, Refusal } from "./experiment";
import type { Agenda } from "./program";
import type { Action, EventData, Occurrence } from "./types";

/** How often the same event is listed: a condition may chatter for ever. */
const MOST_LISTED = 1000;

/** Numbers of an event, of an action, and of what has happened once. */
const [EVENT, ACTION, LISTED] = [13, 4, 3];

/** In the order of their numbers. */
const KINDS = ["override", "bias", "freeze", "release", "set", "reset", "stop"];
const COMPARISONS = ["<", "<=", ">", ">="];

/** Numbers of what there is in a loop, by their names. */
export interface Places {
  readonly columns: ReadonlyMap<string, number>;
  readonly inputs: ReadonlyMap<string, number>;
  readonly parameters: ReadonlyMap<string, number>;
  readonly components: ReadonlyMap<string, number>;
}

/** The component and the port of a name: either may have dots, the longest component counts. */
export function parted(
  name: string,
  components: { has(component: string): boolean },
): [string, string] {
  let dot = name.lastIndexOf(".");
  while (dot > 0 && !components.has(name.slice(0, dot))) dot = name.lastIndexOf(".", dot - 1);
  return [name.slice(0, dot), name.slice(dot + 1)];
}

function placeOf(places: ReadonlyMap<string, number>, name: string): number {
  const found = places.get(name);
  if (found === undefined) throw new Error(`there is no ${name}`);
  return found;
}

/** Kind, place and value of each thing that an event does. */
function actionsOf(action: Action, { inputs, parameters, components }: Places): number[][] {
  const { kind } = action;
  const known = (name: string) => KINDS.indexOf(name);
  switch (kind) {
    case "alter":
      return action.values.map(([target, value]) => [
        known(action.effect),
        placeOf(inputs, target),
        Number(value),
      ]);
    case "freeze":
    case "release":
      return action.targets.map((target) => [known(kind), placeOf(inputs, target), 0]);
    case "set":
      return [...action.parameters, ...action.inputs].map(([target, value]) => [
        known(kind),
        placeOf(parameters, target),
        Number(value),
      ]);
    case "reset":
      return action.components.map((name) => [known(kind), placeOf(components, name), 0]);
    case "stop":
      return [[known(kind), 0, 0]];
  }
}

/** Events in numbers, in the order in which they act at the same time. */
export function agendaOf(events: readonly EventData[], places: Places): Agenda {
  const rows = new Float64Array(events.length * EVENT);
  const actions: number[] = [];
  events.forEach(({ at, when, repeat, lasts, label, action }, i) => {
    if (!isTime(at ?? 0)) throw new Refusal(`${label}: its time must be a number, 0 or more`);
    if (!isDuration(lasts ?? 1)) throw new Refusal(`${label}: it must last for more than 0 s`);
    const first = actions.length / ACTION;
    for (const one of actionsOf(action, places)) actions.push(...one, 0);
    const condition = when
      ? [placeOf(places.columns, when.signal), COMPARISONS.indexOf(when.comparison), when.value]
      : [0, 0, 0];
    const timed = [Number(at !== undefined), at ?? 0];
    const last = actions.length / ACTION;
    rows.set([...timed, ...condition, Number(repeat ?? false), lasts ?? 0, first, last], i * EVENT);
  });
  const listed = 1 + events.length * MOST_LISTED * LISTED;
  return { n: events.length, events: rows, actions: Float64Array.from(actions), listed };
}

/** What has happened, in words. */
export function occurrences(
  events: readonly EventData[],
  happened: Float64Array,
  experiment: Experiment,
): Occurrence[] {
  const listed = events.map(() => 0);
  return Array.from({ length: happened[0] }, (_, k) => {
    const [event, step, ends] = happened.subarray(1 + k * LISTED);
    listed[event] += 1;
    const rest = listed[event] === MOST_LISTED ? "; later occurrences are not listed" : "";
    const { text, label } = events[event];
    return {
      time: experiment.time(step),
      text: (ends ? `${text}, ended` : text) + rest,
      label: ends ? "" : label,
      event,
    };
  });
}

/** Why an event has ended a run. */
export function whyEnded(events: readonly EventData[], happened: readonly Occurrence[]): string {
  const { action } = events[happened[happened.length - 1].event];
  return action.kind === "stop" ? action.why : "";
}
