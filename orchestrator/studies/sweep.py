"""A study as a whole: checked and prepared, run, published and drawn."""

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
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from fmus.kinds import AUTO, KINDS, PYTHON, KindName
from orchestrator.cosim import Plan, System
from orchestrator.figures.study_values import FigureEntry, Values
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.identity import PACKAGES
from orchestrator.machine.lazy import progress_bar
from orchestrator.program.card import Cards
from orchestrator.program.library import PROCESSOR, Runners
from orchestrator.runs.bundle import current_fmus, settings_of
from orchestrator.runs.preparation import Prepared, load_scenario
from orchestrator.runs.request import FORCE, KIND, LOOP, option
from orchestrator.runs.result import Result
from orchestrator.runs.scenario import Scenario
from orchestrator.studies.batch_engine import REFUSED, BatchEngine
from orchestrator.studies.blocks import Blocks, local_threads, local_workers
from orchestrator.studies.columns import Numbers, Outcomes, Point, Points
from orchestrator.studies.engine import Engine, FmuEngine
from orchestrator.studies.own_functions import OwnFunction, own_functions
from orchestrator.studies.own_indices import OwnIndex, own_indices, with_fields
from orchestrator.studies.space import Space
from orchestrator.studies.store import Store, StudyResult, open_store, read_study_record
from orchestrator.studies.study import (
    BATCH,
    ENGINES,
    FMU,
    GPU,
    EngineName,
    Study,
    read_figures,
    read_study,
    study_of,
)

#: Packages that studies need in addition to runs.
_NEEDED = ("pyarrow", "scipy")

#: Packages whose versions are recorded.
_RECORDED = (*PACKAGES, *_NEEDED)

#: Attributes of a study that are recorded.
_STATED = ("vary", "sample", "parameters", "stop_time", "step", "order")

#: Number of runs from which a faster way is suggested.
_MANY = 100

#: Number of runs that are tried to learn the columns of functions.
_TRIED = 10

#: Seconds before a progress bar appears.
_PATIENCE = 0.5

#: Advice for a machine without a graphics card.
_INSTEAD = f"--engine {BATCH} makes the same runs on all cores"

#: Scenarios and their systems, by the names of the scenarios.
Systems: TypeAlias = Mapping[str, tuple[Scenario, System]]

#: Name of a study without a file.
_NAMELESS = "study"


@dataclass(frozen=True)
class Means:
    """Options of making the runs of a study.

    Raises:
        InputError: two options exclude each other, or a number is below 1.

    """

    points: int | None = option(
        None,
        "number of points in place of the study's: of its sample, or, without a sample, of each "
        "range { from, to, n } under [vary]; default: from the study",
    )
    engine: EngineName | None = option(
        None,
        "engine that makes the runs: fmu (the FMUs), batch (the system as one program; the same "
        "numbers) or gpu (that program on graphics cards); default: from the study",
    )
    kind: KindName = option(AUTO, KIND)
    loop: Plan.Loop = option(Plan.LOOPS[0], LOOP)
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
        for name, n in (("points", self.points), ("workers", self.workers)):
            if n is not None and n < 1:
                raise InputError(f"--{name} {n}: must be at least 1")
        if self.workers is not None and self.scheduler is not None:
            raise InputError(
                "--workers sets the processes on this machine; workers of a scheduler are started "
                "with the scheduler"
            )


