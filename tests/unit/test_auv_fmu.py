"""The face of the product, and every default of every set of parameters.

Defaults are the values of section 4.1, or our own (reading 7).
"""

import subprocess
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from math import pi, radians
from pkgutil import walk_packages

import numpy as np
import pytest

import auv_fmu
import orchestrator
from auv_fmu.guidance import formation
from auv_fmu.guidance.autopilot import Vertical
from auv_fmu.guidance.los import Law
from auv_fmu.paper import control_point, euler, plant
from auv_fmu.paper.observer import EULER
from auv_fmu.paper.saturation import Saturation
from auv_fmu.remus.prestero import Coefficients
from auv_fmu.remus.remus100 import Form
from auv_fmu.water.waves import Spectrum

TEN, ZERO_3, ZERO_4, ZERO_5, ZERO_6 = (10.0,) * 3, *((0.0,) * n for n in (3, 4, 5, 6))
CONTROLLER = {
    "K1": TEN, "lambda_": 1.0, "gamma": 1.0, "sigma": 0.001, "theta_0": ZERO_4, "eps_t": 1.0,
    "ell": 0.35,
}  # fmt: skip
SECTION_4_1 = {
    "Vehicle": {
        "m11": 25.0, "m22": 17.5, "m33": 30.0, "m55": 22.5, "m66": 15.0, "d11": 30.0, "d22": 30.0,
        "d33": 30.0, "d55": 20.0, "d66": 20.0, "righting_pitch": 5.0,
    },
    "Model": {
        "m11": 25.0, "m55": 22.5, "m66": 15.0, "d11": 30.0, "d55": 20.0, "d66": 20.0,
        "righting_pitch": 5.0,
    },
    "RollAxis": {"m44": 22.5, "d44": 20.0},
    "Limits": {"tau_min": (-80.0,) * 3, "tau_max": (80.0,) * 3},
    "Disturbance": {"A_f": 0.5, "A_d": 1.0, "omega_d": 0.1},
    "Gains": {**CONTROLLER, "K2": TEN, "k_d": 50.0, "s": Saturation.TANH},
    "PdGains": CONTROLLER,
    "plant.Parameters": {
        "ell": 0.35, "eta0": (2.0, 6.0, 0.0, 0.0, 0.0, 0.0), "integrator": plant.EULER,
    },
    "motion_planner.Parameters": {
        "ell": 0.35, "tau_d": (5.0, 1.0, 2.0), "eta0": (0.0, 0.0, -2.0, 0.0, 0.0),
    },
    "PointMass": {
        "mass": pytest.approx((25.0, 15.0 / 0.35**2, 22.5 / 0.35**2), rel=1e-3),
        "drag": pytest.approx((30.0, 20.0 / 0.35**2, 20.0 / 0.35**2), rel=1e-3),
        "ell": 0.35, "tau_max": (80.0,) * 3,
    },
    "Follower": {"ell": 0.35},
    "LongestSteps": dict.fromkeys(("plant", "controller", "planner"), 0.02),
    "Setting": {"h": 0.02},
}  # fmt: skip
NO_SAMPLE = {"age": 0.0, "fresh": False}
OURS = {
    "Inputs": {
        **dict.fromkeys(("y", "eta", "dy", "dy_d", "ddy_d"), ZERO_3), "y_d": (1.0, 0.0, 0.0),
    },
    "RollAxis": {"righting_roll": 5.0, "rolls": True},
    "Localisation": {"std": 0.001, "seed": 1},
    "Gains": {"printed_jacobian": False, "innovation_gate": 1.0, "form": EULER},
    "PdGains": {"printed_jacobian": False},
    "plant.Parameters": {"nu0": ZERO_6, "current": ZERO_3, "T": ZERO_3},
    "motion_planner.Parameters": {"nu0": ZERO_5},
    "Waypoints": {
        "n": 6,
        "x": (3.0, 15.0, 15.0, 3.0, 3.0, 15.0, *(0.0,) * 26),
        "y": (6.0, 6.0, 10.0, 10.0, 14.0, 14.0, *(0.0,) * 26),
        "z": (0.0, 4.0, 4.0, 4.0, 4.0, 0.0, *(0.0,) * 26),
        "t": (3.0, 28.0, 36.0, 60.0, 68.0, 93.0, *(0.0,) * 26),
        "timed": False,
        "cruise": 0.5,
        "rounding": 6.0,
    },
    "Follower": {"speed_max": 2.5, "turn_max": 4.0},
    "Path": {
        "n": 4,
        "x": (0.0, 100.0, 100.0, 0.0, *(0.0,) * 28),
        "y": (0.0, 0.0, 20.0, 20.0, *(0.0,) * 28),
        "z": (2.0, 10.0, 10.0, 10.0, *(0.0,) * 28),
    },
    "los.Parameters": {
        "law": Law.ADAPTIVE, "Delta_h": 5.0, "Delta_v": 5.0, "kappa": 0.25, "gamma_h": 0.01,
        "gamma_v": 0.01, "crab_max": 0.5, "K_f": 1.0, "radius": 3.0, "speed": 1.0,
    },
    "Model": {"d11_quadratic": 0.0},
    "Poles": {"omega": 1.0, "zeta": 1.0},
    "autopilot.Parameters": {"vertical": Vertical.DEPTH, "theta_max": 0.5},
    "Waves": {
        "spectrum": Spectrum.JONSWAP, "Hs": 1.0, "Tp": 7.0, "gamma": 3.3, "highest": 4.0,
        "direction": 0.0, "s": 10.0, "n": 32, "seed": 1,
    },
    "Current": {"speed": 0.1, "direction": 0.0, "root": 7.0, "mu": 0.005, "sigma": 0.02, "seed": 1},
    "Sea": {"depth": 50.0, "g": 9.81},
    "Stages": {
        "n": 1, "shape": (formation.LINE,) * 4, "spacing": (5.0,) * 4, "x": ZERO_4, "y": ZERO_4,
        "z": ZERO_4, "t": (30.0, 60.0, 90.0), "duration": (20.0,) * 3,
    },
    "Estimator": {"lambda_": 0.5, "k_d": 0.5, "age_max": 4.0, "z_max": 2.0},
    "formation.Parameters": {
        "number": 2, "vehicles": 3, "omega_chi": 0.3, "turn_chi": 0.2, "estimated": False,
    },
    "Sampling": {
        "period": 0.0, "delay": 0.0, "loss": 0.0, "outage_start": 0.0, "outage_duration": 0.0,
        "seed": 1,
    },
    "Bias": {"std": 0.0, "walk": 0.0},
    "VelocityBias": {"std": 0.0, "walk": 0.0},
    "AttitudeNoise": {"tilt": radians(0.5), "heading": radians(2.0)},
    "AttitudeBias": {"tilt": 0.0, "heading": 0.0, "walk": 0.0},
    "Gyro": {
        "noise": radians(0.0035), "bias": radians(0.05),
        "walk": pytest.approx(radians(10.0) / 3600 / 60, rel=1e-13),
    },
    "Accelerometer": {
        "noise": pytest.approx(0.14e-3 * 9.81, rel=1e-13),
        "bias": pytest.approx(2e-3 * 9.81, rel=1e-13),
        "walk": pytest.approx(0.04e-3 * 9.81 / 60, rel=1e-13),
    },
    "DepthSensor": {"noise": 0.002},
    "Dvl": {"noise": 0.01},
    "PositionFix": {"noise": (0.3, 0.3, 0.3)},
    "Noise": {
        "depth": 0.002, "tilt": radians(0.5), "heading": radians(2.0), "velocity": 0.01,
        "position": (0.3, 0.3, 0.3),
    },
    "Start": {"position": 10.0, "velocity": 1.0, "attitude": 0.1},
    "navigation_filter.Parameters": {"delay_max": 1.0, "ell": 0.35},
    "DepthSample": {"z": 0.0, **NO_SAMPLE},
    "AttitudeSample": {"eta": ZERO_3, **NO_SAMPLE},
    "VelocitySample": {"nu": ZERO_3, **NO_SAMPLE},
    "InertialSample": {"f": ZERO_3, "omega": ZERO_3, **NO_SAMPLE},
    "PositionSample": {"position": ZERO_3, **NO_SAMPLE},
    "acoustic_link.Parameters": {
        "period": 1.0, "sound_speed": 1500.0, "latency": 0.2, "loss": 0.0, "seed": 1,
        "outage_start": 0.0, "outage_duration": 0.0,
    },
}  # fmt: skip

