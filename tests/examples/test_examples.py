"""Each example of a component does what its page says, compared with something independent."""

from __future__ import annotations

import csv
from itertools import pairwise
from math import atan2, cos, exp, hypot, log, pi, sin, sqrt, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import bilinear, lfilter

from fmus.ports.port import Refusal
from fmus.trial import run
from support.examples import EXAMPLES, NAMES, load

REFERENCE = Path(__file__).parent / "reference"


def reference(name: str) -> dict[str, list[float]]:
    """Columns of a published result."""
    lines = (REFERENCE / f"{name}.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    return {column: [float(row[column]) for row in rows] for column in rows[0]}


def near(found: Any, expected: Any, *, atol: float = 0.0, rtol: float = 0.0) -> bool:
    """True if all numbers are within a tolerance of the expected ones."""
    return bool(np.allclose(found, expected, rtol, atol))


def solution(rate: Any, x0: Any, times: Any) -> Any:
    """States at times, by a much more exact integration than the tested one."""
    found = solve_ivp(rate, (times[0], times[-1]), x0, "DOP853", times, rtol=1e-11, atol=1e-12)
    return found.y


def held(A: Any, B: Any, x0: Any, u: Any, h: float, count: int) -> Any:
    """States of dx/dt = A x + B u, exactly, at the end of each of some steps with held inputs."""
    n = len(A)
    together = np.zeros((n + 1, n + 1))
    together[:n, :n], together[:n, n] = A, np.asarray(B) @ np.atleast_1d(u)
    step = expm(together * h)
    states = [np.append(x0, 1.0)]
    for _ in range(count):
        states.append(step @ states[-1])
    return np.array(states)[:, :n]


@pytest.mark.parametrize("name", NAMES)
def test_is_short_and_does_something_with_its_defaults(name: str) -> None:
    text = (EXAMPLES / name / f"{name}.py").read_text()
    assert len(text.splitlines()) < 110
    module = load(name)
    assert module.__doc__ and 8 <= len(module.__doc__.splitlines()) <= 25
    seen = run(module, stop_time=20.0, step=0.02)
    del seen["time"]
    # A component without a state is constant with constant inputs.
    moving = hasattr(module, "State")
    assert any(len(set(values)) > 1 for values in seen.values()) >= moving


# Models of the Reference FMUs: the published results, bit for bit, as they have the same rule and
# the same step.


def test_bouncing_ball_is_the_reference_fmu() -> None:
    published = reference("bouncing_ball")
    seen = run(load("bouncing_ball"), stop_time=3.0, step=0.01)
    assert seen["h"] == published["h"]
    assert seen["v"] == published["v"]


def test_bouncing_ball_bounces_at_the_times_of_the_solution() -> None:
    seen = run(load("bouncing_ball"), {"h_max": 1e-5}, stop_time=2.4, step=1e-4)
    # The times between bounces are a geometric series.
    fall, v = sqrt(2 / 9.81), sqrt(2 * 9.81)
    bounces = [
        t for t, a, b in zip(seen["time"][1:], seen["v"][:-1], seen["v"][1:], strict=True) if b > a
    ]
    expected = [fall + 2 * v / 9.81 * sum(0.7**k for k in range(1, n)) for n in range(1, 9)]
    # Each bounce is seen up to a step late, and Euler's rule makes each a little higher.
    assert near(bounces, expected, atol=1e-3)


def test_van_der_pol_is_the_reference_fmu() -> None:
    published = reference("van_der_pol")
    seen = run(load("van_der_pol"), stop_time=20.0, step=0.01)
    assert seen["x0"][::20] == published["x0"]
    assert seen["x1"][::20] == published["x1"]


def test_van_der_pol_approaches_the_solution_with_the_step() -> None:
    # The rule is of first order: the error falls with h_max.
    for h_max, error in ((1e-3, 0.03), (1e-4, 0.003)):
        seen = run(load("van_der_pol"), {"h_max": h_max}, stop_time=10.0, step=0.1)
        x = solution(lambda t, x: [x[1], (1 - x[0] ** 2) * x[1] - x[0]], [2.0, 0.0], seen["time"])
        assert near([seen["x0"], seen["x1"]], x, atol=error)


def test_dahlquist_is_the_reference_fmu() -> None:
    module = load("dahlquist")
    seen = run(module, stop_time=10.0, step=0.1)
    assert seen["x"] == reference("dahlquist")["x"]
    assert near(seen["exact"], np.exp(-np.array(seen["time"])), rtol=1e-14)
    assert max(map(abs, run(module, {"h_max": 1.5}, stop_time=150.0, step=1.5)["x"][50:])) < 1e-9
    assert max(map(abs, run(module, {"h_max": 2.5}, stop_time=150.0, step=2.5)["x"])) > 1e6


def test_stair_is_the_reference_fmu() -> None:
    module = load("stair")
    published = reference("stair")
    seen = run(module, stop_time=12.0, step=0.2)
    # The published run ends with the ninth second.
    assert seen["counter"][: len(published["counter"])] == published["counter"]
    assert set(seen["counter"][45:]) == {10}
    assert run(module, stop_time=12.0, step=3.0)["counter"] == [1, 4, 7, 10, 10]


def test_state_space_is_the_reference_fmu() -> None:
    published = reference("state_space")
    seen = run(load("state_space"), stop_time=10.0, step=1.0)
    for port in ("y[1]", "y[2]", "y[3]"):
        assert seen[port] == published[port]


def test_state_space_is_the_solution_of_any_system() -> None:
    A = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    given = {f"A[{i + 1},{j + 1}]": A[i][j] for i in range(3) for j in range(3)}
    seen = run(load("state_space"), {**given, "x0[1]": 2.0, "h_max": 1e-4}, stop_time=2.0, step=0.1)
    x = held(np.array(A), np.eye(3), [2.0, 0.0, 0.0], [1.0, 2.0, 3.0], 0.1, 20)
    y = np.transpose([seen["y[1]"], seen["y[2]"], seen["y[3]"]])
    # Euler's rule: half a step of the second derivative, which is up to 5.
    assert near(y, x + np.array([1.0, 2.0, 3.0]), atol=3e-4)


# Components of PythonFMU's examples: their formulas, evaluated here.


def test_resistor_has_the_values_of_pythonfmu() -> None:
    module = load("resistor")
    seen = run(module, stop_time=1.0, step=0.1)
    # The values that PythonFMU's component has before and after its first step.
    assert set(seen["positive_pin_i"]) == {0.001} == set(seen["i"])
    assert set(seen["negative_pin_i"]) == {-0.001}
    assert set(seen["delta_v"]) == {10.0}
    seen = run(module, {"R": 50.0}, lambda t: {"positive_pin_v": t}, stop_time=1.0, step=0.25)
    assert seen["i"] == [-0.2, -9.75 / 50, -9.5 / 50, -9.25 / 50, -0.18]


def test_step_response_has_the_values_of_pythonfmu() -> None:
    seen = run(load("step_response"), stop_time=10.0, step=0.1)
    expected = 22.0 * 5.0 * -np.expm1(-np.array(seen["time"]) / 2.0)
    assert near(seen["realOut"], expected, rtol=1e-13, atol=1e-13)
    assert seen["realOut"][20] == pytest.approx(110 * 0.632, rel=1e-3)
    assert seen["realOut"][60] == pytest.approx(110 * 0.950, rel=1e-3)


def test_sine_network_is_near_the_sine_where_it_was_trained() -> None:
    module = load("sine_network")
    seen = run(module, {}, lambda t: {"sin_input": t - 10.0}, stop_time=20.0, step=0.01)
    x = np.array(seen["time"]) - 10.0
    network, exact = np.array(seen["sin_output_tf"]), np.sin(x)
    assert near(seen["sin_output_ref"], exact, atol=1e-15)
    expected = np.array(module.W3) @ np.tanh(np.array(module.W2) @ np.tanh(np.outer(module.W1, x)))
    assert near(network, expected, atol=1e-12)
    assert np.abs(network - exact)[np.abs(x) <= 2 * pi].max() < 0.005


# Filters and observers.


def test_kalman_filter_has_the_gain_of_the_riccati_equation() -> None:
    h, q, r = 0.1, 0.1, 0.5
    seen = run(load("kalman_filter"), stop_time=60.0, step=h)
    F, H = np.array([[1.0, h], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    Q = q * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])
    before = solve_discrete_are(F.T, H.T, Q, [[r * r]])
    after = np.linalg.inv(np.linalg.inv(before) + H.T @ H / r**2)
    assert seen["std_p"][-1] == pytest.approx(sqrt(after[0, 0]), rel=1e-9)
    assert seen["std_v"][-1] == pytest.approx(sqrt(after[1, 1]), rel=1e-9)
    assert seen["p"][-1] == pytest.approx(1.0, abs=1e-6)


def test_kalman_filter_is_least_squares_over_all_measurements() -> None:
    h, count, q, r, std = 0.2, 15, 0.3, 0.5, (2.0, 1.5)
    rng = np.random.default_rng(1)
    z = rng.normal(size=count + 1)
    given = {"q": q, "r": r, "p0": 0.4, "v0": -0.2, "std_p0": std[0], "std_v0": std[1]}
    seen = run(
        load("kalman_filter"),
        given,
        lambda t: {"z": float(z[round(t / h)])},
        stop_time=count * h,
        step=h,
    )
    # All states are unknown; start, motion and measurements are equations with their weights.
    F = np.array([[1.0, h], [0.0, 1.0]])
    root = np.linalg.inv(np.linalg.cholesky(q * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])))
    rows, right = np.zeros((3 + 3 * count, 2 * count + 2)), np.zeros(3 + 3 * count)
    rows[:2, :2], right[:2] = np.diag([1 / std[0], 1 / std[1]]), [0.4 / std[0], -0.2 / std[1]]
    rows[2, 0], right[2] = 1 / r, z[0] / r
    for k in range(count):
        here = slice(3 + 3 * k, 5 + 3 * k)
        rows[here, 2 * k : 2 * k + 2], rows[here, 2 * k + 2 : 2 * k + 4] = -root @ F, root
        rows[5 + 3 * k, 2 * k + 2], right[5 + 3 * k] = 1 / r, z[k + 1] / r
    found = np.linalg.lstsq(rows, right, rcond=None)[0]
    assert [seen["p"][-1], seen["v"][-1]] == pytest.approx(found[-2:], abs=1e-9)


