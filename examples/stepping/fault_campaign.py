"""Try faults on the helix of Fig. 4, each from the same saved state.

    python examples/stepping/fault_campaign.py

A fault lasts from 80 s to 85 s. Errors are distances of the control point from its reference: the
largest one since then, and the largest one in the last five seconds, until 100 s.
"""

from math import radians

import numpy as np

from auv_fmu import Simulation

BEGIN, END, STOP = 80.0, 85.0, 100.0

#: The input that a fault changes, the output that feeds it, and the input's new value, made of the
#: output's present value and of the one at the beginning.
FAULTS = {
    "none": ("controller.y.x", "plant.y.x", lambda now, first: now),
    "x off by 0.3 m": ("controller.y.x", "plant.y.x", lambda now, first: now + 0.3),
    "position off by 1 m": ("controller.y", "plant.y", lambda now, first: now + 1.0),
    "position frozen": ("controller.y", "plant.y", lambda now, first: first),
    "yaw off by 20°": (
        "controller.eta.psi",
        "plant.eta.psi",
        lambda now, first: now + radians(20.0),
    ),
    "half the surge force": ("plant.tau.u", "controller.tau.u", lambda now, first: 0.5 * now),
    "no surge force": ("plant.tau.u", "controller.tau.u", lambda now, first: 0.0),
    "no pitch moment": ("plant.tau.q", "controller.tau.q", lambda now, first: 0.0),
    "no yaw moment": ("plant.tau.r", "controller.tau.r", lambda now, first: 0.0),
}


def campaign():
    """Yield the name of each fault, its largest and its last error [m]."""
    with Simulation("fig4") as auv:
        auv.run(until=BEGIN)
        healthy = auv.save()
        for name, (target, source, law) in FAULTS.items():
            auv.restore(healthy)
            first = auv[source]
            while auv.time < END - 1e-9:
                auv[target] = law(auv[source], first)
                auv.step()
            del auv[target]
            auv.run(until=STOP)
            result = auv.result()
            errors = result["plant.y"] - result["planner.y_d"]
            distance = np.linalg.norm(errors, axis=1)
            since, last = result.time >= BEGIN, result.time >= STOP - 5.0
            yield name, distance[since].max(), distance[last].max()


if __name__ == "__main__":
    print("fault                  largest     last")
    for name, largest, last in campaign():
        print(f"{name:20} {largest:7.2f} m {last:6.2f} m")
    simulated, all_runs = BEGIN + len(FAULTS) * (STOP - BEGIN), len(FAULTS) * STOP
    print(f"{simulated:.0f} s simulated instead of {all_runs:.0f} s")
