"""The numbers that docs/explanation/remus.md says of runs: `python tools/remus_numbers.py`.

Each line is a change of the scenarios `remus` and `remus-pd`. For both controllers it has the
largest error in the first 40 s and from 120 s on [m], the share of steps in which a fin is at its
limit, in pitch and yaw [%], the largest command in yaw [N.m], and the mean rate of the rudder
[degrees/s].
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestrator import simulate
from orchestrator.vehicle.signals import AllocatedLoop, tracking_error

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
    "no noise": {"plant.noise.std": 0.0},
    "no noise, fin of 0.03 s": {"plant.noise.std": 0.0, "plant.fin.T": 0.03},
    "k_d = 50": {"controller.k_d": 50.0},
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
    away = np.linalg.norm(tracking_error(result, AllocatedLoop()), axis=1)
    first, late = (away[chosen].max() for chosen in (result.time < 40.0, result.time >= 120.0))
    missed = [
        np.abs(result[f"controller.tau.{k}"] - result[f"allocation.tau_attained.{k}"])[1:] > 1e-9
        for k in "qr"
    ]
    pitch, yaw = (100.0 * one.mean() for one in missed)
    command = np.abs(result["controller.tau.r"]).max()
    turned = np.abs(np.diff(np.degrees(result["plant.actuator.delta_r"])))
    rate = turned.sum() / result.time[-1]
    return f"{first:6.2f}{late:6.2f}{pitch:4.0f}{yaw:4.0f}{command:7.1f}{rate:6.0f}"


def main() -> None:
    """Print all lines."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    heading = f"{'first':>6}{'late':>6}{'q':>4}{'r':>4}{'yaw':>7}{'rate':>6}"
    print(f"{'changed':42}{heading}  |{heading}")
    for name, changes in _CHANGES.items():
        shared = {key: value for key, value in changes.items() if key not in _PROPOSED}
        print(f"{name:42}{_numbers('remus', changes)}  |{_numbers('remus-pd', shared)}", flush=True)


if __name__ == "__main__":
    main()