def sweep(
    study: str | Path | Mapping[str, Any],
    *,
    indices: Mapping[str, Callable[[Result], object]] | None = None,
    points: int | None = None,
    engine: EngineName | None = None,
    kind: KindName = AUTO,
    loop: Plan.Loop = Plan.LOOPS[0],
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
        indices: your own by their names: functions of the result of a run, which return a number,
            or a list or dictionary of numbers; :meth:`.Result.metrics` tries them on one result.
        points: number of points in place of the study's: of its sample, or, without a sample, of
            each range `{ from, to, n }` under `vary`; None: the study's own.
        engine: engine that makes the runs, `fmu`, `batch` or `gpu`; None: the study's own.
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
    parsed = study_of(_NAMELESS, study) if isinstance(study, Mapping) else read_study(str(study))
    means = Means(points, engine, kind, loop, scheduler, workers, force)
    return complete_study(
        parsed,
        means,
        study_folder(parsed, out),
        sys.argv,
        progress=progress,
        functions=own_functions(indices or {}),
    )


def study_folder(study: Study, out: str | Path | None) -> Path:
    """Return the folder of a study."""
    return Path("results", study.stem) if out is None else Path(out)


def complete_study(
    study: Study,
    means: Means,
    folder: Path,
    command: Sequence[str],
    say: Callable[[str], None] = lambda _: None,
    progress: bool = False,
    functions: Sequence[OwnFunction] = (),
    systems: Systems | None = None,
) -> StudyResult:
    """Make the missing runs of a study, publish them and draw the figures.

    Args:
        study: to run.
        means: options.
        folder: for its files.
        command: for the record.
        say: receives notes for the user.
        progress: show a bar.
        functions: the user's own indices that are functions.
        systems: of its scenarios; None: they are loaded.

    Raises:
        InputError: the study cannot be run, or its files cannot be written.
        KeyboardInterrupt: there was a signal to stop.

    """
    # Lazily, since `check` needs no matplotlib.
    from orchestrator.figures.study_figures import draw_figures, figure_files  # noqa: PLC0415

    check_installed(_NEEDED if means.scheduler is None else (*_NEEDED, "distributed"))
    if means.points is not None:
        study = study.with_points(means.points)
    kind = _kind_begun(folder) if means.kind == AUTO else means.kind
    ready = prepare_study(study, replace(means, kind=kind), functions, systems)
    space, engine = ready.space, ready.engine
    record = _record(study, ready, command)
    with open_store(folder, record, space.indices, means.force) as store:
        store.ledger.check(figure_files(ready.figures))
        if not store.is_done:
            if not len(store):
                remark = study.sample and study.sample.remark
                for hint in filter(None, (remark, faster(space, engine, ready.means, ready.own))):
                    say(hint)
            engines = [engine]
            if isinstance(engine, BatchEngine) and study.explains:
                # For runs that it refuses, since it gives no reason.
                engines.append(FmuEngine(space.prepared, means.loop, ready.own, engine.functions))
            _complete(store, engines, space, ready.means, study.name if progress else None)
        result = StudyResult(folder)
        store.write_record(
            {**read_study_record(folder), "failed": result.failed, "cautions": result.cautions}
        )
        # All figures, or none if one of them cannot be written.
        with store.ledger.changing() as unfinished:
            legends = {name: scenario.legend for name, (scenario, _) in ready.systems.items()}
            runs = Values(result, legends=legends, units=space.units, logarithmic=space.logarithmic)
            notes = list(draw_figures(ready.figures, study.title, runs, unfinished))
        for note in notes:
            say(note)
    return result


class Ready(NamedTuple):
    """A study that is ready to run.

    Attributes:
        means: options, with the kind of FMUs.
        systems: by the names of their scenarios.
        space: its runs.
        figures: to draw.
        engine: that makes the runs.
        own: the user's own indices.

    """

    means: Means
    systems: Systems
    space: Space
    figures: Sequence[FigureEntry]
    engine: Engine
    own: Sequence[OwnIndex]


def prepare_study(
    study: Study,
    means: Means,
    functions: Sequence[OwnFunction] = (),
    given: Systems | None = None,
) -> Ready:
    """Check a study and prepare its runs.

    Args:
        study: to run.
        means: options.
        functions: the user's own indices that are functions; a run shows their columns.
        given: systems of its scenarios; None: they are loaded.

    Raises:
        Refused: its runs cannot be made, or its figures cannot be drawn; with all problems.

    """
    findings, systems = Findings(), dict[str, tuple[Scenario, System]]()
    for name in study.scenario:
        with findings.collecting():
            systems[name] = given[name] if given else load_scenario(name, means.kind)
    findings.refuse()
    if any(scenario.digest for scenario, _ in systems.values()):
        means = replace(means, kind=_kind(settings_of(current_fmus(means.kind))["kind"]))
    own = own_indices(study, {name: system for name, (_, system) in systems.items()})
    space = Space(study, systems, [*chain(*(file.indices for file in own))])
    with findings.collecting():
        engine = _engine(means.engine or study.engine, space.prepared, means, own)
    if functions:
        findings.refuse()
        if isinstance(engine, BatchEngine) and engine.runners is not PROCESSOR:
            raise InputError(
                f"indices that are functions need rows, which engine {GPU!r} does not keep; use "
                f"--engine {BATCH}"
            )
        engine.functions = with_columns(functions, space, own, engine, means)
        space.indices += tuple(chain(*(function.columns for function in engine.functions)))
    with findings.collecting():
        figures = with_fields(study.figures, own, space.indices)
        entries = read_figures(
            study.name, figures, space.columns, space.has_scenarios, space.indices
        )
        entries = entries if study.draws else ()
    findings.refuse()
    return Ready(means, systems, space, entries, engine, own)


def with_columns(
    functions: Sequence[OwnFunction],
    space: Space,
    own: Sequence[OwnIndex],
    engine: Engine,
    means: Means,
) -> Sequence[OwnFunction]:
    """Return functions with their columns, as the first run shows them that does not fail.

    Raises:
        InputError: a function fails, a column has the name of another, or the first runs fail.

    """
    engine.functions, failure = functions, None
    names = tuple(f"index {function.name}: " for function in functions)
    workers = 1 if means.scheduler is None else None
    for number in range(min(_TRIED, len(space))):
        points = [space.points(np.array([number]))]
        # As all others are made, since an FMU may end its process.
        with making_runs(engine, points, scheduler=means.scheduler, workers=workers) as blocks:
            [outcomes] = blocks
        [failure] = outcomes.failures.each()
        if failure is None:
            known = [function.with_columns(outcomes.columns) for function in functions]
            columns = [*chain(*(function.columns for function in known))]
            taken = {
                *space.columns,
                *space.indices,
                *(index.name for file in own for index in file.indices),
            }
            if twice := taken.intersection(columns):
                raise InputError(f"{min(twice)}: two columns of runs would have this name")
            return known
        if failure.startswith(names):
            raise InputError(failure)
    raise InputError(f"the columns of indices are unknown, since the first runs fail: {failure}")


def _kind_begun(folder: Path) -> KindName:
    """Return the kind of FMUs with which the study in a folder began, or AUTO without one."""
    with suppress(InputError):
        return _kind(read_study_record(folder).get("kind"))
    return AUTO


def _kind(name: object) -> KindName:
    """Return the kind with a name, or AUTO if there is none."""
    return next((kind for kind in KINDS if kind == name), AUTO)


def check_installed(needed: Sequence[str] = _NEEDED) -> None:
    """Raise an InputError if packages are not installed."""
    missing = [package for package in needed if find_spec(package) is None]
    if "distributed" in missing:
        raise InputError("--scheduler needs Dask: pip install 'auv-fmu[cluster]'")
    if missing:
        raise InputError(f"studies need {', '.join(missing)}: pip install 'auv-fmu[studies]'")


def _check_engine(name: str, prepared: Mapping[str, Prepared]) -> None:
    """Raise an InputError if there is no such engine, or it does not support the runs."""
    if name not in ENGINES:
        raise InputError(f"engine {name!r}: use one of {', '.join(ENGINES)}")
    for scenario, run in prepared.items():
        if run.input_tables:
            raise InputError(f"{scenario}: has a table of inputs, which studies do not support")
        if name != FMU and run.events:
            raise InputError(f"{scenario}: has events, which engine {name!r} does not support")
        if name != FMU and run.experiment.coupling == "linear":
            raise InputError(
                f"{scenario}: coupling linear goes back in time, which engine {name!r} cannot; "
                f"use --engine {FMU}"
            )


def _engine(
    name: str, prepared: Mapping[str, Prepared], means: Means, own: Sequence[OwnIndex]
) -> Engine:
    _check_engine(name, prepared)
    if name == FMU:
        return FmuEngine(prepared, means.loop, own)
    runners: Runners = Cards(_INSTEAD) if name == GPU else PROCESSOR
    engine, is_here = BatchEngine(_systems(prepared), own, runners=runners), means.scheduler is None
    if is_here:
        runners.names  # noqa: B018 - finds the cards
    for scenario, run in prepared.items():
        experiment = run.experiment
        engine.prepare(
            Point(0, scenario, {}, experiment.stop_time, experiment.step, experiment.order),
            is_here or name == BATCH,
        )
    return engine


def _systems(prepared: Mapping[str, Prepared]) -> dict[str, System]:
    return {scenario: run.system for scenario, run in prepared.items()}


def faster(space: Space, engine: Engine, means: Means, own: Sequence[OwnIndex] = ()) -> str:
    """Return a hint at an option that makes many runs faster; empty if there is none."""
    option = ""
    if len(space) >= _MANY and isinstance(engine, FmuEngine):
        is_bundles = all(run.scenario.digest for run in space.prepared.values())
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


def _record(study: Study, ready: Ready, command: Sequence[str]) -> dict[str, Any]:
    """Return the content of study.json at the start of a study."""
    stated = asdict(study)
    own = {file.name: file.digest for file in ready.own}
    own |= {function.name: function.digest for function in ready.engine.functions}
    engine, cards = ready.engine, list[str]()
    if isinstance(engine, BatchEngine) and ready.means.scheduler is None:
        cards = [*engine.runners.names]
    return {
        "study": study.name,
        "title": study.title,
        "command": list(command),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "runs": len(ready.space),
        "kind": ready.means.kind,
        "made_of": {
            "scenario": [scenario.name for scenario, _ in ready.systems.values()],
            "engine": ready.means.engine or study.engine,
            **{name: stated[name] for name in _STATED},
            **({"indices": own} if own else {}),
            "points": ready.space.digest,
            "systems": [dict(prepared.identity) for prepared in ready.space.prepared.values()],
            "version": ready.engine.digest,
        },
        "versions": {"python": sys.version.split()[0]}
        | {package: version(package) for package in _RECORDED},
        "platform": platform.platform(),
        **({"cards": cards} if cards else {}),
    }


@contextmanager
def making_runs(
    engine: Engine,
    points: Iterable[Points],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Iterator[Iterator[Outcomes]]:
    """Yield an iterator over the outcomes of runs, block by block as they are done.

    Runs are taken from their iterator when they are needed. Each has one outcome; that of a run
    that ends its process is the last.

    Args:
        engine: that makes the runs.
        points: runs to make, some at a time.
        scheduler: address of a Dask scheduler; None for processes or threads of this machine.
        workers: number of them; None for one per core.

    Raises:
        InputError: there is no such scheduler, or no worker is left to make the runs.

    """
    if scheduler is not None:
        # Dask takes a second to import, and need not be installed.
        from orchestrator.studies.cluster import cluster  # noqa: PLC0415

        pool = cluster(scheduler, engine)
    elif isinstance(engine, BatchEngine):
        pool = local_threads(workers or engine.runners.threads, engine)
    else:
        pool = local_workers(workers, engine)
    with pool as started:
        yield Blocks(started, engine).outcomes(points)


def _complete(
    store: Store, engines: Sequence[Engine], space: Space, means: Means, name: str | None
) -> None:
    """Make the missing runs and publish the table.

    Args:
        store: for the outcomes.
        engines: each makes the runs that the one before has refused.
        space: all runs.
        means: options.
        name: of the study, for a progress bar; None for no bar.

    """
    with progress_bar(
        total=len(space),
        initial=len(store),
        desc=name,
        unit="run",
        delay=_PATIENCE,
        disable=None if name else True,
    ) as bar:
        left = store.missing(len(space))
        for engine in engines:
            if not left:
                break
            points, refused = map(space.points, left.blocks(engine.most_runs)), Numbers()
            outcomes = making_runs(engine, points, scheduler=means.scheduler, workers=means.workers)
            with outcomes as blocks:
                for block in blocks:
                    is_refused = block.failures.has(REFUSED) & (engine is not engines[-1])
                    refused.add(Numbers.of(block.numbers[is_refused]))
                    store.add(block[~is_refused])
                    bar.update(len(block) - int(is_refused.sum()))
            left = refused
        store.publish(space)
