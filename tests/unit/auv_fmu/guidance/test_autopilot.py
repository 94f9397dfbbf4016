"""Autopilots: their poles, a published law, limits and angles."""

from __future__ import annotations

import csv
from math import cos, inf, pi, sin, tan
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from auv_fmu.guidance import autopilot
from auv_fmu.guidance.autopilot import (
    Desired,
    DesiredMotion,
    Inputs,
    Measured,
    MeasuredMotion,
    Model,
    Parameters,
    Poles,
    State,
    Vertical,
    evaluate,
    of_angle,
)
from auv_fmu.paper.actuators import Limits

AT_REST = State(0.0, 0.0, 0.0, 0.0)
HERE, STILL = Desired(0.0, 0.0, 0.0), DesiredMotion(0.0, 0.0, 0.0)
NO_LIMITS = Limits((-inf,) * 3, (inf,) * 3)
MODEL = Model(d11_quadratic=6.0)
PITCH = Parameters(MODEL, vertical=Vertical.PITCH, limits=NO_LIMITS)


def inputs(z=0.0, theta=0.0, psi=0.0, u=0.0, q=0.0, r=0.0, to=HERE, moving=STILL) -> Inputs:
    """Measured values, and desired ones."""
    return Inputs(Measured(z, theta, psi), MeasuredMotion(u, q, r), to, moving)


def test_law_agrees_with_python_vehicle_simulator():
    """`PIDpolePlacement`, whose integral gain has m wn^2 - k where this one has m wn^2."""
    with (Path(__file__).parent / "mss" / "pid.csv").open(encoding="utf-8") as file:
        rows = [{name: float(x) for name, x in row.items()} for row in csv.DictReader(file)]
    assert len(rows) == 40
    for row in rows:
        gains = of_angle(row["m"], row["d"], row["k"], Poles(row["wn"], row["zeta"]))
        u = -gains.p * row["e_x"] - gains.d * row["e_v"] - gains.i * row["e_int"]
        expected = row["u"] - 0.1 * row["wn"] * row["k"] * row["e_int"]
        assert u == pytest.approx(expected, rel=1e-12, abs=1e-12)


def closed_loop(rates, n: int) -> np.ndarray:
    """Characteristic polynomial of rates at rest, by central differences."""
    small = 1e-6
    columns = [(np.array(rates(small * e)) - rates(-small * e)) / (2 * small) for e in np.eye(n)]
    return np.poly(np.transpose(columns))


def of_design(omega: float, zeta: float, share: float) -> list[float]:
    cubic = [1.0, 2.0 * zeta * omega, omega**2, share * omega**3]
    return cubic if share else cubic[:3]


@pytest.mark.parametrize("poles", [Poles(0.5, 1.0), Poles(2.0, 0.7)])
def test_heading_and_pitch_have_the_poles_of_the_design(poles: Poles):
    """The linear model of each, closed by its law."""
    parameters = PITCH._replace(heading=poles, pitch=poles)

    def heading(x):
        psi, r, integral = x
        found = evaluate(parameters, AT_REST._replace(psi=integral), inputs(psi=psi, r=r))
        return r, (found.tau[2] - MODEL.d66 * r) / MODEL.m66, found.rates.psi

    def pitch(x):
        theta, q, integral = x
        found = evaluate(parameters, AT_REST._replace(theta=integral), inputs(theta=theta, q=q))
        moment = found.tau[1] - MODEL.d55 * q - MODEL.righting_pitch * sin(theta)
        return q, moment / MODEL.m55, found.rates.theta

    for rates in (heading, pitch):
        expected = of_design(*poles, share=0.1)
        np.testing.assert_allclose(closed_loop(rates, 3), expected, rtol=1e-6)


