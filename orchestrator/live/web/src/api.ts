// The interface for scripts: `auvfmu.set({"controller.k_d": 30})`, `auvfmu.csv()`.

import { fromHash, suggested, toHash } from "./link";
import { eventsOf, presetOf, type Settings, untouched } from "./settings";
import { Refusal, type Runner } from "./simulate";
import { csv } from "./text";
import type { Data, LoopData, Value } from "./types";

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
  apply(settings: Settings): void | Promise<void>;
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
  const unknown = found.unknown.map((field) => suggested(field, found.settings, data));
  if (unknown.length > 0) throw new Refusal(`not understood: ${unknown.join(", ")}`);
  return found.settings;
}

/** Returns the loops that are shown; if all are hidden, the scenario's own. */
function shownLoops(data: Data, { preset, hidden }: Settings): readonly LoopData[] {
  const { loops } = presetOf(data, preset) ?? data.presets[0];
  const shown = loops.filter(({ label }) => !hidden.includes(label));
  return shown.length > 0 ? shown : loops.slice(0, 1);
}

/** Makes the interface for scripts. */
export function makeApi(data: Data, runner: Runner, keeper: Keeper): Api {
  const run = (settings: Settings, loop: LoopData) => {
    const { values, stopTime, step } = settings;
    return runner.run(loop, values, { stopTime, step, events: eventsOf(settings, loop) });
  };
  let last: Promise<unknown> = Promise.resolve();
  /** Calls take effect one after the other. */
  const inTurn = <T>(work: () => Promise<T>): Promise<T> => {
    const next = last.then(work, work).catch((error) => {
      // Consoles would show the name of the class, which is shortened in the page.
      throw error instanceof Refusal ? new Error(error.message) : error;
    });
    last = next;
    return next;
  };
  return {
    set: (changes) =>
      inTurn(async () => {
        const settings = changed(keeper.settings, data, changes ?? {});
        // A run that is refused throws before the settings are applied.
        for (const loop of shownLoops(data, settings)) await run(settings, loop);
        await keeper.apply(settings);
      }),
    csv: () =>
      inTurn(async () => {
        const { settings } = keeper;
        const [own] = shownLoops(data, { ...settings, hidden: [] });
        return csv(await run(settings, own));
      }),
  };
}

/** Makes the interface without a page. */
export function apiWithoutPage(data: Data, engine: Runner): Api {
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
