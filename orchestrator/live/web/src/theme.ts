// Colours of the page, light and dark, from the style sheet.

import type { Colour } from "./meshes";

export interface Palette {
  background: Colour;
  /** Colour of each controller. */
  controllers: readonly [Colour, Colour];
  reference: Colour;
  /** Colour of the upper fin. */
  highlight: Colour;
  grid: Colour;
  text: Colour;
}

/** Values read since the theme last changed: charts need them often. */
const known = new Map<string, string>();

/** Returns the value of a custom property, such as `--text`. */
export function property(name: string): string {
  const found =
    known.get(name) ?? getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  known.set(name, found);
  return found;
}

/** Reads a colour `#rrggbb`. */
function parsed(text: string): Colour {
  return [1, 3, 5].map((i) => Number.parseInt(text.slice(i, i + 2), 16) / 255) as unknown as Colour;
}

function colour(name: string): Colour {
  return parsed(property(name));
}

export function mixed(a: Colour, b: Colour, share: number): Colour {
  return a.map((value, k) => value + (b[k] - value) * share) as unknown as Colour;
}

/** Returns a vehicle's colour, lighter on a dark page. */
export function vehicleColour(text: string): Colour {
  return mixed(parsed(text), [1, 1, 1], Number.parseFloat(property("--lighter")) / 100);
}

/**
 * Gives the lines of the first controller a vehicle's colour, and lines of the second the colour of
 * text; undefined: each its own.
 */
export function colourLines(text: string | undefined): void {
  known.clear();
  const { style } = document.documentElement;
  if (text === undefined) {
    for (const name of ["--first", "--second"]) style.removeProperty(name);
  } else {
    style.setProperty("--first", written(vehicleColour(text)));
    style.setProperty("--second", property("--text"));
  }
  known.clear();
}

function written(colour: Colour): string {
  const parts = colour.map((part) => Math.round(255 * part).toString(16));
  return `#${parts.map((part) => part.padStart(2, "0")).join("")}`;
}

export function palette(): Palette {
  return {
    background: colour("--surface"),
    controllers: [colour("--first"), colour("--second")],
    reference: colour("--reference"),
    highlight: colour("--highlight"),
    grid: colour("--grid"),
    text: colour("--text"),
  };
}

/** Sets the theme: the system's until the button is pressed; calls `changed` at every change. */
export function themeButton(button: HTMLButtonElement, changed: () => void): void {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;
  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
  const update = () => {
    button.textContent = isDark() ? "Light" : "Dark";
    button.setAttribute("aria-label", isDark() ? "Light colours" : "Dark colours");
    known.clear();
    changed();
  };
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    update();
  });
  system.addEventListener("change", update);
  update();
}
