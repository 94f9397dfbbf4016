"""Figures as a study file has them: a table `[figures.NAME]` each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.figures.study_figures import KINDS, FigureEntry
from orchestrator.figures.study_values import SCENARIO, is_known
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.runs.entries import (
    Entry,
    are_names,
    check_entries,
    flattened,
    is_number,
    is_table,
    is_text,
)
from orchestrator.vehicle.indices import index_columns

#: What a figure may be called: its files are.
_NAME = re.compile(r"[\w-]+")

#: The table that is no figure.
LABELS = "labels"

#: What is shown of a study whose file does not say it: of each vehicle, and of all together.
_USUAL, _ALL = ("late_error", "peak_command"), "lost"


def _are_names(value: Any) -> bool:
    return is_text(value) or are_names(value)


def _are_numbers(value: Any) -> bool:
    return is_table(value) and all(is_number(number) for _, number in flattened(value))


#: What the table of a figure may hold, in the order of the reference page.
ENTRIES: Mapping[str, Entry] = {
    "kind": Entry(
        f"name out of {', '.join(KINDS)}", lambda value: value in tuple(KINDS), "What it is.", ""
    ),
    "x": Entry(
        "name, or list of names",
        _are_names,
        "Value along the horizontal axis; of `bands` also several, a column of panels each; of "
        "`influence` what moves the others.",
        "",
    ),
    "y": Entry("name", is_text, "Value along the vertical axis.", ""),
    "show": Entry("name, or list of names", _are_names, "What is shown, a row each.", ""),
    "by": Entry(
        "name, or list of names",
        _are_names,
        "Columns that tell runs apart, by colours or in panels of their own; `[]` for none.",
        "the scenario, if there are several",
    ),
    "where": Entry(
        "table of values", is_table, "Only runs of which these columns have these values.", "none"
    ),
    "limits": Entry("table of numbers", _are_numbers, "Lines at values of what is shown.", "none"),
}


def read_figures(
    where: str,
    figures: Mapping[str, Any],
    varied: Mapping[str, type],
    is_compared: bool,
    indices: Sequence[str] | None = None,
) -> tuple[FigureEntry, ...]:
    """The figures of a study.

    Args:
        where: they stand, for messages.
        figures: what the study file says of them; without a figure the usual one is drawn.
        varied: the types of what varies, by name.
        is_compared: whether there are several scenarios.
        indices: the columns of what comes out of a run; None: of one vehicle.

    Raises:
        InputError: an entry cannot be what it shall be.

    """
    tables, indices = dict(figures), indices or index_columns()
    labels = _labels(where, tables.pop(LABELS, {}))
    numbers = [name for name, kind in varied.items() if kind is not str]
    if not tables and numbers:
        tables["influence"] = {"kind": "influence", "x": numbers, "show": _usual(indices)}
    by = (SCENARIO,) if is_compared else ()
    plans = []
    for name, table in tables.items():
        if not _NAME.fullmatch(name):
            raise InputError(f"{where}: figures: {name!r} is no name of a file: letters, digits, -")
        _check(f"{where}: figures: {name}", table, (*numbers, *indices), (*varied, *by))
        plans.append(
            FigureEntry(
                name,
                table["kind"],
                _listed(table.get("x", ())),
                table.get("y", ""),
                _listed(table.get("show", ())),
                _listed(table.get("by", by)),
                dict(flattened(table.get("where", {}))),
                dict(flattened(table.get("limits", {}))),
                labels,
            )
        )
    return tuple(plans)


def _usual(indices: Sequence[str]) -> list[str]:
    """What is shown of a study whose file does not say it: of each vehicle, and of all."""
    of = [name.removesuffix(_USUAL[0]) for name in indices if name.endswith(_USUAL[0])]
    return [*(f"{vehicle}{name}" for name in _USUAL for vehicle in of), _ALL]


def _labels(where: str, table: Any) -> dict[str, str]:
    if not (is_table(table) and all(is_text(label) for _, label in flattened(table))):
        raise InputError(f"{where}: figures: {LABELS} is not a table of texts")
    return dict(flattened(table))


def _check(where: str, table: Any, numbers: Sequence[str], columns: Sequence[str]) -> None:
    """Check that a figure holds what its kind needs, and names what runs have.

    Args:
        where: it stands, for messages.
        table: that describes it.
        numbers: the columns that can be drawn.
        columns: those that tell runs apart.

    """
    if not is_table(table):
        raise InputError(f"{where}: is no table; write [figures.NAME]")
    check_entries(where, table, ENTRIES)
    kind = table.get("kind")
    if kind is None:
        raise InputError(f"{where}: lacks kind; there are {', '.join(KINDS)}")
    _, needs, may = KINDS[kind]
    if missing := [key for key in needs if not table.get(key)]:
        raise InputError(f"{where}: lacks {' and '.join(missing)}")
    if more := [key for key in table if key not in ("kind", *needs, *may)]:
        raise InputError(f"{where}: a figure of kind {kind!r} has no {more[0]}")
    if kind in ("maps", "front") and not is_text(table["x"]):
        raise InputError(f"{where}: x is a list; a figure of kind {kind!r} has one x")
    for key in ("x", "y", "show", "limits"):
        for value in _listed(table.get(key, ())):
            if not is_known(value, numbers):
                raise InputError(
                    f"{where}: {key}: runs have no number {value!r}{did_you_mean(value, numbers)}"
                )
    for key in ("by", "where"):
        for column in _listed(table.get(key, ())):
            if column not in columns:
                raise InputError(
                    f"{where}: {key}: runs have no column {column!r}{did_you_mean(column, columns)}"
                )


def _listed(value: Any) -> list[str]:
    if is_table(value):
        return [name for name, _ in flattened(value)]
    return [value] if is_text(value) else list(value)
