"""`run.json`: what a result was made from, and with what."""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from time import monotonic
from typing import Any

from fmus.kinds import NATIVE, PYTHON
from orchestrator.machine.ledger import RECORD
from orchestrator.master import plan as identity
from orchestrator.master.experiment import Experiment
from orchestrator.master.fmi.binary import runs_python
from orchestrator.master.observers.files import FORMATS
from orchestrator.master.observers.observer import Ending, Header, Occurrence
from orchestrator.runs.preparation import Prepared
from orchestrator.system.names import port_name
from orchestrator.vehicle.signals import STANDARD, Loop, loops_of

#: The indices of a run.
METRICS = "metrics.json"

#: The table of a run, in one format or the other, and all files that every run writes.
TABLES = tuple(f"result.{ending}" for ending in FORMATS)
FILES = (*TABLES, METRICS, RECORD)

#: Packages whose versions a result depends on.
PACKAGES = (*identity.PACKAGES, "matplotlib")


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
    (folder / METRICS).write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")


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
        "sha256": prepared.scenario.digest,
        "identity": identity.digest_of(prepared.identity),
        "command": list(command),
        **clock.times(),
        "failure": ending.failure,
        "remark": ending.remark,
        "messages": list(ending.messages),
        "experiment": {**vars(header.experiment), "steps": dict(prepared.system.steps)},
        "loop": header.loop,
        "texts": sorted(header.strings),
        "units": dict(header.units),
        "vehicles": [asdict(loop) for loop in loops_of(prepared.system)],
        **(remarks or {}),
        "events": [occurrence._asdict() for occurrence in ending.events],
        "fmus": {
            component.name: {
                "file": component.fmu.name,
                "sha256": component.digest,
                "kind": PYTHON if runs_python(component.folder) else NATIVE,
            }
            for component in prepared.system.components.values()
        },
        "parameters": {str(name): value for name, value in header.parameters.items()},
        "versions": {"python": sys.version.split()[0]}
        | {package: version(package) for package in PACKAGES},
        "platform": platform.platform(),
    }
    write_files(folder, content)


def write_files(folder: Path, content: dict[str, Any]) -> None:
    """Write a record, with the names of all files beside it."""
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    text = json.dumps({**content, "files": sorted(files | {RECORD})}, indent=2)
    (folder / RECORD).write_text(text + "\n", encoding="utf-8")


def read_ending(record: dict[str, Any]) -> Ending:
    """How a run has ended, from its record."""
    events = record.get("events", ())
    return Ending(
        record.get("failure"),
        record.get("remark"),
        events=tuple(Occurrence(float(e["time"]), str(e["text"]), str(e["label"])) for e in events),
    )


def read_header(record: dict[str, Any], columns: tuple[str, ...]) -> Header:
    """The header of a table, from the record beside it."""
    stated = record["experiment"]
    known = {field.name: stated[field.name] for field in fields(Experiment) if field.name in stated}
    return Header(
        columns,
        Experiment(**known),
        {port_name(name): value for name, value in record["parameters"].items()},
        record.get("loop", "python"),
        units=record.get("units", {}),
    )


def read_loops(record: dict[str, Any]) -> tuple[Loop, ...]:
    """The loops of the vehicles of a run, from its record; of one without, the standard one."""
    return tuple(Loop(**names) for names in record.get("vehicles", ())) or (STANDARD,)
