"""The loops that make the steps of a run: one step at a time in Python, or many in one C call.

Both make the same FMI calls in the same order, and the same rows, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from ctypes import CDLL, POINTER, Structure, c_double, c_int, c_size_t, c_void_p
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fmpy import platform_tuple

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.instance import CALLS, CMember, CMove
from orchestrator.cosim.fmi.isolated import Isolation
from orchestrator.cosim.hooks import Run
from orchestrator.cosim.observers import CBlock
from orchestrator.cosim.stages import Decimation, LinkedStage, Member, make_stages
from orchestrator.machine.cache import users_folder
from orchestrator.machine.compilers import (
    FLAGS,
    compile_library,
    find_compiler,
    find_library,
    library_key,
    load_library,
    own_compiler,
)
from orchestrator.machine.errors import InputError, reason

#: Steps in Python that take as long as setting up the compiled loop, and as long as compiling it.
_SET_UP, _WORTH_COMPILING = 20, 10_000

#: Above this number of values numpy's library splits products among threads, which takes
#: milliseconds where other cores are busy.
_MOST_MULTIPLIED = 4_096

#: Source of the compiled loop.
SOURCE = Path(__file__).with_name("stepper.c")

#: Its category in the cache.
CATEGORY = "loop"

#: Its C function.
_FUNCTION = "advance"

#: Libraries that this process has loaded, by cache folder.
_in_use: dict[Path, CDLL] = {}

#: Return values of the C function.
_DUE, _FAILED = range(2)

#: Longest time until Python checks whether the run is to stop [s].
_GLANCE = 0.02


class Stepping(NamedTuple):
    """A loop that makes the steps of a run.

    Attributes:
        name: of the loop in records.
        steps: makes the remaining steps and counts them; stops before a row that is not finite. It
            yields whenever hooks may act: at the latest after as many steps as are due. It raises
            ComponentFailed if the next step fails, and Ended if a component ends the run in it.

    """

    name: str
    steps: Callable[[Run], Iterator[None]]


def step_interpreted(run: Run) -> Iterator[None]:
    """Make the steps in Python, and yield after each."""
    values, shown, append = run.row.values, run.row.shown, run.blocks.append
    experiment, stages, passing = run.experiment, run.stages, run.passing
    steps = experiment.rows - 1
    is_not_finite = _watch(shown)
    for k, t, h, end in experiment.steps(run.made):
        # Converted once for all components.
        time, length = c_double(t), c_double(h)
        if passing is not None:
            make_stages(passing, values, experiment, steps, k - 1, time, length)
            if is_not_finite():
                return
            append(t, shown)
        make_stages(stages, values, experiment, steps, k - 1, time, length)
        if passing is None:
            if is_not_finite():
                return
            append(end, shown)
        run.made = k
        yield


def _watch(values: np.ndarray) -> Callable[[], object]:
    """Return a function that tells whether some values are not all finite."""
    if len(values) > _MOST_MULTIPLIED:
        return lambda: not np.isfinite(values).all()
    # Zero times a finite number is zero, otherwise nan: the cheapest test.
    return partial(np.vdot, values, np.zeros_like(values))


class CMapping(Structure):
    """Values that a connection maps to others: see stepper.c."""

    _fields_ = (
        ("connection", c_size_t),
        ("n", c_size_t),
        ("from_values", POINTER(c_double)),
        ("to_values", POINTER(c_double)),
    )


class CStage(Structure):
    """Inputs to gather, and the components to step: see stepper.c."""

    _fields_ = (
        ("targets", c_void_p),
        ("sources", c_void_p),
        ("factors", c_void_p),
        ("offsets", c_void_p),
        ("mappings", POINTER(CMapping)),
        ("members", POINTER(CMember)),
        ("n_connections", c_size_t),
        ("n_mappings", c_size_t),
        ("n_members", c_size_t),
        ("every", c_size_t),
        ("at_end", c_int),
    )


class CRun(Structure):
    """The steps of a run: see stepper.c."""

    _fields_ = (
        ("stages", POINTER(CStage)),
        ("values", c_void_p),
        ("n_stages", c_size_t),
        ("shown_after", c_size_t),
        ("n_shown", c_size_t),
        ("start_time", c_double),
        ("step", c_double),
        ("stop_time", c_double),
        ("full_steps", c_size_t),
        ("steps", c_size_t),
    )


class CFailure(Structure):
    """The first call with a status worse than a warning: see stepper.c."""

    _fields_ = (("stage", c_size_t), ("member", c_size_t), ("call", c_int), ("status", c_int))


def step_compiled(library: CDLL, run: Run) -> Iterator[None]:
    """Make the steps of a run with the compiled loop: see :class:`Stepping`."""
    advance = library.advance
    advance.restype = c_int
    advance.argtypes = (
        POINTER(CRun), POINTER(c_size_t), c_size_t, c_double, POINTER(CBlock),
        POINTER(CFailure),
    )  # fmt: skip
    row, experiment, blocks = run.row, run.experiment, run.blocks
    stages, steps = [*(run.passing or ()), *run.stages], experiment.rows - 1
    c_run = CRun(
        (CStage * len(stages))(*map(_laid_out, stages)),
        row.values.ctypes.data,
        len(stages),
        len(stages) if run.passing is None else len(run.passing),
        len(row.shown),
        experiment.start_time,
        experiment.step,
        experiment.stop_time,
        experiment.full_steps,
        steps,
    )
    block, failure, made = blocks.block, CFailure(), c_size_t(run.made)
    outcome = _DUE
    while outcome == _DUE and run.made < steps:
        if block.n == block.most:
            blocks.hand_over()
        made.value = run.made
        outcome = advance(c_run, made, min(run.due, run.until, steps), _GLANCE, block, failure)
        run.made = made.value
        yield
    if outcome == _FAILED:
        member = stages[failure.stage].members[failure.member]
        raise member.instance.failed(failure.status, CALLS[failure.call])


def _laid_out(stage: LinkedStage) -> CStage:
    gather, members = stage.gather, [_pointers(member) for member in stage.members]
    mappings = [_mapping(place, gather.mapped[place]) for place in sorted(gather.mapped)]
    return CStage(
        *(array.ctypes.data for array in (gather.targets, gather.sources)),
        *(array.ctypes.data for array in (gather.factors, gather.offsets)),
        (CMapping * len(mappings))(*mappings),
        (CMember * len(members))(*members),
        len(gather.targets),
        len(mappings),
        len(members),
        *(stage.decimation or Decimation(1)),
    )


def _pointers(member: Member) -> CMember:
    pointers = member.instance.pointers()
    if member.do_step is None:
        pointers.do_step = None
    pointers.n_inputs *= bool(member.set_inputs)
    known, reads = member.instance.get_outputs, member.get_outputs
    pointers.n_outputs = len(reads)
    pointers.outputs = (CMove * len(reads))(
        *(pointers.outputs[known.index(call)] for call in reads)
    )
    return pointers


def _mapping(place: int, pairs: Mapping[float, float]) -> CMapping:
    n = len(pairs)
    return CMapping(place, n, (c_double * n)(*pairs), (c_double * n)(*pairs.values()))


def load_stepper() -> CDLL | None:
    """Load the library if it was compiled earlier; None: it was not."""
    folder = users_folder()
    # A loaded library is not looked up again, which would slow down short runs.
    if folder not in _in_use and (library := find_library(CATEGORY, key_of(), _FUNCTION)):
        _in_use[folder] = library
    return _in_use.get(folder)


def compile_stepper(in_no_time: bool = False) -> CDLL:
    """Compile the library, unless it was compiled earlier, and load it.

    Args:
        in_no_time: if set, use only a compiler that takes a tenth of a second.

    Raises:
        InputError: it cannot be compiled; the text says what to do.

    """
    compiler = own_compiler() if in_no_time else find_compiler()
    if compiler is None:
        raise InputError(
            "the compiled loop needs a C compiler: install gcc or clang, or `pip install ziglang`"
        )
    compiled = partial(compile_library, compiler, *FLAGS, str(SOURCE))
    try:
        return load_library(CATEGORY, key_of(), _FUNCTION, compiled)
    except OSError as error:
        raise InputError(f"the loop cannot be compiled: {reason(error)}") from error


@cache
def key_of(machine: str = platform_tuple) -> str:
    """Key of the library in the cache."""
    return library_key(SOURCE.read_text(encoding="utf-8"), *FLAGS, machine=machine)


#: Name of the loop in C.
COMPILED = "compiled"

#: The loop that is always available.
PYTHON_LOOP = Stepping("python", step_interpreted)


def choose_loop(
    choice: str, experiment: Experiment, isolation: Isolation | None = None
) -> Stepping:
    """Choose the loop for a run.

    Args:
        choice: `auto`, `python` or `compiled`.
        experiment: of the run.
        isolation: of the FMUs, whose functions are then not in this process.

    Raises:
        InputError: the compiled loop is not available.

    """
    if choice == COMPILED:
        if isolation:
            raise InputError(
                "the compiled loop cannot step isolated FMUs: drop --loop compiled or --isolate"
            )
        return _compiled(load_stepper() or compile_stepper())
    if choice == "auto" and not isolation and experiment.rows > _SET_UP:
        if library := load_stepper():
            return _compiled(library)
        if experiment.rows > _WORTH_COMPILING:
            with suppress(InputError):
                return _compiled(compile_stepper(in_no_time=True))
    return PYTHON_LOOP


def _compiled(library: CDLL) -> Stepping:
    return Stepping(COMPILED, partial(step_compiled, library))