@pytest.mark.parametrize("r", [1e-9, 0.5, 1e3])
def test_kalman_filter_keeps_its_covariance_positive(r: float) -> None:
    """Also for a target that does not manoeuvre, measured nearly without error."""
    seen = run(load("kalman_filter"), {"q": 0.0, "r": r}, stop_time=100.0, step=0.1)
    assert min(seen["std_p"]) > 0.0 and min(seen["std_v"]) > 0.0


def _radar(x: Any) -> Any:
    return np.array([np.sqrt(x[0] ** 2 + x[1] ** 2), np.arctan2(x[1], x[0])])


def test_extended_kalman_filter_is_the_textbook_filter() -> None:
    h, count, q, R = 0.5, 80, 1.0, np.diag([10.0**2, 0.01**2])
    rng = np.random.default_rng(2)
    # The track crosses the half-line on which the bearing jumps.
    truth = [np.array([-800.0 + 5 * k * h, 300.0 - 20 * k * h]) for k in range(count)]
    z = [_radar(p) + rng.normal(size=2) * [10.0, 0.01] for p in truth]
    seen = run(
        load("extended_kalman_filter"),
        {"position0.x": -700.0, "position0.y": 200.0},
        lambda t: dict(zip(("range", "bearing"), map(float, z[round(t / h)]), strict=True)),
        stop_time=(count - 1) * h,
        step=h,
    )
    # Slopes by central differences.
    F = np.kron([[1.0, h], [0.0, 1.0]], np.eye(2))
    Q = q * np.kron([[h**3 / 3, h**2 / 2], [h**2 / 2, h]], np.eye(2))
    x, P = np.array([-700.0, 200.0, 0.0, 0.0]), np.diag([200.0, 200.0, 10.0, 10.0]) ** 2
    for k in range(count):
        if k:
            x, P = F @ x, F @ P @ F.T + Q
        H = np.zeros((2, 4))
        for j in range(2):
            off = 1e-4 * (np.arange(4) == j)
            H[:, j] = (_radar(x + off) - _radar(x - off)) / 2e-4
        e = z[k] - _radar(x)
        e[1] = (e[1] + pi) % (2 * pi) - pi
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ e, (np.eye(4) - K @ H) @ P
    last = [seen[port][-1] for port in ("position.x", "position.y", "velocity.x", "velocity.y")]
    # As exact as the differences are.
    assert last == pytest.approx(x, rel=1e-6, abs=1e-5)
    assert hypot(last[0] - truth[-1][0], last[1] - truth[-1][1]) < 30.0
    assert last[2:] == pytest.approx([5.0, -20.0], abs=3.0)
    with pytest.raises(Refusal, match="too near"):
        run(
            load("extended_kalman_filter"),
            {"position0.x": 0.0, "position0.y": 0.0},
            stop_time=1.0,
            step=1.0,
        )


