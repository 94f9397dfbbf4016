"""Figures as a study file has them: a table `[figures.NAME]` each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.figures.study_figures import FigureEntry
from orchestrator.figures.study_values import SCENARIO, is_known
from orchestrator.machine.errors import Findings, InputError, did_you_mean
from orchestrator.system.names import flattened
from orchestrator.vehicle.indices import index_columns

#: What a figure may be called: its files are.
_NAME = re.compile(r"[\w-]+")

#: The table that is no figure.
LABELS = "labels"

#: What is shown of a study whose file does not say it: of each vehicle, and of all together.
_USUAL, _ALL = ("late_error", "peak_command"), "lost"


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
        figures: that the study file has; without any the usual one is drawn.
        varied: the types of what varies, by name.
        is_compared: whether there are several scenarios.
        indices: the columns of what comes out of a run; None: of one vehicle.

    Raises:
        Refused: a figure names what runs do not have.

    """
    tables, indices = dict(figures), indices or index_columns()
    labels = dict(flattened(tables.pop(LABELS, {})))
    numbers = [name for name, kind in varied.items() if kind is not str]
    if not tables and numbers:
        tables["influence"] = {"kind": "influence", "x": numbers, "show": _usual(indices)}
    by = (SCENARIO,) if is_compared else ()
    findings, plans = Findings(), []
    for name, table in tables.items():
        with findings.collecting():
            if not _NAME.fullmatch(name):
                raise InputError(
                    f"{where}: figures: {name!r} is no name of a file: letters, digits, -"
                )
            _check_names(f"{where}: figures: {name}", table, (*numbers, *indices), (*varied, *by))
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
    findings.refuse()
    return tuple(plans)


def _usual(indices: Sequence[str]) -> list[str]:
    """What is shown of a study whose file does not say it: of each vehicle, and of all."""
    of = [name.removesuffix(_USUAL[0]) for name in indices if name.endswith(_USUAL[0])]
    return [*(f"{vehicle}{name}" for name in _USUAL for vehicle in of), _ALL]


def _check_names(
    where: str, table: Mapping[str, Any], numbers: Sequence[str], columns: Sequence[str]
) -> None:
    """Check that a figure names what runs have.

    Args:
        where: it stands, for messages.
        table: that describes it.
        numbers: the columns that can be drawn.
        columns: those that tell runs apart.

    """
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
    if isinstance(value, Mapping):
        return [name for name, _ in flattened(value)]
    return [value] if isinstance(value, str) else list(value)
