"""Vehicles in formation: the numbers that the remarks of their scenarios name, and the wiring."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
import pytest

from orchestrator import load, simulate
from orchestrator.cosim import Table
from orchestrator.runs.scenario import read_scenario
from orchestrator.vehicle.signals import loops_of
from support.runs import compared

VEHICLES = ("auv1", "auv2", "auv3")


class Fleet:
    """Tracking errors and distances of a result, from its columns."""

    def __init__(self, result: Table) -> None:
        self.result = result
        self.time = self.result.time
        self.errors = np.array([self._error(name) for name in VEHICLES])
        places = [self.group(f"{name}.plant.eta", "xyz") for name in VEHICLES]
        apart = [np.linalg.norm(a - b, axis=1) for a, b in combinations(places, 2)]
        self.distance = np.min(apart, axis=0)

    def group(self, name: str, members: str) -> np.ndarray:
        return self.result.group(*(f"{name}.{member}" for member in members))

    def _error(self, name: str) -> np.ndarray:
        """|y - y_d|, with (9): y is ell ahead of the centre of mass."""
        theta, psi = (self.result[f"{name}.plant.eta.{k}"] for k in ("theta", "psi"))
        level = np.cos(theta)
        bow = np.column_stack((level * np.cos(psi), level * np.sin(psi), -np.sin(theta)))
        y = self.group(f"{name}.plant.eta", "xyz") + 0.35 * bow
        return np.linalg.norm(y - self.group(f"{name}.planner.y_d", "xyz"), axis=1)

    def largest(self, after: float) -> float:
        return float(self.errors[:, self.time > after].max())

    def peak(self) -> float:
        return float(max(np.abs(self.result[f"{name}.plant.tau.u"]).max() for name in VEHICLES))


@cache
def fleets(name: str) -> list[Fleet]:
    """Both runs of a scenario, made once."""
    return [Fleet(table) for table in compared(name)]


def test_a_v_is_followed_as_its_remark_says():
    proposed, pd = fleets("formation-v")
    assert proposed.largest(25.0) == pytest.approx(0.27, abs=0.005)
    assert pd.largest(25.0) == pytest.approx(0.44, abs=0.005)
    assert min(proposed.distance.min(), pd.distance.min()) > 4.3
    assert 74.0 < proposed.peak() < 75.0 and 31.0 < pd.peak() < 32.0


def test_a_formation_changes_as_its_remark_says():
    proposed, pd = fleets("formation-change")
    assert proposed.largest(25.0) == pytest.approx(0.38, abs=0.005)
    assert pd.largest(25.0) == pytest.approx(0.56, abs=0.005)
    for fleet in (proposed, pd):
        assert fleet.distance.min() == pytest.approx(2.7, abs=0.05)
        assert 75.0 < fleet.time[fleet.distance.argmin()] < 95.0


def test_followers_lose_their_leader_as_the_remark_says():
    proposed, pd = fleets("formation-lost-link")
    assert 1.7 < proposed.largest(25.0) < 1.8 and 2.2 < pd.largest(25.0) < 2.3
    assert proposed.largest(100.0) == pytest.approx(0.12, abs=0.005)
    assert pd.largest(100.0) == pytest.approx(0.09, abs=0.005)
    for fleet in (proposed, pd):
        assert fleet.distance.min() == pytest.approx(0.2, abs=0.05)
        lost = fleet.result["auv2.link.lost"]
        during = (fleet.time > 50.0) & (fleet.time < 69.9)
        assert np.ptp(fleet.result["auv2.link.received"][during]) <= 1
        assert lost[during][-1] - lost[during][0] == pytest.approx(20, abs=1)


def test_the_first_place_has_the_errors_of_a_single_vehicle():
    """The first place is the leader's, so rows and final errors are equal."""
    path = {
        str(name).replace("leader.", "planner."): value
        for name, value in read_scenario("formation-v").parameters.items()
        if str(name).startswith("leader.")
    }
    start = {"plant.eta0.x": -1.0, "plant.eta0.y": 1.0, "plant.eta0.z": 3.0}
    alone = simulate("path", {**path, **start}, kind="native", stop_time=10.0)
    together = simulate("formation-v", kind="native", stop_time=10.0)
    for axis in "xyz":
        name = f"plant.eta.{axis}"
        assert np.array_equal(alone[name], together[f"auv1.{name}"])
    found = together.metrics()["vehicles"]["auv1"]["final_error"]
    assert found == pytest.approx(alone.metrics()["final_error"], abs=1e-12)


def test_places_in_a_v_follow_geometry():
    """The leader runs straight north: its V lies at 45 degrees to both sides."""
    proposed, _ = fleets("formation-v")
    row = int(np.searchsorted(proposed.time, 40.0))
    leader = proposed.group("leader.y_d", "xyz")[row]
    half = 5.0 / np.sqrt(2.0)
    for name, offset in (("auv1", (0, 0)), ("auv2", (-half, half)), ("auv3", (-half, -half))):
        place = proposed.group(f"{name}.planner.y_d", "xyz")[row]
        np.testing.assert_allclose(place - leader, [*offset, 0.0], atol=1e-9)


def test_loops_of_a_formation_are_found():
    loops = loops_of(load("formation-lost-link", "native"))
    assert [loop.name for loop in loops] == list(VEHICLES)
    assert [loop.planner for loop in loops] == [f"{name}.planner" for name in VEHICLES]
    assert [loop.controller for loop in loops] == [f"{name}.controller" for name in VEHICLES]
