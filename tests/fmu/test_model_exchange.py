"""FMUs for model exchange: FMPy's solver gives the solution of the equations in Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from ctypes import Structure, byref, c_bool, c_double, c_int, c_size_t
from functools import cache
from inspect import signature
from itertools import pairwise
from math import inf, nan, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from fmus.discovery import Source, source_of
from fmus.kinds import FMI_VERSIONS
from fmus.native.packaging import NativeKind
from fmus.ports.definition import Definition
from fmus.ports.groups import class_of, flat, is_record, parts_of, unpacking
from orchestrator.machine.compilers import compiler_for, platforms
from support.examples import source as example
from support.fmi3 import Fmi3Library
from support.markdown import sections
from support.raw import MODEL_EXCHANGE, Host, Library, Status, instance
from support.settings import NAMES
from support.status_table import PAGE
from support.tiers import slow


class EventInfo(Structure):
    """fmi2EventInfo."""

    _fields_ = (*((f"flag{k}", c_int) for k in range(5)), ("next_event_time", c_double))


class Case(NamedTuple):
    """A run of a component: its end [s], values of ports, and the error of the solver's result."""

    stop: float
    values: Mapping[str, float] = {}
    error: float = 1e-6


#: Between limits, where the equations are smooth.
CASES = {
    "AuvPlant": Case(20.0, {
        "tau.u": 30.0, "tau.q": -2.0, "tau.r": 1.0, "tau_w.v": 2.0, "eta0.phi": 0.3, "nu0.p": 0.2,
        "actuator.T.u": 0.5, "actuator.T.r": 2.0, "current.y": 0.3, "dwater.x": 0.02,
    }),
    "AuvPlant without roll": Case(20.0, {
        "roll": 0.0, "tau.u": 50.0, "tau.q": 4.0, "tau.r": -3.0, "current.x": 0.2,
    }),
    "Remus100": Case(20.0, {
        "command.n": 100.0, "command.delta_r": 0.1, "command.delta_s": -0.05, "nu0.u": 1.0,
        "current.y": 0.2, "dwater.x": 0.01,
    }),
    "BlueRov2Heavy": Case(5.0, {
        "command[1]": 0.4, "command[2]": 0.3, "command[3]": -0.3, "command[4]": -0.4,
        "command[6]": 0.2, "command[7]": -0.1, "nu0.p": 0.3, "current.y": 0.2, "dwater.x": 0.01,
    }),
    "dc_motor": Case(2.0, {"load": 0.05}),
    "van_der_pol": Case(10.0, {"mu": 2.0}),
    "dahlquist": Case(5.0),
    "quarter_car": Case(2.0),
    "state_space": Case(2.0, {"A[1,2]": -3.0, "A[2,1]": 2.0}),
    "cart_pendulum": Case(3.0, {"u": 0.5, "c": 0.1}),
    "water_tank": Case(500.0),
    "battery": Case(3000.0, {"demand": 2.0}),
    "bouncing_ball": Case(0.4),
}  # fmt: skip

#: Absolute and relative tolerance of the solver for the expected solution.
EXACT = 1e-11


def source(name: str) -> Source:
    name = name.split(maxsplit=1)[0]
    return source_of(name) if name in NAMES else example(name)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Path]:
    """Builds the FMU of a case for a version of FMI."""

    @cache
    def make(of: str, fmi: str) -> Path:
        path = tmp_path_factory.mktemp("exchange") / f"{of}.fmu"
        here = platforms(fmi, None)
        NativeKind(fmi, here, compiler_for(here), lambda line: None).write(source(of), path)
        return path

    return lambda name, fmi: make(name.split(maxsplit=1)[0], fmi)