def test_luenberger_observer_forgets_its_error_as_wanted() -> None:
    seen = run(load("luenberger_observer"), {"h_max": 0.002}, stop_time=2.0, step=0.02)
    m, d, k, omega, zeta = 1.0, 0.5, 20.0, 15.0, 0.7
    # The gains by placing the poles, which is solved here for its coefficients.
    A, C = np.array([[0.0, 1.0], [-k / m, -d / m]]), np.array([[1.0, 0.0]])
    wanted = np.roots([1.0, 2 * zeta * omega, omega**2])
    L = np.array([2 * zeta * omega - d / m, 0.0])
    L[1] = omega**2 - k / m - d / m * L[0]
    assert near(np.sort(np.linalg.eigvals(A - np.outer(L, C))), np.sort(wanted), rtol=1e-12)
    x = held(A - np.outer(L, C), np.column_stack([[0.0, 1.0], L]), [0, 0], [2.0, 0.1], 0.02, 100)
    # Runge-Kutta of fourth order: a relative error of (omega h)^4.
    assert near(np.transpose([seen["p"], seen["v"]]), x, atol=1e-8)
    assert seen["p"][-1] == pytest.approx(0.1, abs=1e-6)


def test_complementary_filter_is_its_equation() -> None:
    module = load("complementary_filter")
    seen = run(module, stop_time=30.0, step=0.1)
    t = np.array(seen["time"])
    assert near(seen["angle"], 0.04 * -np.expm1(-t / 2.0), atol=1e-14)
    assert near(seen["gyro_angle"], 0.02 * t, atol=1e-14)
    # A consistent motion passes unchanged, also through the point where the angle jumps.
    turning = run(
        module,
        {"angle0": 0.05},
        lambda t: {
            "gyro": 1.0,
            "a_x": -9.81 * sin(t + 0.05),
            "a_z": 9.81 * cos(t + 0.05),
        },
        stop_time=10.0,
        step=0.01,
    )
    assert near(turning["angle"], np.array(turning["time"]) + 0.05, atol=0.006)


