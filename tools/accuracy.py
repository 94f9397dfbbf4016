"""What the step does to the numbers of the scenarios, for docs/explanation/accuracy.md.

`python tools/accuracy.py` prints them in Markdown. All runs are without measurement noise. The
batch engine makes them; only the body that moves freely is run by the FMU. It takes three minutes
on one core, and 1 GB.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from auv_fmu.loop import closed_loop
from auv_fmu.loop.closed_loop import LongestSteps, Scene, Setting, Vehicles
from auv_fmu.paper import motion_planner, plant
from auv_fmu.paper.attitude import normalised, rotation_from_quaternion
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.output_feedback import ControllerState
from fmus.ports.port import H_MAX
from orchestrator import load, simulate
from orchestrator.cosim.observers.table import Table
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.paper.measures import total_variation_until
from orchestrator.paper.page import table
from orchestrator.program.components import definitions_of
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Point
from orchestrator.vehicle.signals import ACTUATORS, STANDARD, true_control_point

Values = Mapping[str, Any]

#: Scenarios, and how long they take [s].
SCENARIOS = {
    "fig4": 100.0, "fig5": 100.0, "fig5-pd": 100.0, "fig6": 200.0, "fig6-pd": 200.0,
    "fig7a": 100.0, "fig7b": 100.0, "fig7c": 100.0,
}  # fmt: skip

#: Its path depends on the last bits of its start: of numbers there are bands.
CHAOTIC = "fig6-pd"

#: Smaller steps than the paper's, and one that stands for their limit [s].
SMALLER, LIMIT = (0.01, 0.005, 0.002), 0.0002

QUIET: Values = {"plant.noise.std": 0.0}
EULER: Values = {}
RK4: Values = {"plant.integrator": "rk4"}
EXACT: Values = {**RK4, "plant.h_max": STEP / 10}
NO_FRICTION: Values = {"disturbance.A_f": 0.0}

#: How far starts are moved at most [m], and how many.
MOVED, STARTS = 1e-6, 10

#: Indices by the names of the tables: their names in metrics.json, and their three parts.
INDICES = {
    "L2": ("l2_effort", "uqr"), "peak": ("peak_command", "uqr"), "TV": ("total_variation", "uqr"),
    "e_f": ("final_error", "xyz"),
}  # fmt: skip

#: What changes by a larger share depends on the step.
MUCH = 0.05

#: What is compared in the tables of the whole loop.
WAYS = [*((EULER, h) for h in (STEP, *SMALLER)), (RK4, STEP)]
HEADS = [*(f"{1e3 * h:g} ms" for h in (STEP, *SMALLER)), "20 ms, `rk4`"]


class Runs:
    """Runs of the scenarios."""

    def __init__(self) -> None:
        """Load them."""
        self._systems = {name: load(name) for name in SCENARIOS}
        self._engine = BatchEngine(self._systems)

    def setting(self, name: str, values: Values) -> Setting:
        """What the equations are given."""
        changed = {PortName.read(port): value for port, value in {**QUIET, **values}.items()}
        return setting_of(self._systems[name].with_parameters(changed))

    def table(self, name: str, values: Values = EULER, step: float = STEP) -> Table:
        """With all rows."""
        return self._engine.table(self._run(name, values, step))

    def path(self, name: str, values: Values = EULER, step: float = STEP) -> np.ndarray:
        """Of the control point, every 20 ms [m]."""
        return true_control_point(self.table(name, values, step))[:: round(STEP / step)]

    def indices(self, name: str, values: Values, step: float) -> dict[str, float]:
        """By the names of the tables."""
        [outcome] = self._engine.outcomes([self._run(name, values, step)])
        return {
            f"{index} {part}": outcome.indices[f"{long}.{part}"]
            for index, (long, parts) in INDICES.items()
            for part in parts
        }

    def starts(self, name: str) -> Iterator[dict[str, float]]:
        """Some that are moved."""
        x = float(self.table(name)["plant.eta.x"][0])
        for i in range(1, STARTS + 1):
            yield {"plant.eta0.x": x + MOVED * i / STARTS}

    @staticmethod
    def _run(name: str, values: Values, step: float) -> Point:
        return Point(0, name, {**QUIET, **values}, stop_time=SCENARIOS[name], step=step)


def plant_alone(runs: Runs) -> None:
    """What the scheme in the plant makes of a path, the controller being sampled as it is."""
    rows = []
    for name in SCENARIOS:
        exact, path = runs.path(name, EXACT), runs.path(name)
        moved = [largest(runs.path(name, start), path) for start in runs.starts(name)]
        cells = distances(path, exact), distances(runs.path(name, RK4), exact), length(max(moved))
        rows.append([f"`{name}`", *cells])
    show(["scenario", "`euler`", "`rk4`", "start moved by 1 µm"], rows)


def whole_loop(runs: Runs) -> None:
    """How far paths are from the limit of small steps of everything."""
    rows = []
    for name in SCENARIOS.keys() - {CHAOTIC}:
        for friction, said in ((NO_FRICTION, "0"), ({}, "as it is")):
            limit = runs.path(name, friction, LIMIT)
            paths = (runs.path(name, {**friction, **values}, h) for values, h in WAYS)
            rows.append([f"`{name}`", said, *(distances(path, limit) for path in paths)])
    limit = runs.table("fig6", step=LIMIT).group(*STANDARD.y_d)[:: round(STEP / LIMIT)]
    planned = (
        runs.table("fig6", *way).group(*STANDARD.y_d)[:: round(STEP / way[1])] for way in WAYS
    )
    reference = ["the reference", "", *(distances(y_d, limit) for y_d in planned)]
    show(["scenario", "`A_f`", *HEADS], [*sorted(rows), reference])
    for name in ("fig4", "fig5", "fig5-pd"):
        limit = runs.path(name, NO_FRICTION, LIMIT)
        exact = continuous(runs.setting(name, NO_FRICTION), SCENARIOS[name])
        split = runs.path(name, {**NO_FRICTION, "controller.h_max": 0.002})
        print(
            f"\n`{name}` without friction, from the limit: solve_ivp {distances(exact, limit)}; "
            f"20 ms with controller.h_max = 2 ms {distances(split, limit)}."
        )


def printed_numbers(runs: Runs) -> None:
    """Which indices depend on the step."""
    rows, same = [], []
    for name in SCENARIOS.keys() - {CHAOTIC}:
        found = [runs.indices(name, *way) for way in WAYS]
        for index, here in found[0].items():
            values = [indices[index] for indices in found]
            changes = [abs(value / here - 1.0) for value in values]
            if max(changes) > MUCH:
                marks = ["**" if change > MUCH else "" for change in changes]
                cells = [f"{m}{number(v)}{m}" for m, v in zip(marks, values, strict=True)]
                rows.append([f"`{name}`", index, *cells])
            else:
                same.append(max(changes))
    show(["scenario", "index", *HEADS], sorted(rows))
    print(f"\nThe {len(same)} other indices change by {100 * max(same):.1f} % at most.")
    bands = [
        [runs.indices(CHAOTIC, {**values, **start}, h) for start in runs.starts(CHAOTIC)]
        for values, h in WAYS
    ]
    rows = [[index, *(band([run[index] for run in one]) for one in bands)] for index in bands[0][0]]
    show([f"`{CHAOTIC}`", *HEADS], rows)
    rows = []
    for name, until in (("fig5", SCENARIOS["fig5"]), ("fig6", 60.0)):
        ratios = [
            total_variation_until(runs.table(f"{name}-pd", *way), until)
            / total_variation_until(runs.table(name, *way), until)
            for way in WAYS
        ]
        rows += [
            [f"`{name}`, {until:g} s, {k}", *(number(ratio, 2) for ratio in column)]
            for k, column in zip(ACTUATORS, np.transpose(ratios), strict=True)
        ]
    show(["TV, PD over proposed", *HEADS], rows)


def free_body() -> None:
    """Energy of a body that nothing drives or brakes, after 20 s over that at the start."""
    zeros = [*(f"d{i}{i}" for i in range(1, 7)), *(f"tau.{k}" for k in "uqr"), "righting.pitch"]
    free = {f"plant.{name}": 0.0 for name in (*zeros, "righting.roll")}
    free |= {"plant.nu0.u": 1.0, "plant.nu0.q": 0.3, "plant.nu0.r": 0.5}
    rows = []
    for text, values in (
        ("`euler`, 20 ms", EULER),
        ("`euler`, `h_max` = 2 ms", {"plant.h_max": 0.002}),
        ("`rk4`, 20 ms", RK4),
    ):
        result = simulate("fig3b", {**free, **values}, stop_time=20.0, kind="native")
        masses = np.array([result.parameters[f"plant.m{i}{i}"] for i in range(1, 7)])
        energy = result.group(*(f"plant.nu.{k}" for k in "uvwpqr")) ** 2 @ masses
        rows.append([text, f"{100 * (energy[-1] / energy[0] - 1.0):+.2g} %"])
    show(["plant", "change of the energy"], rows)


def continuous(setting: Setting, stop: float) -> np.ndarray:
    """The path of the loop whose controller is not sampled, every 20 ms [m].

    Planner and controller go on by Euler's scheme, whose step over its length is the rate.
    """
    own, gains, settings, h = setting.plant, setting.controller, setting.planner, 2.0**-10
    begun = closed_loop.begin(setting, (0.0, 0.0, 0.0))
    control_begun = begun.controller_state
    if isinstance(control_begun, ControllerState):
        # Its steps are all of one length, which so does not change.
        control_begun = control_begun._replace(h=h)
    start = begun.vehicles.plant, begun.vehicles.planner, control_begun

    def unpacked(t: float, x: np.ndarray) -> tuple[Vehicles, Any, Scene]:
        state, planner, control = like(start, iter(x.tolist()))
        rotation = rotation_from_quaternion(normalised(state.quaternion))
        moving = motion_planner.motion(settings.vehicle, planner, settings.tau_d)
        vehicles = Vehicles(state, rotation, planner, moving)
        return vehicles, control, closed_loop.scene(setting, vehicles, t, (0.0, 0.0, 0.0))

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        vehicles, control, seen = unpacked(t, x)
        measured = closed_loop.measurement(gains, seen)
        control = closed_loop.gated(gains, control, seen.y)
        signals = closed_loop.evaluate(gains, control, measured, 0.0)
        tau = plant.applied(own, signals.tau)
        state, rotation = vehicles.plant, vehicles.rotation
        moving = plant.rates(own.vehicle, own.roll, state, rotation, tau, seen.tau_w)
        planned = motion_planner.step(vehicles.planner, vehicles.moving, h)
        control_later = closed_loop.advanced(gains, control, signals, h)
        rest = np.subtract(flat((planned, control_later)), flat((vehicles.planner, control))) / h
        return np.array([*flat(moving), *(0.0 for _ in flat((state.tau, state.water))), *rest])

    times = STEP * np.arange(round(stop / STEP) + 1)
    found = solve_ivp(
        rates, (0.0, stop), flat(start), "DOP853", t_eval=times, rtol=1e-9, atol=1e-11
    )
    states = zip(found.t, found.y.T, strict=True)
    return np.array([unpacked(t, x)[2].plant.y for t, x in states])


def setting_of(system: System) -> Setting:
    """The parameters of the components of Fig. 2, as their equations take them."""
    given = {name: _values(system, name) for name in system.components}
    of = {
        name: definition.parameters.of(given[name])
        for name, definition in definitions_of(system).items()
    }
    longest = LongestSteps(*(given[name][H_MAX] for name in LongestSteps._fields))
    return Setting(of["plant"], of["controller"], of["disturbance"], of["planner"], longest)


def _values(system: System, component: str) -> Mapping[str, Any]:
    """The numbers of all parameters of a component."""
    found: dict[str, Any] = {}
    for variable in system.components[component].having("parameter"):
        name = PortName(component, variable.name)
        found[variable.name] = variable.typed(system.value(name), str(name))
    return found


def flat(state: Any) -> list[float]:
    """The numbers of a state, in their order."""
    if isinstance(state, float):
        return [state]
    return [number for part in state for number in flat(part)]


def like(state: Any, numbers: Iterator[float]) -> Any:
    """The state of the same form with other numbers."""
    if isinstance(state, float):
        return next(numbers)
    parts = [like(part, numbers) for part in state]
    return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)


def largest(path: np.ndarray, other: np.ndarray) -> float:
    """Distance of two paths [m]."""
    return float(np.linalg.norm(path - other, axis=1).max())


def distances(path: np.ndarray, other: np.ndarray) -> str:
    """The largest, and the root of the mean square."""
    rms = np.sqrt(np.mean(np.sum((path - other) ** 2, axis=1)))
    return f"{length(largest(path, other))}; {length(rms)}"


def length(x: float) -> str:
    """In a unit that needs neither exponent nor zeros."""
    units = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9}
    unit = next((unit for unit, size in units.items() if x >= 0.995 * size), "nm")
    return f"{number(x / units[unit], 2)} {unit}"


def number(x: float, digits: int = 3) -> str:
    """With so many digits, and no exponent."""
    return f"{float(f'{x:.{digits}g}'):,.9g}"


def band(values: Sequence[float]) -> str:
    """From the smallest to the largest."""
    low, high = number(min(values)), number(max(values))
    return low if low == high else f"{low} to {high}"


def show(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print(f"\n{table(head, rows)}")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    made = Runs()
    plant_alone(made)
    whole_loop(made)
    printed_numbers(made)
    free_body()
