// Loads a module of the page into Node.
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

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
const vehicle = [
  parameter("plant.noise.std", 0.001),
  parameter("plant.roll", true, { type: "Boolean" }),
  parameter("plant.integrator", "euler", { type: "String", choices: ["euler", "rk4"] }),
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
const loop = (label, controller, more) => ({
  label,
  components: components(controller),
  head: { order: null, only: [], wires: {} },
  initial: [],
  stages: [],
  parameters: [...gains, ...vehicle],
  events,
  ...more,
});

/** A page's data with one preset, without FMUs. */
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
      parameters: [...gains, parameter("controller.k_d", 50), ...vehicle],
    }),
    loop("PD", "PdController", {
      head: { order: "jacobi", only: [], wires: { "controller.dy": "plant.dy" } },
    }),
  ],
  drawn: [0, 1],
};
export const data = {
  opened: "fault",
  mostSteps: 200_000,
  lastSeconds: 5,
  units: { e: {}, tau: {}, dy: {}, theta_hat: {} },
  fmus: {},
  presets: [preset],
  indices: [],
};
