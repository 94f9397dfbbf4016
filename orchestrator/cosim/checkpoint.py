"""Checkpoints, from which a run continues in another process.

A folder holds two files. One grows and holds all rows so far. The other is replaced as a whole,
once the rows are on the disk: it contains the number of valid rows, their digest, the states of the
FMUs and the state of the run, with a checksum. A process may be killed at any time: it leaves its
last checkpoint. A random token in both files distinguishes them from users' files.

Observers have no state there. A resumed run gives them all rows again, from the first on, so that
any observer of a run can observe a resumed one.
"""

from __future__ import annotations

import os
from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from math import isfinite
from pathlib import Path
from stat import S_ISREG
from typing import Any, NamedTuple
from uuid import uuid4

import numpy as np

from orchestrator.cosim.fmi.instance import Log
from orchestrator.cosim.hooks import NEVER, Run, stateful
from orchestrator.cosim.observers import Ending, Header, NotKept
from orchestrator.machine.disk import move_aside, sealed, unsealed, write_whole
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.identity import Identity, differences
from orchestrator.machine.operating_system import sync_to_disk

#: Names of the file of rows and of the file of the state.
_ROWS, _STATE = "rows.bin", "state.json"

#: Type of a number in the file of rows, and number of rows that are read at once.
_NUMBER, _AT_ONCE = np.dtype("<f8"), 4096

#: First bytes of that file, before the token, and length of both together.
_TITLE, _BEGIN = b"auv-fmu rows ", 64


def begins(path: Path, token: str) -> bool:
    """Return True for a file of rows with a token."""
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(_BEGIN) == _head(token)


def _head(token: str) -> bytes:
    return (_TITLE + token.encode()).ljust(_BEGIN - 1) + b"\n"


class RowLog:
    """A file of rows: numbers without separators.

    Rows after the valid ones are compared with the rows that replace them.
    """

    def __init__(self, path: Path, token: str, width: int, kept: int = 0, digest: str = "") -> None:
        """Create the file, or continue after the first rows of an existing one.

        Args:
            path: of the file.
            token: at the beginning of the file.
            width: number of values in a row.
            kept: number of valid rows.
            digest: of the valid rows.

        Raises:
            InputError: they are missing or have changed.

        """
        self._path, self._width, self._kept = path, width, kept
        self._digest, self._after = sha256(), 0
        if not kept:
            self._file = path.open("x+b")
            self._file.write(_head(token))
            self._file.flush()
            return
        row = width * _NUMBER.itemsize
        if is_whole := begins(path, token):
            for rows in self.kept():
                self._digest.update(rows.astype(_NUMBER, copy=False).tobytes())
        if not is_whole or self._digest.hexdigest() != digest:
            raise InputError(
                f"{path}: missing, damaged, or from another checkpoint; move it and the checkpoint "
                "next to it, or let --force move both aside"
            )
        self._file = path.open("r+b")
        there = (path.stat().st_size - _BEGIN) // row
        # An incomplete row may follow.
        self._file.truncate(_BEGIN + there * row)
        self._file.seek(_BEGIN + kept * row)
        self._after = there - kept

    def append(self, rows: np.ndarray) -> tuple[int, int] | None:
        """Write some rows.

        Returns:
            Row and column of the first number that differs; None: no number differs.

        """
        content = rows.astype(_NUMBER, copy=False).tobytes()
        different = self._different(content) if self._after else None
        self._file.write(content)
        self._digest.update(content)
        if different is None:
            return None
        self._after = 0
        self._file.truncate()
        return divmod(different, self._width)

    def _different(self, content: bytes) -> int | None:
        """Return the index of the first number in the file that differs."""
        place = self._file.tell()
        existing = np.frombuffer(self._file.read(len(content)), np.uint64)
        self._file.seek(place)
        # Compared bit for bit: zero is not minus zero.
        changed = np.flatnonzero(existing != np.frombuffer(content, np.uint64)[: len(existing)])
        self._after -= len(existing) // self._width
        return int(changed[0]) if len(changed) else None

    def kept(self) -> Iterator[np.ndarray]:
        """Yield the valid rows, some thousand at a time."""
        with self._path.open("rb") as file:
            file.seek(_BEGIN)
            for first in range(0, self._kept, _AT_ONCE):
                n = min(_AT_ONCE, self._kept - first)
                numbers = np.fromfile(file, _NUMBER, n * self._width)
                if len(numbers) < n * self._width:
                    raise InputError(f"{self._path}: holds fewer than {self._kept:,} rows")
                yield numbers.astype(float, copy=False).reshape(n, self._width)

    def to_disk(self) -> str:
        """Flush all rows to the disk, and return their digest."""
        self._file.flush()
        sync_to_disk(self._path)
        return self._digest.hexdigest()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class _Stored(NamedTuple):
    """Content of the file of the state.

    Attributes:
        identity: token of both files, under the name that files on disks use for it.
        every: interval of the checkpoints [s].
        of: identity of the run.
        time, made: time [s] and number of steps of the checkpoint; None: no row is valid yet.
        n_rows, rows: number of valid rows, and their digest.
        row: all values, including the hidden ones.
        states: of the FMUs, as base64.
        lasting: states of the overrides, the log and the hooks.

    """

    identity: str
    every: float
    of: dict[str, str]
    time: float | None = None
    made: int = 0
    n_rows: int = 0
    rows: str = ""
    row: Sequence[float] = ()
    states: Mapping[str, str] = {}
    lasting: Sequence[Any] = ()


