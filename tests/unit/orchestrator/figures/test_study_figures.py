"""Figures of studies, compared with loops over the runs."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.figures import study_figures, study_values
from orchestrator.figures.drawing import styled
from orchestrator.figures.study_figures import (
    Groups,
    bands,
    bins_of,
    draw_figures,
    front,
    influence,
    is_logarithmic,
    maps,
    pareto_front,
)
from orchestrator.figures.study_values import Values
from orchestrator.studies.study import read_figures
from orchestrator.vehicle.indices import index_columns
from support.machine import contents

GRID = np.geomspace(1.0, 100.0, 5)
LEGENDS = {"fig5": "proposed", "fig5-pd": "PD"}
VARIED = {"disturbance.A_f": float, "disturbance.A_d": float}


def columns():
    """Two scenarios on a grid, three runs at each of its points; the largest A_f has no error."""
    A_f, A_d, _, scenario = (
        a.ravel() for a in np.meshgrid(GRID, GRID, range(3), ["fig5", "fig5-pd"], indexing="ij")
    )
    n = len(A_f)
    made = {name: np.full(n, np.nan) for name in index_columns()}
    made["late_error"] = np.random.default_rng(3).lognormal(0.0, 1.0, n)
    made["late_error"][A_f == GRID[-1]] = np.nan
    made["peak_command.u"] = A_f**2
    return made | {
        "scenario": scenario.astype(object),
        "disturbance.A_f": A_f,
        "disturbance.A_d": A_d,
        "failure": np.array([None] * n, dtype=object),
    }


def entry(**figure):
    [read] = read_figures("mine.toml", {"f": figure}, VARIED, True)
    return read


def test_bands_are_medians_and_shares():
    runs = columns()
    figure = bands(
        entry(kind="bands", x="disturbance.A_f", show=["late_error", "lost"]), "", Values(runs)
    )
    for axes, middle in zip(figure.axes, (np.median, lambda e: np.mean(~(e <= 1.0))), strict=True):
        for line, scenario in zip(axes.get_lines(), ("fig5", "fig5-pd"), strict=True):
            x, y = line.get_data()
            np.testing.assert_allclose(x, GRID, rtol=1e-12)
            for value, found in zip(GRID, y, strict=True):
                here = (runs["disturbance.A_f"] == value) & (runs["scenario"] == scenario)
                expected = middle(runs["late_error"][here])
                np.testing.assert_equal(found, expected)
        assert axes.get_xscale() == "log"


def test_maps_are_medians_and_grey_where_no_run_has_any():
    runs = columns()
    figure = maps(
        entry(kind="maps", x="disturbance.A_f", y="disturbance.A_d", show="late_error"),
        "", Values(runs, legends=LEGENDS),
    )  # fmt: skip
    proposed, pd, _ = figure.axes
    assert (proposed.get_title(), pd.get_title()) == ("proposed", "PD")
    for axes, scenario in ((proposed, "fig5"), (pd, "fig5-pd")):
        cells = axes.collections[0].get_array()
        for (row, column), found in np.ndenumerate(np.ma.filled(cells, np.nan)):
            here = runs["scenario"] == scenario
            here &= (runs["disturbance.A_d"] == GRID[row]) & (
                runs["disturbance.A_f"] == GRID[column]
            )
            np.testing.assert_equal(found, np.median(runs["late_error"][here]))


def explained(figure):
    """Texts of the legend below the panels."""
    return [text.get_text() for legend in figure.legends for text in legend.texts]


def test_limits_bands_and_grey_cells_are_explained():
    runs = Values(columns(), legends=LEGENDS)
    shown = entry(
        kind="bands", x="disturbance.A_f", show=["late_error", "peak_command.u"],
        limits={"peak_command.u": 80.0},
    )  # fmt: skip
    band = "band: 80% of the runs, line: median"
    assert explained(bands(shown, "", runs)) == ["proposed", "PD", "limit", band]
    shares = entry(kind="bands", x="disturbance.A_f", show=["lost"])
    assert explained(bands(shares, "", runs)) == ["proposed", "PD"]
    cells = {"kind": "maps", "x": "disturbance.A_f", "y": "disturbance.A_d"}
    with_gaps = entry(**cells, show="late_error", limits={"late_error": 1.0})
    figure = maps(with_gaps, "", runs)
    assert explained(figure) == ["no run has a value here"]
    assert figure.axes[-1].get_ylabel() == "largest late error [m]\n(white line: 1)"
    assert explained(maps(entry(**cells, show="peak_command.u"), "", runs)) == []


def test_no_other_point_beats_one_of_the_front():
    points = np.random.default_rng(4).integers(0, 30, (200, 2)).astype(float)
    found = {tuple(point) for point in pareto_front(points)}
    expected = {
        tuple(p) for p in points if not any((q <= p).all() and (q < p).any() for q in points)
    }
    assert found == expected


def test_a_front_of_many_runs_shows_how_many_there_are():
    n = 30_000
    random = np.random.default_rng(6).lognormal(0.0, 1.0, (2, n))
    runs = {name: np.zeros(n) for name in index_columns()}
    runs |= zip(("peak_command.u", "late_error"), random, strict=True)
    shown = entry(kind="front", x="peak_command.u", y="late_error", by=[])
    [axes] = front(shown, "", Values(runs)).axes
    [cells] = axes.collections
    assert cells.get_array().sum() == n


def test_influence_is_a_rank_correlation():
    pytest.importorskip("scipy", reason="needs the extra `studies`")
    runs = columns()
    runs["final_error.x"] = -np.exp(runs["disturbance.A_d"] / 10)
    show = ["peak_command.u", "final_error.x", "largest_drift"]
    figure = influence(entry(kind="influence", x=list(VARIED), show=show), "", Values(runs))
    matrix = np.ma.filled(figure.axes[0].get_images()[0].get_array(), np.nan)
    np.testing.assert_allclose(matrix, [[1, 0], [0, -1], [np.nan, np.nan]], atol=1e-12)


@pytest.mark.parametrize(("n", "show"), [(1, 1), (2, 2), (3, 3), (12, 3)])
@pytest.mark.parametrize("by", [(), ("scenario",)])
def test_influence_of_few_or_long_names_can_be_read(n, show, by):
    """Rows have room for their names, the bar of colours for its own, the names of x below."""
    pytest.importorskip("scipy", reason="needs the extra `studies`")
    x = [f"controller.a_gain_with_a_long_name_{i}" for i in range(n)]
    runs = columns() | {name: np.random.default_rng(5).random(150) for name in x}
    figures = {
        "f": {"kind": "influence", "x": x, "show": ["late_error", "lost", "saturated"][:show]}
    }
    [figure_entry] = read_figures("mine.toml", figures, dict.fromkeys(x, float), bool(by))
    with styled():
        figure = influence(figure_entry, "title", Values(runs, legends=LEGENDS))
        figure.draw_without_rendering()
    *matrices, bar = figure.axes
    for axes in matrices:
        rows = [name.get_window_extent() for name in axes.get_yticklabels()]
        assert axes.bbox.height > sum(row.height for row in rows)
    assert bar.bbox.height > bar.yaxis.label.get_window_extent().height
    for name in matrices[-1].get_xticklabels():
        assert name.get_window_extent().y0 >= 0.0


def test_equal_runs_give_equal_files_and_a_figure_without_values_is_left_out(tmp_path):
    figures = {
        "error": {"kind": "bands", "x": "disturbance.A_f", "show": "late_error"},
        "drift": {"kind": "front", "x": "largest_drift", "y": "late_error"},
        "effort": {"kind": "front", "x": "peak_command.u", "y": "late_error"},
    }
    figures["many"] = figures["error"] | {"by": ["disturbance.A_f", "disturbance.A_d"]}
    entries = read_figures("mine.toml", figures, VARIED, True)
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        assert list(draw_figures(entries, "A_f and A_d", Values(columns()), folder)) == [
            "figure drift left out: no run has largest_drift",
            "figure many left out: by splits the runs into 25 parts, more than 12",
        ]
    found = contents(tmp_path / "a")
    assert found.keys() == {"error.png", "error.svg", "effort.png", "effort.svg"}
    assert found == contents(tmp_path / "b")


def test_each_chart_is_drawn():
    assert study_figures._DRAW.keys() == study_values.CHARTS.keys()


# Bins


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.geomspace(1.0, 20.0, 50), True),
        (np.geomspace(1.0, 9.0, 50), False),
        ([0.0, *np.geomspace(1.0, 20.0, 50)], False),
        ([-1.0, 20.0], False),
        ([1e-9, *np.linspace(5.0, 20.0, 50)], False),
        ([1.0, np.nan, 100.0], True),
        ([np.nan], False),
    ],
)
def test_axis_is_logarithmic_where_a_linear_one_would_hide_most(values, expected):
    assert is_logarithmic(np.array(values)) is expected


@pytest.mark.parametrize(
    "grid",
    [np.geomspace(0.5, 64.0, 7), np.linspace(-3.0, 5.0, 4), [2.0], np.linspace(0.0, 9.0, 100)],
)
def test_each_value_of_a_grid_has_a_bin(grid):
    bins = bins_of(np.repeat(grid, 100), 24)
    np.testing.assert_allclose(bins.centres, grid, rtol=1e-12)
    assert bins.places(np.array(grid)).tolist() == list(range(len(grid)))
    assert all(np.diff(bins.edges) > 0.0)


def test_a_narrow_axis_is_logarithmic_if_its_values_are_spaced_so():
    narrow = np.random.default_rng(4).uniform(1.0, 3.0, 100)
    assert bins_of(narrow, 10, is_wide=True).is_logarithmic
    assert not bins_of(narrow, 10).is_logarithmic
    assert bins_of(np.geomspace(1.0, 3.0, 5), 10).is_logarithmic
    assert not bins_of(np.linspace(1.0, 3.0, 5), 10).is_logarithmic


def test_bins_of_other_values_are_equally_wide_or_equally_full():
    values = np.random.default_rng(1).lognormal(0.0, 2.0, 1000)
    full = bins_of(values, 10, are_full=True)
    assert full.is_logarithmic
    assert np.bincount(full.places(values)).tolist() == [100] * 10
    wide = bins_of(values, 10)
    np.testing.assert_allclose(np.diff(np.log(wide.edges)), np.ptp(np.log(values)) / 10)


def test_groups_are_the_finite_values_of_each_bin():
    random = np.random.default_rng(2)
    places, values = random.integers(0, 5, 40), random.normal(size=40)
    values[::7] = np.nan
    places[places == 3] = 4
    groups = Groups.of(places, values, 6)
    for place, low, mean in zip(range(6), groups.quantiles(0.1), groups.means, strict=True):
        expected = [v for p, v in zip(places, values, strict=True) if p == place and np.isfinite(v)]
        wanted = (np.quantile(expected, 0.1), np.mean(expected)) if expected else (np.nan, np.nan)
        np.testing.assert_allclose((low, mean), wanted, rtol=1e-12)
