"""The printed table of section 4.2 beside every reading of it, in Markdown."""

from __future__ import annotations

import csv
import platform
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from orchestrator.analysis.signals import ACTUATORS, AXES
from orchestrator.experiments.folder import replaced
from orchestrator.experiments.record import PACKAGES, Clock, write_files
from orchestrator.paper.choices import END_TIMES, PD, PROPOSED
from orchestrator.paper.formatting import numbers, plain, table
from orchestrator.paper.sensitivity import PUBLISHED, Range, Sensitivity, Variant
from orchestrator.paper.variants import all_variants
from orchestrator.paper.workers import workers
from orchestrator.studies.engine import REACHED

#: How near is near, in parts of a printed number.
_TOLERANCES = (0.1, 0.25, 0.5)

_NAMES = {PROPOSED: "proposed", PD: "PD"}

_UNITS = ("N", "N·m", "N·m")

_NUMBERS = (
    *(f"L2 effort {k} [{unit}·√s]" for k, unit in zip(ACTUATORS, _UNITS, strict=True)),
    *(f"e_f {k} [m]" for k in AXES),
)


#: What the columns of the table hold, by :class:`.Variant`.
_TITLES = ("ours", "nearest", "nearest of all")


def write_table(folder: Path, command: Sequence[str]) -> tuple[Path, Path]:
    """Make all variants, and write `table.md` and `variants.csv`.

    Args:
        folder: to write into.
        command: for the record.

    Returns:
        The two files.

    Raises:
        InputError: a package is missing, or the folder cannot be written.
        KeyboardInterrupt: the user does not want to wait.

    """
    clock = Clock()
    with replaced(folder) as unfinished:
        with workers() as crew:
            found = all_variants(crew)
        text = f"# The printed table of section 4.2\n\n{section(found)}\n"
        (unfinished / "table.md").write_text(text, encoding="utf-8")
        write_variants(unfinished / "variants.csv", found)
        write_files(unfinished, _record(command, clock))
    return folder / "table.md", folder / "variants.csv"


def _record(command: Sequence[str], clock: Clock) -> dict[str, object]:
    return {
        "command": list(command),
        **clock.times(),
        "versions": {"python": platform.python_version()}
        | {package: version(package) for package in (*PACKAGES, "numba")},
        "platform": platform.platform(),
    }


def write_variants(path: Path, found: Sensitivity) -> None:
    """A row for each combination of options, at the end time at which it scores best."""
    ends = found.scores.argmin(axis=-1)
    names = [f"{_NAMES[scenario]} {name}" for scenario in PUBLISHED for name in _NUMBERS]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*(choice.name for choice in found.choices), "score", *names])
        for options in np.ndindex(ends.shape):
            variant = found.variant((*options, int(ends[options])))
            chosen = zip(found.choices, variant.options, strict=True)
            writer.writerow(
                [
                    *(choice.options[i].text for choice, i in chosen),
                    variant.score,
                    *(value for scenario in PUBLISHED for value in variant.numbers[scenario]),
                ]
            )


def section(found: Sensitivity) -> str:
    """What the variants say."""
    return "\n\n".join(_paragraphs(found))


def _paragraphs(found: Sensitivity) -> Iterator[str]:
    variants = (found.ours, found.nearest(consistent=True), found.nearest(consistent=False))
    first, *_, last = END_TIMES
    yield (
        f"{found.scores.size:,} variants: all combinations of what the paper leaves open of the "
        f"runs behind its table, listed below, with every T_f from {first:g} to {last:g} s. The "
        "score of a variant is the sum of |ln(ours / printed)| over the twelve numbers; the factor "
        "is their geometric mean of ours / printed, or of its inverse where that is larger. "
        "*Nearest* has the least score of all variants that contradict nothing that is printed. "
        "Ranges, of those variants and of all, are of what has come to the reference, with e_f of "
        f"at most {REACHED:g} m; where they do not hold what is printed, they are bold."
    )
    yield table(["", "printed", *_TITLES, "range", "range of all"], list(_rows(found, variants)))
    yield "\n".join(
        f"- {title}: {_described(found, variant)}."
        for title, variant in zip(_TITLES, variants, strict=True)
    )
    yield _verdict(found)
    yield table(
        ["open", "option", "best score", "best of all", "contradicts"], list(_options(found))
    )


