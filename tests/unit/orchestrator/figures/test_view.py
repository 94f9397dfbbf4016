"""The page holds the run, nothing but the run, and no other file."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from orchestrator.figures.page_series import extremes
from orchestrator.figures.style import Drawn
from orchestrator.figures.view import view_page
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.signals import STANDARD
from support.tables import loop_table

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
