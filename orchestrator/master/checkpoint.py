"""What a run needs to go on in another process, written from time to time.

A folder holds two files. All rows so far are in the one that grows. The other is replaced as a
whole, once the rows are on the disk: it says how many of them count, and holds the states of the
FMUs and whatever else a run knows. A process may be killed at any time: what it leaves is its last
checkpoint.

Observers have no state there. A run that is resumed tells them all rows again, from the first on,
so whoever can observe a run can observe one that was resumed.
"""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from shutil import rmtree
from typing import Any, NamedTuple

import numpy as np

from orchestrator.errors import InputError, reason
from orchestrator.master.attendant import Lasting, Run
from orchestrator.master.log import Log
from orchestrator.master.observer import Ending, Header, NotKept
from orchestrator.master.spool import Spool
from orchestrator.system.atomic import whole
from orchestrator.system.structure import System

#: The file that grows, and the one that is replaced.
_ROWS, _STATE = "rows.bin", "state.json"

#: What makes a run the one that it is: by names in words, each as text.
Identity = Mapping[str, str]


class _Stored(NamedTuple):
    """What the file that is replaced holds.

    Attributes:
        time, made: how far the run had come [s], and in how many steps.
        every: for how many seconds a checkpoint was written [s].
        of: the run.
        row: all values, hidden ones too.
        states: of the FMUs, as base64.
        lasting: what else there was to remember.

    """

    time: float
    made: int
    every: float
    of: dict[str, str]
    row: list[float]
    states: dict[str, str]
    lasting: list[Any]


def check_gives_states(system: System) -> None:
    """Check that the states of all FMUs can be had.

    Raises:
        InputError: of one they cannot.

    """
    for name, component in system.components.items():
        if not component.gives_state:
            raise InputError(
                f"{name}: its FMU {component.fmu.name} does not give its state away "
                "(canGetAndSetFMUstate and canSerializeFMUstate): a run with it has no checkpoints"
            )


class Checkpoints:
    """An observer and attendant that writes checkpoints, and begins with the one that it finds.

    As an attendant it comes first: what others do at the same time belongs to what follows.

    Attributes:
        folder: of the checkpoint.
        time: of the checkpoint in the folder [s]; None: there is none.

    """

    def __init__(
        self,
        folder: Path,
        identity: Identity,
        every: float,
        resume: bool,
    ) -> None:
        """Look for a checkpoint; nothing is written before the run begins.

        Args:
            folder: of the checkpoint.
            identity: of the run.
            every: a checkpoint for so many simulated seconds [s].
            resume: begin with the one that is there, if there is one.

        Raises:
            InputError: what is there is not wanted, or not what is wanted.

        """
        if not (isfinite(every) and every > 0.0):
            raise InputError(f"a checkpoint every {every:g} s: must be positive and finite")
        self.folder, self._identity, self._every = folder, identity, every
        self._found = _read(folder)
        if self._found is not None:
            if not resume:
                raise InputError(
                    f"{folder} holds a run as it was at t = {self._found.time:g} s: --resume goes "
                    "on with it; delete the folder to begin anew"
                )
            if different := sorted(dict(self._found.of.items() ^ identity.items())):
                raise InputError(
                    f"{folder} is of another run: {', '.join(different)} differ; run what it was "
                    "made by, or delete it to begin anew"
                )
        self._log: Log | None = None
        self.time: float | None = None if self._found is None else self._found.time

    def begin(self, header: Header) -> None:
        """Open the file of rows."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._columns = ("time", *header.columns)
        self._known = 0 if self._found is None else self._found.made + 1
        self._spool = Spool(self.folder / _ROWS, 1 + len(header.columns), self._known)

    def take(self, rows: np.ndarray) -> None:
        """Write some rows, but for those that are told again."""
        again = min(self._known, len(rows))
        self._known -= again
        new = rows[again:]
        if (different := self._spool.append(new)) and self._log is not None:
            row, column = different
            self._log.remark(
                f"{self._columns[column]} is not what it was at t = {new[row, 0]:g} s before the "
                "run was resumed: an FMU does not restore all of its state"
            )

    def end(self, ending: Ending) -> None:
        """Close the file of rows."""
        self._spool.close()

    def attend(self, run: Run) -> int:
        """Write a checkpoint, or begin with one."""
        self._log = run.log
        if self._found is not None:
            self._resume(run, self._found)
            self._found = None
        elif run.made:
            self._write(run)
        steps = max(round(self._every / run.experiment.step), 1)
        return (run.made // steps + 1) * steps

    def remove(self) -> None:
        """Remove what a run that has come to its end does not need any more."""
        rmtree(self.folder)

    def _write(self, run: Run) -> None:
        content = _Stored(
            run.time,
            run.made,
            self._every,
            dict(self._identity),
            run.row.values.tolist(),
            {
                name: b64encode(instance.state()).decode()
                for name, instance in run.instances.items()
            },
            [one.state() for one in _lasting(run)],
        )
        run.blocks.hand_over()
        try:
            self._spool.to_disk()
            with whole(self.folder / _STATE) as partial:
                partial.write_text(json.dumps(content._asdict()), encoding="utf-8")
        except OSError as error:
            raise NotKept(f"stopped at t = {run.time:g} s: {reason(error)}") from error
        self.time = run.time

    def _resume(self, run: Run, found: _Stored) -> None:
        # First of all what rows mean, who is told them wants to know.
        for one, state in zip(_lasting(run), found.lasting, strict=True):
            one.restore(state)
        first = 1  # which was computed anew
        for rows in self._spool.kept():
            run.blocks.tell(rows[first:])
            run.made += len(rows) - first
            if run.interrupts:
                raise KeyboardInterrupt
            first = 0
        run.row.values[:] = found.row
        for name, instance in run.instances.items():
            instance.restore(b64decode(found.states[name]))


def _lasting(run: Run) -> list[Lasting]:
    attendants = [one for one in run.attendants if isinstance(one, Lasting)]
    return [run.row.texts, run.signals, run.log, *attendants]


def interval_in(folder: Path) -> float | None:
    """For how many seconds the last checkpoint in a folder was written [s]; None: there is none.

    Raises:
        InputError: it cannot be read.

    """
    found = _read(folder)
    return None if found is None else found.every


def _read(folder: Path) -> _Stored | None:
    path = folder / _STATE
    try:
        return _Stored(**json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path}: no checkpoint: {reason(error)}") from error
