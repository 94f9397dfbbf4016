"""Simulations that are stepped by hand: the numbers of runs from start to end, and of FMPy."""

from __future__ import annotations

import pickle
import re
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fmu import Result, Simulation, SimulationFailed, Simulations, load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import Connection, Linear, PortName, System, read_component
from orchestrator.machine.compilers import machines_compiler
from support.mixed import Shape, build
from support.processor_card import ProcessorCard
from support.tiers import slow

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

H = 0.02

#: Loops and kinds, with the loop that then makes the steps.
WAYS = [
    ({"kind": "native"}, "program"),
    ({"kind": "native", "loop": "compiled"}, "compiled"),
    ({"kind": "native", "loop": "python"}, "python"),
    *slow(
        ({"kind": "native", "fmi": "3", "loop": "compiled"}, "compiled"),
        ({"kind": "python", "loop": "compiled"}, "compiled"),
        ({"kind": "native", "isolate": True}, "python"),
    ),
]
EACH_WAY = pytest.mark.parametrize(
    ("way", "loop"), WAYS, ids=lambda way: way if isinstance(way, str) else ""
)

#: Names that can be set, with values; `plant.y` is an output, which feeds the controller.
SETTABLE = {
    "plant.tau.u": 12.0,
    "controller.y": [0.1, -0.2, 0.3],
    "plant.y.x": 0.25,
    "plant.water.x": -0.1,
    "controller.k_d": 35.0,
    "disturbance.A_f": 0.7,
}
PARAMETERS = ("controller.k_d", "disturbance.A_f")

ACTIONS = st.one_of(
    st.tuples(st.just("set"), st.sampled_from(sorted(SETTABLE)), st.sampled_from([1.0, -0.5])),
    st.tuples(st.just("del"), st.sampled_from(sorted({*SETTABLE} - {*PARAMETERS}))),
    st.tuples(st.just("step"), st.integers(1, 9)),
    st.tuples(st.just("run"), st.integers(1, 20)),
    st.tuples(st.sampled_from(["save", "copy", "read"])),
    st.tuples(st.just("restore"), st.integers(0, 5)),
    st.tuples(st.just("reset"), st.sampled_from([{}, {"plant.d11": 40.0, "plant.noise.seed": 3}])),
)


class Timeline:
    """A simulation, and the events that a run from start to end needs for the same rows."""

    def __init__(self, sim: Simulation) -> None:
        self.sim, self.events, self.parameters = sim, list[dict[str, Any]](), dict[str, Any]()
        self.saved = [(sim.save(), [*self.events], {**self.parameters})]

    def act(self, what: str, *arguments: Any) -> None:
        getattr(self, what)(*arguments)

    def set(self, name: str, factor: float) -> None:
        value = np.multiply(SETTABLE[name], abs(factor) if name in PARAMETERS else factor).tolist()
        self.sim[name] = value
        kind = "set" if name in PARAMETERS else "override"
        self.events.append({"at": self.sim.time, kind: {name: value}})

    def delete(self, name: str) -> None:
        with suppress(ValueError):
            del self.sim[name]
            self.events.append({"at": self.sim.time, "release": name})

    def step(self, n: int) -> None:
        for _ in range(n):
            self.sim.step()

    def run(self, n: int) -> None:
        self.sim.run(until=(round(self.sim.time / H) + n) * H)

    def read(self) -> None:
        assert self.sim["plant.eta"].shape == (6,)

    def save(self) -> None:
        self.saved.append((self.sim.save(), [*self.events], {**self.parameters}))

    def restore(self, i: int) -> None:
        state, events, parameters = self.saved[i % len(self.saved)]
        if parameters != self.parameters:
            # Columns are the same: the state has the parameters.
            self.sim.reset(parameters)
        self.sim.restore(state)
        self.events, self.parameters = [*events], {**parameters}

    def copy(self) -> None:
        twin = self.sim.copy()
        # Whatever the first does now, the copy does not see.
        self.sim["plant.tau.u"] = -33.0
        self.sim.step()
        self.sim.close()
        self.sim = twin

    def reset(self, parameters: dict[str, Any]) -> None:
        self.sim.reset(parameters)
        self.events, self.parameters = [], {**parameters}