class Equations:
    """The hooks of a component in Python, with values of its ports."""

    def __init__(self, definition: Definition, values: Mapping[str, float]) -> None:
        self.behaviour = definition.behaviour
        starts = {port.name: values.get(port.name, port.start or 0.0) for port in definition.ports}
        inputs = [port for port in definition.ports if port.causality == "input"]
        booleans = {port.name for port in definition.ports if port.type == "Boolean"}
        starts |= {name: bool(starts[name]) for name in booleans}
        self.given = {
            "parameters": definition.parameters.of(starts),
            "inputs": unpacking(self.behaviour.inputs, inputs)([starts[p.name] for p in inputs]),
            "t": 0.0,
        }
        self.first = self.call("start")

    def call(self, name: str, **given: Any) -> Any:
        hook = self.behaviour.hooks[name]
        assert hook is not None
        known = {**self.given, **given}
        if "derived" in signature(hook).parameters:
            known["derived"] = self.call("derive", **given)
        return hook(**{argument: known[argument] for argument in signature(hook).parameters})

    def state(self, x: Iterator[float]) -> Any:
        """State with given continuous states."""
        fields = self.behaviour.rates.__annotations__
        hints = {name: hint for name, hint in _hints(self.behaviour.rates) if name in fields}
        return self.first._replace(**{name: _made(hint, x) for name, hint in hints.items()})

    def continuous(self, state: Any) -> list[float]:
        return [*flat(tuple(getattr(state, name) for name in self.behaviour.rates._fields))]

    def rates(self, t: float, x: Any) -> list[float]:
        return [*flat(self.call("rates", state=self.state(iter(map(float, x))), t=t))]


def _hints(record: Any) -> Iterator[tuple[str, Any]]:
    return zip(record._fields, parts_of(record) or (), strict=True)


def _made(hint: Any, numbers: Iterator[float]) -> Any:
    """A value of a type, of numbers in order."""
    parts, kind = parts_of(hint), class_of(hint)
    if parts is None:
        return next(numbers)
    values = tuple(_made(part, numbers) for part in parts)
    if is_record(kind):
        return kind(*values)
    return kind(values) if isinstance(kind, type) and kind is not tuple else values


def exchanged(path: Path, case: Case, output: list[str], **options: Any) -> Any:
    """Rows of FMPy's run for model exchange, with CVode."""
    defaults = {"relative_tolerance": 1e-10, "output_interval": case.stop / 100, **options}
    return simulate_fmu(
        str(path), fmi_type="ModelExchange", solver="CVode", stop_time=case.stop,
        start_values={**case.values}, output=output, **defaults,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "fmi"),
    [
        *((name, "2") for name in CASES),
        *((name, "3") for name in ("Remus100", "bouncing_ball")),
        *slow(*((name, "3") for name in CASES if name not in ("Remus100", "bouncing_ball"))),
    ],
)
def test_a_solver_gives_the_solution(built, name: str, fmi: str):
    path, case, definition = built(name, fmi), CASES[name], source(name).definition
    assert validate_fmu(str(path)) == []
    states = [port.name for port in definition.local if port.name.startswith("state.")]
    rows = exchanged(path, case, states)
    equations = Equations(definition, case.values)
    x0 = equations.continuous(equations.first)
    expected = solve_ivp(
        equations.rates, (0.0, case.stop), x0, "DOP853", rows["time"], rtol=EXACT, atol=EXACT
    ).y
    found = np.array([rows[name] for name in states])
    scale = 1.0 + np.abs(expected).max(axis=1, keepdims=True)
    assert np.abs((found - expected) / scale).max() < case.error
    assert np.ptp(expected, axis=1).max() > 0.1


@pytest.mark.parametrize("name", CASES)
def test_rates_are_the_limit_of_short_steps(name: str):
    """The steps are written without them where they have another rule."""
    h, case = 1e-6, CASES[name]
    lags = dict.fromkeys(("actuator.T.u", "actuator.T.q", "actuator.T.r"), 1.0)
    equations = Equations(source(name).definition, {**case.values, **lags})
    x0 = equations.continuous(equations.first)
    for t in (0.0, 0.1, 0.5, 1.0):
        span = (0.0, t * case.stop)
        x = solve_ivp(equations.rates, span, x0, "DOP853", rtol=EXACT, atol=EXACT).y[:, -1]
        state = equations.state(iter(map(float, x)))
        if equations.behaviour.hooks["event"]:
            # The water of the input, as a step has it.
            state = equations.call("event", state=state)
        before = np.array(equations.continuous(state))
        after = equations.continuous(equations.call("update", state=state, h=h))
        rates = equations.rates(0.0, before)
        scale = 1e-4 * (1 + np.abs(rates).max())
        np.testing.assert_allclose(rates, (after - before) / h, rtol=1e-4, atol=scale)


