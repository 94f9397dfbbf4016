// Charts: one small uPlot for each signal, with a common cursor.

import uPlot from "uplot";
import { chatters, extremes, movingMean } from "./chatter";
import { make, numberField } from "./dom";
import { swatch } from "./legend";
import type { Lines, Panel, Section, Style } from "./panels";
import { entered, short, tick } from "./text";
import { property } from "./theme";

/** An event, with its beginning and end [s]. */
export interface Mark {
  readonly from: number;
  readonly until: number;
  readonly label: string;
}

const HEIGHT = 132;
const TIME_AXIS = 22;
const VALUE_AXIS = 46;

/** Room above a plot for the names of events. */
const ABOVE = 22;

/** Gap between printed charts [px]. */
const GAP = 12;

/** Opacity of the band of a signal that chatters. */
const BAND = 0.3;

const DASHES: Record<Style, number[]> = {
  first: [],
  second: [6, 3],
  true: [4, 4],
  "first-of-all": [],
  "second-of-all": [6, 3],
};
const WIDTH = 1.5;

/** Share of a limit above which the chart includes it. */
const NEAR = 0.5;

const PROPERTIES: Record<Style, string> = {
  first: "--first",
  second: "--second",
  true: "--reference",
  "first-of-all": "--reference",
  "second-of-all": "--reference",
};

function longestOf(texts: readonly string[]): number {
  return Math.max(0, ...texts.map(({ length }) => length));
}

class Chart {
  readonly root: HTMLElement;
  readonly #panel: Panel;
  readonly #values: readonly HTMLElement[];
  readonly #caption: string;
  readonly #host: HTMLElement;
  readonly #plot: uPlot;
  #lines: Lines = { time: new Float64Array(0), values: [] };
  #marks: readonly Mark[] = [];
  /** True if there is room above for the names of events. */
  #named = false;
  /** Lines that chatter; undefined: others. */
  #bands: readonly (Float64Array | undefined)[] = [];
  #stale = false;
  #visible = false;
  #time = 0;
  #from = 0;

