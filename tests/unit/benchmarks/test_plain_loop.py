"""The loop of Fig. 4 in C written by hand has the numbers of straight-line Python."""

from __future__ import annotations

import ctypes
import importlib
import shutil
from itertools import pairwise
from math import hypot
from pathlib import Path

import pytest

from auv_fmu.loop.closed_loop import PAPER, closed_loop
from auv_fmu.paper.actuators import Limits

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"

#: Limits that a run reaches, because the commands of Fig. 4 reach none of its own.
NARROW = Limits((-6.0, -5.0, -4.0), (7.0, 3.0, 2.0))

#: Numbers before the limits in the parameters of the program.
BEFORE = 15


@pytest.fixture
def plain_loop(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("plain_loop")


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
@pytest.mark.parametrize("limits", [PAPER.plant.limits, NARROW], ids=["own", "narrow"])
def test_it_ends_as_the_straight_line_does_to_the_last_bit(plain_loop, tmp_path, limits):
    command = ("cc", "-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
    library = plain_loop.built(command, tmp_path / "plain_loop.so")
    parameters = ((BEFORE + 6) * ctypes.c_double).in_dll(library, "parameters")
    assert tuple(parameters[BEFORE:]) == (*PAPER.plant.limits.tau_min, *PAPER.plant.limits.tau_max)
    parameters[BEFORE:] = (*limits.tau_min, *limits.tau_max)
    found = plain_loop.run(library, 5000)

    noise = PAPER.plant.noise._replace(std=0.0)
    setting = PAPER._replace(plant=PAPER.plant._replace(limits=limits, noise=noise))
    instants = [*closed_loop(5000, setting)]
    square = [0.0, 0.0, 0.0]
    for now, later in pairwise(instants):
        for i in range(3):
            square[i] += now.tau[i] * now.tau[i] * (later.t - now.t)
    last = instants[-1]
    vehicle, planner = last.vehicles.plant, last.vehicles.planner
    y_hat, dy_hat_o, theta_hat, _ = last.controller_state
    ends = (*vehicle.position, *vehicle.quaternion, *vehicle.nu_r)
    assert any(instant.tau != instant.command for instant in instants) == (limits == NARROW)
    assert (*found.position, *found.quaternion, *found.nu) == ends
    assert (*found.y_hat, *found.dy_hat_o, *found.theta_hat) == (*y_hat, *dy_hat_o, *theta_hat)
    ends = (*planner.position, planner.theta, planner.psi, *planner.nu)
    assert (*found.position_d, found.theta_d, found.psi_d, *found.nu_d) == ends
    assert [*found.square] == square
    y_d = last.scene.reference.y_d
    assert found.error == pytest.approx(hypot(*map(float.__sub__, last.scene.y, y_d)), rel=1e-15)