@EACH_WAY
@settings(max_examples=12)
@given(actions=st.lists(ACTIONS, max_size=12))
def test_any_sequence_ends_as_a_straight_run(
    way: dict[str, Any], loop: str, actions: Sequence[tuple[Any, ...]]
):
    system = fig4(way)
    timeline = Timeline(Simulation(system, step=H, **without_kind(way)))
    for what, *arguments in actions:
        timeline.act({"del": "delete"}.get(what, what), *arguments)
    timeline.step(2)
    with timeline.sim as sim:
        assert sim.loop == loop
        result, last = sim.result(), sim["plant.eta"]
    straight = simulate(
        system, timeline.parameters, events=timeline.events, step=H, stop_time=sim.time,
        **{"loop": "python", **without_kind(way)} if "isolate" not in way else {},
    )  # fmt: skip
    same_rows(result, straight)
    assert last.tolist() == result.rows[-1, place(result, "plant.eta")].tolist()


def fig4(way: dict[str, Any]) -> System:
    return loaded(way["kind"], way.get("fmi", "2"))


@cache
def loaded(kind: Any, fmi: Any) -> System:
    return load("fig4", kind, fmi=fmi)


def without_kind(way: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in way.items() if name not in ("kind", "fmi")}


def place(result: Result, group: str) -> list[int]:
    return [1 + i for i, name in enumerate(result.columns) if name.startswith(f"{group}.")]


def same_rows(first: Result, second: Result) -> None:
    assert first.columns == second.columns
    assert first.header.parameters == second.header.parameters
    for name in ("time", *first.columns):
        np.testing.assert_array_equal(first[name], second[name], name)


@EACH_WAY
@pytest.mark.parametrize("order", ["feedthrough", "gauss-seidel", "jacobi"])
def test_a_run_to_the_end_is_simulate(way: dict[str, Any], loop: str, order: str):
    options = {"stop_time": 0.51, "step": H, "order": order}
    with Simulation(fig4(way), **options, **without_kind(way)) as sim:
        sim.run()
        result = sim.result()
        assert (sim.loop, sim.time) == (loop, 0.51)
        # It continues from there, on another grid.
        sim.step()
        assert sim.time == pytest.approx(0.53, abs=1e-15)
        assert len(sim.result()) == len(result) + 1
    same_rows(result, simulate(fig4(way), **options))
    assert result.metrics() == simulate(fig4(way), **options).metrics()


def test_fmpy_makes_the_same_steps_of_any_length(native: Path):
    """FMPy drives the same FMU with the same inputs."""
    lengths = [0.02, 0.013, 0.02, 0.5, 1e-3, 0.0077, 0.02, 0.02]
    values: dict[str, list[list[float]]] = {}
    for loop in ("program", "compiled", "python"):
        with Simulation(native / "AuvPlant.fmu", stop_time=1.0, loop=loop) as sim:
            values[loop] = []
            for i, h in enumerate(lengths):
                sim["AuvPlant.tau"] = [10.0 + i, -3.0, 0.5 * i]
                sim.step(h)
                values[loop].append(sim["AuvPlant.eta"].tolist())
            assert sim.time == pytest.approx(sum(lengths), abs=1e-15)
            # It returns to its own step.
            sim.run(until=1.0)
            assert np.diff(sim.result().time)[-2] == pytest.approx(H, abs=1e-15)
            commands = sim.result()["AuvPlant.tau.u"][: len(lengths)]
            np.testing.assert_array_equal(commands, 10.0 + np.arange(len(lengths)))
    values["fmpy"] = [*fmpy_steps(native / "AuvPlant.fmu", lengths)]
    for loop, found in values.items():
        assert found == values["fmpy"], loop


