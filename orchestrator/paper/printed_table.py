"""The printed table of effort and error beside ours: `auv-fmu table`."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from auv_fmu.paper.euler import STEP
from orchestrator.machine.workers import workers
from orchestrator.paper.choices import (
    AGAINST_FIVE,
    END_TIMES,
    FIVE_DEGREES,
    PD,
    PROPOSED,
    PUBLISHED,
    VEHICLE_CHOICE,
)
from orchestrator.paper.page import escape_markdown, numbers, table
from orchestrator.paper.variants import (
    FARTHEST_START,
    QUANTILES,
    SAME,
    SEARCHED,
    SHOWN,
    Bounds,
    Found,
    Sensitivity,
    Variant,
    all_variants,
)
from orchestrator.runs.folder import RECORD, replace_files
from orchestrator.runs.record import RECORDED_PACKAGES, Stopwatch, write_content
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.signals import ACTUATORS, AXES

#: The files.
_NAMES = _TEXT, _VARIANTS = "table.md", "variants.csv"

#: The score is told of so much less and more than T_f [s], for e_f moves with the waves.
_AROUND = 10

#: How near is near, in parts of a printed number.
_TOLERANCES = (0.1, 0.25, 0.5)

_CONTROLLERS = {PROPOSED: "proposed", PD: "PD"}

#: What the six numbers of each scenario are.
NUMBERS = {
    scenario: (
        *(f"{controller} effort {k}" for k in ACTUATORS),
        *(f"{controller} e_f {k} [m]" for k in AXES),
    )
    for scenario, controller in _CONTROLLERS.items()
}

#: What the columns of the table hold, by :class:`.Variant`.
_TITLES = ("ours", "nearest", "nearest of all", "nearest of five")

#: Formulas of the efforts in short, for the columns that hold ranges.
_FORMULAS = ("L2 norm", "sum without the step")


def section(found: Found) -> str:
    """What the variants say."""
    return "\n\n".join(_paragraphs(found))


def _paragraphs(found: Found) -> Iterator[str]:
    variants = found.printed
    first, *_, last = END_TIMES
    yield (
        f"{found.six.scores.size:,} variants: all combinations of the points that the paper "
        "leaves open in the runs of its table, listed below, with every T_f from "
        f"{first:g} to {last:g} s. The "
        "score of a variant is the sum of |ln(ours / printed)| over the twelve numbers; the factor "
        "is the geometric mean of these ratios, or of its inverse where that is larger. "
        "*Nearest* has the lowest score of all variants that contradict nothing that is printed, "
        "*nearest of five* of those whose only contradiction is a vehicle of five degrees of "
        f"freedom: {found.five.scores.size:,} more, by medians over {len(SEARCHED)} starts each. "
        "Ranges are of the variants with six degrees of freedom that have reached the reference, "
        f"with e_f of at most {REACHED:g} m, and, except in the last column, of variants that "
        "contradict nothing; where they do not contain the printed number, they are bold. "
        "The mean of |tau| is not among the formulas: like (59) it cannot exceed 80."
    )
    ranges = [*(f"range, {formula}" for formula in _FORMULAS), "range of all"]
    yield table(["", "printed", *_TITLES, *ranges], list(_rows(found, variants)))
    held_by = [found.six, found.six, found.six, found.five]
    yield "\n".join(
        f"- {title}: {_described(held, variant)}."
        for title, variant, held in zip(_TITLES, variants, held_by, strict=True)
    )
    yield _starts(variants)
    yield _reached(found)
    yield _impulses(found.six)
    yield table(
        ["open", "option", "best score", "best of all", "contradicts"], list(_options(found))
    )


def _rows(found: Found, variants: Sequence[Variant]) -> Iterator[list[str]]:
    for scenario, published in PUBLISHED.items():
        spans = [found.six.span(scenario, True, formula) for formula in range(len(_FORMULAS))]
        spans.append(found.six.span(scenario, False))
        for i, name in enumerate(NUMBERS[scenario]):
            yield [
                name,
                f"{published[i]:g}",
                *(_cell(variant, scenario, i) for variant in variants),
                *(_range(span, published, i) for span in spans),
            ]
    empty = [""] * (len(_FORMULAS) + 1)
    yield ["score", "", *(f"{variant.score:.2f}" for variant in variants), *empty]
    yield ["factor", "", *(f"{variant.factor:.2f}" for variant in variants), *empty]


def _cell(variant: Variant, scenario: str, i: int) -> str:
    text = _number(variant.numbers[scenario][i])
    if variant.bands is None:
        return text
    low, high = variant.bands[scenario]
    return f"{text} ({_number(low[i])} to {_number(high[i])})"


def _range(span: Bounds, published: np.ndarray, i: int) -> str:
    """From the smallest to the largest; bold if what is printed lies outside."""
    text = f"{_number(span.low[i])} to {_number(span.high[i])}"
    return text if span.low[i] <= published[i] <= span.high[i] else f"**{text}**"


def _number(value: float) -> str:
    """Three digits, without an exponent for the efforts of wild runs."""
    return f"{value:.3g}" if value < 1000.0 else f"{value:,.0f}"


def _described(found: Sensitivity, variant: Variant) -> str:
    """Where a variant differs from ours, its end time, and how much hangs on that."""
    *others, end = (
        (choice, choice.options[i], i)
        for choice, i in zip(found.choices, variant.options, strict=True)
    )
    words = [f"{choice.name}: {option.text}" for choice, option, i in others if i != choice.ours]
    choice, option, last = end
    scores = found.scores[variant.options[:-1]]
    around = [i for i in (last - _AROUND, last + _AROUND) if 0 <= i < len(END_TIMES)]
    beside = " and ".join(f"{scores[i]:.2f} at {END_TIMES[i]:g} s" for i in around)
    text = escape_markdown("; ".join((*words, f"{choice.name} = {option.text}")))
    return f"{text}; the score is {beside}"


def _starts(variants: Sequence[Variant]) -> str:
    """Which of the variants depend on the last bits of the start."""
    told = [title for title, variant in zip(_TITLES, variants, strict=True) if variant.bands]
    still = [title for title in _TITLES if title not in told]
    text = (
        f"Each of these was made from {len(SHOWN)} more starts, moved by at most "
        f"{1e6 * FARTHEST_START:g}e-6 m along each axis."
    )
    if told:
        low, _, high = (100 * quantile for quantile in QUANTILES)
        text += (
            f" The numbers of {_and(told)} depend on that, so they are medians, with the band from "
            f"{low:.0f} to {high:.0f} % of the starts, and the score is computed from the medians: "
            "with five degrees of freedom the run passes the vertical, where (1) has a pole, and "
            "the last bits decide what comes after."
        )
    if still:
        text += f" The numbers of {_and(still)} stay within {100 * SAME:g} %."
    return text


def _reached(found: Found) -> str:
    """What no variant gives, by the formula of the efforts."""
    texts = []
    for formula, name in enumerate(_FORMULAS):
        missed = [
            escape_markdown(NUMBERS[scenario][i])
            for scenario, published in PUBLISHED.items()
            for span in [found.six.span(scenario, True, formula)]
            for i in np.flatnonzero((published < span.low) | (published > span.high))
        ]
        many = f"what is never reached is {_and(missed)}" if missed else "each is reached"
        texts.append(f"with the {name}, {many}")
    near = [
        numbers([100 * held.efforts_within(formula) for formula in range(len(_FORMULAS))])
        for held in (found.six, found.five)
    ]
    percent = numbers([100 * tolerance for tolerance in _TOLERANCES])
    counts = [
        numbers([held.most_within(tolerance) for tolerance in _TOLERANCES])
        for held in (found.six, found.five)
    ]
    return (
        f"**Among variants that contradict nothing, {'; '.join(texts)}.** At most {counts[0]} of "
        f"the twelve are at once within {percent} % of the printed numbers in any variant with six "
        f"degrees of freedom, and {counts[1]} with five. Of the same variants, the six "
        f"efforts by themselves are at once within {near[0]} % with the two formulas and six "
        f"degrees of freedom, and within {near[1]} % with five."
    )


def _and(names: Sequence[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _impulses(found: Sensitivity) -> str:
    return (
        "With the L2 norm the surge efforts cannot be reached: "
        + "; ".join(_impulse(found, scenario) for scenario in PUBLISHED)
        + ". These bounds follow from the Cauchy-Schwarz inequality, (integral of tau_u)^2 <= T * "
        "integral of tau_u^2. The gains and limits of section 4.1 decide how long the way "
        "takes, the damping decides its impulse: 30 kg/s over 31 m are 930 N·s. As a sum over "
        "steps without the step, (59) is the L2 norm / sqrt(h T_f), with h = "
        f"{STEP:g} s the same number at T_f = {1.0 / STEP:g} s and a smaller one later, so that "
        "these bounds shrink as 1 / sqrt(T_f). "
        "Whether the authors computed it so is not known."
    )


def _impulse(found: Sensitivity, scenario: str) -> str:
    """What the way to the reference asks of the effort of the surge force."""
    approaches, printed = found.ways_of(scenario), PUBLISHED[scenario][0]
    duration, impulse, least = (
        (min(values), max(values))
        for values in zip(*((*way, way.least_effort) for way in approaches), strict=True)
    )
    soonest = min(way.soonest(printed) for way in approaches)
    free = min(way.contradicts_until(printed, STEP) for way in approaches)
    return (
        f"the {_CONTROLLERS[scenario]} controller brings the vehicle to the reference, to |e| of "
        f"{REACHED:g} m, in {duration[0]:.3g} to {duration[1]:.3g} s, with an impulse of tau_u of "
        f"{impulse[0]:.4g} to {impulse[1]:.4g} N·s, so its L2 effort is at least {least[0]:.3g} "
        f"N·√s: with the printed {printed:g} it would take {soonest:.3g} s at the soonest. As a "
        f"sum without the step this contradicts nothing from T_f = {free:.3g} s on"
    )


def _options(found: Found) -> Iterator[list[str]]:
    six = found.six
    for axis, choice in enumerate(six.choices[:-1]):
        best = [six.best_with_each(axis, consistent) for consistent in (True, False)]
        for option, *scores in zip(choice.options, *best, strict=True):
            written = [f"{score:.2f}" if np.isfinite(score) else "" for score in scores]
            yield [*map(escape_markdown, (choice.name, option.text, *written, option.against))]
        if choice.name == VEHICLE_CHOICE:
            score = f"{found.printed[-1].score:.2f}, of medians"
            row = (choice.name, FIVE_DEGREES.text, "", score, AGAINST_FIVE)
            yield [*map(escape_markdown, row)]


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
    clock = Stopwatch()
    with replace_files(folder, (*_NAMES, RECORD), force=force) as unfinished:
        with workers() as crew:
            found = all_variants(crew)
        text = f"# The printed table of section 4.2\n\n{section(found)}\n"
        (unfinished / _TEXT).write_text(text, encoding="utf-8")
        write_variants(unfinished / _VARIANTS, found)
        content = {"command": list(command), **clock.times()}
        write_content(unfinished, content, RECORDED_PACKAGES)
    return folder / _TEXT, folder / _VARIANTS


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
