"""The page says of the plant's integrator what runs of the FMUs say."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.vehicle.signals import true_control_point
from support.markdown import DOCS

PAGE = (DOCS / "accuracy.md").read_text(encoding="utf-8")
QUIET = {"plant.noise.std": 0.0}
RK4 = {**QUIET, "plant.integrator": "rk4"}


def row(*cells: str) -> list[str]:
    """The rest of the first row of a table that begins with some cells, without its marks."""
    begins = f"| {' | '.join(cells)} |"
    found = next(line for line in PAGE.splitlines() if line.startswith(begins))
    return [cell.strip(" *") for cell in found.strip("|").split("|")[len(cells) :]]


@pytest.mark.parametrize("name", ["fig4", "fig5-pd"])
def test_paths_of_the_plants_schemes_are_as_far_apart_as_the_page_says(name):
    """To the two digits of the page; of `rk4` that it is exact to less than a micrometre."""
    euler, rk4, exact = (
        true_control_point(simulate(name, values, kind="native"))
        for values in (QUIET, RK4, {**RK4, "plant.h_max": 0.002})
    )
    said = row(f"`{name}`")[0].split("; ")[0]
    away = np.linalg.norm(euler - exact, axis=1).max()
    assert away == pytest.approx(float(said.removesuffix(" cm")) / 100, rel=0.05)
    assert np.linalg.norm(rk4 - exact, axis=1).max() < 1e-6


def test_effort_of_the_pd_controller_belongs_to_the_plants_scheme_as_the_page_says():
    said = row("`fig5-pd`", "L2 q")
    found = [
        simulate("fig5-pd", values, kind="native").metrics()["l2_effort"][1]
        for values in (QUIET, RK4)
    ]
    assert [f"{effort:.3g}" for effort in found] == [said[0], said[-1]] == ["166", "133"]
