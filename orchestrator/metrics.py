"""Performance indices of a run: equation (59) and e_f of section 4.2."""

from __future__ import annotations

from typing import Any

import numpy as np

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import control_point
from orchestrator.result import Result
from orchestrator.system import PortName, System, typed

ACTUATORS = ("u", "q", "r")
AXES = ("x", "y", "z")

#: What the control point follows from.
POSTURE = tuple(f"plant.eta.{k}" for k in (*AXES, "phi", "theta", "psi"))

#: The parameters of (3).
LIMITS = tuple(f"plant.{limit}.{k}" for limit in ("tau_min", "tau_max") for k in ACTUATORS)

#: T_L of section 4.2 [s].
LAST_SECONDS = 5.0


def metrics(system: System, result: Result, scenario: str) -> dict[str, Any]:
    """What metrics.json holds.

    Indices whose columns a system does not have are left out.

    Args:
        system: that was run.
        result: of the run.
        scenario: its name.

    """
    values: dict[str, Any] = {
        "scenario": scenario,
        "stop_time": float(result.time[-1]),
        "step": result.step,
        "order": result.order,
        "parameters": changed_parameters(system, result),
    }
    if result.failure is not None:
        values["failure"] = result.failure
    applied = [f"plant.{signal}.{k}" for signal in ("tau", "tau_applied") for k in ACTUATORS]
    if result.computed > 1 and result.has(applied, LIMITS):
        values.update(effort(result))
    if result.has([*(f"planner.y_d.{k}" for k in AXES), *POSTURE], ["plant.ell"]):
        values["final_error"] = final_error(result).tolist()
    return values


def changed_parameters(system: System, result: Result) -> dict[str, Any]:
    """Parameters that differ from the FMU's defaults, and inputs that were set."""
    changed = {}
    for name, value in result.parameters.items():
        start = system.components[name.component].variables[name.port].start
        default = type(value)({"true": 1, "false": 0}.get(start, start))
        if value != default:
            changed[str(name)] = value
    for name, value in system.parameters.items():
        variable = system.components[name.component].variables[name.port]
        if variable.causality == "input":
            changed[str(name)] = typed(str(name), variable, value)
    return changed


def effort(result: Result) -> dict[str, list[float]]:
    """Efforts of the actuators, lists in the order u, q, r.

    `rms_effort` is (59); `l2_effort` is it without 1/T_f under the root, which has the size of
    the numbers the paper prints (reading 6). Both are of the applied signal, which a row holds
    for the step that ends there.
    """
    applied = result.group(*(f"plant.tau_applied.{k}" for k in ACTUATORS))[1:]
    commanded = result.group(*(f"plant.tau.{k}" for k in ACTUATORS))[1:]
    h = np.diff(result.time)[:, np.newaxis]
    square = (applied**2 * h).sum(axis=0)
    lower, upper = (
        np.array([result.parameters[PortName("plant", f"{limit}.{k}")] for k in ACTUATORS])
        for limit in ("tau_min", "tau_max")
    )
    outside = (commanded < lower) | (commanded > upper)
    return {
        "l2_effort": np.sqrt(square).tolist(),
        "rms_effort": np.sqrt(square / result.time[-1]).tolist(),
        "peak_command": np.abs(commanded).max(axis=0).tolist(),
        "saturated_fraction": outside.mean(axis=0).tolist(),
        "total_variation": np.abs(np.diff(applied, axis=0)).sum(axis=0).tolist(),
    }


def true_control_point(result: Result) -> np.ndarray:
    """y without measurement noise: (9) on the plant's posture, (rows, 3) [m]."""
    ell = result.parameters[PortName("plant", "ell")]
    posture = result.group(*POSTURE)
    return np.array(
        [
            control_point((x, y, z), rotation_from_euler(*euler), ell)
            for x, y, z, *euler in posture.tolist()
        ]
    )


def tracking_error(result: Result) -> np.ndarray:
    """e = y - y_d with the true control point, (rows, 3) [m]."""
    error: np.ndarray = true_control_point(result) - result.group(
        *(f"planner.y_d.{k}" for k in AXES)
    )
    return error


def final_error(result: Result) -> np.ndarray:
    """e_f of section 4.2: max |e| of each axis over the last T_L seconds [m]."""
    last = result.time >= result.time[-1] - LAST_SECONDS
    largest: np.ndarray = np.abs(tracking_error(result)[last]).max(axis=0)
    return largest
