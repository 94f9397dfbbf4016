"""The files of `auv-fmu table`."""

from __future__ import annotations

import csv
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from orchestrator.machine.ledger import RECORD
from orchestrator.machine.workers import workers
from orchestrator.paper.printed_table import NUMBERS, section
from orchestrator.paper.sensitivity import PUBLISHED, Found
from orchestrator.paper.variants import all_variants
from orchestrator.runs.folder import replaced
from orchestrator.runs.record import PACKAGES, Clock, write_files

#: The files.
_NAMES = _TEXT, _VARIANTS = "table.md", "variants.csv"


def write_table(folder: Path, command: Sequence[str], force: bool = False) -> tuple[Path, Path]:
    """Make all variants, and write `table.md` and `variants.csv`.

    Args:
        folder: to write into.
        command: for the record.
        force: move aside files of the user's that have names of these.

    Returns:
        The two files.

    Raises:
        InputError: a package is missing, or the folder cannot be written.
        KeyboardInterrupt: the user does not want to wait.

    """
    clock = Clock()
    with replaced(folder, (*_NAMES, RECORD), force=force) as unfinished:
        with workers() as crew:
            found = all_variants(crew)
        text = f"# The printed table of section 4.2\n\n{section(found)}\n"
        (unfinished / _TEXT).write_text(text, encoding="utf-8")
        write_variants(unfinished / _VARIANTS, found)
        write_files(unfinished, _record(command, clock))
    return folder / _TEXT, folder / _VARIANTS


def _record(command: Sequence[str], clock: Clock) -> dict[str, object]:
    return {
        "command": list(command),
        **clock.times(),
        "versions": {"python": platform.python_version()}
        | {package: version(package) for package in (*PACKAGES, "numba")},
        "platform": platform.platform(),
    }


def write_variants(path: Path, found: Found) -> None:
    """A row for each combination of options of the runs, as its numbers score best when read."""
    names = [name for scenario in PUBLISHED for name in NUMBERS[scenario]]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*(choice.name for choice in found.six.choices), "score", *names])
        for held in (found.six, found.five):
            of_runs = held.scores.shape[: len(held.of_runs)]
            for options in np.ndindex(of_runs):
                scores = held.scores[options]
                reading = np.unravel_index(int(scores.argmin()), scores.shape)
                variant = held.variant((*options, *map(int, reading)))
                chosen = zip(held.choices, variant.options, strict=True)
                writer.writerow(
                    [
                        *(choice.options[i].text for choice, i in chosen),
                        variant.score,
                        *(value for scenario in PUBLISHED for value in variant.numbers[scenario]),
                    ]
                )
