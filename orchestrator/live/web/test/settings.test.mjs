// Settings, links and command lines, against texts written out.
import assert from "node:assert/strict";
import test from "node:test";
import { data, fleet, load, preset } from "./load.mjs";

const { fromHash, suggested, toHash } = await load("link");
const { untouched, withEdit, withValues, eventsOf } = await load("settings");
const { commandLine, toToml } = await load("command");
const { parted } = await load("simulate");
const { names } = await load("controls");
const { firstWords, GROUPS, sliderOf } = await load("sliders");

const start = untouched(preset);

test("the preset's value is not a change", () => {
  const changed = withValues(start, preset, { "controller.eps_t": 3, "plant.noise.std": 0 });
  assert.deepEqual(changed.values, { "controller.eps_t": 3, "plant.noise.std": 0 });
  const back = withValues(changed, preset, { "controller.eps_t": 10 });
  assert.deepEqual(back.values, { "plant.noise.std": 0 });
});

test("a value is a change if one of the loops has another, until it is reset", () => {
  const [own, other] = preset.loops;
  const longer = other.parameters.map((one) =>
    one.name === "plant.noise.std" ? { ...one, value: 0.5 } : one,
  );
  const apart = { ...preset, loops: [own, { ...other, parameters: longer }] };
  const changed = withValues(start, apart, { "plant.noise.std": 0.001 });
  assert.deepEqual(changed.values, { "plant.noise.std": 0.001 });
  assert.deepEqual(withValues(changed, apart, { "plant.noise.std": undefined }).values, {});
});

test("the event's own time is not a change", () => {
  const changed = withEdit(start, preset, 0, { at: 40, lasts: null });
  assert.deepEqual(changed.edits, { 0: { at: 40, lasts: null } });
  assert.deepEqual(withEdit(changed, preset, 0, { at: 50, lasts: 10 }).edits, {});
});

test("an edited event keeps its action", () => {
  const [first, second] = eventsOf(
    withEdit(start, preset, 0, { at: 40, lasts: null }),
    preset.loops[0],
  );
  assert.equal(first.at, 40);
  assert.equal("lasts" in first, false);
  assert.equal(first.label, "no yaw moment");
  assert.deepEqual(second, preset.loops[0].events.fault[1]);
});

test("a link contains the changes, and reads back as the same settings", () => {
  assert.equal(toHash(start, data), "#preset=fault");
  let changed = withValues(start, preset, {
    "controller.K1[1]": 2.5e-7,
    "plant.roll": false,
    "plant.integrator": "rk4",
  });
  changed = withEdit({ ...changed, stopTime: 50, step: 0.01 }, preset, 0, { at: 40, lasts: null });
  changed = { ...changed, hidden: ["PD"] };
  const hash = toHash(changed, data);
  assert.equal(
    hash,
    "#preset=fault&controller.K1[1]=2.5e-7&plant.roll=false&plant.integrator=rk4" +
      "&stop_time=50&step=0.01&events.1.at=40&events.1.for=always&hide=PD",
  );
  assert.deepEqual(fromHash(hash, data), { settings: changed, unknown: [] });
});

test("a link without events has none", () => {
  const none = { ...start, events: "" };
  assert.equal(toHash(none, data), "#preset=fault&events=");
  assert.deepEqual(fromHash("#preset=fault&events=", data).settings, none);
});

test("invalid fields of a link are listed and ignored", () => {
  const { settings, unknown } = fromHash(
    "#preset=no&controller.eps_t=x&plant.lost=1&stop_time=",
    data,
  );
  assert.deepEqual(settings, start);
  assert.deepEqual(unknown, ["preset=no", "controller.eps_t=x", "plant.lost=1", "stop_time="]);
});

test("names that are not understood get suggestions, and values do not", () => {
  const said = (field) => suggested(field, start, data);
  assert.equal(said("kd=5"), "kd=5; did you mean controller.k_d?");
  assert.equal(said("controller.epst=5"), "controller.epst=5; did you mean controller.eps_t?");
  assert.equal(said("stoptime=5"), "stoptime=5; did you mean stop_time?");
  assert.equal(said("preset=flet"), "preset=flet; did you mean fleet?");
  assert.equal(said("hide=pd"), "hide=pd; did you mean PD?");
  assert.equal(said("controller.k_d=x"), "controller.k_d=x");
  assert.equal(said("something=else"), "something=else");
});

