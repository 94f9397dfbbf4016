"""Rings of direct feedthroughs, solved, delayed, or with linear inputs, beside exact solutions."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, sin
from pathlib import Path

import fmpy
import numpy as np
import pytest

from orchestrator.cosim import (
    Checkpoints,
    Experiment,
    Isolation,
    PortName,
    Run,
    System,
    Table,
    make_plan,
    simulate_plan,
)
from orchestrator.cosim.fmi.instance import ComponentFailed
from orchestrator.cosim.loop import compile_stepper
from orchestrator.machine.errors import InputError
from support.linear import QUARTER_TRUCK, SINE, TWO_MASSES, Model, Part, error, linear, system_of
from support.runs import run_table
from support.runs import whole as run
from support.texts import mentions

H = 0.1

#: y_a = k u_a + sin t, y_b = l u_b: the gain of the ring is k l.
WIRES = {"a.u0": "b.y1", "a.u1": "s.y0", "b.u0": "a.y1"}


def gains(k: float, l: float) -> dict[str, Part]:
    return {"s": SINE, "a": Part(D=[[0.0, 0.0], [k, 1.0]]), "b": Part(D=[[0.0, 0.0], [l, 0.0]])}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("linear")


def ring(folder, k: float, l: float, names: str = "sab", **kind: object) -> System:
    return system_of({name: linear(folder, **kind) for name in names}, gains(k, l), WIRES)


@pytest.mark.parametrize(
    ("k", "l", "order"),
    [(0.5, 0.9, "feedthrough"), (1.0, -2.0, "gauss-seidel"), (2.0, 3.0, "jacobi")],
)
@pytest.mark.parametrize("can", [True, False])
def test_static_rings_are_solved_in_every_row_whatever_their_gain(folder, k, l, order, can):
    """By directional derivatives, and by differences."""
    table = run(ring(folder, k, l, can=can), Experiment(5.0, H, order))
    solution = np.sin(table.time) / (1.0 - k * l)
    np.testing.assert_allclose(table["a.y1"], solution, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(table["b.y1"], l * solution, rtol=0.0, atol=1e-13)


def test_a_ring_through_our_controller_is_solved_without_a_step(folder, dist: Path):
    """Its measurement follows its own command; the gain is 50 times too large for iteration.

    FMPy gives it alone what the ring has come to, and gets its commands after the step.
    """
    fmu, controller = linear(folder, can=False), dist / "ObserverController.fmu"
    k, own = 0.1, {"innovation_gate": 0.0}
    system = system_of(
        {"s": fmu, "gain": fmu, "controller": controller},
        {"s": SINE, "gain": Part(D=[[0.0, 0.0], [k, 0.1]])},
        {"gain.u0": "controller.tau.u", "gain.u1": "s.y0", "controller.y.x": "gain.y1"},
    ).with_parameters({PortName("controller", name): value for name, value in own.items()})
    table = run(system, Experiment(1.0, 0.02))
    assert table.header.experiment.order == "feedthrough"
    tau, y = table["controller.tau.u"], table["gain.y1"]
    np.testing.assert_allclose(y, k * tau + 0.1 * np.sin(table.time), rtol=0.0, atol=1e-9)
    given = np.array([*zip(table.time, y, strict=True)], dtype=[("time", float), ("y.x", float)])
    alone = fmpy.simulate_fmu(
        str(controller), stop_time=1.0, step_size=0.02, output_interval=0.02, input=given,
        output=["tau.u"], start_values=own,
    )  # fmt: skip
    assert np.ptp(tau) > 0.1
    np.testing.assert_allclose(tau[:-1], alone["tau.u"][1:], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("names", ["abs", "bsa", "sba"])
def test_the_order_of_elements_does_not_matter(folder, names):
    first, other = (
        run(ring(folder, 1.0, -2.0, some), Experiment(1.0, H)) for some in ("sab", names)
    )
    for column in first.columns:
        np.testing.assert_allclose(other[column], first[column], rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("coupling", ["solve", "linear"])
def test_both_loops_and_isolation_make_the_same_rows(folder, coupling):
    system, experiment = ring(folder, 0.5, 0.9), Experiment(2.0, H, coupling=coupling)
    compile_stepper()
    table, *others = (
        run(system, experiment),
        run(system, experiment, loop="compiled"),
        run(system, experiment, isolation=Isolation()),
    )
    for other in others:
        assert other.rows.tobytes() == table.rows.tobytes()


def test_a_ring_of_components_without_a_ring_of_ports_is_not_late(folder):
    """Each output follows one input only, and the FMU says that both follow both."""
    passes = Part(D=np.eye(2))
    parts = {"s": SINE, "a": passes, "b": passes}
    wires = {"a.u0": "s.y0", "a.u1": "b.y0", "b.u0": "a.y0", "b.u1": "a.y1"}
    for names in ("sab", "bas"):
        fmus = {name: linear(folder, "all", can=False) for name in names}
        table = run(system_of(fmus, parts, wires), Experiment(2.0, H))
        for output in ("a.y0", "a.y1", "b.y0", "b.y1"):
            np.testing.assert_array_equal(table[output], table["s.y0"])


def test_components_fed_by_a_ring_take_its_new_outputs(folder):
    """Wherever it stands; it is in no ring itself."""
    parts = {"sink": Part(D=[[0.0, 0.0], [3.0, 0.0]]), **gains(0.5, 0.9)}
    wires = {**WIRES, "sink.u0": "a.y1"}
    for coupling in ("solve", "delay"):
        for names in (["sink", *"sab"], [*"abs", "sink"]):
            fmus = {name: linear(folder) for name in names}
            table = run(system_of(fmus, parts, wires), Experiment(2.0, H, coupling=coupling))
            np.testing.assert_array_equal(table["sink.u0"], table["a.y1"])
            np.testing.assert_array_equal(table["sink.y1"], 3.0 * table["a.y1"])


@pytest.mark.parametrize(
    ("order", "taken"),
    [("feedthrough", [0.0, 0.2, 0.42, 0.66]), ("gauss-seidel", [0.0, 0.22, 0.46, 0.72])],
)
@pytest.mark.parametrize("names", ["abs", "sba"])
def test_the_order_of_two_solved_rings_does_not_matter(folder, names, order, taken):
    """b takes a new value from a without feedthrough, in any order of the two."""
    itself = [[0.0, 0.0], [0.5, 1.0]]
    parts = {
        "a": Part(B=[[0.0, 1.0], [0.0, 0.0]], C=[[1.0, 0.0], [0.0, 0.0]], D=itself, x=[1.0, 0.0]),
        "b": Part(D=itself),
        "s": Part(B=[[1.0, 0.0], [0.0, 0.0]], C=[[1.0, 0.0], [0.0, 0.0]]),
    }
    wires = {"a.u0": "a.y1", "b.u0": "b.y1", "b.u1": "a.y0", "s.u0": "b.y1"}
    system = system_of({name: linear(folder) for name in names}, parts, wires)
    system = system.with_parameters({PortName("a", "u1"): 1.0})
    table = run(system, Experiment(0.3, H, order))
    # a.y0 = 1 + t, b.y1 = 2 a.y0, which s takes at the beginning or at the end of each step.
    np.testing.assert_allclose(table["b.y1"], 2.0 + 2.0 * table.time, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(table["s.y0"], taken, rtol=0.0, atol=1e-14)


def test_fmus_that_compute_outputs_in_steps_only_are_delayed_and_one_line_says_so(folder):
    system, table = ring(folder, 0.5, 0.9, cached=True, can=False), Table()
    ending = simulate_plan(make_plan(system, Experiment(2.0, H)), [table])
    [message] = ending.messages
    assert mentions(message, "a b.y1 late: ring; Real")
    a = b = 0.0
    for k, sine in enumerate(np.sin(H * np.arange(20)), start=1):
        a = 0.5 * b + sine
        b = 0.9 * a
        assert table["a.y1"][k] == pytest.approx(a, abs=1e-13)
    with pytest.raises(InputError, match=r"solve: a .*b\.y1"):
        simulate_plan(make_plan(system, Experiment(2.0, H, coupling="solve")))


@pytest.mark.parametrize(("order", "late"), [("feedthrough", 0), ("gauss-seidel", 1)])
@pytest.mark.parametrize("k", [-2.0, 6.0])
def test_a_delayed_ring_whose_values_grow_is_run_until_they_are_no_longer_finite(
    folder, k, order, late
):
    """Every row that is finite is kept."""
    steps = value = 0
    while isfinite(value := k * value + sin(H * (steps + 1 - late))):
        steps += 1
    experiment = Experiment(3000 * H, H, order, coupling="delay")
    table = run_table(ring(folder, k, 1.0), experiment)
    assert len(table.rows) == 1 + steps
    assert mentions(str(table.failure), f"{H * (1 + steps):.12g}")
    shorter = run_table(ring(folder, k, 1.0), replace(experiment, stop_time=steps * H))
    assert shorter.failure is None
    assert shorter.rows.tobytes() == table.rows.tobytes()


@pytest.mark.parametrize("growth", [0.0, 0.3])
def test_values_that_grow_without_a_fault_are_accepted(folder, growth):
    """A ramp, and exponentials of time, on a ring that is delayed."""
    parts = gains(0.5, 0.9) | {"s": Part(A=[[growth, 1.0], [0.0, growth]], C=np.eye(2), x=[0, 1])}
    system = system_of({name: linear(folder) for name in "sab"}, parts, WIRES)
    assert simulate_plan(make_plan(system, Experiment(40.0, H, coupling="delay"))).failure is None


@pytest.mark.parametrize("isolation", [None, Isolation()])
def test_inputs_change_linearly_also_where_a_new_value_ends_their_change(folder, isolation):
    """FMI does not say whether it does: values are set first, and then how they change."""
    system = ring(folder, 0.5, 0.9)
    forgetful = ring(folder, 0.5, 0.9, forgets=True)
    experiment = Experiment(1.0, H, coupling="linear")
    table, other = (
        run_table(version, experiment, isolation=isolation) for version in (system, forgetful)
    )
    assert table.failure is None
    assert other.rows.tobytes() == table.rows.tobytes()


class _Broken:
    """A hook that ends a run after some steps."""

    def act(self, run: Run) -> int:
        if run.made == 21:
            raise ComponentFailed("broken off")
        return 21


@pytest.mark.parametrize("coupling", ["solve", "linear"])
def test_a_run_with_a_solved_ring_continues_from_its_checkpoint(folder, tmp_path, coupling):
    system, experiment = ring(folder, 1.0, -2.0), Experiment(3.0, H, coupling=coupling)
    whole, again = run(system, experiment), Table()
    kept = Checkpoints(tmp_path, {}, 1.0, resume=False)
    ending = simulate_plan(make_plan(system, experiment), [kept], hooks=[kept, _Broken()])
    assert ending.failure == "stopped at t = 2.1 s: broken off"
    kept = Checkpoints(tmp_path, {}, 1.0, resume=True)
    simulate_plan(make_plan(system, experiment), [again, kept], hooks=[kept])
    assert kept.time == 3.0
    assert again.rows.tobytes() == whole.rows.tobytes()


@pytest.mark.parametrize(
    ("model", "steps", "last", "says"),
    [
        (TWO_MASSES, (0.05, 0.025, 0.0125), 2e-3, "dependencies"),
        (QUARTER_TRUCK, (0.005, 0.0025, 0.00125), 1e-3, "nothing"),
    ],
)
def test_linear_inputs_are_of_second_order_where_held_ones_are_of_first(
    folder, model: Model, steps, last, says
):
    def found(coupling: str | None, step: float) -> float:
        return error(folder, model, Experiment(model.stop, step, coupling=coupling), says)

    errors = [found("linear", step) for step in steps]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert ((orders > 1.8) & (orders < 2.6)).all(), orders
    assert errors[-1] < last
    assert found(None, steps[-1]) > 10.0 * errors[-1]


def test_linear_inputs_are_refused_where_an_fmu_cannot_take_them(folder):
    system = ring(folder, 0.5, 0.9, can=False)
    with pytest.raises(InputError, match=r"linear: a .*canInterpolateInputs"):
        simulate_plan(make_plan(system, Experiment(1.0, H, coupling="linear")))
    system = replace(ring(folder, 0.5, 0.9), steps={"b": 2 * H})
    with pytest.raises(InputError, match="linear: b: "):
        simulate_plan(make_plan(system, Experiment(1.0, H, coupling="linear")))
    with pytest.raises(InputError, match="order"):
        Experiment(1.0, H, ("a", "b", "s"), coupling="linear")
    with pytest.raises(InputError, match=r"'strong': .*solve, delay, linear"):
        Experiment(1.0, H, coupling="strong")