def fmpy_steps(fmu: Path, lengths: Sequence[float]) -> Iterator[list[float]]:
    description = read_model_description(fmu)
    references = {v.name: v.valueReference for v in description.modelVariables}
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(fmu),
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    commands = [references[f"tau.{axis}"] for axis in "uqr"]
    eta = [references[f"eta.{name}"] for name in ("x", "y", "z", "phi", "theta", "psi")]
    time = 0.0
    for i, h in enumerate(lengths):
        slave.setReal(commands, [10.0 + i, -3.0, 0.5 * i])
        slave.doStep(time, h)
        time += h
        yield slave.getReal(eta)
    slave.terminate()
    slave.freeInstance()


@EACH_WAY
def test_it_fails_as_simulate_does_and_a_reset_mends_it(way: dict[str, Any], loop: str):
    failing = simulate(fig4(way), {"plant.d11": 1e4}, step=H)
    with Simulation(fig4(way), {"plant.d11": 1e4}, step=H, **without_kind(way)) as sim:
        before = sim.save()
        for go_on in (sim.run, sim.step, lambda: sim.run(until=1.0)):
            with pytest.raises(SimulationFailed) as raised:
                go_on()
            assert str(raised.value) == failing.failure
        same_rows(sim.result(), failing)
        assert sim.result().failure == failing.failure
        sim.restore(before)
        sim.run(until=5 * H)
        sim.reset({"plant.d11": 30.0})
        sim.run(until=1.0)
        same_rows(sim.result(), simulate(fig4(way), {"plant.d11": 30.0}, step=H, stop_time=1.0))


@EACH_WAY
def test_events_and_tables_act_and_your_hand_wins(way: dict[str, Any], loop: str):
    events = [
        {"at": 0.1, "override": {"plant.tau.u": 5.0}, "for": 0.2},
        {"at": 0.2, "set": {"controller.k_d": 30.0}},
    ]
    with Simulation(fig4(way), events=events, step=H, stop_time=0.6, **without_kind(way)) as sim:
        assert sim.loop == ("compiled" if loop == "program" else loop)
        for until, expected in ((0.08, None), (0.1, 5.0), (0.28, 5.0)):
            sim.run(until=until)
            assert (sim["plant.tau.u"] == expected) == (expected is not None)
        sim.run()
        same_rows(sim.result(), simulate(fig4(way), events=events, step=H, stop_time=0.6))
        sim.reset()
        sim.run(until=0.14)
        with sim.copy() as twin:
            sim.reset()
            twin.run()
            same_rows(twin.result(), simulate(fig4(way), events=events, step=H, stop_time=0.6))
        sim["plant.tau.u"] = -1.0
        sim.run(until=0.2)
        assert sim["plant.tau.u"] == -1.0
        assert sim["controller.k_d"] == 30.0
        for refused in (lambda: sim.step(0.01), lambda: sim.run(until=0.21), lambda: sim.run(2.0)):
            with pytest.raises(ValueError, match="the scenario's events allow"):
                refused()


@EACH_WAY
def test_wrong_names_and_values_are_refused_in_a_line(way: dict[str, Any], loop: str):
    with Simulation(fig4(way), step=H, stop_time=1.0, **without_kind(way)) as sim:
        with pytest.raises(KeyError, match=r"'plant.tau.x'; did you mean plant\.tau\."):
            sim["plant.tau.x"]
        for name, value, why in (
            ("plant.tau.u", float("nan"), "plant.tau.u = nan: must be finite"),
            ("plant.tau.u", "much", "not a real number"),
            ("plant.tau", [1.0, 2.0], "plant.tau: takes 3 values, not 2"),
            ("plant.eta.x", 1.0, "feeds nothing here"),
            ("plant.m11", 1.0, "fixed parameter: reset({'plant.m11': ...})"),
            ("controller.k_d", -1.0, "must be at least"),
            ("plant.tau_u", 1.0, "no port or parameter 'plant.tau_u'; did you mean plant.tau"),
        ):
            with pytest.raises(ValueError, match=re.escape(why)):
                sim[name] = value
        for h in (0.0, -1.0, float("nan"), float("inf")):
            with pytest.raises(ValueError, match="must be positive"):
                sim.step(h)
        sim.run(until=0.1)
        with pytest.raises(ValueError, match=r"until = 0\.05 s: the simulation has reached 0\.1 s"):
            sim.run(until=0.05)
        with pytest.raises(ValueError, match="another system"):
            sim.restore(sim.save()._replace(columns=()))
    with pytest.raises(ValueError, match="is closed"):
        sim.step()
    same_rows(sim.result(), simulate(fig4(way), step=H, stop_time=0.1))


