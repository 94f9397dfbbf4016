"""Many runs side by side on the cores; those that were finished before are reused."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from orchestrator.errors import InputError, last_line
from orchestrator.experiments.bundle import current_fmus
from orchestrator.experiments.scenario import FOLDER as SCENARIOS

#: What a folder of results was computed from.
_STAMP = "job.json"


@dataclass(frozen=True)
class Job:
    """One run of the command line.

    Attributes:
        name: of its folder.
        arguments: of `auv-fmu run`, without `--out`.

    """

    name: str
    arguments: tuple[str, ...]

    @property
    def command(self) -> str:
        """What a user types for this run."""
        return shlex.join(("auv-fmu", "run", *self.arguments))


def run_all(jobs: Sequence[Job], folder: Path) -> dict[str, dict[str, Any]]:
    """Run what is not there yet and read the metrics of all.

    Args:
        jobs: what to run.
        folder: below which each job has a folder.

    Returns:
        The metrics of each job by its name, and of the runs it was compared with by
        `name/companion`.

    Raises:
        InputError: a run could not be made.

    """
    current_fmus()
    sources = _sources()
    missing = [job for job in jobs if not _is_finished(job, folder / job.name, sources)]
    with (
        ThreadPoolExecutor(os.cpu_count() or 1) as pool,
        tqdm(total=len(jobs), initial=len(jobs) - len(missing), unit="run", disable=None) as bar,
    ):
        futures = [pool.submit(_run, job, folder / job.name, sources) for job in missing]
        try:
            for future in as_completed(futures):
                future.result()
                bar.update()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return {
        path.parent.relative_to(folder).as_posix(): json.loads(path.read_text(encoding="utf-8"))
        for job in jobs
        for path in (folder / job.name).rglob("metrics.json")
    }


def _sources() -> str:
    """Hash of all that a result depends on besides its command."""
    digest = hashlib.sha256(current_fmus().name.encode())
    digest.update(sys.version.encode())
    for name in ("fmpy", "matplotlib", "numpy", "pythonfmu"):
        digest.update(version(name).encode())
    package = Path(__file__).parents[1]
    for path in sorted([*package.rglob("*.py"), *package.rglob("*.toml"), *SCENARIOS.iterdir()]):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _stamp(job: Job, sources: str) -> Mapping[str, str]:
    return {"command": job.command, "sources": sources}


def _is_finished(job: Job, folder: Path, sources: str) -> bool:
    if not all((folder / name).is_file() for name in ("metrics.json", "result.csv")):
        return False
    try:
        stamp = json.loads((folder / _STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return bool(stamp == _stamp(job, sources))


def _run(job: Job, folder: Path, sources: str) -> None:
    (folder / _STAMP).unlink(missing_ok=True)
    command = [sys.executable, "-P", "-m", "orchestrator.commands.main", "run", *job.arguments]
    process = subprocess.run(
        [*command, "--out", str(folder)], capture_output=True, text=True, check=False
    )
    if process.returncode != 0:
        raise InputError(f"{job.command}: {last_line(process.stderr)}")
    text = json.dumps(_stamp(job, sources))
    (folder / _STAMP).write_text(text + "\n", encoding="utf-8")
