"""The printed table of section 4.2 beside every reading of it, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.analysis.signals import ACTUATORS, AXES
from orchestrator.paper.choices import END_TIMES, PD, PROPOSED
from orchestrator.paper.formatting import numbers, plain, table
from orchestrator.paper.sensitivity import PUBLISHED, Range, Sensitivity, Variant
from orchestrator.studies.engine import REACHED

#: How near is near, in parts of a printed number.
_TOLERANCES = (0.1, 0.25, 0.5)

_CONTROLLERS = {PROPOSED: "proposed", PD: "PD"}

_UNITS = ("N", "N·m", "N·m")

#: What the six numbers of each scenario are.
NUMBERS = {
    scenario: (
        *(
            f"{controller} L2 effort {k} [{unit}·√s]"
            for k, unit in zip(ACTUATORS, _UNITS, strict=True)
        ),
        *(f"{controller} e_f {k} [m]" for k in AXES),
    )
    for scenario, controller in _CONTROLLERS.items()
}

#: What the columns of the table hold, by :class:`.Variant`.
_TITLES = ("ours", "nearest", "nearest of all")


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
        for i, name in enumerate(NUMBERS[scenario]):
            yield [
                name,
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
        f"**At most {numbers(most)} of the twelve numbers come at once within {percent} % of what "
        "is printed.** Among variants that contradict nothing that is printed, "
        + "; ".join(_impulse(found, scenario) for scenario in PUBLISHED)
        + ". These bounds are of Cauchy and Schwarz, (integral of tau_u)^2 <= T * integral of "
        "tau_u^2. How long the way takes is decided by the gains and limits of section 4.1, its "
        "impulse by the damping: 30 kg/s over 31 m are 930 N·s."
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
        f"the {_CONTROLLERS[scenario]} controller brings the vehicle to the reference, to |e| of "
        f"{REACHED:g} m, in {duration[0]:.3g} to {duration[1]:.3g} s, with an impulse of tau_u of "
        f"{impulse[0]:.4g} to {impulse[1]:.4g} N·s, so its L2 effort is at least {least[0]:.3g} "
        f"N·√s: with the printed {printed:g} it would take {soonest:.3g} s at the soonest"
    )


def _options(found: Sensitivity) -> Iterator[list[str]]:
    for axis, choice in enumerate(found.choices[:-1]):
        best = [found.best_with_each(axis, consistent) for consistent in (True, False)]
        for option, *scores in zip(choice.options, *best, strict=True):
            written = [f"{score:.2f}" if np.isfinite(score) else "" for score in scores]
            yield [plain(choice.name), plain(option.text), *written, plain(option.against)]