# Events


def test_a_ball_bounces_at_the_times_of_the_solution(built):
    rows = exchanged(built("bouncing_ball", "2"), Case(3.0), ["h", "v"], record_events=True)
    bounces = [before["time"] for before, after in pairwise(rows) if before["v"] < 0 < after["v"]]
    fall, v = sqrt(2 / 9.81), sqrt(2 * 9.81)
    # The times between bounces are a geometric series, until the ball stays.
    n = next(n for n in range(100) if v * 0.7 ** (n + 1) < 0.1)
    expected = [fall + 2 * v / 9.81 * sum(0.7**k for k in range(1, m)) for m in range(1, n + 1)]
    np.testing.assert_allclose(bounces, expected, atol=1e-6)
    assert rows["h"][-1] == pytest.approx(0.0, abs=1e-9)
    assert rows["v"][-1] == 0.0


def test_a_battery_stops_where_it_is_empty(built):
    case = Case(4000.0, {"demand": 2.5, "charge0": 0.5})
    rows = exchanged(built("battery", "2"), case, ["charge", "i", "switch.charge"])
    charge = np.maximum(0.5 - rows["time"] * 2.5 / (3600 * 2.5), 0.0)
    np.testing.assert_allclose(rows["charge"], charge, atol=1e-6)
    assert set(rows["i"][rows["time"] > 1801]) == {0.0}


def test_a_tank_stays_full_at_its_rim(built):
    case = Case(400.0, {"inflow": 0.008})
    rows = exchanged(built("water_tank", "2"), case, ["level", "overflows"])
    full = rows["overflows"].astype(bool)
    assert 0.1 < np.mean(full) < 0.9
    assert rows["level"][full] == pytest.approx(1.0, abs=1e-9)
    assert np.ptp(np.flatnonzero(full)) == np.count_nonzero(full) - 1


@pytest.mark.parametrize(
    ("name", "ports", "limit", "indicator"),
    [
        ("AuvPlant", "tau.u", 80.0, "switch.tau.u"),
        ("AuvPlant", "tau.r", -80.0, "switch.tau.r"),
        ("Remus100", "command.delta_r", np.deg2rad(15.0), "switch.command.delta_r"),
        ("BlueRov2Heavy", "command[3]", -1.0, "switch.limit[3]"),
    ],
)
def test_an_indicator_changes_its_sign_at_a_limit(
    built, tmp_path: Path, name: str, ports: str, limit: float, indicator: str
):
    library = Library(Path(fmpy.extract(str(built(name, "2")), tmp_path)))
    port, watched = map(library.description.find, (ports, indicator))
    with reached(library, "in continuous-time mode") as host:
        for share in (0.99, 1.01):
            assert host.set("Real", [port.reference], [share * limit]) == Status.OK
            assert host.value(watched) * (1.0 - share) > 0.0


def test_fins_stop_at_their_limit_and_leave_it_again(built):
    """dT/dt = (command - delta) / T until the limit, where the fin waits for another command."""
    limit, T = np.deg2rad(15.0), 0.1
    columns = [("time", float), ("command.delta_r", float)]
    signals = np.array([(0.0, 0.5), (1.0, 0.5), (1.0, 0.0), (2.0, 0.0)], columns)
    rows = exchanged(built("Remus100", "2"), Case(2.0), ["actuator.delta_r"], input=signals)
    t, found = rows["time"], rows["actuator.delta_r"]
    there = np.minimum(0.5 * (1 - np.exp(-t / T)), limit)
    expected = np.where(t < 1.0, there, limit * np.exp(-(t - 1.0) / T))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_a_jump_of_the_water_leaves_the_motion_over_ground(built, tmp_path: Path):
    library = Library(Path(fmpy.extract(str(built("AuvPlant", "2")), tmp_path)))
    water, over, through = map(library.description.find, ("water.x", "nu.u", "nu_r.u"))
    with reached(library, "in event mode") as host:
        assert host.set("Real", [water.reference], [0.5]) == Status.OK
        info = EventInfo()
        assert host.call("fmi2NewDiscreteStates", byref(info)) == Status.OK
        assert info.flag3 == 1, "values of continuous states have changed"
        assert (host.value(over), host.value(through)) == (0.0, -0.5)