def test_notch_filter_is_scipys() -> None:
    module, h = load("notch_filter"), 0.01
    u = np.random.default_rng(3).normal(size=501)
    own = {"T": h}
    seen = run(module, own, lambda t: {"u": float(u[round(t / h)])}, stop_time=500 * h, step=h)
    # A notch without frequency scale, at the frequency that the transformation moves to 2 Hz.
    w = 2 / h * tan(2 * pi * 2.0 * h / 2)
    b, a = bilinear([1.0, 0.0, w * w], [1.0, w / 5.0, w * w], fs=1 / h)
    assert near(seen["y"], lfilter(b, a, u), atol=1e-12)
    hum = run(module, own, lambda t: {"u": sin(4 * pi * t)}, stop_time=20.0, step=h)
    assert max(map(abs, hum["y"][-100:])) < 1e-4
    assert run(module, own, stop_time=20.0, step=h)["y"][-1] == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(Refusal, match="two samples"):
        run(module, {"T": 0.25}, stop_time=1.0, step=0.25)


def test_lag_with_delay_is_its_solution_with_noise() -> None:
    module = load("lag_with_delay")
    for step in (0.01, 0.04, 0.1):
        seen = run(module, stop_time=20.0, step=step)
        t = np.array(seen["time"])
        x = np.array(seen["x"])

        def exact(since: Any) -> Any:
            return 20.0 + 60.0 * -np.expm1(-np.maximum(since, 0.0) / 3.0)

        # The input comes out of the line within a cell, or a step if that is longer.
        late = max(0.04, step)
        assert np.all(exact(t - 2.0 - late) - 1e-9 <= x)
        assert np.all(x <= exact(t - 2.0 + late) + 1e-9)
        assert np.all(x[t <= 2.0] == 20.0)
    noise = np.array(seen["y"]) - x
    assert noise[1:].std() == pytest.approx(0.2, rel=0.15)
    assert run(module, stop_time=20.0, step=0.1) == seen
    assert run(module, {"seed": 2}, stop_time=20.0, step=0.1)["y"] != seen["y"]
    assert run(module, {"std": 0.0}, stop_time=20.0, step=0.1)["y"] == seen["x"]


