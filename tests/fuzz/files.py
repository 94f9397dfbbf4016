"""Attack the command line with broken files.

A valid file of each kind is mutated (:mod:`.files_mutators`) and handed to a command. Whatever it
has become, the command ends with 0, or with 2 and one line; no exception leaves it; it writes only
into the current and the temporary folder; and it is done within seconds and some hundred
megabytes.
"""

from __future__ import annotations

import atexit
import io
import os
import resource
import signal
import sys
import tempfile
import traceback
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from random import Random
from shutil import which
from types import FrameType
from typing import Any, NamedTuple
from unittest.mock import patch

from fmus.kinds import NATIVE, PYTHON
from orchestrator import Result, simulate
from orchestrator.commands.main import main as auv_fmu
from orchestrator.cosim import Ending, Linear, Mapped, Observer, Plan
from orchestrator.cosim.formats.ssp_writer import ssp_bytes
from orchestrator.exchange import verify
from orchestrator.machine import user_files
from orchestrator.machine.disk import _process_folder
from orchestrator.runs import SCENARIOS_FOLDER as SCENARIOS
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from support import typed

from . import files_mutators as mutators

#: Limits of a command: seconds, bytes of additional memory, and letters of its message.
SECONDS, BYTES, LETTERS = 20, 2 * 2**30, 5000


class Finding(AssertionError):
    """A command that mishandled a file."""


class Overdue(BaseException):
    """A command took too long; no handler of the program catches this."""