# Calls, one by one


@contextmanager
def reached(library: Library, state: str) -> Iterator[Host]:
    """An instance for model exchange in a state of the table."""
    ways = {
        "instantiated": [], "initialising": ["setup", "enter"],
        "in event mode": ["setup", "enter", "exit"],
    }  # fmt: skip
    with instance(library, kind=MODEL_EXCHANGE) as host:
        for way in ways.get(state, ways["in event mode"]):
            assert getattr(host, way)() == Status.OK
        if state in ("in continuous-time mode", "error"):
            assert host.call("fmi2EnterContinuousTimeMode") == Status.OK
        if state == "terminated":
            assert host.call("fmi2Terminate") == Status.OK
        if state == "error":
            assert host.call("fmi2SetTime", c_double(nan)) == Status.Error
        yield host


def made(host: Host, call: str, n: int, indicators: int) -> Status:
    """Make a call of the table."""
    function, _, case = call.partition(", ")
    many = indicators if "Indicators" in function else n
    number = {"not finite": inf, "another number of values": 0.0, "NULL": 0.0}.get(case, 0.25)
    values = None if case == "NULL" else (c_double * (many + 1))(*[number] * (many + 1))
    flags = [byref(c_int()), byref(c_int())]
    arguments: dict[str, list[Any]] = {
        "fmi2SetTime": [c_double(number)],
        "fmi2NewDiscreteStates": [byref(EventInfo())],
        "fmi2CompletedIntegratorStep": [c_bool(True), *flags],
        "fmi2DoStep": [c_double(0.0), c_double(0.02), c_int(1)],
    }
    if function == "fmi2NewDiscreteStates" and isinstance(host.library, Fmi3Library):
        arguments[function] = [*(byref(c_bool()) for _ in range(5)), byref(c_double())]
    array = [values, c_size_t(many + (case == "another number of values"))]
    given = array if function.startswith(("fmi2Get", "fmi2SetC")) else []
    return host.call(function, *arguments.get(function, given))


@pytest.mark.parametrize("fmi", FMI_VERSIONS)
def test_every_call_answers_as_the_page_says(built, tmp_path: Path, fmi: str):
    load = Fmi3Library if fmi == "3" else Library
    library = load(Path(fmpy.extract(str(built("AuvPlant", fmi)), tmp_path)))
    [table] = [section for section in sections(PAGE) if section.heading == "Model exchange"]
    statuses = {"OK": Status.OK, "error": Status.Error, "not taken": Status.Discard}
    assert len(table.rows) == len({row[0] for row in table.rows}) == 15
    for call, *cells in table.rows:
        for states, cell in zip(table.header[1:], cells, strict=True):
            for state in states.split(", "):
                with reached(library, state) as host:
                    host.messages.clear()
                    assert made(host, call, 19, 3) == statuses[cell], (call, state)
                    assert bool(host.messages) == (cell != "OK") or state == "error"
                    # A wrong call leads to the state error, in which no call is OK.
                    fails = cell == "error" or state == "error"
                    goes_on = host.call("fmi2Terminate") == Status.OK
                    assert goes_on != fails, (call, state)


