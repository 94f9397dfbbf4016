"""The compiled loop: stepper.c, compiled once into the user's cache folder, makes the steps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from ctypes import CDLL, POINTER, Structure, c_double, c_int, c_size_t, c_void_p
from functools import cache, partial
from pathlib import Path

from fmpy import platform_tuple

from orchestrator.cosim.fmi.instance import CALLS
from orchestrator.cosim.fmi.transfer import CMember, CMove
from orchestrator.cosim.hooks.hook import Run
from orchestrator.cosim.observers.observer import CBlock
from orchestrator.cosim.schedule import Member, Stage
from orchestrator.cosim.stages import Decimation
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

SOURCE = Path(__file__).with_name("stepper.c")

#: What it is among what is kept.
CATEGORY = "loop"

#: What it offers.
_FUNCTION = "advance"

#: Libraries that this process has loaded, by cache folders.
_in_use: dict[Path, CDLL] = {}

#: Why Python has to look.
_DUE, _FAILED = range(2)

#: Longest time until Python checks whether the run is to stop [s].
_GLANCE = 0.02


class CMapping(Structure):
    """Values that become others on their way through one connection."""

    _fields_ = (
        ("connection", c_size_t),
        ("n", c_size_t),
        ("from_values", POINTER(c_double)),
        ("to_values", POINTER(c_double)),
    )


class CStage(Structure):
    """Inputs to gather, and the components to step then."""

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
    """What the steps of a run are made of."""

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
    """The first call with a status that is worse than a warning."""

    _fields_ = (("stage", c_size_t), ("member", c_size_t), ("call", c_int), ("status", c_int))


def step_compiled(library: CDLL, run: Run) -> Iterator[None]:
    """Make the steps of a run by stepper.c, compiled: see :class:`.loop.Steps`."""
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
        outcome = advance(c_run, made, min(run.due, steps), _GLANCE, block, failure)
        run.made = made.value
        yield
    if outcome == _FAILED:
        member = stages[failure.stage].members[failure.member]
        raise member.instance.failed(failure.status, CALLS[failure.call])


def _laid_out(stage: Stage) -> CStage:
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
    """Load the library that was compiled earlier; None: there is none."""
    folder = users_folder()
    # What is loaded needs no second look: short runs would take longer for it.
    if folder not in _in_use and (library := find_library(CATEGORY, key_of(), _FUNCTION)):
        _in_use[folder] = library
    return _in_use.get(folder)


def compile_stepper(in_no_time: bool = False) -> CDLL:
    """Compile the library, unless it was compiled earlier, and load it.

    Args:
        in_no_time: only by a compiler that takes a tenth of a second.

    Raises:
        InputError: it cannot be; the text says what to do.

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