test("a link may ask for a time", () => {
  assert.deepEqual(fromHash("#time=12.5", data), { settings: start, unknown: [], time: 12.5 });
  assert.deepEqual(fromHash("#time=-1", data).unknown, ["time=-1"]);
});

test("a controller is hidden once, and a second preset is listed as unknown", () => {
  const { settings, unknown } = fromHash("#preset=fault&hide=PD&preset=path&hide=PD", data);
  assert.deepEqual(settings, { ...start, hidden: ["PD"] });
  assert.deepEqual(unknown, ["preset=path"]);
});

test("an event that cannot end has no duration", () => {
  const [event] = preset.loops[0].events.fault;
  const [own, other] = preset.loops;
  const loops = [{ ...own, events: { fault: [{ ...event, canEnd: false }] } }, other];
  const { unknown } = fromHash("#events.1.for=2", { ...data, presets: [{ ...preset, loops }] });
  assert.deepEqual(unknown, ["events.1.for=2"]);
});

test("a link accepts no events, times or durations that are invalid in a scenario file", () => {
  const wrong = [
    "events=constructor",
    "events.1.at=-1",
    "events.1.at=",
    "events.1.for=0",
    "events.1.for=Infinity",
    "events.2.at=3",
    "events.3.for=2",
    "events.99999999999999999999.at=3",
  ];
  const { settings, unknown } = fromHash(`#${wrong.join("&")}`, data);
  assert.deepEqual(settings, start);
  assert.deepEqual(unknown, wrong);
});

test("an edit belongs to the same event in a loop with fewer events", () => {
  const [, second] = preset.loops[0].events.fault;
  const other = { ...preset.loops[1], events: { fault: [second] } };
  const changed = withEdit(start, preset, 0, { at: 40 });
  assert.deepEqual(eventsOf(changed, other), [second]);
  assert.equal(eventsOf(withEdit(start, preset, 1, { lasts: 3 }), other)[0].lasts, 3);
});

test("the name of a user's scenario is one word of the shell", () => {
  const [own, other] = preset.loops;
  const file = { ...own, scenario: "/tmp/my $(runs)/it's.toml" };
  assert.equal(commandLine(start, preset, file), "auv-fmu run '/tmp/my $(runs)/it'\\''s.toml'");
  const text = commandLine(start, preset, { ...other, label: "../my $(PD)" });
  assert.equal(text.split("\n")[0], "cat > fault-..-my-PD-.toml <<'END'");
});

test("an empty link opens the first preset", () => {
  assert.deepEqual(fromHash("", data), { settings: start, unknown: [] });
});

test("the command has the changes of its loop's parameters", () => {
  const [own] = preset.loops;
  assert.equal(commandLine(start, preset, own), "auv-fmu run fault");
  const changed = withValues({ ...start, stopTime: 50, step: 0.01 }, preset, {
    "controller.K1[1]": 20,
    "controller.k_d": 40,
  });
  assert.equal(
    commandLine(changed, preset, own),
    "auv-fmu run fault --set 'controller.K1[1]=20' --set controller.k_d=40 --stop-time 50 --step 0.01",
  );
});

test("edited events are written into a file", () => {
  const changed = withEdit(start, preset, 0, { at: 40 });
  assert.equal(
    commandLine(changed, preset, preset.loops[0]),
    `cat > fault-events.toml <<'END'
[[events]]
at = 40
for = 10
override = { "plant.tau.r" = 0 }
label = "no yaw moment"

[[events]]
when = "plant.eta.z < -1.5"
freeze = ["controller.y.x"]
label = "a \\"fix\\""
END
auv-fmu run fault --events fault-events.toml`,
  );
});

test("an empty set of events is written into a file", () => {
  const text = commandLine({ ...start, events: "" }, preset, preset.loops[0]);
  assert.equal(text.split("\n")[1], "events = []");
});

test("a loop without a scenario is written as a scenario file", () => {
  const changed = withValues({ ...start, events: "" }, preset, { "plant.noise.std": 0 });
  assert.equal(
    commandLine(changed, preset, preset.loops[1]),
    `cat > fault-PD.toml <<'END'
title = "fault with the PD controller"
stop_time = 100
step = 0.02
order = "jacobi"

[components]
plant = "AuvPlant"
controller = "PdController"
disturbance = "DisturbanceGenerator"
planner = "MotionPlanner"

[wires]
"controller.dy" = "plant.dy"

[parameters]
"controller.eps_t" = 10
"plant.noise.std" = 0
END
auv-fmu run fault-PD.toml`,
  );
});

