// Which events happen, when and for how long.

import { isDuration, isTime } from "./experiment";
import { type Edit, eventOf, type Settings } from "./settings";
import { entered } from "./text";
import type { EventData, Preset } from "./types";

/** What a user does here: take another set of events, or change one of them. */
export interface Wishes {
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
      // What cannot be read stays, so that it can be mended.
      const isKept = document.activeElement === input || Number.isNaN(now);
      if (!isKept) input.value = now == null ? "" : String(now);
      const isGood = now == null || (isAt ? isTime(now) : isDuration(now));
      input.setAttribute("aria-invalid", String(!isGood));
      input.classList.toggle("changed", (now ?? null) !== (own ?? null));
    }
  }

  #row(event: EventData): HTMLElement {
    const { number } = event;
    const item = document.createElement("li");
    const name = document.createElement("span");
    name.className = "label";
    name.textContent = event.label;
    name.title = event.text;
    item.append(name);
    if (event.at === undefined) {
      const when = document.createElement("small");
      when.textContent = `when ${event.when?.signal} ${event.when?.comparison} ${event.when?.value}`;
      item.append(when);
    } else {
      item.append(this.#field("at", number, event.label));
    }
    if (event.canEnd) item.append(this.#field("for", number, event.label));
    return item;
  }

  #field(kind: "at" | "for", number: number, label: string): HTMLElement {
    const whole = document.createElement("label");
    whole.className = "time";
    const input = document.createElement("input");
    input.type = "text";
    input.inputMode = "decimal";
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
    whole.append(`${kind} `, input, " s");
    return whole;
  }
}