def test_a_loop_that_cannot_be_had_is_refused():
    for options, why in (
        ({"loop": "program", "isolate": True}, "leave out kind and isolate"),
        ({"loop": "fast"}, "use one of auto, program, compiled, python"),
        ({"loop": "program", "events": [{"at": 1.0, "stop": True}]}, "no events"),
    ):
        with pytest.raises(ValueError, match=re.escape(why)):
            Simulation("fig4", **options)
    with pytest.raises(TypeError, match=r"^Simulation\(\) got an unexpected keyword argument 'h'"):
        Simulation("fig4", h=0.1)


def test_an_fmu_without_states_steps_and_is_named_where_it_needs_one(tmp_path: Path):
    fmu = build(tmp_path, Shape((1, 0, 0, 0), (1, 0, 0, 0)))
    with Simulation(fmu, step=0.1) as sim:
        [name] = [name for name in sim.result().columns if "input" in name]
        sim[name] = 2.0
        sim.step()
        assert (sim.time, sim[name], sim.stop_time) == (0.1, 2.0, None)
        for needs_one in (sim.save, sim.copy):
            with pytest.raises(ValueError, match="its FMU does not provide its state"):
                needs_one()
        with pytest.raises(ValueError, match=r"has no stop time; use run\(until=...\)"):
            sim.run()
        sim.run(until=0.3)
        assert sim.result().time.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-15)


def test_states_can_be_pickled_and_rows_left_out():
    with Simulation("fig4", stop_time=1.0) as sim, Simulation("fig4", keep=False) as other:
        for _ in range(25):
            sim.step()
            state = pickle.loads(pickle.dumps(sim.save()))
        wanted = sim.result().rows
        sim.run()
        other.restore(state)
        other.run(until=1.0)
        assert other["plant.eta"].tolist() == sim["plant.eta"].tolist()
        sim.restore(state)
        np.testing.assert_array_equal(sim.result().rows, wanted)
        with pytest.raises(ValueError, match="keep=False"):
            other.result()


def test_ctrl_c_stops_after_a_step_and_more_can_follow():
    for loop in ("program", "compiled"):
        with Simulation("fig4", kind="native", loop=loop, keep=False) as sim:
            timer = Timer(0.2, signal.raise_signal, [signal.SIGINT])
            timer.start()
            with pytest.raises(KeyboardInterrupt):
                sim.run(until=1e6)
            timer.join()
            reached = sim.time
            assert 0.0 < reached < 1e6
            assert reached == pytest.approx(round(reached / H) * H, rel=1e-12)
            sim.step()
            assert sim.time > reached


def test_threads_step_simulations_at_the_same_time():
    wanted = simulate("fig4", stop_time=2.0, kind="native")

    def stepped(loop: str) -> Result:
        with Simulation("fig4", stop_time=2.0, kind="native", loop=loop) as sim:
            while sim.time < 2.0 - 0.5 * H:
                sim.step()
            return sim.result()

    with ThreadPoolExecutor(4) as pool:
        for result in pool.map(stepped, ["program", "compiled", "python"] * 2):
            same_rows(result, wanted)


# Many at once


#: The processor, and the kernels of a card.
DEVICES = pytest.mark.parametrize("device", [None, ProcessorCard()], ids=["processor", "card"])


