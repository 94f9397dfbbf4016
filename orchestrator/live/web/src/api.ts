// The interface for scripts: `auvfmu.set({"controller.k_d": 30})`, `auvfmu.csv()`.

import { fromHash, toHash } from "./link";
import { eventsOf, presetOf, type Settings, untouched } from "./settings";
import { type Engine, Refusal } from "./simulate";
import { csv } from "./text";
import type { Data, Result, Value } from "./types";

export interface Api {
  /**
   * Changes settings, runs, and draws. Names are those in links: `component.parameter`,
   * `stop_time`, `step`, `events` (which resets edits of events), `hide`, `vehicle`, and `preset`
   * (which resets all settings). Refused settings change nothing.
   */
  set(changes: Readonly<Record<string, Value>>): Promise<void>;
  /** Returns the rows of the scenario's own loop, in the format of result.csv. */
  csv(): Promise<string>;
}

/** Owner of the settings: the page, or a plain object without a page. */
interface Keeper {
  readonly settings: Settings;
  apply(settings: Settings): void;
}

/** Returns settings with changes. */
function changed(
  settings: Settings,
  data: Data,
  changes: Readonly<Record<string, Value>>,
): Settings {
  // A named preset resets all settings.
  const fields = new URLSearchParams("preset" in changes ? "" : toHash(settings, data).slice(1));
  if ("events" in changes) {
    for (const key of [...fields.keys()]) if (key.startsWith("events.")) fields.delete(key);
  }
  for (const [name, value] of Object.entries(changes)) fields.set(name, String(value));
  const found = fromHash(fields.toString(), data);
  if (found.unknown.length > 0) throw new Refusal(`not understood: ${found.unknown.join(", ")}`);
  return found.settings;
}

/** Runs each loop that is shown; if all are hidden, the scenario's own. */
function* runs(data: Data, engine: Engine, settings: Settings): Generator<Result> {
  const { preset, values, stopTime, step, hidden } = settings;
  const { loops } = presetOf(data, preset) ?? data.presets[0];
  const shown = loops.filter(({ label }) => !hidden.includes(label));
  for (const loop of shown.length > 0 ? shown : loops.slice(0, 1)) {
    yield engine.run(loop, values, { stopTime, step, events: eventsOf(settings, loop) });
  }
}

/** Makes the interface for scripts. */
export function makeApi(data: Data, engine: Engine, keeper: Keeper): Api {
  return {
    async set(changes) {
      const settings = changed(keeper.settings, data, changes ?? {});
      // A run that is refused throws before the settings are applied.
      Array.from(runs(data, engine, settings));
      keeper.apply(settings);
    },
    async csv() {
      const [own] = runs(data, engine, { ...keeper.settings, hidden: [] });
      return csv(own);
    },
  };
}

/** Makes the interface without a page. */
export function apiWithoutPage(data: Data, engine: Engine): Api {
  const opened = presetOf(data, data.opened) ?? data.presets[0];
  let settings = untouched(opened);
  const apply = (taken: Settings) => {
    settings = taken;
  };
  return makeApi(data, engine, {
    get settings() {
      return settings;
    },
    apply,
  });
}