class Checkpoints:
    """An observer and hook that writes checkpoints, and continues from an existing one.

    It must be the first hook: the actions of others at the same time belong to the next steps.

    Attributes:
        folder: of the checkpoint.
        time: of the checkpoint in the folder [s]; None: there is none.

    """

    @staticmethod
    def check(every: float) -> None:
        """Check an interval before a run.

        Raises:
            InputError: it is not positive and finite.

        """
        if not (isfinite(every) and every > 0.0):
            raise InputError(f"a checkpoint every {every:g} s: must be positive and finite")

    @staticmethod
    def interval_in(folder: Path) -> float | None:
        """Interval of the last checkpoint in a folder [s]; None: there is none.

        Raises:
            InputError: it cannot be read.

        """
        stored = _read(folder)
        return None if stored is None else stored.every

    def __init__(
        self,
        folder: Path,
        identity: Identity,
        every: float,
        resume: bool,
        force: bool = False,
        token: str = "",
    ) -> None:
        """Look for a checkpoint; nothing is written before the run begins.

        Args:
            folder: of the checkpoint.
            identity: of the run.
            every: interval of the checkpoints in simulated time [s].
            resume: if set, continue from an existing checkpoint.
            force: if set, move another checkpoint or file aside.
            token: random, for a new checkpoint; empty: it is drawn.

        Raises:
            InputError: there is a checkpoint that was not asked for, or of another run.

        """
        Checkpoints.check(every)
        self.folder, self._identity, self._every = folder, identity, every
        self._found = self._look(resume, force)
        self._token = self._found.identity if self._found else token or uuid4().hex
        self._log: Log | None = None
        self.time: float | None = None if self._found is None else self._found.time

    def _look(self, resume: bool, force: bool) -> _Stored | None:
        """Return the existing checkpoint, from which the run continues."""
        try:
            stored = _read(self.folder)
            rows = self.folder / _ROWS
            # A process that was killed at its begin may have left an empty file of rows.
            is_empty = rows.is_file() and not rows.is_symlink() and not rows.stat().st_size
            is_ours = stored and (is_empty or begins(rows, stored.identity))
            if os.path.lexists(rows) and not is_ours:
                raise InputError(
                    f"{rows} is not a file of a checkpoint; move it, choose another folder, or let "
                    "--force move it aside"
                )
            if stored is None or stored.time is None:
                return stored
            if not resume:
                raise InputError(
                    f"{self.folder} holds a checkpoint at t = {stored.time:g} s: --resume "
                    "continues from it; --force moves it aside and starts over"
                )
            if different := differences(stored.of, self._identity):
                raise InputError(
                    f"{self.folder} belongs to another run: {', '.join(different)} differ; resume "
                    "that run, or let --force move it aside and start over"
                )
        except InputError:
            if not force:
                raise
            for path in (self.folder / _STATE, self.folder / _ROWS):
                if os.path.lexists(path):
                    move_aside(path)
            return None
        return stored

    def begin(self, header: Header) -> None:
        """Open the file of rows."""
        self._columns = ("time", *header.columns)
        rows, width, stored = self.folder / _ROWS, len(self._columns), self._found
        if stored is None or stored.time is None:
            self._known, digest = 0, ""
            # The token is stored first, as a proof that the file of rows is ours.
            self.folder.mkdir(parents=True, exist_ok=True)
            self._store()
            rows.unlink(missing_ok=True)
        else:
            self._known, digest = stored.n_rows, stored.rows
        self._row_log = RowLog(rows, self._token, width, self._known, digest)

    def take(self, rows: np.ndarray) -> None:
        """Write some rows, except those that are repeated."""
        again = min(self._known, len(rows))
        self._known -= again
        new = rows[again:]
        if (different := self._row_log.append(new)) and self._log is not None:
            row, column = different
            self._log.remark(
                f"{self._columns[column]} differs at t = {new[row, 0]:g} s from its value before "
                "the run was resumed: an FMU does not restore all of its state"
            )

    def end(self, ending: Ending) -> None:
        """Close the file of rows."""
        self._row_log.close()

    def act(self, run: Run) -> int:
        """Write a checkpoint, or continue from one."""
        self._log = run.log
        stored, self._found = self._found, None
        if stored is not None and stored.time is not None:
            with _explained(self.folder / _STATE):
                self._resume(run, stored)
        elif run.made:
            self._write(run)
        steps = max(round(min(self._every / run.experiment.step, NEVER)), 1)
        return (run.made // steps + 1) * steps

    def remove(self) -> None:
        """Remove the files that a finished run no longer needs."""
        stored, rows = _read(self.folder), self.folder / _ROWS
        if stored is not None and stored.identity == self._token:
            # The file with the token is removed last, as a proof that the rows are ours.
            self._store()
            if begins(rows, self._token):
                rows.unlink()
            (self.folder / _STATE).unlink()
        self._partial.unlink(missing_ok=True)
        with suppress(OSError):
            # Fails if the folder is not empty.
            self.folder.rmdir()

    def _write(self, run: Run) -> None:
        run.blocks.hand_over()
        try:
            self._store(
                time=run.time,
                made=run.made,
                n_rows=run.blocks.count,
                rows=self._row_log.to_disk(),
                row=run.row.values.tolist(),
                states={
                    name: b64encode(instance.state()).decode()
                    for name, instance in run.instances.items()
                },
                lasting=[part.state() for part in stateful(run)],
            )
        except OSError as error:
            raise NotKept(f"stopped at t = {run.time:g} s: {reason(error)}") from error
        self.time = run.time

    @property
    def _partial(self) -> Path:
        return self.folder / f".auv-fmu-{self._token}.json"

    def _store(self, **more: Any) -> None:
        content = _Stored(self._token, self._every, dict(self._identity), **more)
        write_whole(self.folder / _STATE, sealed(content._asdict()), self._partial)

    def _resume(self, run: Run, stored: _Stored) -> None:
        # The meaning of rows is restored first: observers that get them need it.
        for part, state in zip(stateful(run), stored.lasting, strict=True):
            part.restore(state)
        first = run.blocks.count  # computed again
        for rows in self._row_log.kept():
            run.blocks.tell(rows[first:])
            run.made += len(rows) - first
            if run.interrupts:
                raise KeyboardInterrupt
            first = 0
        run.row.values[:] = stored.row
        for name, instance in run.instances.items():
            instance.restore(b64decode(stored.states[name]))


def _read(folder: Path) -> _Stored | None:
    path = folder / _STATE
    if not os.path.lexists(path):
        return None
    with _explained(path):
        if not S_ISREG(path.lstat().st_mode):
            raise ValueError("it is not a file")
        return _Stored(**unsealed(path.read_text(encoding="utf-8")))


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Name the file of a damaged checkpoint."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
        raise InputError(
            f"{path}: not a checkpoint: {reason(error)}; move it, or let --force move it aside"
        ) from error