#: Defaults of PythonVehicleSimulator 1.0.1, and of parameters that it lacks.
REMUS_100 = {
    "Hull": {
        "length": 1.6,
        "diameter": 0.19,
        "mass": pytest.approx(4 / 3 * pi * 1026 * 0.8 * 0.095**2, rel=1e-13),
        "gravity": 9.81,
        "r_bg": (0.0, 0.0, 0.02),
        "net_buoyancy": 0.0,
        "added_roll": 0.3,
    },
    "Drag": {
        "c_d": 0.42,
        "c_d_across": pytest.approx(np.interp(0.5, (0.4933, 0.5585), (1.2108, 1.0836)), rel=1e-12),
        "wing": 0.7,
        "oswald": 0.7,
        "T_surge": 20.0,
        "T_sway": 20.0,
        "T_heave": 20.0,
        "T_yaw": 1.0,
        "zeta_roll": 0.3,
        "zeta_pitch": 0.8,
        "fading": 3.0,
    },
    "Tail": {
        "rho": 1026.0,
        "area": 2 * 0.00665,
        "x": -0.8,
        "lift_r": 0.5,
        "lift_s": 0.7,
        "delta_max": radians(15.0),
        "diameter": 0.14,
        "deduction": 0.1,
        "advance": 0.944,
        "j_1": 0.6632,
        "kt_0": 0.4566,
        "kt_1": 0.1798,
        "kq_0": 0.07,
        "kq_1": 0.0312,
        "torque": 0.1,
        "n_max": pytest.approx(1525 * pi / 30, rel=1e-13),
    },
    "remus100.Parameters": {
        "T_delta": 0.1,
        "T_n": 1.0,
        "ell": 0.35,
        "eta0": ZERO_6,
        "nu0": ZERO_6,
        "current": ZERO_3,
        "form": Form.SPHEROID,
    },
    # Prestero's: tests/unit/auv_fmu/remus/test_prestero.py compares them with his tables.
    "Coefficients": Coefficients()._asdict(),
    "allocation.Parameters": {"speed": 1.5, "measured": False},
}