class Place(NamedTuple):
    """Files in the current folder, by name, and the command."""

    files: Mapping[str, bytes]
    arguments: list[str]


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        valid: such a file.
        mutate: makes another of it.
        place: puts a file where a command meets it.

    """

    valid: bytes
    mutate: mutators.Mutator
    place: Callable[[bytes], Place]


def kinds(run: Result) -> dict[str, Kind]:
    """Kinds of files, each with a valid file; some need npm."""
    fmus = {
        # Descriptions need no code; a system of such FMUs can be read and written, not run.
        fmu.name: _zipped({"modelDescription.xml": _entries(fmu.read_bytes())[_DESCRIPTION]})
        for fmu in sorted(current_fmus().glob("*.fmu"))
    }
    with tempfile.TemporaryDirectory() as folder:
        for name, content in fmus.items():
            Path(folder, name).write_bytes(content)
        system = closed_loop(Path(folder), read_scenario("fig5"))
        archive = ssp_bytes(replace(system, stop_time=0.1, step=0.02))
        saved = run.save(Path(folder, "saved"))
        stored = {path.name: path.read_bytes() for path in saved.iterdir()}
    entries, fmu = _entries(archive), fmus["ObserverController.fmu"]
    newer = _entries(_newer_system())
    [newer_fmu] = [name for name in newer if name.endswith(".fmu")]
    [newer_values] = [name for name in newer if name.endswith(".ssv")]

    def exported(content: bytes) -> Place:
        return Place({"mine.ssp": content}, ["export", "mine.ssp"])

    def in_archive(entries: Mapping[str, bytes], name: str) -> Callable[[bytes], Place]:
        return lambda content: exported(_zipped({**entries, name: content}))

    def within_fmu(content: bytes) -> Place:
        return in_archive(newer, newer_fmu)(_zipped({_DESCRIPTION: content}))

    def as_controller(content: bytes) -> Place:
        scenario = b'[components]\ncontroller = "mine.fmu"\n'
        return Place({"mine.fmu": content, "mine.toml": scenario}, ["export", "mine.toml"])

    def beside_the_others(name: str, *command: str) -> Callable[[bytes], Place]:
        return lambda content: Place({**stored, name: content}, [*command])

    found = {
        "description": Kind(
            _entries(fmu)[_DESCRIPTION],
            mutators.xml,
            lambda content: as_controller(_zipped({_DESCRIPTION: content})),
        ),
        "fmu": Kind(fmu, mutators.archive, as_controller),
        "ssd": Kind(entries[_STRUCTURE], mutators.xml, in_archive(entries, _STRUCTURE)),
        "ssv": Kind(entries[_VALUES], mutators.xml, in_archive(entries, _VALUES)),
        "ssp": Kind(archive, mutators.archive, exported),
        "description3": Kind(typed.text().encode(), mutators.xml, within_fmu),
        "ssd2": Kind(newer[_STRUCTURE], mutators.xml, in_archive(newer, _STRUCTURE)),
        "ssv2": Kind(newer[newer_values], mutators.xml, in_archive(newer, newer_values)),
        "scenario": Kind(
            (SCENARIOS / "fig5.toml").read_bytes(),
            mutators.toml,
            lambda content: Place({"mine.toml": content}, ["export", "mine.toml"]),
        ),
        "plot": Kind(stored["result.csv"], mutators.table, beside_the_others("result.csv", *_PLOT)),
        "view": Kind(stored["result.csv"], mutators.table, beside_the_others("result.csv", *_VIEW)),
        "record": Kind(stored["run.json"], mutators.json, beside_the_others("run.json", *_VIEW)),
        "indices": Kind(
            stored["metrics.json"], mutators.json, beside_the_others("metrics.json", *_VIEW)
        ),
        "table": Kind(
            stored["result.csv"],
            mutators.table,
            lambda content: Place({"t.csv": content}, ["verify", "t.csv", "--tolerance", "1e-6"]),
        ),
    }
    if which("npm") is None:
        del found["view"], found["record"], found["indices"]
    return found


def _newer_system() -> bytes:
    """An SSP 2.0 of FMUs of FMI 3.0, with ports of all types, arrays, and mappings."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "typed.fmu")
        path.write_bytes(_zipped({_DESCRIPTION: typed.text().encode()}))
        wires = {f"b.u_{kind}": f"a.y_{kind}" for kind in typed.SCALARS}
        parameters = {f"a.u_{kind}": value for kind, value in typed.VALUES.items()}
        system = typed.system_of(path, "ab", wires, {**parameters, "a.M[2,1]": -0.5})
        ways = {"Int64": Mapped(((1, 2), (3, -4))), "Float64": Linear(2.0, 1.0)}
        connections = [
            replace(wire, transformation=ways.get(wire.target.port.removeprefix("u_")))
            for wire in system.connections
        ]
        return ssp_bytes(replace(system, connections=tuple(connections), stop_time=0.1, step=0.02))


_DESCRIPTION, _STRUCTURE, _VALUES = (
    "modelDescription.xml", "SystemStructure.ssd", "parameters/controller.ssv",
)  # fmt: skip
_PLOT, _VIEW = ("plot", ".", "plant.y", "--out", "plot.svg"), ("view", ".")


