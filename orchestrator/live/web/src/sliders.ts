// Sliders: their parameters and headings, and the values of their positions.

import { namedFor } from "./settings";
import type { VehicleData } from "./types";

/** Positions of a slider, from 0. */
export const POSITIONS = 1000;

/** A range of values, linear or logarithmic; if `zero` is set, its first position is zero. */
interface Scale {
  readonly low: number;
  readonly high: number;
  readonly log?: boolean;
  readonly zero?: boolean;
  readonly whole?: boolean;
}

export interface Slider {
  /** Symbol or member in HTML, after the words; empty: words only. */
  readonly symbol: string;
  /** Words in place of the description of its first parameter. */
  readonly words?: string;
  /** Text for screen readers, for a slider that sets several parameters. */
  readonly spoken?: string;
  /** Parameters that the slider sets together; each also has a field. */
  readonly names: readonly string[];
  /** Factor of the slider's value for each parameter. */
  readonly signs?: readonly number[];
  readonly scale: Scale;
}

interface Group {
  readonly title: string;
  readonly open?: boolean;
  readonly rows: readonly Slider[];
}

const by = (low: number, high: number): Scale => ({ low, high, log: true });
const from = (low: number, high: number): Scale => ({ low, high });

function row(symbol: string, name: string, scale: Scale): Slider {
  return { symbol, names: [name], scale };
}

function diagonal(symbol: string, name: string): Slider {
  const all = `controller.${name}`;
  return { symbol, spoken: all, names: [1, 2, 3].map((k) => `${all}[${k}]`), scale: by(0.1, 1000) };
}

/** Limited commands, in words. */
const LIMITS = [
  ["u", "Largest surge force"],
  ["q", "Largest pitch moment"],
  ["r", "Largest yaw moment"],
];

function limit([member, words]: readonly string[]): Slider {
  return {
    symbol: `&tau;<sub>${member}</sub>`,
    words,
    spoken: `limits of plant.tau.${member}`,
    names: [`plant.tau_min.${member}`, `plant.tau_max.${member}`],
    signs: [-1, 1],
    scale: from(0, 200),
  };
}

const EULER = { theta: "&theta;", psi: "&psi;" };

const posture = (component: string, low: number, high: number): Slider[] => [
  ...["x", "y", "z"].map((axis) =>
    row(`<i>${axis}</i>`, `${component}.eta0.${axis}`, from(low, high)),
  ),
  ...Object.entries(EULER).map(([angle, letter]) =>
    row(
      letter,
      `${component}.eta0.${angle}`,
      from(angle === "psi" ? -3.14 : -1.5, angle === "psi" ? 3.14 : 1.5),
    ),
  ),
];

const members = (letter: string, name: string, names: string, scale: Scale): Slider[] =>
  [...names].map((member) => row(`${letter}<sub>${member}</sub>`, `${name}.${member}`, scale));

export const GROUPS: readonly Group[] = [
  {
    title: "Gains",
    open: true,
    rows: [
      diagonal("<i>K</i><sub>1</sub>", "K1"),
      diagonal("<i>K</i><sub>2</sub>", "K2"),
      row("&lambda;", "controller.lambda", by(0.01, 100)),
      row("<i>k<sub>d</sub></i>", "controller.k_d", by(1, 1000)),
      row("&gamma;", "controller.gamma", { low: 0.001, high: 100, log: true, zero: true }),
      row("&sigma;", "controller.sigma", { low: 1e-5, high: 1, log: true, zero: true }),
      row("&epsilon;<sub><i>t</i></sub>", "controller.eps_t", by(0.01, 100)),
    ],
  },
  { title: "Limits of the actuators", rows: LIMITS.map(limit) },
  { title: "Start of the vehicle", rows: posture("plant", -20, 20) },
  {
    title: "Reference",
    rows: [
      ...posture("planner", -100, 100),
      ...members("&tau;", "planner.tau_d", "u", from(0, 50)),
      ...members("&tau;", "planner.tau_d", "qr", from(-10, 10)),
      row("", "planner.cruise", from(0.1, 2)),
      row("", "planner.rounding", from(0.5, 15)),
    ],
  },
  {
    title: "Commands",
    rows: [
      ...members("&tau;", "plant.tau", "u", from(-100, 100)),
      ...members("&tau;", "plant.tau", "qr", from(-20, 20)),
    ],
  },
  {
    title: "Noise",
    rows: [
      row("", "plant.noise.std", { low: 1e-5, high: 1, log: true, zero: true }),
      row("", "plant.noise.seed", { low: 1, high: 100, whole: true }),
    ],
  },
  {
    title: "Disturbance and current",
    rows: [
      row("<i>A<sub>f</sub></i>", "disturbance.A_f", from(0, 20)),
      row("<i>A<sub>d</sub></i>", "disturbance.A_d", from(0, 40)),
      row("&omega;<sub><i>d</i></sub>", "disturbance.omega_d", from(0, 2)),
      ...[
        ["x", "north"],
        ["y", "east"],
        ["z", "down"],
      ].map(([axis, way]) => row(way, `plant.current.${axis}`, from(-1, 1))),
    ],
  },
];

/** Returns a slider for the components of a vehicle; `GROUPS` has the names of a single vehicle. */
export function sliderOf(vehicle: VehicleData, slider: Slider): Slider {
  const named = (text: string) => namedFor(vehicle, text);
  const { spoken } = slider;
  return {
    ...slider,
    names: slider.names.map(named),
    ...(spoken === undefined ? {} : { spoken: named(spoken) }),
  };
}

/** Returns the first words of a description: without a symbol, remark or member. */
export function firstWords(description: string): string {
  return description.split(/ \(|[,;:.] /, 1)[0];
}

/** Returns the value at a position, with no more digits than positions can distinguish. */
export function valueAt(scale: Scale, position: number): number {
  const { low, high, log, zero, whole } = scale;
  if (zero && position <= 0) return 0;
  const share = Math.min(1, Math.max(0, position / POSITIONS));
  if (log) return Number((low * (high / low) ** share).toPrecision(3));
  const value = low + (high - low) * share;
  if (whole) return Math.round(value);
  const step = 10 ** Math.floor(Math.log10((high - low) / 200));
  return Number((Math.round(value / step) * step).toPrecision(12));
}

export function positionOf(scale: Scale, value: number): number {
  const { low, high, log, zero } = scale;
  if (zero && value <= 0) return 0;
  const share = log
    ? Math.log(Math.max(value, low) / low) / Math.log(high / low)
    : (value - low) / (high - low);
  return Math.round(POSITIONS * Math.min(1, Math.max(0, share)));
}