#: Numbers of von Benzon et al. (2022), the fit of the T200's curve, and parameters that they lack.
BLUEROV2 = {
    "Body": {
        "mass": 13.5, "inertia": (0.26, 0.23, 0.37), "volume": 0.0134, "rho": 1000.0,
        "gravity": 9.82, "r_b": (0.0, 0.0, -0.01),
    },
    "Hydrodynamics": {
        "added": (6.36, 7.12, 18.68, 0.189, 0.135, 0.222),
        "linear": (13.7, 0.0, 33.0, 0.0, 0.8, 0.0),
        "quadratic": (141.0, 217.0, 190.0, 1.19, 0.47, 1.5),
    },
    "Curve": {
        "dead_band": 0.07, "forward": 28.2, "forward_square": 31.3, "reverse": 22.9,
        "reverse_square": 23.4,
    },
    "Layout": {
        "x": (0.156, 0.156, -0.156, -0.156, 0.12, 0.12, -0.12, -0.12),
        "y": (0.111, -0.111, 0.111, -0.111, 0.218, -0.218, 0.218, -0.218),
        "z": (0.085,) * 4 + (0.0,) * 4,
        "e_x": pytest.approx((0.5**0.5, 0.5**0.5, -(0.5**0.5), -(0.5**0.5), 0, 0, 0, 0)),
        "e_y": pytest.approx((-(0.5**0.5), 0.5**0.5, -(0.5**0.5), 0.5**0.5, 0, 0, 0, 0)),
        "e_z": (0.0,) * 4 + (-1.0,) * 4,
    },
    "bluerov2.Parameters": {
        "T": 0.029, "ell": 0.35, "eta0": ZERO_6, "nu0": ZERO_6, "current": ZERO_3,
    },
}  # fmt: skip


def name_of(kind: type) -> str:
    """Its name, with its module's where several have it."""
    module = kind.__module__.rpartition(".")[2]
    return f"{module}.{kind.__name__}" if kind.__name__ == "Parameters" else kind.__name__


#: Every named tuple of the package that has defaults.
SETS = {
    name_of(value): value
    for module in walk_packages(auv_fmu.__path__, "auv_fmu.")
    for value in vars(import_module(module.name)).values()
    if isinstance(value, type) and getattr(value, "_field_defaults", None)
}


@pytest.mark.parametrize("name", SETS)
def test_defaults_are_the_papers_or_named_as_ours(name):
    plain = {
        field: value
        for field, value in SETS[name]._field_defaults.items()
        if name_of(type(value)) not in SETS
    }
    assert plain == {
        **SECTION_4_1.get(name, {}),
        **OURS.get(name, {}),
        **REMUS_100.get(name, {}),
        **BLUEROV2.get(name, {}),
    }


def nested(value):
    return [inner for inner in value if name_of(type(inner)) in SETS]


def test_sets_within_the_setting_of_the_loop_are_those_with_all_defaults():
    blocks = nested(SETS["Setting"]())
    assert [name_of(type(block)) for block in blocks] == [
        "plant.Parameters",
        "Gains",
        "Disturbance",
        "motion_planner.Parameters",
        "LongestSteps",
    ]
    inner = [value for block in blocks for value in nested(block)]
    assert [name_of(type(value)) for value in inner] == [
        "Vehicle",
        "RollAxis",
        "Limits",
        "Localisation",
        "Vehicle",
    ]
    assert all(value == type(value)() for value in (*blocks, *inner))


def test_constants_are_the_ones_of_section_4_1():
    assert (control_point.ELL, euler.STEP) == (0.35, 0.02)


FACE = {"Result", "load", "read", "simulate", "sweep"}


def test_the_face_is_the_orchestrators():
    assert set(dir(auv_fmu)) >= set(auv_fmu.__all__) >= FACE
    for name in FACE:
        assert getattr(auv_fmu, name) is getattr(orchestrator, name)
    assert not hasattr(auv_fmu, "nothing")


def test_the_face_is_imported_when_it_is_used():
    code = "import sys, auv_fmu; assert auv_fmu.__version__; sys.exit(bool({}))"
    heavy = "{'numpy', 'orchestrator', 'fmus', 'fmpy'} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", code.format(heavy)], check=True)


def test_a_copy_within_an_fmu_has_no_face():
    [folder] = auv_fmu.__path__
    spec = spec_from_file_location("auv_fmu_0123456789ab", f"{folder}/__init__.py")
    copy = module_from_spec(spec)
    spec.loader.exec_module(copy)
    assert FACE.isdisjoint(dir(copy)) and "Vector" in copy.__all__
    assert not hasattr(copy, "simulate")