# Controllers.


def test_pid_is_its_equations() -> None:
    module, h = load("pid"), 0.01
    wide = {"u_min": -1e9, "u_max": 1e9}
    # A constant error: the proportional part, and an integral that grows evenly.
    seen = run(module, {**wide, "b": 0.5}, stop_time=2.0, step=h)
    assert near(seen["u"], 2.0 * 0.5 + 2.0 * np.array(seen["time"]), atol=1e-12)
    # The filtered derivative, by the backward rule s = (1 - 1/z) / h in its transfer function.
    y = np.cumsum(np.random.default_rng(4).normal(size=301))
    seen = run(module, wide, lambda t: {"y": float(y[round(t / h)])}, stop_time=3.0, step=h)
    b, a = np.array([1.0, -1.0]) / h * -2.0 * 0.1, np.array([1.0, 0.0])
    a = a + 0.1 / 10.0 * np.array([1.0, -1.0]) / h
    # It rests at its first input.
    assert near(seen["derivative"], lfilter(b, a, y - y[0]), atol=1e-9)
    # Without a derivative time, whatever it measures.
    seen = run(module, {**wide, "Td": 0.0}, lambda t: {"y": sin(t)}, stop_time=1.0, step=h)
    assert set(seen["derivative"]) == {0.0}


def test_pid_does_not_wind_up() -> None:
    module = load("pid")
    seen = run(module, {"u_max": 3.0}, stop_time=50.0, step=0.01)
    assert max(seen["u"]) == 3.0
    # At rest K/Ti e + (u_max - v)/Tt = 0, and v = K e + I.
    assert seen["integral"][-1] == pytest.approx(3.0 + 2.0 * 0.5 - 2.0, abs=1e-9)

    def back(t: float) -> dict[str, float]:
        return {"r": 1.0 if t < 40.0 else -1.0}

    seen = run(module, {"u_max": 3.0, "Td": 0.0}, back, stop_time=50.0, step=0.01)
    first = next(t for t, u in zip(seen["time"], seen["u"], strict=True) if t > 39.0 and u < 3.0)
    assert first == pytest.approx(40.0)
    with pytest.raises(Refusal, match="below"):
        run(module, {"u_max": -6.0}, stop_time=1.0, step=0.1)


@pytest.mark.parametrize("r", [1e-4, 0.01, 10.0])
def test_lqr_has_the_gain_of_scipy(r: float) -> None:
    seen = run(load("lqr"), {"r": r}, stop_time=0.1, step=0.05)
    T, m = 0.05, 2.0
    A, B = np.array([[1.0, T], [0.0, 1.0]]), np.array([[T * T / (2 * m)], [T / m]])
    P = solve_discrete_are(A, B, np.diag([1.0, 0.1]), [[r]])
    K = np.linalg.solve(r + B.T @ P @ B, B.T @ P @ A)[0]
    assert [seen["K_p"][0], seen["K_v"][0]] == pytest.approx(K, rel=1e-8)
    assert seen["u"][0] == pytest.approx(-K[0], rel=1e-8)
    assert 0 < seen["rounds"][0] < 10_000


def test_lqr_of_a_cart_that_costs_nothing_does_nothing() -> None:
    seen = run(load("lqr"), {"q_p": 0.0, "q_v": 0.0}, stop_time=0.1, step=0.05)
    assert set(seen["u"]) == {0.0} and set(seen["rounds"]) == {1}


