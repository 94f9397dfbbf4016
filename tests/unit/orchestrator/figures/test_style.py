"""Symbols in headings are formulas; vehicles have different colours."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from orchestrator.figures.style import REFERENCE, heading, vehicle_colours


@pytest.mark.parametrize(
    ("title", "expected"),
    [
        ("under A_f = 1, A_d = 2", "under $A_{f}$ = 1, $A_{d}$ = 2"),
        ("theta_hat and eps_t", r"$\hat{\theta}$ and $\epsilon_{t}$"),
        ("my_run of a_long_name", "my_run of a_long_name"),
        ("costs $5", r"costs \$5"),
        (r"a\A_f", r"a\A_f"),
    ],
)
def test_symbols_of_the_paper_are_formulas(title, expected):
    assert heading(title) == expected


@given(st.text(alphabet=r"aA_ftheta_hat$\{}^ 1=.", max_size=30))
def test_every_title_can_be_drawn(title):
    figure = Figure()
    figure.suptitle(heading(title))
    figure.draw_without_rendering()


@pytest.mark.parametrize("n", [1, 2, 7, 8, 20, 40])
def test_vehicles_have_different_colours(n):
    colours = vehicle_colours(n)
    assert len(set(colours)) == len(colours) == n
    assert all(re.fullmatch("#[0-9A-F]{6}", colour) for colour in colours)
    assert REFERENCE not in colours
