// The display of runs: paths in space, charts, indices, and the player for all of them.

import { Charts, type Mark, rowAt } from "./charts";
import { element } from "./dom";
import { IndicesTable } from "./indices_table";
import { fillLegend } from "./legend";
import { columnLines, columnSections, lines, longest, sections } from "./panels";
import { Player } from "./player";
import { missing, Scene } from "./scene";
import { fleetOf } from "./settings";
import { attitude, controlPoint, metrics, reference, rowsOf, smallestDistance } from "./signals";
import { general } from "./text";
import { colourLines, palette, themeButton } from "./theme";
import type { Common, Comparison, Run, ShownLoop, VehicleData } from "./types";

/** Width of a printed page, and height of the scene on it [px]. */
const PAPER = 660;
const PICTURE = 380;

export class Display {
  readonly player: Player;
  readonly #common: Common;
  readonly #charts: Charts;
  readonly #indices: IndicesTable;
  readonly #scene: Scene | undefined;
  #results: readonly (Run | undefined)[] = [];
  /** Colour of the chosen vehicle's lines; undefined: each controller has its own. */
  #colour: string | undefined;

  /** Charts begin at `from` [s]. */
  constructor(common: Common, from = 0) {
    this.#common = common;
    this.#scene = this.#makeScene();
    this.#charts = new Charts(
      element("series"),
      (time) => {
        if (!this.player.isPlaying) this.player.seek(time);
      },
      from,
    );
    this.player = new Player(
      {
        toggle: element("play"),
        slider: element("time"),
        output: element("now"),
        speed: element("speed"),
        marks: element("marks"),
      },
      (time) => this.#showTime(time),
    );
    this.#indices = new IndicesTable(element("indices"), common.indices);
    new ResizeObserver(([{ target }]) => {
      document.documentElement.style.setProperty("--toolbar", `${target.clientHeight}px`);
    }).observe(element("toolbar"));
    themeButton(element("theme"), () => this.#paint());
    this.#wirePrint();
  }