def _zipped(entries: Mapping[str, bytes]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, data in entries.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return content.getvalue()


def _entries(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _replay(run: Result, plan: Plan, observers: Sequence[Observer], *_: object) -> Ending:
    """Give observers the rows of an earlier run instead of a new one."""
    for observer in observers:
        observer.begin(run.header)
        observer.take(run.rows)
        observer.end(run.ending)
    return run.ending


def attack(kind: Kind, content: bytes) -> int:
    """Hand a file to its command; returns the exit status.

    Raises:
        Finding: the command did what it must not.

    """
    place = kind.place(content)
    output, complaint = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for name, data in place.files.items():
            Path(name).write_bytes(data)
        try:
            with redirect_stdout(output), redirect_stderr(complaint), _bounded(folder) as outside:
                status = auv_fmu(place.arguments)
        except Overdue as error:
            raise Finding(f"no end after {SECONDS} s, in {_where(error)}") from None
        except (Exception, SystemExit) as error:
            raise Finding(f"{type(error).__name__}: {error!s:.200}, in {_where(error)}") from error
    lines = complaint.getvalue().splitlines(keepends=True)
    for line in lines:
        if not line.strip("\n").isprintable():
            raise Finding(f"no line to read: {line[:300]!r}")
    text = "".join(line for line in lines if not line.startswith("auv-fmu: warning: "))
    if outside:
        raise Finding(f"wrote outside: {', '.join(outside)}")
    if "MemoryError" in text or "MemoryError" in output.getvalue():
        raise Finding(f"out of memory: {text:.200}")
    if status not in (0, 2):
        raise Finding(f"status {status}: {text:.200}")
    if status == 2 and not (text.count("\n") == 1 and text.isprintable() is False):
        raise Finding(f"not one line: {text[:500]!r}")
    if len(text) > LETTERS:
        raise Finding(f"no line to read: {text[:300]!r}, {len(text)} letters")
    return status


def _where(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    return " < ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in frames[:-4:-1])


#: Folders that a running command may write to, and the paths that it wrote elsewhere.
_watched: tuple[tuple[str, ...], list[str]] | None = None

_WRITING = {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.symlink", "os.link", "os.chmod"}


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if _watched is None or event not in _WRITING | {"open"}:
        return
    if event == "open":
        path, mode, flags = arguments
        if not (set(mode or "") & set("wax+") or (flags or 0) & (os.O_WRONLY | os.O_RDWR)):
            return
    else:
        path, *others = arguments
        # A path below an open folder, as rmtree has it: that folder was looked at.
        if any(isinstance(other, int) and other >= 0 for other in others[-1:]):
            return
    if isinstance(path, int):
        return
    allowed, outside = _watched
    where = os.path.abspath(os.fsdecode(path))  # noqa: PTH100  # resolves no links
    if not where.startswith((*allowed, "/dev/", "/proc/self/")):
        outside.append(where)


@contextmanager
def _bounded(folder: str) -> Iterator[list[str]]:
    """Limit time and memory, and list files that are written outside the allowed folders."""
    global _watched  # noqa: PLW0603
    outside: list[str] = []
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + BYTES, hard))
    before = signal.signal(signal.SIGALRM, _stop)
    signal.alarm(SECONDS)
    _watched = ((folder, tempfile.gettempdir()), outside)
    try:
        yield outside
    finally:
        _watched = None
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _stop(_: int, __: FrameType | None) -> None:
    raise Overdue


def _forget() -> None:
    """Empty the caches, so that archives are unpacked again."""
    for kept in (user_files._folders, user_files._digests, user_files._sizes):
        kept.clear()


@contextmanager
def prepared() -> Iterator[dict[str, Kind]]:
    """All kinds of files, after one run of each with its valid file."""
    before = tempfile.tempdir, sys.dont_write_bytecode
    with tempfile.TemporaryDirectory(prefix="mutated-files-") as folder:
        # Temporary files go into a folder of their own, so that writing beside it is seen.
        tempfile.tempdir, sys.dont_write_bytecode = folder, True
        _forget()
        _process_folder.cache_clear()
        try:
            for fmus in (PYTHON, NATIVE):
                current_fmus(fmus)  # else the first command would take the time
            run = simulate("fig4", stop_time=0.2)
            with patch.object(verify, "simulate_plan", partial(_replay, run)):
                found = kinds(run)
                for name, kind in found.items():
                    # The first use of a library may write into its cache.
                    assert attack(kind, kind.valid) == 0, name
                sys.addaudithook(_watch)
                yield found
        finally:
            tempfile.tempdir, sys.dont_write_bytecode = before
            _forget()
            _process_folder.cache_clear()


@cache
def _kinds() -> dict[str, Kind]:
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(prepared())


def findings(seed: int) -> Iterator[str]:
    """Attack the command line with a file of each kind."""
    for name, kind in _kinds().items():
        try:
            attack(kind, kind.mutate(kind.valid, Random(f"{name} {seed}")))
        except Finding as finding:
            yield f"{name}: {finding}"