class Lent:
    """An array of another package, which has DLPack and nothing else."""

    def __init__(self, array: np.ndarray) -> None:
        self.__dlpack__, self.__dlpack_device__ = array.__dlpack__, array.__dlpack_device__


@DEVICES
def test_each_of_many_is_a_simulation_of_its_own(device: Any):
    n, random = 300, np.random.default_rng(1)
    d11, seeds = random.uniform(20.0, 60.0, n), np.arange(n)
    starts = np.zeros((n, 6))
    starts[:, :3] = random.uniform(-2.0, 2.0, (n, 3))
    forces = random.uniform(-20.0, 20.0, n)
    each = {"plant.d11": d11, "plant.eta0": starts, "plant.noise.seed": seeds}
    sims = Simulations("fig4", n, each, threads=2, device=device)
    sims.run(until=0.4)
    sims["plant.tau.u"] = Lent(forces)
    sims["controller.k_d"] = 40.0
    sims.step(5)
    del sims["plant.tau.u"]
    sims.reset([7], {"plant.d11": 33.0})
    sims.step()
    assert sims.time[[0, 7]].tolist() == [26 * H, H]
    for i in (0, 7, n - 1):
        own = {name: values[i].tolist() for name, values in each.items()}
        with pytest.warns(UserWarning, match="another vehicle"):
            sim = Simulation("fig4", own)
        with sim:
            if i == 7:
                sim.reset({"plant.d11": 33.0})
            else:
                sim.run(until=0.4)
                sim["plant.tau.u"] = forces[i]
                sim["controller.k_d"] = 40.0
                sim.run(until=25 * H)
                del sim["plant.tau.u"]
            sim.step()
            for name in ("plant.eta", "plant.y", "controller.tau", "controller.theta_hat"):
                assert sims[name][i].tolist() == sim[name].tolist(), name
            assert sims["plant.d11"][i] == sim["plant.d11"]


@DEVICES
def test_arrays_are_views_and_states_can_be_assigned(device: Any):
    sims = Simulations("fig4", 4, {"plant.noise.seed": np.arange(4)}, device=device)
    eta, saved = sims["plant.eta"], sims.states.copy()
    start = eta.copy()
    sims.step(10)
    ends = sims["plant.y"].copy()
    for name in ("plant.eta", "controller.k_d", "plant.noise.seed"):
        assert np.shares_memory(sims[name], sims.states)
    assert (eta != start).any()
    if device is None:
        with pytest.raises(ValueError, match="read-only"):
            eta[:] = 0.0
    sims.states[:] = saved
    np.testing.assert_array_equal(eta, start)
    sims.step(10)
    np.testing.assert_array_equal(sims["plant.y"], ends)
    sims["plant.tau.u"] = [1.0, 2.0, 3.0, 4.0]
    sims.step()
    sims.states[:] = sims.states[2]
    sims.step(50)
    assert sims["plant.tau.u"].tolist() == [3.0] * 4
    assert len(np.unique(sims["plant.y"], axis=0)) == 1


@DEVICES
def test_vehicles_of_a_fleet_have_their_noise_and_connections(native: Path, device: Any):
    names, plant = ("one.plant", "two.plant"), native / "AuvPlant.fmu"
    wire = Connection(
        PortName("one.plant", "nu.u"), PortName("two.plant", "water.x"), Linear(0.5, 0.25)
    )
    fleet = System("fleet", {name: read_component(name, plant) for name in names}, (wire,))
    seeds = {f"{name}.noise.seed": np.arange(3) + 3 * i for i, name in enumerate(names)}
    sims = Simulations(fleet, 3, seeds, device=device)
    # Generators make new words after 312 numbers.
    sims.step(120)
    speeds = np.array([1.0, 2.0, 3.0])
    sims["one.plant.nu.u"] = speeds
    sims.step()
    assert sims["two.plant.water.x"].tolist() == (0.5 * speeds + 0.25).tolist()
    for i in range(3):
        with Simulation(fleet, {name: values[i] for name, values in seeds.items()}) as sim:
            sim.run(until=120 * H)
            sim["one.plant.nu.u"] = speeds[i]
            sim.step()
            for name in ("one.plant.y", "two.plant.y", "two.plant.eta"):
                assert sims[name][i].tolist() == sim[name].tolist(), name


