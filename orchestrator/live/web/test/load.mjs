// Modules of the page in Node, and data of a page.
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

/** Loads a module of the page. */
export async function load(name) {
  const { outputFiles } = await build({
    entryPoints: [fileURLToPath(new URL(`../src/${name}.ts`, import.meta.url))],
    bundle: true,
    format: "esm",
    platform: "node",
    write: false,
  });
  return import(
    `data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`
  );
}

const parameter = (name, value, more = {}) => ({
  name,
  type: "Real",
  default: value,
  value,
  description: "",
  ...more,
});

const gains = [
  parameter("controller.eps_t", 10, { default: 1 }),
  parameter("controller.K1[1]", 10),
];
const ofPlant = [
  parameter("plant.noise.std", 0.001),
  parameter("plant.roll", true, { type: "Boolean" }),
  parameter("plant.integrator", "euler", { type: "Enumeration", choices: { euler: 1, rk4: 2 } }),
];
const events = {
  fault: [
    {
      number: 0,
      text: "override plant.tau.r = 0",
      label: "no yaw moment",
      action: { kind: "alter", effect: "override", values: [["plant.tau.r", 0]] },
      at: 50,
      lasts: 10,
      canEnd: true,
    },
    {
      number: 1,
      text: "freeze controller.y.x",
      label: 'a "fix"',
      action: { kind: "freeze", targets: ["controller.y.x"] },
      when: { signal: "plant.eta.z", comparison: "<", value: -1.5 },
      canEnd: true,
    },
  ],
};
const components = (controller) => ({
  plant: "AuvPlant",
  controller,
  disturbance: "DisturbanceGenerator",
  planner: "MotionPlanner",
});
const vehicle = (prefix) => ({
  name: prefix ? prefix.slice(0, -1) : "plant",
  vehicle: `${prefix}plant`,
  controller: `${prefix}controller`,
  planner: `${prefix}planner`,
  disturbance: `${prefix}disturbance`,
  allocation: "",
});
const loop = (label, controller, more) => ({
  label,
  vehicles: [vehicle("")],
  measured: [],
  components: components(controller),
  head: { order: null, vehicles: null, absent: [], only: [], wires: {} },
  program: [0, 0],
  ports: {},
  restarted: {},
  actingRow: 0,
  parameters: [...gains, ...ofPlant],
  events,
  ...more,
});

/** A preset with two loops, without programs. */
export const preset = {
  name: "fault",
  title: "",
  remark: "",
  zUp: true,
  stopTime: 100,
  step: 0.02,
  events: "fault",
  loops: [
    loop("proposed", "ObserverController", {
      scenario: "fault",
      parameters: [...gains, parameter("controller.k_d", 50), ...ofPlant],
    }),
    loop("PD", "PdController", {
      head: {
        order: "jacobi",
        vehicles: null,
        absent: [],
        only: [],
        wires: { "controller.dy": "plant.dy" },
      },
    }),
  ],
  drawn: [0, 1],
  colours: [],
  references: [],
};

const ofEach = (name) =>
  ["auv1", "auv2"]
    .flatMap((prefix) =>
      [...gains, ...ofPlant].map((one) => ({ ...one, name: `${prefix}.${one.name}` })),
    )
    .concat(parameter(`${name}.count`, 2));

/** A preset with two vehicles, and a leader that is not part of a vehicle. */
export const fleet = {
  ...preset,
  name: "fleet",
  events: "",
  loops: [
    loop("PD", "PdController", {
      vehicles: [vehicle("auv1."), vehicle("auv2.")],
      components: {
        "auv1.plant": "AuvPlant",
        "auv1.controller": "PdController",
        "auv2.plant": "AuvPlant",
        leader: "PathPlanner",
      },
      head: { order: null, vehicles: 2, absent: ["auv2.disturbance"], only: [], wires: {} },
      parameters: ofEach("leader"),
      events: {},
    }),
  ],
  drawn: [0],
  colours: ["#0072B2", "#D55E00"],
  references: ["#0072B2", "#D55E00"],
};

/** Data of a page with these presets. */
export const data = {
  opened: "fault",
  mostSteps: 200_000,
  units: { e: {}, tau: {}, dy: {}, theta_hat: {} },
  presets: [preset, fleet],
  indices: [],
  measured: [],
};
