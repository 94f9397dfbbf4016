// The form for events: their set, times and durations.

import { make, numberField } from "./dom";
import { type Edit, eventOf, type Settings } from "./settings";
import { isDuration, isTime } from "./simulate";
import { entered } from "./text";
import type { EventData, Preset } from "./types";

/** Calls for the user's choices: another set of events, or a changed event. */
interface Wishes {
  take(events: string): void;
  edit(number: number, edit: Edit): void;
}

export class EventsForm {
  readonly #select: HTMLSelectElement;
  readonly #list: HTMLElement;
  readonly #wishes: Wishes;
  #built = "";

  constructor(select: HTMLSelectElement, list: HTMLElement, wishes: Wishes) {
    this.#select = select;
    this.#list = list;
    this.#wishes = wishes;
    select.addEventListener("change", () => wishes.take(select.value));
  }

  show(settings: Settings, preset: Preset): void {
    const sets = preset.loops[0].events;
    const events = sets[settings.events] ?? [];
    const key = `${preset.name} ${settings.events}`;
    if (key !== this.#built) {
      this.#built = key;
      this.#select.replaceChildren(
        new Option("none", ""),
        ...Object.keys(sets)
          .filter(Boolean)
          .map((name) => new Option(name, name)),
      );
      this.#select.value = settings.events;
      this.#list.replaceChildren(...events.map((event) => this.#row(event)));
    }
    for (const input of this.#list.querySelectorAll("input")) {
      const number = Number(input.dataset.number);
      const { at, lasts } = eventOf(preset, settings.events, number) ?? {};
      const edit = settings.edits[number] ?? {};
      const isAt = input.dataset.kind === "at";
      const own = isAt ? at : lasts;
      const now = isAt ? (edit.at ?? at) : edit.lasts === undefined ? lasts : edit.lasts;
      // An invalid number stays in the field, so that the user can correct it.
      const isKept = document.activeElement === input || Number.isNaN(now);
      if (!isKept) input.value = now == null ? "" : String(now);
      const isGood = now == null || (isAt ? isTime(now) : isDuration(now));
      input.setAttribute("aria-invalid", String(!isGood));
      input.classList.toggle("changed", (now ?? null) !== (own ?? null));
    }
  }

  #row(event: EventData): HTMLElement {
    const { number } = event;
    const name = make("span", "label", event.label);
    name.title = event.text;
    const { signal, comparison, value } = event.when ?? {};
    const when =
      event.at === undefined
        ? make("small", "", `when ${signal} ${comparison} ${value}`)
        : this.#field("at", number, event.label);
    const duration = event.canEnd ? [this.#field("for", number, event.label)] : [];
    return make("li", "", name, when, ...duration);
  }

  #field(kind: "at" | "for", number: number, label: string): HTMLElement {
    const input = numberField();
    input.dataset.kind = kind;
    input.dataset.number = String(number);
    input.setAttribute("aria-label", kind === "at" ? `${label}: time` : `${label}: duration`);
    if (kind === "for") {
      input.placeholder = "always";
      input.title = "how long it lasts; empty: until the run ends";
    }
    input.addEventListener("change", () => {
      const value = entered(input.value);
      const lasts = input.value.trim() === "" ? null : value;
      this.#wishes.edit(number, kind === "at" ? { at: value } : { lasts });
    });
    return make("label", "time", `${kind} `, input, " s");
  }
}