  /** Prints the scene and all charts, in light colours. */
  #wirePrint(): void {
    const { dataset } = document.documentElement;
    let theme: string | undefined;
    addEventListener("beforeprint", () => {
      theme = dataset.theme;
      dataset.theme = "light";
      this.#paint();
      this.#charts.print(PAPER);
      this.#scene?.print(PAPER, PICTURE);
    });
    addEventListener("afterprint", () => {
      if (theme === undefined) delete dataset.theme;
      else dataset.theme = theme;
      this.#scene?.fit();
      this.#charts.fit();
      this.#paint();
    });
  }

  #makeScene(): Scene | undefined {
    const host = element("scene");
    const canvas = host.querySelector("canvas") as HTMLCanvasElement;
    try {
      return new Scene(host, canvas, this.#common.hull);
    } catch {
      canvas.remove();
      host.append(missing("This browser has no WebGL: the path in space is not shown."));
      return undefined;
    }
  }

  /** Plays the runs once they are seen; with a time [s], or if motion is unwanted, shows it still. */
  start(time?: number): void {
    const { player } = this;
    const stage = element("stage");
    if (time !== undefined) player.seek(time);
    if (time !== undefined || stage.hidden) return;
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) return;
    player.seek(-Infinity);
    const seen = new IntersectionObserver(([{ isIntersecting }]) => {
      if (!isIntersecting) return;
      seen.disconnect();
      if (!player.isPlaying && player.isAtStart) player.toggle();
    });
    seen.observe(stage);
  }

  /** Makes the charts of runs, for loops in the order in which they are drawn. */
  build(comparison: Comparison, loops: readonly ShownLoop[]): void {
    const labels = loops.map(({ label }) => label);
    const fleet = fleetOf(comparison);
    const { columns = {} } = comparison;
    const { units } = this.#common;
    this.#charts.build(
      fleet.length > 0 ? sections(labels, units, fleet.length) : columnSections(labels, columns),
    );
    this.#results = [];

    const select = element<HTMLSelectElement>("vehicle");
    (select.parentElement as HTMLElement).hidden = fleet.length < 2;
    select.replaceChildren(...fleet.map((name) => new Option(name)));
  }

  /** Sets the colour of charts: of the chosen vehicle; undefined: of each controller. */
  paint(colour: string | undefined): void {
    this.#colour = colour;
    this.#paint();
  }

  #paint(): void {
    colourLines(this.#colour);
    this.#scene?.paint(palette());
    this.#charts.repaint();
  }

  /**
   * Shows runs.
   *
   * @param comparison how the runs are drawn.
   * @param loops vehicles and controllers, in the order in which they are drawn.
   * @param results runs of the loops; undefined: hidden.
   * @param chosen number of the vehicle for charts and indices.
   */
  show(
    comparison: Comparison,
    loops: readonly ShownLoop[],
    results: readonly (Run | undefined)[],
    chosen: number,
  ): void {
    this.#results = results;
    const place = Math.max(
      0,
      results.findIndex((result) => result),
    );
    const first = results[place];
    const times = results.flatMap((result) => (result?.rows ? [result.time] : []));
    const start = times.length ? Math.min(...times.map((time) => time[0])) : 0;
    const end = Math.max(start + 1e-9, ...times.map((time) => time[time.length - 1]));
    const marks = marksOf(first, end);
    const { units } = this.#common;
    const { columns = {} } = comparison;
    const hasVehicles = fleetOf(comparison).length > 0;
    const looked = loops.map(({ vehicles }) => ({ vehicle: vehicles[chosen], fleet: vehicles }));
    this.#charts.set(
      hasVehicles ? lines(results, looked, units) : columnLines(results, columns),
      marks,
    );
    if (hasVehicles) this.#showPaths(comparison, loops, results, place);
    this.#indices.show(
      results.flatMap((result, place) => {
        if (!result || !hasVehicles) return [];
        const { label } = loops[place];
        return [{ label, place, metrics: metrics(result, chosen, looked[place].fleet) }];
      }),
    );
    this.player.set(start, end, marks);
  }

  #showPaths(
    comparison: Comparison,
    loops: readonly ShownLoop[],
    results: readonly (Run | undefined)[],
    place: number,
  ): void {
    const first = results[place];
    const { colours, references: referenceColours, zUp } = comparison;
    const fleet = loops[place].vehicles;
    const references = fleet.map((vehicle) => {
      const points = first && reference(first, vehicle);
      return points && rowsOf(points);
    });
    const hasReference = references.some((points) => points);
    const waypoints = first && hasReference ? waypointsOf(first) : [];
    this.#scene?.set({
      tracks: results.map((result, k) =>
        result
          ? loops[k].vehicles.map((vehicle) => ({
              path: controlPoint(result, vehicle),
              attitude: attitude(result, vehicle),
            }))
          : [],
      ),
      references,
      colours,
      referenceColours,
      waypoints,
      ell: Math.max(
        ...fleet.map(({ vehicle }) => Number(first?.parameters[`${vehicle}.ell`] ?? 0)),
      ),
      apart: Math.min(...results.map((result) => closest(result, fleet))),
      zUp,
    });
    fillLegend(element("legend"), comparison, loops, [
      ...(hasReference ? ["reference"] : []),
      ...(waypoints.length ? ["waypoints"] : []),
    ]);
    const times = this.#scene?.times ?? 1;
    element("scale").textContent = times > 1.05 ? `vehicles drawn × ${general(times, 2)}` : "";
  }

  #showTime(time: number): void {
    const whole = longest(this.#results);
    if (whole) this.#scene?.show(rowAt(whole.time, time));
    this.#charts.show(time);
  }
}

/** Returns the smallest distance between two vehicles in a run [m]. */
function closest(result: Run | undefined, fleet: readonly VehicleData[]): number {
  const distance = result && smallestDistance(result, fleet);
  return distance?.reduce((a, b) => Math.min(a, b)) ?? Infinity;
}

/** End of the name of the first parameter of a PathPlanner's waypoints. */
const WAYPOINT = ".waypoint[1].x";

/** Returns the waypoints of each PathPlanner [m]. */
function waypointsOf({ parameters }: Run): number[] {
  const planners = Object.keys(parameters).filter((name) => name.endsWith(WAYPOINT));
  return planners.flatMap((first) => {
    const name = first.slice(0, -WAYPOINT.length);
    return Array.from({ length: 3 * Number(parameters[`${name}.count`]) }, (_, i) =>
      Number(parameters[`${name}.waypoint[${Math.floor(i / 3) + 1}].${"xyz"[i % 3]}`]),
    );
  });
}

/** Returns the marks of a run: each event from its beginning to its end, if it has one. */
function marksOf(result: Run | undefined, end: number): Mark[] {
  const happened = result?.happened ?? [];
  return happened.flatMap(({ time, label, event }, k) => {
    if (!label) return [];
    const over = happened.find((other, n) => n > k && other.event === event && !other.label);
    return [{ from: time, until: over?.time ?? end, label }];
  });
}