def _rows(found: Sensitivity, variants: tuple[Variant, ...]) -> Iterator[list[str]]:
    for scenario, published in PUBLISHED.items():
        spans = [found.span(scenario, consistent) for consistent in (True, False)]
        for i, name in enumerate(_NUMBERS):
            yield [
                f"{_NAMES[scenario]} {name}",
                f"{published[i]:g}",
                *(_number(variant.numbers[scenario][i]) for variant in variants),
                *(_range(span, published, i) for span in spans),
            ]
    yield ["score", "", *(f"{variant.score:.2f}" for variant in variants), "", ""]
    yield ["factor", "", *(f"{variant.factor:.2f}" for variant in variants), "", ""]


def _range(span: Range, published: np.ndarray, i: int) -> str:
    """From the smallest to the largest; bold if what is printed lies outside."""
    text = f"{_number(span.low[i])} to {_number(span.high[i])}"
    return text if span.low[i] <= published[i] <= span.high[i] else f"**{text}**"


def _number(value: float) -> str:
    """Three digits, without an exponent for the efforts of wild runs."""
    return f"{value:.3g}" if value < 1000.0 else f"{value:,.0f}"


def _described(found: Sensitivity, variant: Variant) -> str:
    """Where a variant differs from ours, and its end time."""
    *others, end = (
        (choice, choice.options[i], i)
        for choice, i in zip(found.choices, variant.options, strict=True)
    )
    words = [f"{choice.name}: {option.text}" for choice, option, i in others if i != choice.ours]
    choice, option, _ = end
    return plain("; ".join((*words, f"{choice.name} = {option.text}")))


def _verdict(found: Sensitivity) -> str:
    most = [found.most_within(tolerance) for tolerance in _TOLERANCES]
    percent = numbers([100 * tolerance for tolerance in _TOLERANCES])
    return (
        f"**No variant explains the table.** At most {numbers(most)} of the twelve numbers come at "
        f"once within {percent} % of what is printed. "
        + " ".join(_impulse(found, scenario) for scenario in PUBLISHED)
        + " How long the way takes is decided by the gains and limits of section 4.1, its impulse "
        "by the damping: 30 kg/s over 31 m are 930 N·s."
    )


def _impulse(found: Sensitivity, scenario: str) -> str:
    """Why no choice brings the effort of the surge force down."""
    ways, printed = found.ways_of(scenario), PUBLISHED[scenario][0]
    duration, impulse, least = (
        (min(values), max(values))
        for values in zip(*((*way, way.least_effort) for way in ways), strict=True)
    )
    soonest = min(way.soonest(printed) for way in ways)
    return (
        f"With the {_NAMES[scenario]} controller the vehicle is at the reference, with |e| of "
        f"{REACHED:g} m, after {duration[0]:.3g} to {duration[1]:.3g} s, and until then its surge "
        f"force has an impulse of {impulse[0]:.4g} to {impulse[1]:.4g} N·s. By Cauchy and Schwarz "
        f"no force does that with an effort below {least[0]:.3g} N·√s: with the printed "
        f"{printed:g} it takes {soonest:.3g} s at the soonest."
    )


def _options(found: Sensitivity) -> Iterator[list[str]]:
    for axis, choice in enumerate(found.choices[:-1]):
        best = [found.best_with_each(axis, consistent) for consistent in (True, False)]
        for option, *scores in zip(choice.options, *best, strict=True):
            written = [f"{score:.2f}" if np.isfinite(score) else "" for score in scores]
            yield [plain(choice.name), plain(option.text), *written, plain(option.against)]