def test_state_machine_keeps_its_times() -> None:
    module = load("state_machine")
    seen = run(module, stop_time=100.0, step=0.1)
    for t, mode, walk, cycles in zip(
        *(seen[k] for k in ("time", "mode", "walk", "cycles")), strict=True
    ):
        past = (t + 1e-6) % 22.0
        assert mode == sum(past >= end for end in (10.0, 13.0, 21.0)), t
        assert walk == (mode == module.Mode.RED)
        assert cycles == int((t + 1e-6) // 22.0)
    # The button is never pressed; then one short press at 30 s is enough, for one cycle.
    waiting = run(module, {}, lambda t: {"button": 30.0 <= t < 30.05}, stop_time=80.0, step=0.1)
    changes = [
        (round(t, 1), int(b))
        for t, a, b in zip(
            waiting["time"][1:], waiting["mode"][:-1], waiting["mode"][1:], strict=True
        )
        if a != b
    ]
    assert changes == [(30.1, 1), (33.0, 2), (41.0, 3), (42.0, 0)]
    seen = run(module, {"first": module.Mode.RED}, stop_time=8.0, step=0.1)
    assert seen["mode"][0] == 2 and seen["mode"][-1] == 3


def test_waypoint_guidance_visits_all_waypoints() -> None:
    module = load("waypoint_guidance")
    seen = run(module, {"h_max": 0.1}, stop_time=100.0, step=0.1)
    x, y = np.array(seen["position.x"]), np.array(seen["position.y"])
    for a, b in ((20, 0), (20, 20), (0, 20), (0, 0)):
        assert np.hypot(x - a, y - b).min() < 1.6
    assert seen["waypoint"] == sorted(seen["waypoint"]) and set(seen["waypoint"]) == {2, 3, 4, 5}
    arrived = seen["arrived"].index(True)
    assert 70.0 < seen["time"][arrived] < 80.0
    assert set(x[arrived:]) == {x[arrived]}


def test_waypoint_guidance_is_the_solution_on_a_leg() -> None:
    module, h = load("waypoint_guidance"), 0.1
    # The first leg leads straight up: the robot must turn into it.
    given = {"path[2,1]": 0.0, "path[2,2]": 20.0, "path[3,1]": -20.0}
    seen = run(module, {**given, "h_max": 1e-3}, stop_time=15.0, step=h)

    def rate(t: float, x: Any) -> list[float]:
        turn = pi / 2 + atan2(x[0], 2.0) - x[2]
        return [cos(x[2]), sin(x[2]), min(max(2.0 * turn, -1.0), 1.0)]

    x = solution(rate, [0.0, 0.0, 0.0], seen["time"])
    assert near([seen["position.x"], seen["position.y"]], x[:2], atol=1e-3)
    with pytest.raises(Refusal, match="waypoints 1 and 2"):
        run(module, {"path[2,1]": 0.0}, stop_time=1.0, step=0.1)


# Plants.


def test_rate_limiter_has_a_rate_and_a_gap() -> None:
    module, h = load("rate_limiter"), 0.01
    seen = run(module, stop_time=4.0, step=h)
    t = np.array(seen["time"])
    assert near(seen["x"], np.minimum(0.5 * t, 1.0), atol=1e-12)
    assert near(seen["y"], np.clip(0.5 * t - 0.05, 0.0, 0.95), atol=1e-12)
    # A slow sine: the output turns a gap later, and rests in between.
    sine = run(module, {"width": 0.4}, lambda t: {"u": sin(0.2 * t)}, stop_time=100.0, step=h)
    y = np.array(sine["y"])
    assert y[2000:].max() == pytest.approx(0.8, abs=1e-5)
    assert y[2000:].min() == pytest.approx(-0.8, abs=1e-5)
    assert np.abs(np.array(sine["x"]) - y).max() <= 0.2 + 1e-12
    resting = np.mean(np.diff(y[2000:]) == 0.0)
    # From 1 down to 0.6 and from -1 up to -0.6: acos(0.6) of each half turn.
    assert resting == pytest.approx(np.arccos(0.6) / pi, abs=0.02)
    fast = run(module, {"width": 0.0}, lambda t: {"u": 9 * sin(9 * t)}, stop_time=9.0, step=h)
    assert np.abs(np.diff(fast["y"])).max() <= 0.5 * h + 1e-12


def test_engine_map_is_interpolated_and_integrated() -> None:
    module = load("engine_map")
    table = RegularGridInterpolator((module.THROTTLES, module.SPEEDS), np.array(module.TORQUES))
    points = np.random.default_rng(5).uniform((0.0, 0.0), (1.0, 600.0), (50, 2))
    throttles = [float(throttle) for throttle, _ in points]
    for k, (throttle, speed) in enumerate(points):
        seen = run(
            module,
            {"speed0": float(speed)},
            lambda t: {"throttle": throttles[k]},  # noqa: B023
            stop_time=0.0,
            step=1.0,
        )
        assert seen["torque"][0] == pytest.approx(table((throttle, speed)), abs=1e-10)
        assert seen["power"][0] == seen["torque"][0] * speed
    seen = run(module, {"h_max": 1e-3}, stop_time=8.0, step=0.1)
    speed = solution(lambda t, w: (table((0.4, w[0])) - 60.0) / 0.2, [80.0], seen["time"])[0]
    # Euler's rule: half a step times the second derivative, at most.
    assert near(seen["speed"], speed, atol=0.05)
    assert table((0.4, seen["speed"][-1])) == pytest.approx(60.0, abs=0.1)
    stalled = run(module, {}, lambda t: {"load": 150.0}, stop_time=8.0, step=0.1)
    assert stalled["stalled"][-1] and stalled["speed"][-1] == 0.0


def test_dc_motor_is_the_exact_solution() -> None:
    seen = run(load("dc_motor"), {}, lambda t: {"load": 0.2}, stop_time=3.0, step=0.05)
    R, L, k, J, b = 1.5, 0.12, 0.1, 0.005, 0.0005
    A = np.array([[-R / L, -k / L, 0.0], [k / J, -b / J, 0.0], [0.0, 1.0, 0.0]])
    B = np.array([[1 / L, 0.0], [0.0, -1 / J], [0.0, 0.0]])
    x = held(A, B, [0.0, 0.0, 0.0], [12.0, 0.2], 0.05, 60)
    # Runge-Kutta of fourth order with 17 ms, and a time constant of 80 ms: about (17/80)^4 / 120.
    assert near(np.transpose([seen["i"], seen["speed"], seen["angle"]]), x, atol=2e-4)
    free = run(load("dc_motor"), stop_time=10.0, step=0.1)
    assert free["speed"][-1] == pytest.approx(12.0 * k / (R * b + k * k), rel=1e-6)


def test_quarter_car_is_the_exact_solution() -> None:
    seen = run(load("quarter_car"), {"h_max": 1e-3}, stop_time=2.0, step=0.01)
    m1, m2, k, d, tyre = 300.0, 40.0, 18000.0, 1200.0, 180000.0
    M, S = np.diag([m1, m2]), np.array([[k, -k], [-k, k + tyre]])
    D = d * np.array([[1.0, -1.0], [-1.0, 1.0]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, S), -np.linalg.solve(M, D)]])
    x = held(A, [[0.0], [0.0], [0.0], [tyre / m2]], [0.0] * 4, 0.05, 0.01, 200)
    # The trapezoidal rule: (h w)^2 / 12 a radian of the wheel's motion, with w = 70 rad/s.
    assert near(np.transpose([seen["body"], seen["wheel"]]), x[:, :2], atol=1e-4)
    assert near(seen["acceleration"], (A @ x.T)[2], atol=0.03)
    assert near(seen["tyre_force"], tyre * (0.05 - x[:, 1]), atol=15.0)
    # Stable with steps that are longer than any time constant.
    assert run(load("quarter_car"), {"h_max": 0.5}, stop_time=50.0, step=0.5)["body"][-1] == (
        pytest.approx(0.05, abs=1e-3)
    )


