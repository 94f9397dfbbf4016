"""What a run leaves, and how it is read again: `run.json`, its table, its checkpoints."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import chain
from math import inf, isfinite
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from fmus.kinds import NATIVE, PYTHON
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.binary import runs_python
from orchestrator.cosim.formats.tables import read_columns, read_rows
from orchestrator.cosim.hooks.checkpoint import Checkpoints, interval_in
from orchestrator.cosim.observers.files import TABLE_FORMATS
from orchestrator.cosim.observers.observer import Ending, Header, Occurrence
from orchestrator.cosim.plan import PACKAGES, digest_of
from orchestrator.cosim.system.names import port_name
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.values import TYPES, Standing, StringTable
from orchestrator.figures.style import Drawn
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.errors import InputError
from orchestrator.machine.user_files import explain_errors, read_text
from orchestrator.runs.folder import RECORD, is_changed, locate
from orchestrator.runs.preparation import Prepared
from orchestrator.vehicle.signals import STANDARD, Loop, loop_of

#: The indices of a run.
METRICS = "metrics.json"

#: The table of a run, in one format or the other, and all files that every run writes.
TABLES = tuple(f"result.{ending}" for ending in TABLE_FORMATS)
FILES = (*TABLES, METRICS, RECORD)

#: The folder of checkpoints, within the folder of the result.
CHECKPOINTS = "checkpoint"

#: Packages whose versions a result depends on.
RECORDED_PACKAGES = (*PACKAGES, "matplotlib")

#: What a file is not that cannot be read.
_NOT_A_RECORD = "not the record of a run"


#: Numbers that JSON has no words for, by the texts that are written for them.
_NOT_FINITE = {text: float(text) for text in ("inf", "-inf", "nan")}

#: What in the indices holds texts of the user.
_TEXTS = ("scenario", "order", "parameters")


class Stopwatch:
    """When something has begun, and how long it has taken, even if the clock is set meanwhile."""

    def __init__(self) -> None:
        """Begin now."""
        self._started = datetime.now(UTC)
        self._tick = monotonic()

    def times(self) -> dict[str, object]:
        """What a record says of it."""
        return {
            "started": self._started.isoformat(timespec="seconds"),
            "seconds": round(monotonic() - self._tick, 3),
        }


def write_metrics(folder: Path, values: Mapping[str, Any]) -> None:
    """Write metrics.json into a folder."""
    (folder / METRICS).write_text(in_json(values), encoding="utf-8")


def read_metrics(path: Path) -> dict[str, Any]:
    """Read metrics.json.

    Raises:
        InputError: it cannot be read.

    """
    with explain_errors(path, "not the indices of a run"):
        values = json.loads(read_text(path, "not the indices of a run"))
        if not isinstance(values, dict):
            raise ValueError("it holds no names")
        return {
            name: value if name in _TEXTS else _as_numbers(value) for name, value in values.items()
        }


def write_record(
    folder: Path,
    prepared: Prepared,
    header: Header,
    ending: Ending,
    command: Sequence[str],
    clock: Stopwatch,
    remarks: Mapping[str, object] | None = None,
) -> None:
    """Write the record of a run into the folder of its files.

    Args:
        folder: with all other files of the result.
        prepared: what was run.
        header, ending: of its table.
        command: that has run it.
        clock: started with it.
        remarks: what else there is to say of it.

    """
    content = {
        "scenario": prepared.scenario.name,
        "title": prepared.scenario.title,
        "label": prepared.scenario.label,
        "z_up": prepared.scenario.z_up,
        "figure": prepared.scenario.figure,
        "sha256": prepared.scenario.digest,
        "identity": digest_of(prepared.identity),
        "command": list(command),
        **clock.times(),
        **content_of(header, ending, prepared.loops),
        "experiment": {**vars(header.experiment), "steps": dict(prepared.system.steps)},
        **(remarks or {}),
        "fmus": {
            component.name: {
                "file": component.fmu.name,
                "sha256": component.digest,
                "kind": PYTHON if runs_python(component.folder) else NATIVE,
            }
            for component in prepared.system.components.values()
        },
    }
    write_content(folder, content)


def content_of(header: Header, ending: Ending, loops: Sequence[Loop]) -> dict[str, object]:
    """What is written of a table: :func:`header_in`, `ending_in` and `loops_in` read it again."""
    return {
        "failure": ending.failure,
        "remark": ending.remark,
        "messages": list(ending.messages),
        "experiment": vars(header.experiment),
        "loop": header.loop,
        "types": {
            **{n: header.standing[n].fmi_type for n in header.columns if n in header.standing},
            **{str(n): "String" for n, value in header.parameters.items() if type(value) is str},
        },
        "units": dict(header.units),
        "vehicles": [asdict(loop) for loop in loops],
        "events": [occurrence._asdict() for occurrence in ending.events],
        "parameters": {str(name): value for name, value in header.parameters.items()},
    }


def write_content(
    folder: Path, content: Mapping[str, object], packages: Sequence[str] = RECORDED_PACKAGES
) -> None:
    """Write a record, with versions, the platform, and the names of all files beside it."""
    versions = {package: version(package) for package in packages}
    copy_record(
        folder,
        {
            **content,
            "versions": {"python": platform.python_version()} | versions,
            "platform": platform.platform(),
        },
    )


def copy_record(folder: Path, content: Mapping[str, object]) -> None:
    """Write a record as it is, but for the names of all files beside it."""
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    whole = {**content, "files": sorted(files | {RECORD})}
    (folder / RECORD).write_text(in_json(whole), encoding="utf-8")


def in_json(content: Mapping[str, object]) -> str:
    """A record or indices as JSON, with texts for numbers that are not finite."""
    return json.dumps(_as_texts(content), indent=2, allow_nan=False) + "\n"


def _as_texts(content: object) -> object:
    """The same with texts for numbers that are not finite."""
    if isinstance(content, Mapping):
        return {name: _as_texts(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return list(map(_as_texts, content))
    return str(content) if isinstance(content, float) and not isfinite(content) else content


def _as_numbers(content: Any) -> Any:
    """The same with the numbers for these texts."""
    if isinstance(content, dict):
        return {name: _as_numbers(value) for name, value in content.items()}
    if isinstance(content, list):
        return list(map(_as_numbers, content))
    return _NOT_FINITE.get(content, content) if isinstance(content, str) else content


def ending_in(record: dict[str, Any]) -> Ending:
    """How a run has ended, from its record."""
    events = (
        Occurrence(float(e["time"]), str(e["text"]), str(e["label"]), int(e.get("event", 0)))
        for e in record.get("events", ())
    )
    return Ending(
        record.get("failure"),
        record.get("remark"),
        tuple(record.get("messages", ())),
        events=tuple(events),
    )


def header_in(record: dict[str, Any], columns: tuple[str, ...]) -> Header:
    """The header of a table, from the record beside it."""
    stated = record["experiment"]
    known = {field.name: stated[field.name] for field in fields(Experiment) if field.name in stated}
    types, strings = _types_in(record), StringTable()
    return Header(
        columns,
        Experiment(**known),
        {
            port_name(name): value if types.get(name) == "String" else _as_numbers(value)
            for name, value in record["parameters"].items()
        },
        record.get("loop", "python"),
        {name: Standing(types[name], strings) for name in columns if name in types},
        record.get("units", {}),
    )


def _types_in(record: dict[str, Any]) -> dict[str, str]:
    """The types of columns and parameters that hold anything but doubles."""
    # Earlier versions named columns of texts only.
    types = record.get("types", dict.fromkeys(record.get("texts", ()), "String"))
    if not all(TYPES[fmi_type].stands for fmi_type in types.values()):
        raise ValueError("it holds types that no run has")
    return dict(types)


def loops_in(record: dict[str, Any]) -> tuple[Loop, ...]:
    """The loops of the vehicles of a run, from its record; of one without, the standard one."""
    return tuple(loop_of(names) for names in record.get("vehicles", ())) or (STANDARD,)


def read_result(
    path: Path,
    watched: Callable[[Sequence[str], Sequence[Loop]], Collection[str]] | None = None,
) -> Drawn:
    """What can be seen of a stored result, by its name.

    Args:
        path: a folder that a run has written, or a table in CSV or Parquet. Of a table without a
            record beside it, no parameters are known.
        watched: chooses the columns that will be drawn among the ones there are, given the loops;
            None: what the paper's figures draw.

    Raises:
        InputError: there is no result, or it cannot be read.

    """
    file = table_in(path)
    record = read_record(file)
    header, blocks = stored_rows(file, record)
    loops = loops_in(record)
    drawn = {name for loop in loops for name in loop.drawn()}
    table = VisibleRows(drawn if watched is None else watched(header.columns, loops))
    table.begin(header)
    for rows in blocks:
        table.take(rows)
    table.end(ending_in(record))
    label = str(record.get("label") or record.get("scenario") or file.stem)
    return Drawn(label, table, bool(record.get("z_up")), loops)


def stored_rows(file: Path, record: dict[str, Any]) -> tuple[Header, Iterator[np.ndarray]]:
    """The header and the rows of a stored table, block by block.

    Raises:
        InputError: it cannot be read, or has no rows.

    """
    place = locate(file)
    columns = read_columns(place)
    header = header_in(record, columns) if record else None
    standing = header.standing if header else {}
    blocks = read_rows(place, {name: one.number for name, one in standing.items()})
    first = next(blocks, None)
    if first is None:
        raise InputError(f"{file}: has no rows")
    return header or _header(columns, first, file), chain([first], blocks)


def table_in(path: Path) -> Path:
    """The file with the table of a result.

    Raises:
        InputError: there is none.

    """
    with explain_errors(path, "not the name of a result"):
        for file in (path, *(path / name for name in TABLES)):
            if locate(file).is_file():
                return file
    raise InputError(f"{path}: holds no result.csv or result.parquet")


def changed_files(table: Path) -> list[Path]:
    """The table of a result and its record, as far as they are not what the run wrote."""
    return [file for file in (table, table.with_name(RECORD)) if is_changed(file)]


def read_record(table: Path) -> dict[str, Any]:
    """The record of the run that has written a table; empty if none beside it names the table.

    Raises:
        InputError: it is broken.

    """
    file = locate(table.with_name(RECORD))
    if not file.exists():
        return {}
    with explain_errors(file, _NOT_A_RECORD):
        record = json.loads(read_text(file, _NOT_A_RECORD))
        try:
            if table.name not in record["files"]:
                return {}
            header, *_ = header_in(record, ()), ending_in(record), loops_in(record)
        except (KeyError, TypeError, AttributeError):
            raise ValueError("it lacks what a run writes") from None
        except InputError as error:
            raise ValueError(str(error)) from None
        for name, value in header.parameters.items():
            if not isinstance(value, float | int | str):
                raise ValueError(f"the parameter {name} is {value!r}")
    return dict(record)


def _header(columns: tuple[str, ...], rows: np.ndarray, file: Path) -> Header:
    """The header of a table without a record: its first rows tell the step."""
    step = float(rows[1, 0] - rows[0, 0]) if len(rows) > 1 else 1.0
    if not 0.0 < step < inf:
        raise InputError(f"{file}: times must increase")
    return Header(columns, Experiment(step, step))


def checkpoints_of(
    runs: Sequence[Prepared],
    folders: Sequence[Path],
    every: float | None,
    resume: bool,
    force: bool = False,
    token: str = "",
    say: Callable[[str], None] = lambda _: None,
) -> list[Checkpoints]:
    """The checkpoints of some runs, one after the other.

    Args:
        runs: whose results go into a folder: of the first into it, of the others below it.
        folders: of their checkpoints.
        every: one for so many simulated seconds [s]; None: as often as before, if runs are resumed.
        resume: begin with those that are there.
        force: move aside what is there otherwise.
        token: random, for new ones; empty: one is drawn.
        say: takes notes for the user.

    Returns:
        None at all, if none are wanted.

    Raises:
        InputError: there is nothing to resume, or something else; or an FMU has no state.

    """
    if resume and every is None:
        every = interval_in(folders[0])
        if every is None:
            raise InputError(
                f"nothing to resume in {folders[0]}; a run with "
                "--checkpoint-every writes checkpoints there"
            )
    if every is None:
        return []
    for prepared in runs:
        check_gives_states(prepared.system)
    found = [
        Checkpoints(folder, prepared.identity, every, resume, force, token)
        for folder, prepared in zip(folders, runs, strict=True)
    ]
    for checkpoints in found:
        # FMUs may change the current folder.
        checkpoints.folder = checkpoints.folder.absolute()
    times = [checkpoints.time for checkpoints in found]
    for prepared, time in zip(runs, times, strict=True):
        if time is not None:
            say(f"{prepared.scenario.name}: continues at t = {time:g} s")
    if resume and not any(times):
        say(f"nothing to resume in {folders[0]}: starts from the beginning")
    return found


def check_gives_states(system: System) -> None:
    """Check that the states of all FMUs can be had.

    Raises:
        InputError: of one they cannot.

    """
    for name, component in system.components.items():
        if not component.gives_state:
            raise InputError(
                f"{name}: its FMU {component.fmu.name} does not provide its state "
                "(canGetAndSetFMUstate and canSerializeFMUstate): a run with it has no checkpoints"
            )


def leave_checkpoints(
    kept: Sequence[Checkpoints], is_whole: bool, say: Callable[[str], None] = lambda _: None
) -> None:
    """Remove checkpoints that are not needed any more, or say where they are.

    Args:
        kept: of runs that belong together.
        is_whole: whether all of these have come to their end.
        say: takes notes for the user.

    """
    # The folder with the first one's holds the others'.
    for checkpoints in reversed(kept):
        if is_whole:
            checkpoints.remove()
        elif checkpoints.time is not None:
            place = _shown(checkpoints.folder)
            say(f"--resume continues from t = {checkpoints.time:g} s, from {place}")


def _shown(folder: Path) -> Path:
    """A folder as it is called from the current one, if that holds it."""
    with suppress(OSError, ValueError):
        return folder.relative_to(Path.cwd())
    return folder
