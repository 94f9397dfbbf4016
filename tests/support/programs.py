"""Programs of systems, compiled and run as a host in C runs them."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.machine.compilers import EXPORTED, FLAGS, machines_compiler
from orchestrator.program.writer import Text

DOUBLES = ctypes.POINTER(ctypes.c_double)

_NONE = np.zeros(0)


class Played(NamedTuple):
    """Outcome of a run of a program.

    Attributes:
        rows: that were shown, time first.
        has_begun: whether values came to rest.
        outcome: 0 at the end, 1 where a component has refused, 2 where an event has ended it.
        refused: the number of the component, and of steps before that.

    """

    rows: np.ndarray
    has_begun: bool
    outcome: int
    refused: tuple[int, int]


def compiled(text: str, place: Path, *options: object) -> Path:
    """A program as a library, or an object if that is what the options say."""
    place.with_suffix(".c").write_text(text, encoding="utf-8")
    command = [
        str(machines_compiler()), *FLAGS[:-2], "-O1", "-fno-math-errno", "-Wall", "-Wextra",
        "-Wno-unused", "-Wno-unused-parameter", *EXPORTED, place.with_suffix(".c"), *options,
        "-o", place, "-lm",
    ]  # fmt: skip
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not process.returncode and not process.stderr, process.stderr[:2000]
    return place


def values_of(text: Text) -> list[float]:
    """Start values of a program's parameters."""
    system, found = text.plan.system, []
    for name in text.parameters:
        value = system.value(name)
        items = system.components[name.component].variables[name.port].items
        found.append(0.0 if value is None else float(items.get(value, value)))
    return found


def play(
    text: Text,
    path: Path,
    events: np.ndarray = _NONE,
    actions: np.ndarray = _NONE,
    happened: np.ndarray = _NONE,
) -> Played:
    """A run of a program, in two parts.

    Args:
        text: of the program.
        path: of its library.
        events: that happen in it, as events.c has them.
        actions: of these.
        happened: to be filled.

    """
    library = ctypes.CDLL(str(path))
    library.size_of_simulation.restype = ctypes.c_size_t
    library.begin.argtypes = (
        ctypes.c_void_p, DOUBLES, *[ctypes.c_double] * 3, ctypes.c_int, ctypes.c_int,
    )  # fmt: skip
    experiment, reason = text.plan.experiment, (ctypes.c_int * 4)()
    parameters = (ctypes.c_double * len(text.parameters))(*values_of(text))
    size = library.size_of_simulation()
    simulation, ahead = (ctypes.create_string_buffer(size) for _ in range(2))
    rows = np.zeros((experiment.rows, 1 + len(text.columns)))
    outcome = library.begin(
        simulation, parameters, experiment.start_time, experiment.step, experiment.stop_time,
        experiment.full_steps, experiment.rows - 1,
    )  # fmt: skip
    has_begun = not outcome
    for until in (experiment.rows // 3, experiment.rows - 1):
        if outcome:
            break
        outcome = (
            library.run_with_events(
                simulation, ahead, until, _pointer(rows), parameters, len(events),
                *map(_pointer, (events, actions, happened)),
            )
            if text.has_events
            else library.run(simulation, until, _pointer(rows))
        )  # fmt: skip
    library.failure(simulation, reason)
    shown = rows[: library.rows_shown(simulation)]
    return Played(shown, has_begun, outcome, (reason[0], reason[3]))


def _pointer(values: np.ndarray) -> Any:
    return values.ctypes.data_as(DOUBLES)
