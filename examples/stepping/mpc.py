"""Steer the vehicle of Fig. 4 by model predictive control, in place of the paper's controller.

    python examples/stepping/mpc.py

Every 0.5 s, three Gauss-Newton steps improve the commands of the next 3 s. Their sensitivities are
finite differences of a `Simulations` of the plant, one row for each number. The prediction starts
from the true posture and velocity, knows the reference, and leaves the disturbance out.
"""

import numpy as np
from scipy.optimize import lsq_linear

from auv_fmu import Simulation, Simulations, simulate

QUIET, STOP = {"plant.noise.std": 0.0}, 60.0

#: Moves that are planned, and the steps of 20 ms that each is held.
MOVES, HOLD = 6, 25

#: Limit of the commands [N, N.m], and weights of commands and of their changes against a metre.
LIMIT, WEIGHT, CHANGE = 80.0, 0.01, 0.03


def residuals(plants, auv, tries, before, y_d):
    """Return errors and weighted commands over the horizon, a row for each try."""
    plants.reset(parameters={"plant.eta0": auv["plant.eta"], "plant.nu0": auv["plant.nu"]})
    errors = np.empty_like(tries)
    for k in range(MOVES):
        plants["plant.tau"] = tries[:, k]
        plants.step(HOLD)
        errors[:, k] = plants["plant.y"] - y_d[k]
    changes = np.diff(np.insert(tries, 0, before, axis=1), axis=1)
    return np.hstack((errors, WEIGHT * tries, CHANGE * changes)).reshape(len(tries), -1)


def mpc():
    """Return the result of the vehicle, with a reference that is known beyond the stop."""
    auv = Simulation("fig4", QUIET)
    ahead = simulate("fig4", QUIET, stop_time=STOP + MOVES * HOLD * auv.step_size)
    y_d = ahead.group("planner.y_d.x", "planner.y_d.y", "planner.y_d.z")[HOLD::HOLD]
    plants = Simulations({"only": ["plant"]}, 1 + 3 * MOVES, QUIET)
    pushes = np.insert(np.eye(3 * MOVES), 0, 0.0, axis=0).reshape(-1, MOVES, 3)
    taus, before = np.zeros((MOVES, 3)), np.zeros(3)
    for move in range(round(STOP / auv.step_size / HOLD)):
        for _ in range(3):
            r = residuals(plants, auv, taus + pushes, before, y_d[move:])
            bounds = -LIMIT - taus.ravel(), LIMIT - taus.ravel()
            taus += lsq_linear((r[1:] - r[0]).T, -r[0], bounds, "bvls").x.reshape(MOVES, 3)
        auv["plant.tau"] = before = taus[0].copy()
        auv.run(until=(move + 1) * HOLD * auv.step_size)
        taus = np.append(taus[1:], taus[-1:], axis=0)
    return auv.result()


if __name__ == "__main__":
    paper = simulate("fig4", QUIET, stop_time=STOP)
    pd = {"components": {"controller": "PdController"}, "wires": {"controller.dy": "plant.dy"}}
    results = {"paper": paper, "PD": simulate(pd, QUIET, stop_time=STOP), "MPC": mpc()}
    print("       within 0.5 m   final error   effort in u, q, r")
    for name, result in results.items():
        errors = result["plant.y"] - result["planner.y_d"]
        after = result.time[np.linalg.norm(errors, axis=1) > 0.5][-1]
        error, effort = max(result.metrics()["final_error"]), result.metrics()["l2_effort"]
        print(f"{name:5} after {after:4.1f} s {error:13.3f} m  ", *(f"{k:5.0f}" for k in effort))