test("a name is split after the longest component that it begins with", () => {
  const components = new Set(["auv1.plant", "leader", "auv1"]);
  assert.deepEqual(parted("auv1.plant.eta.x", components), ["auv1.plant", "eta.x"]);
  assert.deepEqual(parted("leader.waypoint[1].x", components), ["leader", "waypoint[1].x"]);
  assert.deepEqual(parted("auv1.eta.x", components), ["auv1", "eta.x"]);
});

test("a message names the parameter of one vehicle only", () => {
  const said = "auv1.plant: m11 = -1: must be at least 1e-09";
  assert.ok(names(said, "auv1.plant.m11"));
  assert.ok(!names(said, "auv2.plant.m11"));
  assert.ok(!names(said, "auv1.plant.m1"));
  assert.ok(names("plant: m11 = -1", "plant.m11"));
  assert.ok(names("auv1.plant.m11: not a number", "auv1.plant.m11"));
});

test("a slider is called by the first words of a description", () => {
  const words = {
    "Gain of the observer (k_d)": "Gain of the observer",
    "Gain of the adaptation, in SI units (gamma)": "Gain of the adaptation",
    "Ocean current in the earth frame; not in the paper: x": "Ocean current in the earth frame",
    "Initial posture: phi": "Initial posture",
    "Seed of the noise": "Seed of the noise",
  };
  for (const [description, wanted] of Object.entries(words)) {
    assert.equal(firstWords(description), wanted);
  }
});

test("sliders set the parameters of their vehicle", () => {
  const rows = GROUPS.flatMap((group) => group.rows);
  const [own, other] = [preset, fleet].map(({ loops }) => loops[0].vehicles.at(-1));
  for (const row of rows) {
    assert.deepEqual(sliderOf(own, row), row);
    assert.deepEqual(
      sliderOf(other, row).names,
      row.names.map((name) => `auv2.${name}`),
    );
  }
  const spoken = rows.map((row) => sliderOf(other, row).spoken).filter(Boolean);
  assert.ok(spoken.includes("limits of auv2.plant.tau.u"));
});

test("a link names a vehicle that is not the first", () => {
  const begin = untouched(fleet);
  assert.equal(toHash(begin, data), "#preset=fleet");
  const changed = withValues({ ...begin, vehicle: "auv2" }, fleet, { "auv2.controller.eps_t": 3 });
  const hash = toHash(changed, data);
  assert.equal(hash, "#preset=fleet&auv2.controller.eps_t=3&vehicle=auv2");
  assert.deepEqual(fromHash(hash, data), { settings: changed, unknown: [] });
  assert.deepEqual(fromHash("#preset=fleet&vehicle=auv9", data), {
    settings: begin,
    unknown: ["vehicle=auv9"],
  });
});

test("the scenario file of several vehicles has their number", () => {
  const text = commandLine({ ...untouched(fleet), stopTime: 50 }, fleet, fleet.loops[0]);
  const wanted = [
    "stop_time = 50",
    "vehicles = 2",
    '"auv2.plant" = "AuvPlant"',
    'leader = "PathPlanner"',
    '"auv2.disturbance" = false',
    '"auv1.controller.eps_t" = 10',
  ];
  for (const line of wanted) assert.ok(text.split("\n").includes(line), line);
});

test("all actions can be written into a scenario file", () => {
  const action = (one) => toToml([{ text: "", label: "", at: 0, action: one }]).split("\n")[2];
  assert.equal(
    action({
      kind: "set",
      parameters: [["plant.current.x", 0.3]],
      inputs: [["plant.tau.u", true]],
    }),
    'set = { "plant.current.x" = 0.3, "plant.tau.u" = true }',
  );
  assert.equal(action({ kind: "release", targets: ["a.b", "a.c"] }), 'release = ["a.b", "a.c"]');
  assert.equal(action({ kind: "reset", components: ["plant"] }), 'reset = ["plant"]');
  assert.equal(action({ kind: "stop", why: "" }), "stop = true");
});
