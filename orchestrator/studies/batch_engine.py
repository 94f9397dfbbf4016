"""Runs of the closed loop by its equations, compiled: the numbers of the FMUs, far sooner."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from itertools import compress
from math import isnan
from threading import local
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.loop import closed_loop
from auv_fmu.loop.closed_loop import Moment, Setting, blocks_of, splits
from auv_fmu.paper.euler import LARGEST_STATE, MOST_INTERNAL_STEPS
from fmus.kinds import AUTO
from orchestrator.machine.children import imported_apart
from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import FEEDTHROUGH, JACOBI, Experiment
from orchestrator.master.observers.observer import Ending, Header
from orchestrator.master.observers.table import Table
from orchestrator.master.plan import code_of, digest_of
from orchestrator.runs.bundle import current_fmus
from orchestrator.studies.batch.kernel import (
    END,
    RunSteps,
    columns,
    computed,
    is_bounded,
    new_accumulators,
    part_of,
)
from orchestrator.studies.batch.support import setting_of, unsupported
from orchestrator.studies.engine import Outcome, Point, kinds_of
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System
from orchestrator.system.values import Value, named
from orchestrator.vehicle.cautions import Seen, cautions, cautions_seen, values_of
from orchestrator.vehicle.index.final_error import LAST as LAST_SECONDS
from orchestrator.vehicle.indices import INDICES, Index, Indices
from orchestrator.vehicle.signals import STANDARD, AllocatedLoop, Loop, with_lag

#: What makes every system.
_OTHER = "use --engine fmu"

#: Orders that the straight line can be run in.
_ORDERS = (FEEDTHROUGH, JACOBI)

_NO_ROWS = np.empty((0, 0))

#: What the kernel accumulates, and how an index follows from it, the number of its terms and the
#: length of the run [s].
_FROM: Mapping[str, tuple[str, Callable[[np.ndarray, int, float], Any]]] = {
    "l2_effort": ("square", lambda found, n, length: np.sqrt(found)),
    "rms_effort": ("square", lambda found, n, length: np.sqrt(found / length)),
    "peak_command": ("peak", lambda found, n, length: found),
    "saturated_fraction": ("outside", lambda found, n, length: found / n),
    "total_variation": ("variation", lambda found, n, length: found),
    "final_error": ("final", lambda found, n, length: found),
    "time_to_reach": ("reached", lambda found, n, length: found),
    "late_error": ("late", lambda found, n, length: found),
    "estimate_error": ("miss", lambda found, n, length: np.sqrt(sum(found.tolist()) / n)),
    "theta_hat_half": ("half", lambda found, n, length: found),
    "theta_hat_end": ("end", lambda found, n, length: found),
    "largest_speed": ("speed", lambda found, n, length: found),
    "largest_drift": ("drift", lambda found, n, length: found),
}

#: The indices that the kernel accumulates, and their columns. Each run asks for them.
_ACCUMULATED = [(index, index.columns) for index in INDICES if index.name in _FROM]

#: The others: reducers make them of the rows, as they do after a run of FMUs; it takes longer.
_OF_ROWS = [index for index in INDICES if index.name not in _FROM]


class _Loop(NamedTuple):
    """A system, and what of a row it has.

    Attributes:
        system: that has the loop.
        names: of its signals.
        columns: of the rows, after the time.
        there: which of these it has.
        without: names of the indices that it has no columns or parameters for.
        known: ports and values of parameters by their names, once they were asked for.

    """

    system: System
    names: Loop
    columns: tuple[str, ...]
    there: Sequence[bool]
    without: frozenset[str]
    known: dict[str, tuple[PortName, Value | None]]


def _loop(system: System) -> _Loop:
    names = AllocatedLoop() if "allocation" in system.components else STANDARD
    of_rows = columns(names)
    there = [system.has(port_name(name)) for name in of_rows]
    without = frozenset(
        index.name
        for index in INDICES
        if not all(system.has(port_name(name)) for name in _needs(index, names))
    )
    return _Loop(system, names, of_rows, there, without, {})


def _needs(index: Index, loop: Loop) -> list[str]:
    """The signals and parameters that an index cannot do without."""
    of = index.reducer
    return [loop.port(port.name) for port in of.ports if port.name not in of.defaults]


class BatchEngine:
    """Makes runs of the closed loop of the bundle's components, one after the other.

    Where it makes them no FMUs are needed.
    """

    def __init__(self, systems: Mapping[str, System], kind: str = AUTO) -> None:
        """Take systems.

        Args:
            systems: by the names that runs have for their scenarios.
            kind: of the FMUs that they are made of.

        Raises:
            InputError: one of them is not what the equations make.

        """
        check_systems(systems, kind)
        self._loops = {name: _loop(system) for name, system in systems.items()}

    @property
    def digest(self) -> str:
        """Of the equations, of what compiles them, and of what makes indices of them."""
        code = code_of("auv_fmu", "orchestrator.vehicle", "orchestrator.studies")
        return digest_of({"code": code, "numba": version("numba")})

    def outcomes(self, points: Iterable[Point]) -> Iterator[Outcome]:
        """Make some runs, in their order."""
        for point in points:
            [outcome] = self.outcomes_at(point, [point.stop_time])
            yield outcome

    def outcomes_at(self, point: Point, stop_times: Sequence[float]) -> list[Outcome]:
        """What would have come out of a run with other stop times, all from one run.

        Args:
            point: to be made.
            stop_times: not later than its own; those before it after whole numbers of steps [s].

        """
        try:
            job = _job(self._loops[point.scenario], point)
            ends = np.array([_end(job, stop_time) for stop_time in stop_times], END)
            accumulators = new_accumulators(len(ends))
            rows = _empty_rows(job) if _OF_ROWS else _NO_ROWS
            made, failure = _made(job, ends, accumulators, rows)
        except InputError as error:
            return [Outcome(point.number, {}, str(error)) for _ in stop_times]
        return [
            Outcome(point.number, {}, failure, _cautions(job, found, made))
            if end["steps"] > made
            else Outcome(
                point.number,
                _indices(job, end, found) | _of_rows(job, stop_time, end, rows),
                None,
                _cautions(job, found, made),
            )
            for stop_time, end, found in zip(stop_times, ends, accumulators, strict=True)
        ]

    def setting(self, point: Point) -> Setting:
        """The setting of the straight line that makes the same numbers as a run.

        Raises:
            InputError: the run has no start.

        """
        return _job(self._loops[point.scenario], point).setting

    def table(self, point: Point) -> Table:
        """A run with its rows, in those columns :func:`.kernel.columns` that it has.

        Raises:
            InputError: it has no start.

        """
        job = _job(self._loops[point.scenario], point)
        rows = _empty_rows(job)
        made, failure = _made(job, np.empty(0, END), new_accumulators(0), rows)
        return _table(job, rows[: made + 1], failure)


def check_systems(systems: Mapping[str, System], kind: str = AUTO) -> None:
    """Check that systems, by their names, are what the equations make.

    Raises:
        InputError: one of them is not.

    """
    for name, system in systems.items():
        if why := unsupported(system, current_fmus(kind)) or _without_column(system):
            raise InputError(f"{name}: {why}, which the batch engine cannot run; {_OTHER}")
        system.check()


class _Job(NamedTuple):
    """A run, ready to be made."""

    loop: _Loop
    system: System  #: of the loop, with the parameters of the run
    experiment: Experiment
    setting: Setting
    run_steps: RunSteps


def _job(loop: _Loop, point: Point) -> _Job:
    """A run, ready to be made.

    Raises:
        InputError: it has no start, or no first step.

    """
    changes = {port_name(name): value for name, value in point.parameters.items()}
    system = loop.system.with_parameters(changes)
    changed = [system.component(name.component).variable(name.port) for name in changes]
    if any(variable.causality != "parameter" for variable in changed):
        system.check()
    experiment = Experiment(point.stop_time, point.step, point.order or FEEDTHROUGH)
    if experiment.order not in _ORDERS:
        raise InputError(f"the batch engine has only the orders {', '.join(_ORDERS)}; {_OTHER}")
    fmus = {name: part.description.modelName for name, part in system.components.items()}
    setting = setting_of(fmus, system.parameters, experiment.step)
    full, stop = experiment.full_steps, experiment.stop_time
    parts = splits(setting, experiment.step)
    if max(parts) > MOST_INTERNAL_STEPS:
        why = (
            f"step {setting.h:g} s needs more than {MOST_INTERNAL_STEPS} internal steps; "
            "take shorter ones, or raise h_max"
        )
        raise InputError(f"stopped at t = 0 s: {why}")
    # Where there is none it has no length, and is no step.
    last_parts = (
        splits(setting, stop - full * experiment.step) if experiment.has_short_step else parts
    )
    run_steps = RunSteps(
        experiment.rows - 1,
        full,
        experiment.step,
        stop,
        parts,
        last_parts,
        experiment.order == JACOBI,
    )
    return _Job(loop, system, experiment, setting, run_steps)


def _end(job: _Job, stop_time: float) -> tuple[int, float, float]:
    """Where the accumulator of a stop time ends, as :data:`.kernel.END` has it.

    Raises:
        InputError: the run has no row there.

    """
    whole, steps = job.experiment, job.run_steps.steps
    if stop_time != whole.stop_time:
        shorter = Experiment(stop_time, whole.step, whole.order)
        steps = shorter.full_steps
        if shorter.has_short_step or stop_time > whole.stop_time:
            raise InputError(
                f"stop time {stop_time:g} s: not a whole number of steps of a run that takes "
                f"{whole.stop_time:g} s"
            )
    return steps, 0.5 * stop_time, whole.time(steps) - LAST_SECONDS


def _empty_rows(job: _Job) -> np.ndarray:
    return np.empty((job.experiment.rows, 1 + len(job.loop.columns)))


def _table(job: _Job, rows: np.ndarray, failure: str | None = None) -> Table:
    """Rows of a run, in the columns that it has, each where the order has it."""
    parameters = {
        name: named(variable, job.system.value(name))
        for component in job.system.components.values()
        for variable in component.having("parameter")
        for name in (PortName(component.name, variable.name),)
    }
    names, there = job.loop.names, job.loop.there
    header = Header(tuple(compress(job.loop.columns, there)), job.experiment, parameters)
    table = Table.of(header, rows[:, [True, *there]], Ending(failure))
    if job.experiment.acting_row:
        # Actuators without a lag give at once what they are told.
        given = compress(names.applied, ~with_lag(table, names))
        late = [header.place[name] for name in (*given, *computed(names)) if name in table]
        table.rows[1:, late] = table.rows[:-1, late]
    return table


def _made(
    job: _Job, ends: np.ndarray, accumulators: np.ndarray, rows: np.ndarray
) -> tuple[int, str | None]:
    """Make a run: how many steps were taken, and why there were no more.

    Raises:
        InputError: it has no start.

    """
    progress = np.empty(1, int)
    # Where an equation raises, the compiled text says no more than that.
    with suppress(ArithmeticError):
        _run(job, job.run_steps, ends, accumulators, rows, progress)
    made = int(progress[0])
    if made < 0:
        raise InputError(f"initialisation refused: {_why(job)}")
    if made == job.run_steps.steps:
        return made, None
    # What the step that is refused begins with is what a shorter run ends with.
    shorter = job.run_steps._replace(steps=made)
    moment = _run(job, shorter, ends[:0], accumulators[:0], _NO_ROWS, progress)
    return made, f"stopped at t = {moment.t:.12g} s: {_why(job, made, moment)}"


def _why(job: _Job, k: int = 0, before: Moment | None = None) -> str:
    """Why a run has no start, or cannot take step k from a moment.

    It is what an equation of plain Python raises, or else what is wrong with what it comes to.
    """
    setting, run_steps, blocks = job.setting, job.run_steps, blocks_of(job.setting)
    # Noise is too small to make a difference.
    n = (0.0, 0.0, 0.0)
    try:
        if before is None:
            moment = closed_loop.begin(setting, blocks, n)
            h, parts, delayed = run_steps.h, run_steps.parts, run_steps.delayed
            closed_loop.act(setting, blocks, moment, h, parts, delayed)
        else:
            h, parts, end = part_of(run_steps, k)
            instant = closed_loop.act(setting, blocks, before, h, parts, run_steps.delayed)
            moment = closed_loop.step(setting, blocks, instant, h, parts, end, n)
    except (ArithmeticError, ValueError) as error:
        return f"{type(error).__name__}: {error}"
    states = {
        "plant": moment.vehicles.plant,
        "planner": moment.vehicles.planner,
        "sea": moment.vehicles.water,
        "controller": moment.controller_state,
    }
    for name, state in states.items():
        if not is_bounded(state):
            return f"{name}: the state is not finite, or exceeds {LARGEST_STATE:g}"
    return "an output is not finite"


def _run(
    job: _Job,
    run_steps: RunSteps,
    ends: np.ndarray,
    accumulators: np.ndarray,
    rows: np.ndarray,
    progress: np.ndarray,
) -> Moment:
    """Call the kernel."""
    # Not installed where no studies are made.
    imported_apart("numba", ".numba_config.yaml")
    from orchestrator.studies.batch.compilation import compile_run, packed  # noqa: PLC0415

    kernel = compile_run(blocks_of(job.setting))
    uniform = _NOISE.uniform(job.setting.plant.noise.seed)
    return kernel(packed(job.setting), run_steps, uniform, ends, accumulators, rows, progress)


class _Noise(local):
    """The uniform numbers of Python's generator, in each thread; to make it takes a while."""

    def __init__(self) -> None:
        bits = np.random.MT19937()
        self._state, self._uniform = np.random.RandomState(bits), np.random.Generator(bits)

    def uniform(self, seed: int) -> np.random.Generator:
        """The numbers of a seed."""
        self._state.seed([seed % 2**32])
        return self._uniform


