"""The page holds the run, nothing but the run, and no other file."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from orchestrator.cosim.observers.observer import Header
from orchestrator.cosim.observers.table import Table
from orchestrator.cosim.system.names import PortName
from orchestrator.figures.page_series import extremes
from orchestrator.figures.style import REFERENCE, Drawn, vehicle_colours
from orchestrator.figures.view import view_page
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.signals import STANDARD
from support.tables import fleet, fleet_table, loop_table

pytest.importorskip("plotly", reason="needs the extra `view`")


def data_of(text):
    """What the page's script reads."""
    return json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.DOTALL)[1])


@given(
    arrays(float, st.integers(2, 500), elements=st.floats(-1e3, 1e3)),
    st.integers(1, 50),
)
def test_thinned_lines_keep_their_extremes(values, divisions):
    rows = extremes(values, divisions)
    assert values[rows].min() == values.min()
    assert values[rows].max() == values.max()
    assert {0, len(values) - 1} <= set(rows)
    assert len(rows) <= 2 * divisions + 2
    assert (np.diff(rows) > 0).all()


def test_frames_are_those_of_the_run():
    """Position and attitude at each frame, from the table by the definition of R."""
    table = loop_table()
    data = data_of(view_page("run", Drawn("run", table)))
    frames = data["frames"]
    np.testing.assert_allclose(frames["time"], table.time, rtol=1e-5)
    for k in (0, 123, 399):
        phi, theta, psi = (table[f"plant.eta.{a}"][k] for a in ("phi", "theta", "psi"))
        c, s = np.cos, np.sin
        R = (
            np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
            @ np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
            @ np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
        )
        np.testing.assert_allclose(np.reshape(frames["rotation"][k], (3, 3)).T, R, atol=1e-5)
        centre = [table[f"plant.eta.{a}"][k] for a in "xyz"]
        nose = centre + 0.35 * R[:, 0]
        np.testing.assert_allclose(frames["position"][k], nose, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("z_up", [False, True])
def test_body_is_upright_whichever_way_z_points(z_up):
    """In the picture: the upper fin is above the hull, and the axes are right-handed."""
    data = data_of(view_page("run", Drawn("run", loop_table(), z_up)))
    axes = [data["scene"]["layout"]["scene"][f"{k}axis"] for k in "xyz"]
    signs = np.sign([axis["range"][1] - axis["range"][0] for axis in axes])
    assert np.prod(signs) == 1.0
    assert signs[2] == (1.0 if z_up else -1.0)
    assert axes[2]["title"]["text"] == ("z up [m]" if z_up else "z down [m]")
    hull, upper_fin, _ = (signs * np.array(part) for part in data["parts"])
    assert upper_fin[:, 2].min() > 0.0
    assert upper_fin[:, 2].max() > hull[:, 2].max()


def test_what_is_missing_is_named_on_the_page():
    text = view_page("run", Drawn("run", loop_table(without=STANDARD.theta_hat)))
    assert "estimated parameters skipped: no controller.theta_hat[1]" in text


def test_a_run_without_a_vehicle_has_no_page():
    with pytest.raises(InputError, match=r"no vehicle to show: no plant\.eta\.x"):
        view_page("run", Drawn("run", loop_table(without=STANDARD.posture)))


def test_values_that_json_lacks_are_gaps():
    table = loop_table()
    table["plant.tau.u"][10:] = np.nan
    values = [
        trace["y"] for trace in data_of(view_page("run", Drawn("run", table)))["series"]["traces"]
    ]
    assert any(None in y for y in values)


def test_the_title_is_text_and_no_markup():
    text = view_page("<script>alert(1)</script> {{data}}", Drawn("run", loop_table()))
    assert "<script>alert(1)" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; {{data}}" in text


# Several vehicles


def three(**how):
    return Drawn("run", fleet_table(3, **how), loops=fleet(3))


def test_frames_of_several_vehicles_follow_each_other():
    """Each vehicle's are those of a page that shows only it."""
    run = three()
    frames = data_of(view_page("run", run))["frames"]
    n = len(frames["time"])
    for i, loop in enumerate(run.loops):
        alone = data_of(view_page("run", run._replace(loops=[loop])))["frames"]
        assert alone["time"] == frames["time"]
        for what in ("position", "rotation", "reference"):
            assert frames[what][i * n : (i + 1) * n] == alone[what]


def test_each_vehicle_has_a_colour_and_stands_in_the_legend_once():
    traces = data_of(view_page("run", three()))["scene"]["traces"]
    assert len({trace["legendgroup"] for trace in traces}) == 3
    named = [trace for trace in traces if trace.get("showlegend", True)]
    assert [trace["name"] for trace in named] == ["auv1", "auv2", "auv3"]
    for trace in named:
        group = [other for other in traces if other["legendgroup"] == trace["name"]]
        lines = [other["line"]["color"] for other in group if other["type"] == "scatter3d"]
        # The reference, the way ahead, the trail, and where the reference is.
        assert lines == [trace["line"]["color"]] * 4
    assert len({trace["line"]["color"] for trace in named}) == 3


def test_a_reference_that_all_follow_is_there_once_and_grey():
    loops = [replace(loop, planner="auv1.planner") for loop in fleet(3)]
    data = data_of(view_page("run", Drawn("run", fleet_table(3), loops=loops)))
    assert len(data["frames"]["reference"]) == len(data["frames"]["time"])
    lines = [trace for trace in data["scene"]["traces"] if trace["name"] == "reference"]
    assert [line["line"]["color"] for line in lines] == [REFERENCE]


def test_errors_of_all_and_their_smallest_distance_are_above_those_of_the_chosen_one():
    """Written out here: |y - y_d| at the start, and the smallest of three distances at the end."""
    run = three()
    data = data_of(view_page("run", run))
    *sizes, distance = data["common"]
    assert [line["name"] for line in sizes] == ["auv1", "auv2", "auv3"]
    for i, line in enumerate(sizes, 1):
        y = [run.result[f"auv{i}.plant.eta.{axis}"][0] for axis in "xyz"]
        theta, psi = (run.result[f"auv{i}.plant.eta.{angle}"][0] for angle in ("theta", "psi"))
        ahead = [np.cos(psi) * np.cos(theta), np.sin(psi) * np.cos(theta), -np.sin(theta)]
        y_d = [run.result[f"auv{i}.planner.y_d.{axis}"][0] for axis in "xyz"]
        error = np.add(y, np.multiply(0.35, ahead)) - y_d
        assert line["y"][0] == pytest.approx(np.sqrt((error**2).sum()), rel=1e-5)
    last = [[run.result[f"auv{i}.plant.eta.{k}"][-1] for k in "xyz"] for i in (1, 2, 3)]
    apart = [np.linalg.norm(np.subtract(last[i], last[j])) for i, j in ((0, 1), (0, 2), (1, 2))]
    assert distance["y"][-1] == pytest.approx(min(apart), rel=1e-5)
    assert len(data["choices"]) == 3
    for i, (loop, choice) in enumerate(zip(run.loops, data["choices"], strict=True), 1):
        alone = data_of(view_page("run", run._replace(loops=[loop])))["series"]
        assert [line["y"] for line in choice["traces"]] == [line["y"] for line in alone["traces"]]
        titles = [title["text"] for title in choice["layout"]["annotations"]]
        assert len(titles) == len(alone["layout"]["annotations"]) + 2
        assert all(text.startswith(f"auv{i}: ") for text in titles[2:])


def test_what_one_of_several_lacks_is_named_with_it():
    text = view_page("run", three(without=fleet(3)[1].y_d))
    assert "auv2: |e| skipped: no auv2.planner.y_d.x" in text
    assert [line["name"] for line in data_of(text)["common"][:-1]] == ["auv1", "auv3"]
    with pytest.raises(InputError, match=r"no vehicle to show: no auv3\.plant\.eta\.x"):
        view_page("run", three(without=fleet(3)[2].posture))


def test_a_page_of_many_vehicles_is_light():
    """Fewer frames and points for each: it grows more slowly than the vehicles in number."""
    two, twenty = (
        len(
            json.dumps(
                data_of(view_page("run", Drawn("run", fleet_table(n, 5000), loops=fleet(n))))
            )
        )
        for n in (2, 20)
    )
    assert twenty < 4 * two


def test_the_names_of_vehicles_are_text_and_no_markup():
    run = three()
    loops = [replace(loop, vehicle=f"<i>.{loop.vehicle}") for loop in run.loops]
    columns = [f"<i>.{name}" if ".plant." in name else name for name in run.result.columns]
    parameters = {
        PortName.read(f"<i>.{name}"): value for name, value in run.result.parameters.items()
    }
    header = Header(tuple(columns), run.result.header.experiment, parameters)
    text = view_page("run", Drawn("run", Table.of(header, run.result.rows), loops=loops))
    assert '<option value="0">&lt;i&gt;.auv1</option>' in text
    assert data_of(text)["common"][0]["name"] == "&lt;i&gt;.auv1"


@pytest.mark.parametrize("n", [1, 2, 7, 8, 20, 40])
def test_vehicles_have_different_colours(n):
    colours = vehicle_colours(n)
    assert len(set(colours)) == len(colours) == n
    assert all(re.fullmatch("#[0-9A-F]{6}", colour) for colour in colours)
    assert REFERENCE not in colours
