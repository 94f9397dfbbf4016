"""`auv-fmu benchmark`: the table of controllers."""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.benchmark.contest import (
    OWN_GAINS,
    Law,
    Vehicle,
    law_of,
    laws,
    members,
    read_gains,
    refusal_in,
    runs_of,
    vehicles,
)
from orchestrator.benchmark.table import ALL, Made, as_csv, as_text, cells, page, runs_in
from orchestrator.benchmark.tuning import FEWEST, Budget, digest, search, written
from orchestrator.commands.options import add_options, add_out, from_options
from orchestrator.commands.streams import INTERRUPTED, OK, describe, say, show
from orchestrator.figures.style import FIGURE_FORMATS
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.runs.folder import open_ledger
from orchestrator.runs.request import FORCE, option
from orchestrator.studies.sweep import Means, check_installed

#: Files of the benchmark, in its folder.
_TABLES, _FIGURE, _GAINS = ("table.md", "table.csv"), "errors", "gains.toml"


@dataclass(frozen=True)
class Choice:
    """Options of the benchmark.

    Raises:
        InputError: a number is too small.

    """

    vehicle: str | None = option(
        None, "only these vehicles, with commas between them; default: all", metavar="NAME,..."
    )
    law: str | None = option(
        None,
        "only these laws besides your own, with commas between them; default: all",
        metavar="NAME,...",
    )
    task: str | None = option(
        None, "the task whose table is printed; default: all tasks together", metavar="NAME"
    )
    runs: int = option(1000, "number of disturbances of each task and vehicle; default: 1000")
    tune: bool = option(
        False, "search the gains first: of your own laws, or, if you name none, of all"
    )
    candidates: int = option(
        Budget().candidates, "candidates in each round of the search; default: 32"
    )
    workers: int | None = option(None, "how many runs are made at a time; default: one per core")
    force: bool = option(False, FORCE)

    def __post_init__(self) -> None:
        for name, n, least in (
            ("runs", self.runs, 1),
            ("candidates", self.candidates, FEWEST),
            ("workers", self.workers, 1),
        ):
            if n is not None and n < least:
                raise InputError(f"--{name} {n}: must be at least {least}")


def add_benchmark(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu benchmark`."""
    describe(
        parser,
        "Compare control laws, on several tasks and vehicles with the same disturbances, in one "
        "table and a figure. Runs that are already in its folder are not made again.",
        "benchmark my_law.py --runs 100",
    )
    parser.add_argument(
        "laws", nargs="*", type=Path, metavar="LAW.py", help="law of your own, to enter the table"
    )
    add_options(parser, Choice)
    add_out(parser, Path("results", "benchmark"))
    parser.set_defaults(action=_benchmark)


def _benchmark(options: argparse.Namespace) -> int:
    choice = from_options(Choice, options)
    check_installed()
    own = {law.name: law for law in map(law_of, options.laws)}
    chosen = _chosen("law", choice.law, laws())
    if twice := own.keys() & chosen.keys():
        raise InputError(f"{min(twice)}: a law of the benchmark has this name; rename the file")
    entered, on = {**chosen, **own}, _chosen("vehicle", choice.vehicle, vehicles())
    tasks = next(iter(on.values())).tasks
    if choice.task is not None:
        _chosen("task", choice.task, dict.fromkeys(tasks))
    for law in entered.values():
        members(law, dict.fromkeys(law.gains, 1.0))
    tuned = (own or entered) if choice.tune else {}
    try:
        gains = _gains(entered, tuned, on, options)
        made = _made(entered, own, on, gains, options)
    except KeyboardInterrupt:
        say(f"interrupted; {options.out} keeps the finished runs: the same command continues there")
        return INTERRUPTED
    _publish(made, entered, on, options.out, choice.force)
    show(*as_text(*cells(made, entered, on, choice.task or ALL)))
    show(f"written to {options.out}{os.sep}")
    return OK


def _chosen(what: str, names: str | None, known: dict[str, Any]) -> dict[str, Any]:
    """Return the named entries of a table, in its order.

    Raises:
        InputError: there is no such entry.

    """
    if names is None:
        return known
    wanted = [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in known:
            hint = did_you_mean(name, known) or f"; there are {', '.join(known)}"
            raise InputError(f"there is no {what} {name!r}{hint}")
    return {name: entry for name, entry in known.items() if name in wanted}


def _gains(
    entered: dict[str, Law],
    tuned: dict[str, Law],
    on: dict[str, Vehicle],
    options: argparse.Namespace,
) -> dict[str, dict[str, dict[str, float]]]:
    """Return the gains of all laws by vehicle, and search those that are missing."""
    file, budget = options.out / _GAINS, Budget(candidates=options.candidates)
    ours, found = read_gains(OWN_GAINS), read_gains(file)
    means = Means(workers=options.workers)
    for vehicle in on.values():
        kept = found.setdefault(vehicle.name, {})
        for law in tuned.values():
            if kept.get(law.name, {}).get("digest") == digest(law, vehicle, budget):
                continue
            say(f"searching the gains of {law.name} for {vehicle.name} ...")
            kept[law.name] = search(law, vehicle, budget, means)
            with open_ledger(options.out, options.force) as ledger, ledger.changing() as unfinished:
                (unfinished / _GAINS).write_text(written(found), encoding="utf-8")
    return {
        name: {
            law: (found[name] if law in tuned else ours.get(name, {})).get(law, {}).get("gains", {})
            for law in entered
        }
        for name in on
    }


def _made(
    entered: dict[str, Law],
    own: dict[str, Law],
    on: dict[str, Vehicle],
    gains: dict[str, dict[str, dict[str, float]]],
    options: argparse.Namespace,
) -> Made:
    """Make the missing runs, and return all; say why runs of the user's own laws are refused."""
    means, made = Means(workers=options.workers, force=options.force), {}
    for vehicle in on.values():
        for law in entered.values():
            values, out = gains[vehicle.name][law.name], options.out
            found = runs_of(
                law, vehicle, options.runs, values, out, options.command, means, say, progress=True
            )
            if law.name in own and (why := refusal_in(found, law, vehicle, options.runs, values)):
                say(why)
            made[law.name, vehicle.name] = runs_in(found, vehicle.tasks)
    return made


def _publish(
    made: Made, entered: dict[str, Law], on: dict[str, Vehicle], out: Path, force: bool
) -> None:
    """Write the tables and the figure."""
    # Lazily, since it takes a second.
    from orchestrator.benchmark.figure import draw  # noqa: PLC0415
    from orchestrator.figures.drawing import save  # noqa: PLC0415

    tasks = next(iter(on.values())).tasks
    texts = page(made, entered, on, tasks), as_csv(made, entered, [*on], tasks)
    figures = [f"{_FIGURE}.{ending}" for ending in FIGURE_FORMATS]
    with open_ledger(out, force) as ledger:
        ledger.check((*_TABLES, *figures))
        with ledger.changing() as unfinished:
            for name, text in zip(_TABLES, texts, strict=True):
                (unfinished / name).write_text(text, encoding="utf-8")
            save(draw(made, entered, on, tasks), *(unfinished / name for name in figures))
