"""A study as a whole: its runs, what makes them, and what is left of them."""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from fmus.kinds import AUTO, KINDS, PYTHON, KindName
from orchestrator.cosim import LOOPS, LoopName, System
from orchestrator.figures.study_values import FigureEntry, Values
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.identity import PACKAGES
from orchestrator.machine.progress import progress_bar
from orchestrator.runs.bundle import current_fmus, settings_of
from orchestrator.runs.loading import load_scenario
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.request import FORCE, KIND, LOOP, option
from orchestrator.runs.scenario import Scenario
from orchestrator.studies.batch_engine import REFUSED, BatchEngine
from orchestrator.studies.blocks import Making, local_threads, local_workers
from orchestrator.studies.engine import Engine, FmuEngine, Outcome, Point
from orchestrator.studies.own_indices import OwnIndex, own_indices, with_fields
from orchestrator.studies.space import Space
from orchestrator.studies.store import Store, open_store
from orchestrator.studies.study import BATCH, ENGINES, FMU, EngineName, Study
from orchestrator.studies.study_file import read_figures, read_study, study_of
from orchestrator.studies.study_result import StudyResult, read_study_record

#: Packages whose versions the runs and their table depend on.
_PACKAGES = (*PACKAGES, "pyarrow", "scipy")

#: What a study says of its runs.
_STATED = ("vary", "sample", "parameters", "stop_time", "step", "order")

#: What a study needs besides.
_NEEDED = ("pyarrow", "scipy")

#: Fewer runs than this are not worth a word on what would make them faster.
_MANY = 100

#: Seconds before a bar appears.
_PATIENCE = 2.0

#: The name of a study that has no file.
_NAMELESS = "study"


@dataclass(frozen=True)
class Means:
    """How the runs of a study are made.

    Raises:
        InputError: its entries do not go together.

    """

    engine: EngineName | None = option(
        None,
        "engine that makes the runs: fmu (the FMUs) or batch (the system as one program); both "
        "give the same numbers; default: from the study",
    )
    kind: KindName = option(AUTO, KIND)
    loop: LoopName = option(LOOPS[0], LOOP)
    scheduler: str | None = option(
        None,
        "address of a Dask scheduler whose workers make the runs, for example "
        "tcp://10.0.0.1:8786; default: this machine makes them",
        metavar="ADDRESS",
    )
    workers: int | None = option(
        None, "how many runs this machine makes at a time; default: one per core"
    )
    force: bool = option(False, FORCE)

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise InputError(f"--workers {self.workers}: must be at least 1")
        if self.workers is not None and self.scheduler is not None:
            raise InputError(
                "--workers sets the processes on this machine; workers of a scheduler are started "
                "with the scheduler"
            )


def sweep(
    study: str | Path | Mapping[str, Any],
    *,
    engine: EngineName | None = None,
    kind: KindName = AUTO,
    loop: LoopName = LOOPS[0],
    scheduler: str | None = None,
    workers: int | None = None,
    out: str | Path | None = None,
    progress: bool = False,
    force: bool = False,
) -> StudyResult:
    """Run a study: make all of its runs, or the missing ones.

        result = sweep("attraction")
        result["plant.eta0.z"], result["failure"], result.to_dataframe()

    Args:
        study: name of a ready study, path of a .toml file, or a dictionary with its entries.
        engine: engine that makes the runs, `fmu` or `batch`; None: the study's own.
        kind: kind of the bundle's FMUs: `python`, `native`, or `auto`: the kind with which the
            study began, else native where available.
        loop: loop that makes their steps: `python`, `compiled` or `auto`.
        scheduler: address of a Dask scheduler whose workers make the runs; None: this machine
            makes them.
        workers: how many runs this machine makes at a time; None: one for each core.
        out: folder of the study; runs that are finished there are not made again. None:
            `results/NAME`.
        progress: show a bar on studies that take longer than some seconds.
        force: move aside your files with names of the study's files, and another study.

    Raises:
        ValueError: the study is not usable; the message says what to change.
        KeyboardInterrupt: Ctrl-C; finished runs are kept.

    """
    wanted = study_of(_NAMELESS, study) if isinstance(study, Mapping) else read_study(str(study))
    means = Means(engine, kind, loop, scheduler, workers, force)
    return complete_study(wanted, means, study_folder(wanted, out), sys.argv, progress=progress)


def study_folder(study: Study, out: str | Path | None) -> Path:
    """Where a study goes."""
    return Path("results", study.stem) if out is None else Path(out)


