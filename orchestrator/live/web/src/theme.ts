// Colours of the page, light and dark, as the style sheet has them.

import type { Colour } from "./lines";

export interface Palette {
  background: Colour;
  /** Of each controller. */
  controllers: readonly [Colour, Colour];
  reference: Colour;
  /** The upper fin. */
  highlight: Colour;
  grid: Colour;
}

/** Values read since the theme last changed: charts ask often. */
const known = new Map<string, string>();

/** The value of a custom property, such as `--text`. */
export function property(name: string): string {
  const found =
    known.get(name) ?? getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  known.set(name, found);
  return found;
}

function colour(name: string): Colour {
  const text = property(name);
  return [1, 3, 5].map((i) => Number.parseInt(text.slice(i, i + 2), 16) / 255) as unknown as Colour;
}

export function palette(): Palette {
  return {
    background: colour("--surface"),
    controllers: [colour("--first"), colour("--second")],
    reference: colour("--reference"),
    highlight: colour("--highlight"),
    grid: colour("--grid"),
  };
}

/** Follows the system until the button is pressed; `changed` is told of every change. */
export function themeButton(button: HTMLButtonElement, changed: () => void): void {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;
  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
  const say = () => {
    button.textContent = isDark() ? "Light" : "Dark";
    button.setAttribute("aria-label", isDark() ? "Light colours" : "Dark colours");
    known.clear();
    changed();
  };
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    say();
  });
  system.addEventListener("change", say);
  say();
}