_NOISE = _Noise()


def _indices(job: _Job, end: np.void, found: np.void) -> dict[str, float]:
    """The indices of an accumulator by their columns."""
    steps, t = int(end["steps"]), job.experiment.time(int(end["steps"]))
    values: dict[str, float] = {}
    for index, names in _ACCUMULATED:
        kept, result = _FROM[index.name]
        n = int(found["instants"]) if kept == "miss" else steps
        if n and index.name not in job.loop.without:
            members = np.atleast_1d(result(found[kept], n, t)).tolist()
            values.update(zip(names, members, strict=True))
    # What was never reached is not a number.
    return {name: value for name, value in values.items() if not isnan(value)}


def _cautions(job: _Job, found: np.void, made: int) -> str | None:
    """What to be wary of in a run of some steps."""
    loop, step, given = job.loop.names, job.experiment.step, job.system.parameters

    def value(name: str) -> Value | None:
        if name not in job.loop.known:
            job.loop.known[name] = port_name(name), values_of(job.loop.system)(name)
        port, otherwise = job.loop.known[name]
        return given.get(port, otherwise)

    seen = Seen(float(found["rho_hat"]), float(found["vertical"])) if made else Seen()
    return kinds_of([*cautions(value, step, [loop]), *cautions_seen(seen, loop, value, step)])


@np.errstate(all="ignore")
def _of_rows(job: _Job, stop_time: float, end: np.void, rows: np.ndarray) -> dict[str, float]:
    """The other indices of a run that ends at a stop time [s], by their columns."""
    if not _OF_ROWS:
        return {}
    shorter = replace(job.experiment, stop_time=stop_time)
    table = _table(job._replace(experiment=shorter), rows[: end["steps"] + 1])
    observer = Indices([job.loop.names], _OF_ROWS)
    observer.begin(table.header)
    observer.take(table.rows)
    return observer.values()


def _without_column(system: System) -> str:
    """An index of a system that the kernel has no columns for, in words; empty: there is none."""
    loop = _loop(system)
    for index in _OF_ROWS:
        for name in _needs(index, loop.names):
            port = port_name(name)
            is_signal = system.has(port) and (
                system.component(port.component).variable(port.port).causality != "parameter"
            )
            if name not in loop.columns and is_signal:
                return f"its index {index.name} is of {name}"
    return ""