def complete_study(
    study: Study,
    means: Means,
    folder: Path,
    command: Sequence[str],
    say: Callable[[str], None] = lambda _: None,
    progress: bool = False,
) -> StudyResult:
    """Make what is missing of a study, and draw it.

    Args:
        study: which.
        means: how.
        folder: for its files.
        command: for the record.
        say: takes notes for the user.
        progress: show a bar.

    Raises:
        InputError: something about the study is not usable, or its files cannot be written.
        KeyboardInterrupt: a signal has come to stop it.

    """
    # What is only checked draws nothing.
    from orchestrator.figures.study_figures import draw_figures, figure_files  # noqa: PLC0415

    check_installed(_NEEDED if means.scheduler is None else (*_NEEDED, "distributed"))
    kind = _kind_begun(folder) if means.kind == AUTO else means.kind
    means, systems, space, entries, engine, own = prepare_study(study, replace(means, kind=kind))
    scenarios = [scenario for scenario, _ in systems.values()]
    record = _record(study, means, space, engine, scenarios, command, own)
    with open_store(folder, record, space.indices, means.force) as kept:
        kept.ledger.check(figure_files(entries))
        if not kept.is_done:
            if not len(kept) and (hint := faster(space, engine, means, own)):
                say(hint)
            name = study.name if progress else None
            engines = [engine]
            if isinstance(engine, BatchEngine):
                # It does not say why a component refuses.
                engines.append(FmuEngine(space.prepared, means.loop, own))
            _complete(kept, engines, space, means, name)
        result = StudyResult(folder)
        kept.write_record(
            {**read_study_record(folder), "failed": result.failed, "cautions": result.cautions}
        )
        # All figures or, where one of them cannot be written, none.
        with kept.ledger.changing() as unfinished:
            legends = {name: scenario.legend for name, (scenario, _) in systems.items()}
            runs = Values(result, legends=legends, units=space.units, logarithmic=space.logarithmic)
            notes = list(draw_figures(entries, study.title, runs, unfinished))
        for note in notes:
            say(note)
    return result


class Ready(NamedTuple):
    """A study whose runs can be made.

    Attributes:
        means: how, with the kind of FMUs that there is.
        systems: that are run, by the names of their scenarios.
        space: its runs.
        figures: that are drawn of them.
        engine: that makes them.
        own: indices of the user's own.

    """

    means: Means
    systems: Mapping[str, tuple[Scenario, System]]
    space: Space
    figures: Sequence[FigureEntry]
    engine: Engine
    own: Sequence[OwnIndex]


def prepare_study(study: Study, means: Means) -> Ready:
    """Find out whether the runs of a study can be made, and prepare them.

    Raises:
        Refused: they cannot be made, or what is drawn of them; with all problems.

    """
    findings, systems = Findings(), dict[str, tuple[Scenario, System]]()
    for name in study.scenario:
        with findings.collecting():
            systems[name] = load_scenario(name, means.kind)
    findings.refuse()
    if any(scenario.digest for scenario, _ in systems.values()):
        means = replace(means, kind=_kind(settings_of(current_fmus(means.kind))["kind"]))
    own = own_indices(study, {name: system for name, (_, system) in systems.items()})
    space = Space(study, systems, [*chain(*(one.indices for one in own))])
    with findings.collecting():
        figures = with_fields(study.figures, own, space.indices)
        entries = read_figures(
            study.name, figures, space.columns, space.has_scenarios, space.indices
        )
    with findings.collecting():
        engine = _engine(means.engine or study.engine, space.prepared, means, own)
    findings.refuse()
    return Ready(means, systems, space, entries, engine, own)


def _kind_begun(folder: Path) -> KindName:
    """The kind of FMU that the study in a folder was begun with; if there is none, any."""
    with suppress(InputError):
        return _kind(read_study_record(folder).get("kind"))
    return AUTO


def _kind(name: object) -> KindName:
    """The kind of a name; of any other name, each kind will do."""
    return next((kind for kind in KINDS if kind == name), AUTO)


def check_installed(needed: Sequence[str] = _NEEDED) -> None:
    """Check that the packages are there that studies need.

    Raises:
        InputError: one of them is not.

    """
    missing = [package for package in needed if find_spec(package) is None]
    if "distributed" in missing:
        raise InputError("--scheduler needs Dask: pip install 'auv-fmu[cluster]'")
    if missing:
        raise InputError(f"studies need {', '.join(missing)}: pip install 'auv-fmu[studies]'")


def _check_engine(name: str, prepared: Mapping[str, Prepared]) -> None:
    """Check that there is such an engine, and that it does all that is asked of it in a run.

    Raises:
        InputError: it does not.

    """
    if name not in ENGINES:
        raise InputError(f"engine {name!r}: use one of {', '.join(ENGINES)}")
    for scenario, one in prepared.items():
        if one.input_table is not None:
            raise InputError(f"{scenario}: has a table of inputs, which studies do not support")
        if name == BATCH and one.events:
            raise InputError(f"{scenario}: has events, which engine {BATCH!r} does not support")
        if name == BATCH and one.experiment.coupling == "linear":
            raise InputError(
                f"{scenario}: coupling linear goes back in time, which engine {BATCH!r} cannot; "
                f"use --engine {FMU}"
            )