  constructor(panel: Panel, scrub: (time: number) => void) {
    this.#panel = panel;
    this.#values = panel.styles.map((style, k) => {
      const value = make("span", `value ${style}`);
      value.title = panel.names[k];
      return value;
    });
    const readout = make("span", "readout", ...this.#values);
    readout.setAttribute("aria-hidden", "true");
    const caption = document.createElement("figcaption");
    caption.innerHTML = `<span class="name">${panel.title} <span class="unit">${panel.unit && `[${panel.unit}]`}</span></span>`;
    this.#caption = caption.textContent ?? "";
    caption.append(readout);
    const host = make("div", "plot");
    host.setAttribute("role", "img");
    this.#host = host;
    this.root = make("figure", "chart pending", caption, host);
    this.#plot = new uPlot(this.#options(), [new Float64Array(0)], host);
    const point = (event: PointerEvent) => {
      const { left } = this.#plot.over.getBoundingClientRect();
      scrub(this.#plot.posToVal(event.clientX - left, "x"));
    };
    this.#plot.over.addEventListener("pointermove", point);
    this.#plot.over.addEventListener("pointerdown", point);
    new ResizeObserver(() => this.fit()).observe(host);
    new IntersectionObserver(
      ([{ isIntersecting }]) => {
        this.#visible = isIntersecting;
        if (!isIntersecting || this.root.hidden) return;
        if (!this.refresh()) this.#point();
      },
      { rootMargin: "60px" },
    ).observe(this.root);
  }

  #options(): uPlot.Options {
    const stroke = (name: string) => () => property(name);
    // A function, as uPlot would keep the first colours of points.
    const ofPoint = (_: uPlot, k: number) => property(PROPERTIES[this.#panel.styles[k - 1]]);
    const axis = {
      stroke: stroke("--muted"),
      font: "11px system-ui, sans-serif",
      grid: { stroke: stroke("--grid"), width: 1 },
      ticks: { show: false },
      gap: 4,
    };
    return {
      width: 280,
      height: HEIGHT,
      padding: [() => (this.#named && this.#marks.length ? ABOVE : 8), 13, 0, 0],
      legend: { show: false },
      cursor: {
        y: false,
        drag: { x: false, y: false },
        bind: silent(),
        points: { size: 6, fill: ofPoint, stroke: ofPoint },
      },
      scales: {
        x: { time: false, range: (_, low, high) => this.#times(low ?? 0, high ?? 1) },
        y: { range: (_, low, high) => this.#range(low ?? 0, high ?? 0) },
      },
      axes: [
        { ...axis, size: TIME_AXIS, space: 55 },
        {
          ...axis,
          // `labels` is null before there are any.
          size: (_, labels) => Math.max(VALUE_AXIS, 12 + 6 * longestOf(labels ?? [])),
          space: 26,
          values: (_, found) => found.map(tick),
        },
      ],
      series: [
        {},
        ...this.#panel.styles.map(
          (style, k): uPlot.Series => ({
            label: this.#panel.names[k],
            stroke: stroke(PROPERTIES[style]),
            width: WIDTH,
            dash: DASHES[style],
            points: { show: false },
          }),
        ),
      ],
      hooks: { drawClear: [() => this.#underlay()], draw: [() => this.#overlay()] },
    };
  }

  /** Returns the range of times, from the chosen beginning if the run lasts longer. */
  #times(low: number, high: number): [number, number] {
    const end = Math.max(high, this.#lines.until ?? high);
    return [this.#from < end ? Math.max(low, this.#from) : low, end];
  }

  /** Returns the range of values, with limits that they come near to. */
  #range(low: number, high: number): [number, number] {
    const { time } = this.#lines;
    const row = rowAt(time, this.#times(time[0], time[time.length - 1])[0]);
    for (const band of this.#bands) {
      const [least, largest] = extremes(band?.subarray(row) ?? new Float64Array(0));
      low = Math.min(low, least);
      high = Math.max(high, largest);
    }
    for (const limit of this.#lines.limits ?? []) {
      if (Math.max(high, -low) > NEAR * Math.abs(limit)) {
        low = Math.min(low, limit);
        high = Math.max(high, limit);
      }
    }
    const margin = 0.07 * (high - low) || 0.1 * Math.abs(high) || 1;
    return [low - margin, high + margin];
  }

  #underlay(): void {
    const { ctx, bbox } = this.#plot;
    const at = (time: number) =>
      Math.min(bbox.left + bbox.width, Math.max(bbox.left, this.#plot.valToPos(time, "x", true)));
    ctx.save();
    ctx.fillStyle = property("--mark");
    for (const { from, until } of this.#marks) {
      ctx.fillRect(at(from), bbox.top, Math.max(1, at(until) - at(from)), bbox.height);
    }
    ctx.globalAlpha = BAND;
    this.#bands.forEach((band, k) => {
      ctx.fillStyle = property(PROPERTIES[this.#panel.styles[k]]);
      if (band) this.#drawBand(band);
    });
    ctx.restore();
  }

  /** Draws the range of a line's values in each column of pixels. */
  #drawBand(band: Float64Array): void {
    const { ctx, bbox } = this.#plot;
    const { time } = this.#lines;
    const { min = 0, max = 1 } = this.#plot.scales.x;
    const rowOf = (x: number) => rowAt(time, min + ((max - min) * x) / bbox.width);
    for (let x = 0; x < bbox.width; x++) {
      const [low, high] = extremes(band.subarray(rowOf(x), rowOf(x + 1) + 1));
      const top = this.#plot.valToPos(high, "y", true);
      const height = this.#plot.valToPos(low, "y", true) - top;
      if (height >= 0) ctx.fillRect(bbox.left + x, top, 1, Math.max(height, 1));
    }
  }

  #overlay(): void {
    const { ctx, bbox } = this.#plot;
    const ratio = uPlot.pxRatio;
    ctx.save();
    ctx.lineWidth = ratio;
    ctx.strokeStyle = property("--muted");
    for (const limit of this.#lines.limits ?? []) {
      const y = Math.round(this.#plot.valToPos(limit, "y", true)) + 0.5;
      if (!(y >= bbox.top && y <= bbox.top + bbox.height)) continue;
      ctx.setLineDash([2 * ratio, 2 * ratio]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.setLineDash([]);
    const isNaming = this.#named && this.root.previousElementSibling === null;
    let after = -Infinity;
    for (const { from, label } of this.#marks) {
      const x = Math.round(this.#plot.valToPos(from, "x", true)) + 0.5;
      if (!(x >= bbox.left && x <= bbox.left + bbox.width)) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      if (isNaming) after = this.#name(label, x, after);
    }
    ctx.restore();
  }

  /** Writes the name of an event at its line if there is room; returns where the last name ends. */
  #name(label: string, x: number, after: number): number {
    const { ctx, bbox } = this.#plot;
    const ratio = uPlot.pxRatio;
    ctx.save();
    ctx.font = `${11 * ratio}px system-ui, sans-serif`;
    ctx.fillStyle = property("--text");
    const width = ctx.measureText(label).width;
    const left = Math.max(bbox.left, Math.min(x - 3 * ratio, bbox.left + bbox.width - width));
    const top = bbox.top - 7 * ratio;
    const hasRoom = left > after;
    if (hasRoom) ctx.fillText(label, left, top);
    ctx.restore();
    return hasRoom ? left + width : after;
  }

  /** Draws the chart, even if it is out of sight, in a width [px]. */
  print(width: number): void {
    if (this.root.hidden) return;
    this.#plot.setSize({ width, height: HEIGHT });
    this.#redraw();
  }

  /** Takes the width that the page has for the chart. */
  fit(): void {
    const width = Math.floor(this.#host.clientWidth);
    if (width > 0 && width !== this.#plot.width) this.#plot.setSize({ width, height: HEIGHT });
  }

  destroy(): void {
    this.#plot.destroy();
  }

  set(lines: Lines, marks: readonly Mark[], named: boolean): void {
    this.#lines = lines;
    this.#marks = marks;
    this.#named = named;
    this.root.hidden = !lines.values.some((values) => values);
    const names = this.#panel.names.filter((_, k) => lines.values[k]);
    this.#host.setAttribute("aria-label", `${this.#caption} over time: ${names.join(", ")}`);
    this.#stale = true;
  }

  /** Draws the chart if it is in sight and has changed; tells whether it does. */
  refresh(): boolean {
    const hasRows = this.#lines.time.length > 0;
    const isDue = this.#stale && this.#visible && hasRows && !this.root.hidden;
    if (isDue) this.#redraw();
    return isDue;
  }

  #redraw(): void {
    this.#stale = false;
    this.root.classList.remove("pending");
    const { time, values: lines } = this.#lines;
    this.#bands = lines.map((values) => (values && chatters(values) ? values : undefined));
    const drawn = lines.map((values, k) =>
      withGaps(this.#bands[k] ? movingMean(time, this.#bands[k]) : values),
    );
    this.#plot.setData([time, ...drawn]);
    // uPlot also sets its new scales in a microtask.
    queueMicrotask(() => this.#point());
  }

  /** Lets the chart begin at another time [s], so that small values can be seen after large ones. */
  begin(from: number): void {
    this.#from = from;
    this.#stale = true;
    this.refresh();
  }

  /** Draws again with other colours. */
  repaint(): void {
    if (this.#stale) return;
    this.#plot.redraw(false);
    this.#point();
  }

  show(time: number): void {
    this.#time = time;
    if (this.#visible && !this.root.hidden && !this.#stale) this.#point();
  }

  /** Moves the cursor, and the values in the caption, to the current time. */
  #point(): void {
    const left = this.#plot.valToPos(this.#time, "x");
    this.#plot.setCursor({ left: Number.isFinite(left) ? left : -10, top: 0 }, false);
    const row = rowAt(this.#lines.time, this.#time);
    this.#lines.values.forEach((values, k) => {
      this.#values[k].textContent = values?.length
        ? short(values[Math.min(row, values.length - 1)])
        : "";
    });
  }
}

/** Returns values for uPlot, in which gaps are null instead of NaN. */
function withGaps(values: Float64Array | undefined): Float64Array | (number | null)[] {
  if (!values?.some(Number.isNaN)) return values ?? [];
  return Array.from(values, (value) => (Number.isNaN(value) ? null : value));
}

/** Turns uPlot's own mouse handling off: the cursor follows the player. */
function silent(): uPlot.Cursor.Bind {
  const off = () => null;
  return {
    mousedown: off,
    mouseup: off,
    click: off,
    dblclick: off,
    mousemove: off,
    mouseleave: off,
    mouseenter: off,
  };
}

/** Returns the last row that is not after a time. */
export function rowAt(times: Float64Array, time: number): number {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time + 1e-9) low = middle;
    else high = middle - 1;
  }
  return Math.max(low, 0);
}

/** The sections of charts. */
export class Charts {
  #charts: Chart[][] = [];
  #isRefreshing = false;
  /** Number of the section that was drawn last. */
  #last = -1;
  #from: number;
  readonly #host: HTMLElement;
  readonly #scrub: (time: number) => void;

  constructor(host: HTMLElement, scrub: (time: number) => void, from: number) {
    this.#from = from;
    this.#host = host;
    this.#scrub = scrub;
  }

  /** Makes all charts. */
  build(sections: readonly Section[]): void {
    // uPlot keeps a reference to every plot until it is destroyed.
    for (const chart of this.#charts.flat()) chart.destroy();
    this.#host.replaceChildren();
    this.#last = -1;
    this.#charts = sections.map(({ title, note, named, panels }, place) => {
      const aside = make("span", "note", note);
      const [{ names, styles }] = panels;
      if (named)
        aside.append(...styles.map((style, k) => make("span", "sample", swatch(style), names[k])));
      const heading = make("h2", "", title, aside);
      if (place === 0) heading.append(this.#beginning());
      const charts = panels.map((panel) => new Chart(panel, this.#scrub));
      for (const chart of charts) chart.begin(this.#from);
      const row = make("div", `charts of-${panels.length}`, ...charts.map(({ root }) => root));
      this.#host.append(make("section", "", heading, row));
      return charts;
    });
  }

  /** Makes a field for the time at which all charts begin. */
  #beginning(): HTMLElement {
    const input = numberField();
    input.value = String(this.#from);
    input.addEventListener("change", () => {
      const from = entered(input.value);
      input.setAttribute("aria-invalid", String(Number.isNaN(from)));
      if (Number.isNaN(from)) return;
      this.#from = from;
      for (const chart of this.#charts.flat()) chart.begin(from);
    });
    const label = make("label", "from", "from ", input, " s");
    label.title = "Charts begin at this time, so that small values can be seen";
    return label;
  }

  set(lines: readonly (readonly Lines[])[], marks: readonly Mark[]): void {
    this.#charts.forEach((charts, section) => {
      charts.forEach((chart, k) => {
        chart.set(lines[section][k], marks, section === 0);
      });
      const parent = charts[0].root.closest("section");
      if (parent) parent.hidden = charts.every(({ root }) => root.hidden);
      parent?.querySelectorAll<HTMLElement>(".sample").forEach((sample, k) => {
        sample.hidden = lines[section].every(({ values }) => values[k] === undefined);
      });
    });
    this.#refresh();
  }

  /** Draws the changed charts a section at a time, so that input never waits for all of them. */
  #refresh(): void {
    if (this.#isRefreshing) return;
    this.#isRefreshing = true;
    setTimeout(() => {
      this.#isRefreshing = false;
      // In turn, so that each is drawn even if all change again before.
      for (let k = 0; k < this.#charts.length; k++) {
        this.#last = (this.#last + 1) % this.#charts.length;
        const drawn = this.#charts[this.#last].map((chart) => chart.refresh());
        if (drawn.includes(true)) return this.#refresh();
      }
    });
  }

  /** Draws all charts in the width of a printed page [px]. */
  print(page: number): void {
    for (const charts of this.#charts) {
      const width = Math.floor((page - GAP * (charts.length - 1)) / charts.length);
      for (const chart of charts) chart.print(width);
    }
  }

  fit(): void {
    for (const chart of this.#charts.flat()) chart.fit();
  }

  show(time: number): void {
    for (const chart of this.#charts.flat()) chart.show(time);
  }

  repaint(): void {
    for (const chart of this.#charts.flat()) chart.repaint();
  }
}