def test_speed_and_depth_have_the_poles_of_the_design():
    """The speed near the desired one, and the depth with a pitch that is there at once."""
    poles, u_d = Poles(0.4, 0.8), 1.5
    parameters = Parameters(MODEL, poles, poles, theta_max=1.4, limits=NO_LIMITS)
    moving = DesiredMotion(u_d, 0.0, 0.0)

    def speed(x):
        faster, integral = x
        u = u_d + faster
        found = evaluate(parameters, AT_REST._replace(u=integral), inputs(u=u, moving=moving))
        drag = (MODEL.d11 + MODEL.d11_quadratic * abs(u)) * u
        return (found.tau[0] - drag) / MODEL.m11, found.rates.u

    def depth(x):
        z, integral = x
        found = evaluate(parameters, AT_REST._replace(z=integral), inputs(z=z, moving=moving))
        return -u_d * tan(found.theta_c), found.rates.z

    for rates in (speed, depth):
        expected = of_design(*poles, share=0.0)
        np.testing.assert_allclose(closed_loop(rates, 2), expected, rtol=1e-6)


def test_speed_holds_without_integral():
    """The drag of the desired speed is known."""
    moving = DesiredMotion(1.5, 0.0, 0.0)
    tau = evaluate(PITCH, AT_REST, inputs(u=1.5, moving=moving)).tau
    assert tau[0] == pytest.approx((MODEL.d11 + 6.0 * 1.5) * 1.5)


def test_turn_at_the_desired_rate_needs_no_error():
    moving, to = DesiredMotion(0.0, 0.1, -0.2), Desired(0.0, 0.2, 1.0)
    tau = evaluate(PITCH, AT_REST, inputs(0.0, 0.2, 1.0, 0.0, 0.1, -0.2, to, moving)).tau
    assert tau[1] == pytest.approx(MODEL.d55 * 0.1 + MODEL.righting_pitch * sin(0.2))
    assert tau[2] == pytest.approx(-MODEL.d66 * 0.2)


@pytest.mark.parametrize("turns", [-3, 0, 5])
def test_heading_takes_the_shorter_way(turns: int):
    """Also to a desired heading of several turns."""
    to = Desired(0.0, 0.0, 3.0 + 2.0 * pi * turns)
    found = evaluate(PITCH, AT_REST, inputs(psi=-3.0, to=to))
    assert found.rates.psi == pytest.approx(2.0 * pi - 6.0)
    assert found.tau[2] < 0.0


def test_integrals_rest_beyond_the_limits():
    """And run where the error leads back."""
    parameters = PITCH._replace(limits=Limits((-1.0,) * 3, (1.0,) * 3))
    far = evaluate(parameters, AT_REST, inputs(theta=-1.0, psi=-1.0, u=-1.0))
    assert min(far.tau) > 1.0
    assert far.rates == AT_REST
    back = evaluate(parameters, State(-100.0, 0.0, -100.0, -100.0), inputs(0.0, 0.1, 0.1, 0.1))
    assert min(back.tau) > 1.0
    assert back.rates == pytest.approx((0.1, 0.0, 0.1, 0.1))


def test_depth_asks_for_at_most_the_largest_pitch():
    moving = DesiredMotion(1.0, 0.0, 0.0)
    found = evaluate(Parameters(), AT_REST, inputs(z=-50.0, moving=moving))
    assert (found.theta_c, found.rates.z) == (-0.5, 0.0)
    astern = evaluate(Parameters(), AT_REST, inputs(moving=DesiredMotion(-1.0, 0.0, 0.0)))
    assert astern.theta_c == 0.0


def test_step_of_the_heading_follows_the_linear_design():
    """In steps of 20 ms by Euler's scheme, against the exact solution of its poles."""
    parameters, h = PITCH._replace(heading=Poles(1.0, 1.0)), 0.02
    psi, r, state, found = 0.5, 0.0, AT_REST, []
    for _ in range(500):
        signals = evaluate(parameters, state, inputs(psi=psi, r=r))
        found.append(psi)
        state = autopilot.step(state, signals.rates, h)
        faster = (signals.tau[2] - MODEL.d66 * r) / MODEL.m66
        psi, r = psi + h * r, r + h * faster
    exact = solve_ivp(
        lambda _, x: [x[1], -2.0 * x[1] - x[0] - 0.1 * x[2], x[0]],
        (0.0, 10.0), [0.5, 0.0, 0.0], t_eval=np.arange(500) * h, rtol=1e-9,
    )  # fmt: skip
    np.testing.assert_allclose(found, exact.y[0], atol=0.006)
    assert cos(found[-1]) > 0.99
