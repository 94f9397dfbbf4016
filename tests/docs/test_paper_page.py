"""Errors of the paper: the page is in the report, its numbers hold, and tests show each point."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.loop.closed_loop import PAPER, LongestSteps, closed_loop
from auv_fmu.paper import motion_planner, output_feedback, plant
from auv_fmu.paper.output_feedback import Gains, Measurement
from auv_fmu.paper.pd import PdGains
from auv_fmu.paper.vehicle import Vehicle, accelerations
from auv_fmu.proof.lyapunov import Errors, composite_errors, lyapunov
from orchestrator.paper.claims import EFFORT_PD, EFFORT_PROPOSED, TURNING_RADIUS, sum_without_step
from orchestrator.paper.page import errata, readings
from orchestrator.runs.wiring import closed_loop as loop_of
from orchestrator.vehicle.proof import gain_check, stated, theorem_of
from support.markdown import DOCS
from support.texts import tells

PAGE = DOCS / "explanation" / "paper.md"
POINTS = tomllib.loads(Path(__file__).with_name("paper_points.toml").read_text(encoding="utf-8"))
QUIET = PAPER._replace(plant=plant.Parameters(noise=plant.Localisation(std=0.0)))


def text_of(title):
    [text] = re.findall(
        rf"^#### {re.escape(title)}$(.+?)(?=^#|\Z)", errata(), re.DOTALL | re.MULTILINE
    )
    return " ".join(text.split())


def test_gains_prints_the_lines_of_the_page(dist):
    lines = "\n".join(stated(theorem_of(loop_of(dist))))
    assert lines in gain_check(loop_of(dist))
    assert f"```text\n{lines}\n```" in PAGE.read_text(encoding="utf-8")


def test_every_point_of_the_page_names_the_tests_that_show_it():
    assert re.findall("^#### (.+)$", errata(), re.MULTILINE) == [*POINTS]
    for named in POINTS.values():
        assert named
        for file, test in (name.split("::") for name in named):
            text = (DOCS.parent / file).read_text(encoding="utf-8")
            assert f"\ndef {test}(" in text, test


def test_the_report_has_the_page_without_its_marks_and_without_links_out_of_it():
    assert "<!--" not in errata() + readings()
    links = re.findall(r"\]\(([^)]+)\)", errata() + readings())
    assert links and set(links) == {"#readings", "#what-is-wrong-in-the-paper"}


def test_v_rises_from_zero():
    """V of Fig. 4 without noise, on its reference, without the last term, which is not negative.

    With theta_0 = theta the last term is zero at first, whatever theta is.
    """
    there = QUIET.plant._replace(eta0=(0.0, 0.0, -2.0, 0.0, 0.0, 0.0))
    gains = Gains(theta_0=(100.0, 100.0, 100.0, 184.0))
    V = []
    for instant in closed_loop(50, QUIET._replace(plant=there, controller=gains)):
        _, dy_d, _ = instant.scene.reference
        _, dy_hat, e, z, *_ = instant.signals
        e_z = tuple(np.subtract(e, z))
        r = composite_errors(instant.scene.plant.dy, dy_d, dy_hat, e_z, z, gains.lambda_, gains.s)
        errors = Errors(e, z, *r)
        rotation = instant.vehicles.rotation
        V.append(lyapunov(Vehicle(), rotation, errors, gains.K2, gains.s, gains.ell))
    assert V[0] == 0.0 < min(V[1:])


def largest_drift(setting):
    """Largest |(v, w)| in the first 50 s [m/s]."""
    return max(np.hypot(*instant.scene.plant.nu[1:3]) for instant in closed_loop(2500, setting))


def test_sway_and_heave_depend_on_controller_and_start():
    text = text_of("Assumption 1 is about the closed loop")
    moving = QUIET.plant._replace(nu0=(2.5, 0.0, 0.0, 0.0, 0.0, 4.0))
    settings = (
        figure_5(Gains(eps_t=10.0)),
        figure_5(PdGains(eps_t=10.0)),
        QUIET._replace(plant=moving),
    )
    found = [f"{largest_drift(setting):.2f}" for setting in settings]
    assert all(tells(text, [drift]) for drift in found)


@given(limit=st.floats(100.0, 1e6))
def test_rho_hat_takes_the_command_beyond_any_limit(limit):
    """A metre from the reference, at rest, with a large theta_0."""
    gains = Gains(theta_0=(limit + 100.0, 0.0, 0.0, 0.0))
    here, there = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    measured = Measurement(here, there, there, there, there)
    state = output_feedback.initial_state(gains, here)
    assert abs(output_feedback.evaluate(gains, state, measured, 0.02).tau[0]) > limit


def test_the_helix_is_not_bounded():
    text = text_of("Assumption 4: the helix is not bounded")
    planner = motion_planner.Parameters()
    state = motion_planner.initial_state(planner.eta0, planner.nu0)
    found = []
    for k in range(50_001):
        moving = motion_planner.motion(planner.vehicle, state, planner.tau_d)
        if k in (0, 5_000, 50_000):
            found.append(f"{motion_planner.reference(state, moving, planner.ell).y_d[2]:.1f}")
        state = motion_planner.step(state, moving, PAPER.h)
    assert all(tells(text, [depth]) for depth in found)


def test_remark_5_in_figure_4():
    """Ratio of twice the rate of z to the estimate below (21) [%]."""
    text = text_of("(38) rests on an approximation")
    found = []
    for setting in (QUIET, PAPER):
        gains, shares = setting.controller, []
        for instant in closed_loop(2500, setting):
            _, dy_d, _ = instant.scene.reference
            _, dy_hat, e, z, *_ = instant.signals
            s_ez, s_z = np.tanh(np.subtract(e, z)), np.tanh(z)
            estimate = np.subtract(dy_hat, dy_d) + gains.lambda_ * (s_ez + s_z)
            dz = np.subtract(instant.scene.plant.dy, dy_hat)
            shares.append(200.0 * np.linalg.norm(dz) / np.linalg.norm(estimate))
        found.append((np.median(shares), max(shares)))
    (median, most), (noisy, _) = found
    assert median < 1.0
    assert tells(text, (1, f"{most:.0f}"), (f"{noisy:.0f}",))


def peak(lambda_, h=PAPER.h, gamma=1.0):
    """Largest surge command of Fig. 4 without noise [N], in the first seconds."""
    gains = Gains(lambda_=lambda_, gamma=gamma)
    setting = QUIET._replace(controller=gains, h=h, h_max=LongestSteps())
    return max(abs(instant.command[0]) for instant in closed_loop(round(4.0 / h), setting))


def test_30_costs_what_is_said():
    text = text_of("(30) and the limits (3) pull apart")
    settings = [(peak(2.1), 80), (peak(2.1, 0.002), 2), (peak(1.0), 1), (peak(2.1, gamma=0.01),)]
    assert tells(text, *((f"{found:.0f}", *beside) for found, *beside in settings))


def figure_5(controller):
    """Fig. 5 with a controller."""
    planner = motion_planner.Parameters(eta0=(0.0, 0.0, -30.0, 0.0, 0.0))
    return QUIET._replace(controller=controller, planner=planner)


def test_surge_efforts_cannot_be_smaller():
    text = text_of("4.2: surge efforts that are too small for L2 norms")
    least = []
    for controller in (Gains(eps_t=10.0), PdGains(eps_t=10.0)):
        impulse, square = 0.0, 0.0
        for instant in closed_loop(2500, figure_5(controller)):
            if np.linalg.norm(np.subtract(instant.scene.plant.y, instant.scene.reference.y_d)) <= 1:
                break
            impulse += PAPER.h * instant.tau[0]
            square += PAPER.h * instant.tau[0] ** 2
        assert tells(text, (f"{impulse:.0f}", f"{instant.t:.1f}"))
        least.append(impulse / np.sqrt(instant.t))
        assert least[-1] <= np.sqrt(square)
    assert tells(text, [f"{effort:.0f}" for effort in least])
    assert least[0] > EFFORT_PROPOSED[0] and least[1] > EFFORT_PD[0]
    # T_f at which the bound of the sum, least / sqrt(h T_f), equals the printed number.
    free = np.square(np.divide(least, (EFFORT_PROPOSED[0], EFFORT_PD[0]))) / PAPER.h
    assert tells(text, [f"{duration:.0f}" for duration in free])


def effort(controller, h):
    """L2 efforts of Fig. 5 after 60 s (reading 6)."""
    setting = figure_5(controller)._replace(h=h, h_max=LongestSteps())
    taus = np.array([instant.tau for instant in closed_loop(round(60.0 / h), setting)])[:-1]
    return np.sqrt(h * (taus**2).sum(axis=0))


def test_pd_efforts_belong_to_the_step():
    text = text_of("4.2: efforts that belong to the step of 20 ms")
    printed, half, quarter = (effort(PdGains(eps_t=10.0), h) for h in (0.02, 0.01, 0.005))
    assert tells(text, (f"{printed[1]:.0f}", 60, f"{half[1]:.0f}"))
    assert tells(text, [f"{effort[2]:.0f}" for effort in (printed, quarter)])
    printed, quarter = (effort(Gains(eps_t=10.0), h) for h in (0.02, 0.005))
    np.testing.assert_allclose(quarter, printed, rtol=0.04)


def test_the_circle_is_the_one_of_2():
    """v and u follow from r in the steady (2), which leaves a polynomial of fifth degree in r."""
    text = text_of("4.1: the quoted turning radius has the size of the diameter")
    m11, m22, d11, d22, d66 = 25.0, 17.5, 30.0, 30.0, 20.0
    inverse_of_u = np.array([m11 * m22 / d22, 0.0, d11]) / 80.0
    yaw = np.polymul([-d66, 80.0], np.polymul(inverse_of_u, inverse_of_u))
    roots = np.roots(np.polyadd(yaw, [-(m11 - m22) * m11 / d22, 0.0]))
    [r] = roots[np.abs(roots.imag) < 1e-9].real
    u = 1.0 / np.polyval(inverse_of_u, r)
    v = -m11 * u * r / d22
    rest = accelerations(Vehicle(), (u, v, 0.0, 0.0, r), 0.0, (80.0, 0.0, 80.0), (0.0,) * 5)
    assert rest == pytest.approx((0.0,) * 5, abs=1e-9)
    radius = np.hypot(u, v) / r
    assert all(tells(text, [f"{x:.3f}"]) for x in (r, radius, 2.0 * radius))
    assert round(2.0 * radius, 1) == TURNING_RADIUS


@given(st.lists(st.floats(-80.0, 80.0), min_size=1))
def test_59_cannot_exceed_the_limit(tau):
    assert np.sqrt(np.mean(np.square(tau))) <= 80.0 * (1.0 + 1e-12)
    assert max(EFFORT_PROPOSED) > 80.0 and min(EFFORT_PD) > 80.0


@given(st.lists(st.floats(-80.0, 80.0), min_size=1), st.floats(1e-3, 1.0))
def test_a_sum_without_the_step_is_the_norm_at_50_s(tau, h):
    """(59) with a sum in place of the integral, and no step in it."""
    duration = h * len(tau)
    coded = np.sqrt(np.sum(np.square(tau)) / duration)
    norm = np.sqrt(np.sum(h * np.square(tau)))
    assert sum_without_step(norm, duration, h) == pytest.approx(coded, rel=1e-9, abs=1e-150)
    assert sum_without_step(norm, 50.0, PAPER.h) == pytest.approx(norm)
    assert sum_without_step(norm, 50.1, PAPER.h) <= norm