def test_water_tank_empties_as_torricelli_says() -> None:
    module = load("water_tank")
    seen = run(module, {}, lambda t: {"inflow": 0.0}, stop_time=150.0, step=0.5)
    t = np.array(seen["time"])
    exact = np.maximum(sqrt(0.2) - 0.001 / 0.5 * sqrt(9.81 / 2) * t, 0.0) ** 2
    # Euler's rule with 20 ms: half a step of the rate of the outflow.
    assert near(seen["level"], exact, atol=2e-5)
    assert seen["level"][-1] < 1e-8
    filled = run(module, {"h_max": 1.0}, stop_time=3000.0, step=1.0)
    assert filled["level"][-1] == pytest.approx(3.16**2 / (2 * 9.81), rel=1e-4)
    assert not any(filled["overflows"])
    over = run(module, {}, lambda t: {"inflow": 0.008}, stop_time=300.0, step=1.0)
    assert over["overflows"][-1] and over["level"][-1] == 1.0
    assert over["outflow"][-1] == pytest.approx(0.001 * sqrt(2 * 9.81))


def test_cart_pendulum_is_the_solution_and_keeps_its_energy() -> None:
    module = load("cart_pendulum")
    seen = run(module, {"h_max": 0.005}, stop_time=10.0, step=0.02)
    assert np.ptp(seen["energy"]) < 1e-6
    assert seen["energy"][0] == pytest.approx(0.2 * 9.81 * 0.5 * cos(0.1))
    # Without a force the centre of mass stays where it is.
    p, angle = np.array(seen["p"]), np.array(seen["angle"])
    assert near(1.2 * p + 0.2 * 0.5 * np.sin(angle), 0.1 * sin(0.1), atol=1e-8)
    pushed = run(module, {"c": 0.3, "h_max": 0.005}, lambda t: {"u": 1.5}, stop_time=3.0, step=0.02)

    def rate(t: float, x: Any) -> list[float]:
        # Solved for the accelerations by hand.
        s, c, w = sin(x[1]), cos(x[1]), x[3]
        force = 1.5 - 0.3 * x[2] + 0.2 * 0.5 * s * w * w
        p = (force - 0.2 * 9.81 * s * c) / (1.0 + 0.2 * s * s)
        return [x[2], w, p, (9.81 * s - p * c) / 0.5]

    x = solution(rate, [0.0, 0.1, 0.0, 0.0], pushed["time"])
    found = [pushed[port] for port in ("p", "angle", "v", "rate")]
    # Runge-Kutta of fourth order: h^4 times what its fast swings amplify.
    assert near(found, x, atol=3e-7)


