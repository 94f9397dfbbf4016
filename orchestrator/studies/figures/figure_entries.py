"""Figures as a study file has them: a table `[figures.NAME]` each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from orchestrator.machine.errors import Findings, InputError, did_you_mean
from orchestrator.studies.engine import INDICES
from orchestrator.studies.figures.study_data import SCENARIO, is_known
from orchestrator.system.names import flattened

#: What a figure can be.
BANDS, MAPS, FRONT, INFLUENCE = "bands", "maps", "front", "influence"

#: What a figure may be called: its files are.
_NAME = re.compile(r"[\w-]+")

#: The table that is no figure.
LABELS = "labels"

#: What is shown of a study whose file does not say it.
_USUAL = ("late_error", "peak_command", "lost")


@dataclass(frozen=True)
class FigureEntry:
    """A figure that is to be drawn; :mod:`.study_file` says what each entry means.

    Attributes:
        name: of its files.

    """

    name: str
    kind: str
    x: Sequence[str] = ()
    y: str = ""
    show: Sequence[str] = ()
    by: Sequence[str] = ()
    where: Mapping[str, Any] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)


def read_figures(
    where: str, figures: Mapping[str, Any], varied: Mapping[str, type], is_compared: bool
) -> tuple[FigureEntry, ...]:
    """The figures of a study.

    Args:
        where: they stand, for messages.
        figures: that the study file has; without any the usual one is drawn.
        varied: the types of what varies, by name.
        is_compared: whether there are several scenarios.

    Raises:
        Refused: a figure names what runs do not have.

    """
    tables = dict(figures)
    labels = dict(flattened(tables.pop(LABELS, {})))
    numbers = [name for name, kind in varied.items() if kind is not str]
    if not tables and numbers:
        tables["influence"] = {"kind": INFLUENCE, "x": numbers, "show": list(_USUAL)}
    by = (SCENARIO,) if is_compared else ()
    findings, plans = Findings(), []
    for name, table in tables.items():
        with findings.collecting():
            if not _NAME.fullmatch(name):
                raise InputError(
                    f"{where}: figures: {name!r} is no name of a file: letters, digits, -"
                )
            _check_names(f"{where}: figures: {name}", table, (*numbers, *INDICES), (*varied, *by))
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
