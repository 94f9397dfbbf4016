"""Run every FMU and archive in our master and in others, each in a separate process."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from collect import Item
from other_masters import TOOLS

#: Steps of every run, and its time limit [s].
STEPS, PATIENCE = 200, 600

#: Longest part of a tool's output that is kept; its last line has the reason of a failure.
_LONGEST_REASON = 400

#: Relative tolerance of a parameter that was read back.
_HELD = 1e-12

_HERE = Path(__file__).parent


def compared(items: Sequence[Item], folder: Path, workers: int) -> dict[str, dict[str, Any]]:
    """Results by name."""
    with ThreadPoolExecutor(workers) as pool:
        names = [item.name for item in items]
        return dict(zip(names, pool.map(partial(_one, folder), items), strict=True))


def _one(folder: Path, item: Item) -> dict[str, Any]:
    entry = {**asdict(item), "is_fmu": item.is_fmu}
    if not item.file:
        return {**entry, "outcome": "absent", "reason": ""}
    with TemporaryDirectory() as temporary:
        examine = _fmu if item.is_fmu else _archive
        entry |= examine(folder.resolve() / item.file, Path(temporary))
    print(f"{item.name}: {entry['outcome']} {entry['reason']}", flush=True)
    return entry


def _fmu(file: Path, folder: Path) -> dict[str, Any]:
    """Compare an FMU with a plain host, with its own parameters and with others."""
    entry = _ours(file, folder / "default.json")
    if entry["outcome"] == "runs":
        entry["deviation"] = _against(_HERE / "host.py", file, folder / "default.json")
        changed = _ours(file, folder / "changed.json", "--changed")
        entry["changed"] = changed
        if changed["outcome"] == "runs" and changed["wanted"]:
            changed["deviation"] = _against(_HERE / "host.py", file, folder / "changed.json")
    return entry


def _archive(file: Path, folder: Path) -> dict[str, Any]:
    """Run an archive in the default order, and compare it with other masters in theirs."""
    entry = _ours(file, folder / "default.json")
    jacobi = _ours(file, folder / "jacobi.json", "--order", "jacobi")
    if jacobi["outcome"] == "runs":
        entry["tools"] = {
            tool: _against(_HERE / "other_masters.py", tool, file, folder / "jacobi.json", skip=1)
            for tool in TOOLS
        }
    return entry


def _ours(file: Path, out: Path, *options: str) -> dict[str, Any]:
    """Result of our master, or the reason of its failure."""
    ended = _run(_HERE / "ours.py", file, STEPS, out, *options)
    if not out.exists():
        return {"outcome": "crashes", "reason": ended}
    came = json.loads(out.read_text(encoding="utf-8"))
    for key, outcome in (("refusal", "refused"), ("failure", "fails")):
        if came.get(key):
            return {"outcome": outcome, "reason": _plain(came[key], file)}
    lost = [name for name, value in came["wanted"].items() if not _same(came["held"][name], value)]
    silent = [name for name in lost if not any(name in line for line in came["said"])]
    return {
        "outcome": "runs",
        "reason": "",
        "rows": came["rows"],
        "said": [_plain(line, file) for line in came["said"]],
        "wanted": len(came["wanted"]),
        "lost": lost,
        "silent": silent,
    }


def _against(*command: object, skip: int = 0) -> float | str:
    """Largest deviation from another host, relative to the size of a column if it is above one.

    Args:
        command: that runs it; the last of it is what our run has written.
        skip: rows of ours that the other host does not have.

    Returns:
        The deviation, or why there is none.

    """
    written = Path(str(command[-1]))
    out = written.with_name("other.npy")
    out.unlink(missing_ok=True)
    ended = _run(*command, out)
    if not out.exists():
        return ended
    rows, theirs = np.load(written.with_suffix(".npy"))[skip:], np.load(out)
    if not json.loads(written.read_text(encoding="utf-8"))["outputs"]:
        return "has no Real output"
    if rows.shape != theirs.shape:
        return f"{theirs.shape} values instead of {rows.shape}"
    size = np.maximum(1.0, np.abs(rows).max(axis=0))
    return float(np.max(np.abs(rows - theirs) / size))


def _run(*command: object) -> str:
    """Run a script; return the reason if it fails."""
    with TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [sys.executable, *map(str, command)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            cwd=folder,
            env=os.environ | {"TMPDIR": folder},
            start_new_session=True,
        )
        try:
            complaint = process.communicate(timeout=PATIENCE)[1].decode(errors="replace").strip()
        except subprocess.TimeoutExpired:
            # An FMU may have started programs of its own.
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return f"no end after {PATIENCE} s"
    if process.returncode < 0:
        return signal.Signals(-process.returncode).name
    return (
        complaint.splitlines()[-1][:_LONGEST_REASON]
        if complaint
        else f"status {process.returncode}"
    )


def _same(held: Any, wanted: Any) -> bool:
    return bool(abs(held - wanted) <= _HELD * max(1.0, abs(wanted)))


def _plain(text: str, file: Path) -> str:
    """A message without the folders of this run."""
    text = text.replace(f"{file}: ", "").replace(str(file), file.name)
    return re.sub(r"/\S*?auvfmu-\w+/\w+/", "", text)[:_LONGEST_REASON]
