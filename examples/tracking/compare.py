"""Compare the learned policy with the paper's controller and the PD controller, on four tasks.

    python examples/tracking/compare.py

The FMU of the policy has to be beside this file. All gains are Fig. 4's.
"""

from pathlib import Path

import numpy as np

from auv_fmu import simulate
from orchestrator.vehicle.signals import tracking_error

pd = {"components": {"controller": "PdController"}, "wires": {"controller.dy": "plant.dy"}}
controllers = {"paper": "fig4", "PD": pd, "learned": Path(__file__).with_name("tracking.toml")}
tasks = {
    "Fig. 4": {},
    "disturbance 10 times": {"disturbance.A_f": 5.0, "disturbance.A_d": 10.0},
    "current of 0.3 m/s": {"plant.current.x": 0.3},
    "noise of 1 cm": {"plant.noise.std": 0.01},
}

print(f"{'':29} within 0.5 m  mean error  effort in u, q, r  total variation")
for task, parameters in tasks.items():
    for name, system in controllers.items():
        result = simulate(system, {"plant.noise.std": 0.001, **parameters}, stop_time=100.0)
        error = np.linalg.norm(tracking_error(result), axis=1)
        after = result.time[np.flatnonzero(error > 0.5)[-1] + 1]
        effort, variation = (
            "".join(f"{value:{width}.0f}" for value in result.metrics()[index])
            for index, width in (("l2_effort", 6), ("total_variation", 7))
        )
        mean = error[result.time > 60.0].mean()
        print(f"{task:21} {name:7} {after:11.1f} s {mean:9.3f} m {effort} {variation}")