def test_of_many_none_takes_a_parameter_that_a_component_refuses(workplace: Path):
    script = Path(__file__).parents[2] / "examples" / "notch_filter" / "notch_filter.py"
    # Another test may have loaded the script by its own name.
    (workplace / "notch.py").write_text(script.read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["build", "notch.py", "--kind", "python", "--out", "."]) == 0
    with Simulation("Notch.fmu", {"Notch.f0": 4.0}) as sim:
        for _ in range(5):
            sim.step()
        wanted = sim["Notch.y"]
    for device in (None, ProcessorCard()):
        sims = Simulations("Notch.fmu", 3, device=device)
        sims["Notch.f0"] = [3.0, 4.0, 5.0]
        with pytest.raises(ValueError, match=r"Notch\.f0: the component refuses"):
            sims["Notch.f0"] = [6.0, 25.0, 7.0]
        assert sims["Notch.f0"].tolist() == [3.0, 4.0, 5.0]
        sims.step(5)
        assert sims["Notch.y"][1] == wanted


@DEVICES
def test_one_of_many_may_fail_and_begin_again(device: Any):
    sims = Simulations("fig4", 3, {"plant.d11": np.array([30.0, 1e4, 30.0])}, device=device)
    sims.run(until=1.0)
    assert sims.failed.tolist() == [False, True, False]
    # simulate stops there, too.
    assert sims.time[1] == pytest.approx(0.28, abs=1e-12)
    sims.reset(sims.failed, {"plant.d11": 30.0})
    assert not sims.failed.any()
    assert sims.time.tolist() == [1.0, 0.0, 1.0]
    sims.run(until=1.0)
    assert sims["plant.eta"][1].tolist() == sims["plant.eta"][0].tolist()


@DEVICES
def test_many_refuse_what_one_refuses(device: Any):
    for parameters, why in (
        ({"plant.d11": np.array([1.0, -1.0])}, "plant.d11 = -1"),
        ({"plant.d11": np.array([1.0, np.nan])}, "must be finite"),
        ({"plant.d12": np.array([1.0, 1.0])}, "no port or parameter 'plant.d12'"),
        ({"plant.noise.seed": np.array([1, 2**31])}, "plant.noise.seed = 2147483648"),
        (
            {"plant.tau_min.u": np.array([-1.0, 0.0]), "plant.tau_max.u": np.array([1.0, 0.0])},
            "simulation 1: plant: tau_min.u = 0 must be below",
        ),
    ):
        with pytest.raises(ValueError, match=re.escape(why)):
            Simulations("fig4", 2, parameters, device=device)
    sims = Simulations("fig4", 2, device=device)
    for name, values, why in (
        ("plant.tau.u", [1.0, 2.0, 3.0], "takes an array of shape (2,), not (3,)"),
        ("plant.tau", np.zeros((2, 2)), "takes an array of shape (2, 3), not (2, 2)"),
        ("plant.tau.u", [1.0, np.inf], "must be finite"),
        ("plant.m11", 1.0, "fixed parameter"),
    ):
        with pytest.raises(ValueError, match=re.escape(why)):
            sims[name] = values
    with pytest.raises(ValueError, match="must be a multiple"):
        sims.run(until=0.5 * H)
    with pytest.raises(ValueError, match="has events"):
        Simulations("fault-sensor", 2)


def test_a_device_that_cannot_be_had_is_refused():
    for device, why in (
        ("gpu", "device = 'gpu': use cpu, cuda or, for the second card, cuda:1"),
        ("cuda:99", r"without device, the processor does the same|device = 'cuda:99'"),
        (ProcessorCard(memory=2**20), r"n = 1000: this processor has memory for \d+"),
    ):
        with pytest.raises(ValueError, match=why):
            Simulations("fig4", 1000, device=device)
