"""Runs of random systems, compared with an independent evaluator."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from itertools import product
from math import isclose
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from orchestrator import Result, load, simulate
from random_systems.evaluator import (
    DELAY,
    GAUSS_SEIDEL,
    JACOBI,
    SOLVE,
    NoSolution,
    default_order,
    evaluate,
)
from random_systems.generator import draw, write

LOOPS = ("python", "compiled")

#: A difference so small, as a share of the largest value that a signal has, is a rounding error.
TOLERANCE = 1e-9

#: The same where values grow from step to step, rounding errors of the start with them, up to
#: fiftyfold a step: so many rows are looked at.
_GROWING, _SOON = 1e-6, 5

#: One in so many systems also runs isolated.
_ISOLATED = 25

#: Outcomes; undecided: the system has no solution that is known well enough.
EQUAL, DIFFERS, REFUSED, UNDECIDED = "equal", "differing", "refused", "undecided"


class Outcome(NamedTuple):
    """Outcome of a run.

    Attributes:
        seed: of the system.
        how: it was run.
        what: :data:`EQUAL` or another of these.
        why: in a line.

    """

    seed: int
    how: str
    what: str
    why: str = ""


def outcomes(seed: int) -> Iterator[Outcome]:
    """All runs of the system of a seed."""
    drawn = draw(seed)
    names = list(drawn.parts)
    random = Random(seed)
    random.shuffle(names)
    with TemporaryDirectory(prefix="random") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = write(drawn, Path(folder))
        default = default_order(drawn)
        orders = dict.fromkeys((default, GAUSS_SEIDEL, JACOBI, tuple(names)))
        for order, coupling in product(orders, (SOLVE, DELAY)):
            text = order if isinstance(order, str) else ",".join(order)
            text += f" {coupling}"
            try:
                evaluation = evaluate(drawn, order, coupling)
            except (NoSolution, ArithmeticError, ValueError) as error:
                yield Outcome(seed, text, UNDECIDED, repr(error))
                continue
            if coupling == SOLVE:
                has_rings = bool(evaluation.rings)
            elif not has_rings:
                continue
            ways: list[dict[str, Any]] = [{"loop": loop} for loop in LOOPS]
            if seed % _ISOLATED == 0 and order == default:
                ways.append({"isolate": True})
            if order == default:
                # The default.
                ways[0]["order"] = None
            for way in ways:
                how = f"{text} {way.get('loop', 'isolated')}"
                try:
                    system = path if random.random() < 0.5 else load(path)
                    result = simulate(
                        system,
                        step=drawn.step,
                        stop_time=drawn.stop_time,
                        # Rings that cannot be solved are delayed, if nothing is said.
                        coupling=None if coupling == SOLVE else coupling,
                        **{"order": order} | way,
                    )
                except ValueError as error:
                    yield Outcome(seed, how, REFUSED, str(error))
                    continue
                rows, taken = evaluation.rows, result.header.experiment.order
                if taken != order:
                    why = f"it was run in {taken} order"
                elif drawn.strong and evaluation.late:
                    # It may have to end early.
                    soon = min(_SOON, len(result))
                    why = difference(result, rows[:soon], _GROWING)
                else:
                    why = result.failure or difference(result, rows)
                    if not why and len(result) != len(rows):
                        why = f"{len(result)} rows, not {len(rows)}"
                yield Outcome(seed, how, DIFFERS if why else EQUAL, why or "")


def findings(seed: int) -> list[str]:
    """List the runs of a system that differ or are refused."""
    wrong = (outcome for outcome in outcomes(seed) if outcome.what not in (EQUAL, UNDECIDED))
    return [f"{outcome.how}: {outcome.what}: {outcome.why}" for outcome in wrong]


def difference(
    result: Result, rows: Sequence[dict[str, Any]], tolerance: float = TOLERANCE
) -> str | None:
    """Describe the first value that differs; None: there is none."""
    for name in rows[0]:
        found, wanted = result[name][: len(rows)], [row[name] for row in rows]
        if isinstance(wanted[0], float):
            # Terms of the size of a thousandth may cancel.
            size = max(float(np.abs(wanted).max()), 1e-3)
            wrong = [
                k
                for k, (a, b) in enumerate(zip(found, wanted, strict=True))
                if not isclose(a, b, rel_tol=0.0, abs_tol=tolerance * size)
            ]
        else:
            wrong = [k for k, (a, b) in enumerate(zip(found, wanted, strict=True)) if a != b]
        if wrong:
            k = wrong[0]
            return f"{name} is {found[k]!r} in row {k}, not {wanted[k]!r}"
    return None
