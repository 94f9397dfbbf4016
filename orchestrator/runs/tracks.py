"""Tracks: tables of a reference over time, as planners in the language of equations.

The velocities of the spline are computed here, once; :mod:`auv_fmu.guidance.track` is the rest.

"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import numpy as np

from fmus.discovery import fingerprint, name_of
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError, escape_unprintable
from orchestrator.machine.texts import finite, in_docstring
from orchestrator.runs.bundle import LOG, kept_fmus, run_fmus
from orchestrator.runs.tables import places_of_time, records, time_of
from orchestrator.vehicle.signals import AXES

#: Fewest and most rows: the spline needs four, and each is written into the FMU.
_FEWEST, _MOST = 4, 20_000

_TEMPLATE = Path(__file__).with_name("templates") / "component" / "track.py.txt"


def planner(table: Path, kind: str, words: Sequence[str]) -> Path:
    """Return the FMU of a planner that follows a table.

    Args:
        table: with the track.
        kind: of the FMU.
        words: options of its build.

    Raises:
        InputError: the table cannot be read, or is not a track.

    """
    word = re.sub(r"\W+", "_", table.stem.lower(), flags=re.ASCII).strip("_")
    module = f"{word}_planner" if word[:1].isalpha() else f"track_{word}_planner"
    text = planner_text(name_of(module), read_track(table), table.name)
    return _built(module, text, kind, words)


@lru_cache(64)
def _built(module: str, text: str, kind: str, words: Sequence[str]) -> Path:
    """Return the FMU of a planner, which is built once from the text of its module."""
    key = sha256(f"{words} {fingerprint(kind)} {module} {text}".encode()).hexdigest()[:16]

    def build() -> dict[str, bytes]:
        LOG.info("building the planner of the track (only once) ...")
        with temporary_folder() as folder:
            script = folder / f"{module}.py"
            script.write_text(text, encoding="utf-8")
            run_fmus("build", folder, str(script), *words)
            return {path.name: path.read_bytes() for path in (script, *folder.glob("*.fmu"))}

    return kept_fmus(key, build)[f"{name_of(module)}.fmu"]


# Tables


def read_track(path: Path) -> np.ndarray:
    """Read a track: t [s], x, y and z [m] in each row.

    Raises:
        InputError: there is no such table, or it has a mistake.

    """
    with records(path, "not a track", _has_columns) as (names, lines):
        places = [_place(names, axis) for axis in AXES]
        clocks = places_of_time(names)
        if not clocks:
            raise ValueError(f"lacks the column time; a track has time, {', '.join(AXES)}")
        rows: list[list[float]] = []
        for line, values in lines:
            row = [time_of(values, clocks, f"line {line}")]
            for axis, place in zip(AXES, places, strict=True):
                row.append(finite(values[place], f"line {line}, {axis}:"))
            if rows and row[0] <= rows[-1][0]:
                raise ValueError(
                    f"line {line}: the time is {row[0]:g} s, and {rows[-1][0]:g} s in the line "
                    "before; times must increase"
                )
            rows.append(row)
        if not _FEWEST <= len(rows) <= _MOST:
            raise ValueError(
                f"has {len(rows)} rows, and a track has {_FEWEST} to {_MOST:,}"
                + ("; for a few places use [path]" if len(rows) < _FEWEST else "; leave out some")
            )
    return np.array(rows)


def _named(axis: str) -> tuple[str, str]:
    """Return the names that the column of an axis may have."""
    return axis, f"y_d.{axis}"


def _place(names: Sequence[str], axis: str) -> int:
    places = [i for i, name in enumerate(names) if name.strip().lower() in _named(axis)]
    if len(places) != 1:
        what = "lacks the column" if not places else "has two columns"
        raise ValueError(f"{what} {axis}; a track has time, {', '.join(AXES)}")
    return places[0]


def _has_columns(names: Sequence[str]) -> bool:
    lowered = {name.strip().lower() for name in names}
    return all(lowered.intersection(_named(axis)) for axis in AXES)


# The spline


def velocities(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the velocities of a cubic spline in its rows.

    The second derivative is continuous in row k if, with slopes m between rows h apart,

        h_k v_k-1 + 2 (h_k-1 + h_k) v_k + h_k-1 v_k+1 = 3 (h_k m_k-1 + h_k-1 m_k)

    In the second row and in the last but one, the third derivative is continuous, too.

    Args:
        t: times, increasing, at least four.
        y: values, (times, coordinates).

    """
    h = np.diff(t)[:, None]
    m = np.diff(y, axis=0) / h
    lower, diagonal, upper, right = (np.zeros_like(y) for _ in range(4))
    lower[1:-1], diagonal[1:-1], upper[1:-1] = h[1:], 2.0 * (h[:-1] + h[1:]), h[:-1]
    right[1:-1] = 3.0 * (h[1:] * m[:-1] + h[:-1] * m[1:])
    for end, inner, beside in ((0, 1, upper), (-1, -2, lower)):
        both = h[end] + h[inner]
        diagonal[end], beside[end] = h[inner], both
        right[end] = ((h[end] + 2.0 * both) * h[inner] * m[end] + h[end] ** 2 * m[inner]) / both
    for k in range(1, len(t)):
        factor = lower[k] / diagonal[k - 1]
        diagonal[k] -= factor * upper[k - 1]
        right[k] -= factor * right[k - 1]
    v: np.ndarray = right / diagonal
    for k in range(len(t) - 2, -1, -1):
        v[k] -= upper[k] / diagonal[k] * v[k + 1]
    return v


def planner_text(name: str, track: np.ndarray, source: str) -> str:
    """Write the text of a planner that follows a track.

    Args:
        name: of the component.
        track: its rows.
        source: name of the track's file.

    Raises:
        InputError: the spline has infinite velocities.

    """
    t, y = track[:, 0], track[:, 1:]
    with np.errstate(all="ignore"):
        dy = velocities(t, y)
    if not np.isfinite(dy).all():
        raise InputError(f"{source}: not a track: two rows are too far apart, or too close in time")
    rows = zip(t.tolist(), y.tolist(), dy.tolist(), strict=True)
    values = {
        "OwnComponent": name,
        "own_count": str(len(t)),
        "own_table": in_docstring(source),
        "own_stop_time": repr(max(float(t[-1]), 1.0)),
        "own_head": repr(f"{escape_unprintable(source)}: at t = "),
        "own_rows": "\n".join(f"    Row({a!r}, {(*b,)!r}, {(*c,)!r})," for a, b, c in rows),
    }
    text = _TEMPLATE.read_text(encoding="utf-8")
    return re.sub("|".join(values), lambda word: values[word[0]], text)