def test_thermostat_circles_with_the_period_of_the_solution() -> None:
    module, step = load("thermostat"), 1.0
    seen = run(module, stop_time=6 * 3600.0, step=step)
    upper, lower, tau, outdoor, hot = 20.5, 19.5, 5e5 / 50.0, 5.0, 45.0
    cooling = tau * log((upper - outdoor) / (lower - outdoor))
    heating = tau * log((hot - lower) / (hot - upper))
    changes = np.diff(seen["switched"])
    times = [t for t, change in zip(seen["time"][1:], changes, strict=True) if change]
    # Each switch is up to a step late, and starts the next from as much beyond the band.
    assert times[0] == pytest.approx(tau * log((hot - 15.0) / (hot - upper)), abs=step)
    lengths = [b - a for a, b in pairwise(times)]
    assert lengths[0::2] == pytest.approx([cooling] * len(lengths[0::2]), abs=4 * step)
    assert lengths[1::2] == pytest.approx([heating] * len(lengths[1::2]), abs=4 * step)
    assert lower - 0.01 < min(seen["temperature"][2400:]) < max(seen["temperature"]) < upper + 0.01
    assert seen["switched"][-1] == len(times)
    off = run(module, {"mode0": module.Mode.OFF}, stop_time=10.0, step=10.0)
    assert off["heating"] == [False, True] and off["switched"][-1] == 1


def test_battery_is_its_circuit() -> None:
    module = load("battery")

    def pulses(t: float) -> dict[str, float]:
        return {"demand": 5.0 if t % 600.0 < 300.0 else -1.0}

    seen = run(module, {"charge0": 0.9}, pulses, stop_time=3600.0, step=10.0)
    charge, fast, slow = 0.9, 0.0, 0.0
    for k, t in enumerate(seen["time"]):
        if k:
            i = pulses(t - 10.0)["demand"]
            charge -= i * 10.0 / 9000.0
            fast = fast * exp(-10.0 / 15.0) + 0.015 * i * (1 - exp(-10.0 / 15.0))
            slow = slow * exp(-10.0 / 200.0) + 0.01 * i * (1 - exp(-10.0 / 200.0))
        source = np.interp(charge, module.CHARGES, module.SOURCE)
        assert seen["charge"][k] == pytest.approx(charge, abs=1e-12)
        assert seen["voltage"][k] == pytest.approx(
            source - 0.03 * pulses(t)["demand"] - fast - slow, abs=1e-12
        )
    flat = run(module, stop_time=3 * 3600.0, step=10.0)
    assert flat["time"][flat["empty"].index(True)] == pytest.approx(7200.0, abs=10.0)
    assert flat["i"][-1] == 0.0 and flat["charge"][-1] == 0.0
    assert flat["voltage"][-1] == pytest.approx(2.9)
    full = run(module, {}, lambda t: {"demand": -1.0}, stop_time=60.0, step=10.0)
    assert set(full["i"]) == {0.0} and set(full["charge"]) == {1.0}
