"""A study as a whole: its runs, who makes them, and what is left of them."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tqdm import tqdm

from orchestrator.errors import InputError
from orchestrator.experiments.bundle import PYTHON
from orchestrator.experiments.preparation import loaded
from orchestrator.master.loop import LOOPS
from orchestrator.studies.engine import Engine, Outcome
from orchestrator.studies.fmu_engine import FmuEngine
from orchestrator.studies.space import Space
from orchestrator.studies.store import FAILURE, Runs, Store, read_record, store, write_record
from orchestrator.studies.study import BATCH, ENGINES, FMU, Study, read_study, study_of

#: Packages whose versions the runs depend on.
PACKAGES = ("auv-fmu", "pythonfmu", "fmpy", "numpy", "pyarrow", "scipy")

#: What a study needs besides.
_NEEDED = ("distributed", "numba", "pyarrow", "scipy")

#: Seconds before a bar appears.
_PATIENCE = 2.0

#: The name of a study that has no file.
_NAMELESS = "study"


def sweep(
    study: str | Path | Mapping[str, Any],
    *,
    engine: str | None = None,
    kind: str = PYTHON,
    loop: str = LOOPS[0],
    scheduler: str | None = None,
    workers: int | None = None,
    out: str | Path | None = None,
    progress: bool = False,
) -> Runs:
    """Make the runs of a study, or those of them that are missing.

        runs = sweep("attraction")
        runs["plant.eta0.z"], runs["failure"], runs.to_dataframe()

    Args:
        study: name of a ready study, path of a .toml file, or what such a file holds.
        engine: that makes the runs, `fmu` or `batch`; None: the study's own.
        kind: of the bundle's FMUs, `python` or `native`; `fmu` only.
        loop: that makes their steps: `python`, `compiled` or `auto`.
        scheduler: address of a Dask scheduler whose workers make the runs; None: processes here.
        workers: how many processes here; None: one for each core.
        out: folder of the study; what was done there before is not done again. None:
            `results/NAME`.
        progress: show a bar on studies that take longer than some seconds.

    Raises:
        ValueError: something about the study is not usable; the text says what to change.
        KeyboardInterrupt: Ctrl-C; what is done is kept.

    """
    plan = study_of(_NAMELESS, study) if isinstance(study, Mapping) else read_study(str(study))
    return swept(
        plan, engine, kind, loop, scheduler, workers, folder_of(plan, out), sys.argv, progress
    )


def folder_of(study: Study, out: str | Path | None) -> Path:
    """Where a study goes."""
    return Path("results", study.name) if out is None else Path(out)


def swept(
    study: Study,
    engine: str | None,
    kind: str,
    loop: str,
    scheduler: str | None,
    workers: int | None,
    folder: Path,
    command: Sequence[str],
    progress: bool,
) -> Runs:
    """The same, for a study that has been read; the command is for the record."""
    _check_installed()
    chosen = engine or study.engine
    systems = {name: loaded(name, kind) for name in study.scenario}
    space = Space(study, systems)
    maker = _engine(chosen, {name: system for name, (_, system) in systems.items()}, kind, loop)
    record = {
        "study": study.name,
        "title": study.title,
        "command": list(command),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "runs": len(space),
        "engine": chosen,
        "kind": kind,
        "made_of": {
            "scenario": [scenario.name for scenario, _ in systems.values()],
            **{
                key: asdict(study)[key]
                for key in ("vary", "sample", "parameters", "stop_time", "step", "order")
            },
            "points": space.digest,
            "engine": chosen,
            "version": maker.digest,
        },
        "versions": {"python": sys.version.split()[0]}
        | {package: version(package) for package in PACKAGES},
        "platform": platform.platform(),
    }
    with store(folder, record) as unfinished:
        if unfinished is not None:
            # A second that a study which is done needs not wait for.
            from orchestrator.studies.cluster import making  # noqa: PLC0415

            runs = (space[number] for number in unfinished.missing(len(space)))
            name = study.name if progress else None
            with making(maker, runs, scheduler=scheduler, workers=workers) as blocks:
                _keep(unfinished, blocks, len(space), name)
            unfinished.publish(space)
        done = Runs(folder)
        failed = sum(failure is not None for failure in done[FAILURE])
        write_record(folder, {**read_record(folder), "failed": failed})
    return done


def _check_installed() -> None:
    missing = [package for package in _NEEDED if find_spec(package) is None]
    if missing:
        raise InputError(f"studies need {' and '.join(missing)}: pip install 'auv-fmu[studies]'")


def _keep(unfinished: Store, blocks: Iterable[Sequence[Outcome]], n: int, name: str | None) -> None:
    """Keep blocks of outcomes as they come, and show how far it is."""
    with tqdm(
        total=n,
        initial=len(unfinished),
        desc=name,
        unit="run",
        delay=_PATIENCE,
        disable=None if name else True,
    ) as bar:
        for outcomes in blocks:
            unfinished.add(outcomes)
            bar.update(len(outcomes))


def _engine(name: str, systems: Mapping[str, Any], kind: str, loop: str) -> Engine:
    if name == FMU:
        return FmuEngine(systems, loop)
    if name == BATCH:
        raise InputError("engine batch: not there yet")
    raise InputError(f"engine {name!r}: use one of {', '.join(ENGINES)}")