def _engine(
    name: str, prepared: Mapping[str, Prepared], means: Means, own: Sequence[OwnIndex]
) -> Engine:
    _check_engine(name, prepared)
    if name == FMU:
        return FmuEngine(prepared, means.loop, own)
    engine = BatchEngine(_systems(prepared), own)
    for scenario, one in prepared.items():
        plan = one.experiment
        engine.prepare(Point(0, scenario, {}, plan.stop_time, plan.step, plan.order))
    return engine


def _systems(prepared: Mapping[str, Prepared]) -> dict[str, System]:
    return {scenario: one.system for scenario, one in prepared.items()}


def faster(space: Space, engine: Engine, means: Means, own: Sequence[OwnIndex] = ()) -> str:
    """What would make many runs sooner, with the same numbers, in words; empty: nothing."""
    option = ""
    if len(space) >= _MANY and isinstance(engine, FmuEngine):
        is_bundles = all(one.scenario.digest for one in space.prepared.values())
        if means.kind == PYTHON and is_bundles and machines_compiler():
            option = "--kind native"
        with suppress(InputError):
            _check_engine(BATCH, space.prepared)
            BatchEngine(_systems(space.prepared), own)
            option = f"--engine {BATCH}"
    return option and (
        f"{len(space):,} runs by FMUs of the {means.kind} kind; {option} gives the same numbers in "
        "a fraction of the time"
    )


def _record(
    study: Study,
    means: Means,
    space: Space,
    engine: Engine,
    scenarios: Sequence[Scenario],
    command: Sequence[str],
    own: Sequence[OwnIndex],
) -> dict[str, Any]:
    """What study.json says when a study begins."""
    stated = asdict(study)
    return {
        "study": study.name,
        "title": study.title,
        "command": list(command),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "runs": len(space),
        "kind": means.kind,
        "made_of": {
            "scenario": [scenario.name for scenario in scenarios],
            "engine": means.engine or study.engine,
            **{name: stated[name] for name in _STATED},
            **({"indices": {one.name: one.digest for one in own}} if own else {}),
            "points": space.digest,
            "systems": [dict(prepared.identity) for prepared in space.prepared.values()],
            "version": engine.digest,
        },
        "versions": {"python": sys.version.split()[0]}
        | {package: version(package) for package in _PACKAGES},
        "platform": platform.platform(),
    }


@contextmanager
def making_runs(
    engine: Engine,
    points: Iterable[Point],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Iterator[Iterator[list[Outcome]]]:
    """The outcomes of runs, block by block as they are done, for the time of the context.

    Runs are taken from their iterator as they are needed. Each has one outcome, also a run that
    ends the process which makes it: that comes at the very end.

    Args:
        engine: what makes them.
        points: to be made.
        scheduler: address of a Dask scheduler; None for processes or threads of this machine.
        workers: how many of them; None for one a core.

    Raises:
        InputError: there is no such scheduler, or no worker is left to make the runs.

    """
    if scheduler is not None:
        # Dask takes a second to be imported, and need not be there.
        from orchestrator.studies.cluster import cluster  # noqa: PLC0415

        crew = cluster(scheduler, engine)
    elif isinstance(engine, BatchEngine):
        crew = local_threads(workers, engine)
    else:
        crew = local_workers(workers, engine)
    with crew as of:
        yield Making(of).outcomes(points)


def _complete(
    unfinished: Store, engines: Sequence[Engine], space: Space, means: Means, name: str | None
) -> None:
    """Make the runs that are missing, and the table of all.

    Args:
        unfinished: takes the runs.
        engines: make them: each the ones that the one before it has refused.
        space: all of them.
        means: how they are made.
        name: of the study, for a bar; None: there is no bar.

    """
    with progress_bar(
        total=len(space),
        initial=len(unfinished),
        desc=name,
        unit="run",
        delay=_PATIENCE,
        disable=None if name else True,
    ) as bar:
        left: Iterable[int] = unfinished.missing(len(space))
        for engine in engines:
            points, refused = (space[number] for number in left), list[int]()
            made = making_runs(engine, points, scheduler=means.scheduler, workers=means.workers)
            with made as blocks:
                for outcomes in blocks:
                    known = [one for one in outcomes if one.failure != REFUSED]
                    refused += [one.number for one in outcomes if one.failure == REFUSED]
                    unfinished.add(known)
                    bar.update(len(known))
            if not refused:
                break
            left = sorted(refused)
    unfinished.publish(space)
