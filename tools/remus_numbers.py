"""The numbers that docs/explanation/remus.md says of runs: `python tools/remus_numbers.py`.

Each line is a change of the scenarios `remus` and `remus-pd`. For both controllers it has the
largest error in the first 40 s and from 120 s on [m], the largest part of the latter across the
path [m], the share of steps in which a fin is at its limit, in pitch and yaw [%], the largest
command in yaw [N.m], and the mean rate of the rudder [degrees/s]. Lines after these have the error
after the end of the path, and steady turns with full rudder.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np

from auv_fmu.remus.hull import inertia
from auv_fmu.remus.remus100 import Parameters, RemusState, accelerations, tail_forces
from orchestrator import simulate
from orchestrator.vehicle.signals import AllocatedLoop, tracking_error

_NONE = (0.0, 0.0, 0.0)

#: Everything that knows how far ahead the control point is.
_KNOWING_ELL = ("plant", "controller", "planner")


def _ell(value: float) -> dict[str, Any]:
    """Another control point, which begins where the reference does."""
    return {f"{name}.ell": value for name in _KNOWING_ELL} | {"plant.eta0.x": -value}


#: What is changed, as the page calls it; values that only one controller has are left out of the
#: other's run.
_CHANGES: Mapping[str, Mapping[str, Any]] = {
    "nothing": {},
    "current of 0.3 m/s across the first leg": {"plant.current.y": 0.3},
    "speed measured": {"allocation.measured": True},
    "nominal speed of 1.0 m/s": {"allocation.speed": 1.0},
    "nominal speed of 2.5 m/s": {"allocation.speed": 2.5},
    "no lags": {"plant.fin.T": 0.0, "plant.propeller.T": 0.0},
    "all of the propeller's torque": {"plant.propeller.torque": 1.0},
    "ell = 0.35 m": _ell(0.35),
    "ell = 0.1 m": _ell(0.1),
    "lambda = 2.1 m/s": {"controller.lambda": 2.1},
    "start 3 m aside": {"plant.eta0.y": 3.0},
    "lambda = 0.15 m/s": {"controller.lambda": 0.15},
    "lambda = 0.6 m/s": {"controller.lambda": 0.6},
    "eps_t = 5 W": {"controller.eps_t": 5.0},
    "gamma = 3": {"controller.gamma": 3.0},
    "no noise": {"plant.noise.std": 0.0},
    "no noise, fin of 0.03 s": {"plant.noise.std": 0.0, "plant.fin.T": 0.03},
    "k_d = 50": {"controller.k_d": 50.0},
    "noise of 3 mm": {"plant.noise.std": 0.003},
    "noise of 1 cm": {"plant.noise.std": 0.01},
    "gains of the paper": {
        "controller.K1": [10.0, 10.0, 10.0], "controller.K2": [10.0, 10.0, 10.0],
        "controller.k_d": 50.0, "controller.lambda": 1.0, "controller.eps_t": 1.0,
    },
}  # fmt: skip

#: Parameters of the proposed controller only.
_PROPOSED = ("controller.K2", "controller.k_d")


def _numbers(scenario: str, changes: Mapping[str, Any]) -> str:
    """What a run comes to, in a line."""
    result = simulate(scenario, changes)
    if result.failure is not None:
        return result.failure
    error = tracking_error(result, AllocatedLoop())
    away = np.linalg.norm(error, axis=1)
    first, late = (away[chosen].max() for chosen in (result.time < 40.0, result.time >= 120.0))
    ahead = result.group(*AllocatedLoop().dy_d)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True) + (ahead == 0.0).all(axis=1)[:, None]
    beside = error - (error * ahead).sum(axis=1)[:, None] * ahead
    across = np.linalg.norm(beside, axis=1)[result.time >= 120.0].max()
    attained = "allocation.tau_attained"
    missed = [
        np.abs(np.subtract(*result.step_values(f"controller.tau.{k}", f"{attained}.{k}").T)) > 1e-9
        for k in "qr"
    ]
    pitch, yaw = (100.0 * one.mean() for one in missed)
    command = np.abs(result.step_values("controller.tau.r")).max()
    turned = np.abs(np.diff(np.degrees(result["plant.actuator.delta_r"])))
    rate = turned.sum() / result.time[-1]
    return f"{first:6.2f}{late:6.3f}{across:6.3f}{pitch:4.0f}{yaw:4.0f}{command:7.1f}{rate:6.0f}"


def _after_the_end(scenario: str) -> str:
    """The largest error while the vehicle comes to rest, and what is left of it later."""
    result = simulate(scenario, stop_time=1500.0)
    away = np.linalg.norm(tracking_error(result, AllocatedLoop()), axis=1)
    resting = away[(result.time >= 290.0) & (result.time < 600.0)].max()
    later = (f"{away[result.time.searchsorted(t)]:.2f} m at {t:g} s" for t in (600.0, 1500.0))
    return f"{resting:.2f} m at most, {', '.join(later)}"


def steady_turn(speed: float) -> tuple[float, float, float]:
    """Sway [m/s] and rate of turn [rad/s] of Remus100 with full rudder, and its moment [N.m].

    Args:
        speed: through the water [m/s], which the surge is held at.

    """
    parameters = Parameters()
    u, v, r = speed, 0.0, 0.0
    actuator = (parameters.tail.delta_max, 0.0, 0.0)
    mass = inertia(parameters.hull)
    for _ in range(5_000):
        state = RemusState(_NONE, _NONE, (u, v, 0.0, 0.0, 0.0, r), actuator, _NONE)
        rates = accelerations(parameters, mass, state)
        v, r = v + 0.02 * rates[1], r + 0.02 * rates[5]
        u = (speed * speed - v * v) ** 0.5
    return v, r, tail_forces(parameters.tail, state)[5]


def prestero_turn(speed: float) -> tuple[float, float, float]:
    """The same with the coefficients of Prestero (2001) for sway and yaw, at the same angle."""
    m, v, r = 30.48, 0.0, 0.0
    u, rudder = speed, -Parameters().tail.delta_max
    for _ in range(20_000):
        Y = -1310 * v * abs(v) + 0.632 * r * abs(r) - 28.6 * u * v + 5.22 * u * r
        N = -3.18 * v * abs(v) - 94.0 * r * abs(r) - 24.0 * u * v - 2.0 * u * r
        dv = (Y + 9.64 * u * u * rudder - m * u * r) / (m + 35.5)
        dr = (N - 6.15 * u * u * rudder) / (3.45 + 4.88)
        v, r = v + 0.005 * dv, r + 0.005 * dr
        u = (speed * speed - v * v) ** 0.5
    return v, r, -6.15 * u * u * rudder


def main() -> None:
    """Print all lines."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    heading = f"{'first':>6}{'late':>6}{'across':>6}{'q':>4}{'r':>4}{'yaw':>7}{'rate':>6}"
    print(f"{'changed':42}{heading}  |{heading}")
    for name, changes in _CHANGES.items():
        shared = {key: value for key, value in changes.items() if key not in _PROPOSED}
        print(f"{name:42}{_numbers('remus', changes)}  |{_numbers('remus-pd', shared)}", flush=True)
    for scenario in ("remus", "remus-pd"):
        print(f"after the end, {scenario}: {_after_the_end(scenario)}")
    for name, turn in (("Remus100", steady_turn), ("Prestero", prestero_turn)):
        for speed in (1.06, 1.5):
            v, r, N = turn(speed)
            print(
                f"turn with 15 degrees of rudder at {speed:g} m/s, {name}: {r:.3f} rad/s, radius "
                f"{speed / r:.1f} m, sway {v:.3f} m/s, moment of the rudder {N:.2f} N.m, over the "
                f"rate {N / r:.1f} kg.m2/s"
            )


if __name__ == "__main__":
    main()