@pytest.mark.parametrize("fmi", FMI_VERSIONS)
def test_a_saved_state_continues_in_the_same_way(built, tmp_path: Path, fmi: str):
    """Also one that no step leads to: its quaternion is not of length one."""
    load = Fmi3Library if fmi == "3" else Library
    library = load(Path(fmpy.extract(str(built("AuvPlant", fmi)), tmp_path)))
    n = 19

    def rates(host: Host) -> list[float]:
        found = (c_double * n)()
        assert host.call("fmi2GetDerivatives", found, c_size_t(n)) == Status.OK
        return [*found]

    with reached(library, "in continuous-time mode") as host:
        assert host.call("fmi2SetTime", c_double(3.0)) == Status.OK
        x = (c_double * n)(*(0.1 * k for k in range(n)))
        assert host.call("fmi2SetContinuousStates", x, c_size_t(n)) == Status.OK
        kept, before = host.get_state(), (rates(host), host.values())
        content = host.serialised(kept)
        assert host.call("fmi2SetContinuousStates", (c_double * n)(), c_size_t(n)) == Status.OK
        assert rates(host) != before[0]
        assert host.set_state(kept) == Status.OK
        assert (rates(host), host.values()) == before
        with reached(library, "in event mode") as other:
            status, restored = other.deserialised(content)
            assert status == other.set_state(restored) == Status.OK
            assert (rates(other), other.values()) == before
            assert made(other, "fmi2CompletedIntegratorStep", n, 3) == Status.OK
        with instance(library) as stepping:
            status, restored = stepping.deserialised(content)
            assert status == Status.OK
            assert stepping.set_state(restored) == Status.Error
            assert "for model exchange" in stepping.messages[-1].text


@pytest.mark.parametrize("fmi", FMI_VERSIONS)
def test_states_may_be_set_by_their_references(built, tmp_path: Path, fmi: str):
    """As CasADi does; all values of a call or none."""
    load = Fmi3Library if fmi == "3" else Library
    library = load(Path(fmpy.extract(str(built("AuvPlant", fmi)), tmp_path)))
    names = ("state.position.x", "state.nu_r.u", "der(state.nu_r.u)", "tau.u")
    x, u, du, tau = (library.description.find(name).reference for name in names)
    with reached(library, "in continuous-time mode") as host:
        assert host.set("Real", [x, u, tau], [5.0, 2.0, 7.0]) == Status.OK
        assert host.get("Real", [x, u, tau]) == (Status.OK, [5.0, 2.0, 7.0])
        # (7 - 30 * 2) / 25
        assert host.get("Real", [du])[1] == pytest.approx([-2.12])
        assert host.set("Real", [u, x], [3.0, nan]) == Status.Discard
        assert host.get("Real", [x, u]) == (Status.OK, [5.0, 2.0])
        assert host.set("Real", [du], [1.0]) == Status.Error
    with instance(library) as stepping:
        assert stepping.set("Real", [u], [3.0]) == Status.Error


def test_rates_that_cannot_be_computed_raise_no_fault(built, tmp_path: Path):
    library = Library(Path(fmpy.extract(str(built("Remus100", "2")), tmp_path)))
    with reached(library, "in continuous-time mode") as host:
        x = (c_double * 18)(*[1e6] * 18)
        assert host.call("fmi2SetContinuousStates", x, c_size_t(18)) == Status.OK
        assert made(host, "fmi2GetDerivatives", 18, 6) == Status.Discard
        assert "m/s through the water" in host.messages[-1].text
        assert not host.fault()
        assert host.call("fmi2Reset") == host.setup() == host.enter() == host.exit() == Status.OK
        assert host.call("fmi2EnterContinuousTimeMode") == Status.OK


def test_pathsim_runs_an_fmu(built):
    pathsim, blocks = pytest.importorskip("pathsim"), pytest.importorskip("pathsim_fmi")
    motor = blocks.ModelExchangeFMU(str(built("dc_motor", "2")), tolerance=1e-9)
    voltage, scope = pathsim.blocks.Constant(12.0), pathsim.blocks.Scope()
    load = pathsim.blocks.Constant(0.0)
    simulation = pathsim.Simulation(
        [voltage, load, motor, scope],
        [
            pathsim.Connection(voltage, motor[0]), pathsim.Connection(load, motor[1]),
            pathsim.Connection(motor[1], scope),
        ],
        Solver=pathsim.solvers.RKCK54, tolerance_lte_abs=1e-9, tolerance_lte_rel=1e-9, log=False,
    )  # fmt: skip
    simulation.run(2.0)
    time, [speed] = scope.read()
    equations = Equations(example("dc_motor").definition, {})
    expected = solve_ivp(equations.rates, (0.0, 2.0), [0.0] * 3, "DOP853", rtol=1e-10).y[1, -1]
    assert time[-1] == pytest.approx(2.0)
    assert speed[-1] == pytest.approx(expected, rel=1e-6)
