"""The REMUS of Prestero (2001), compared with his equations of motion, written from the source.

T. Prestero, Verification of a Six-Degree of Freedom Simulation Model for the REMUS Autonomous
Underwater Vehicle, MIT and WHOI. His numbers are those on which two transcriptions agree: REMUS.m
of ArizaWilmerUTAS/Path-Following (7fc6641) and AUV_model.py of
Psarhadi/Monte-Carlo-Simulation-and-Statistical-Analysis-of-an-AUV (89c4b4b).
"""

from __future__ import annotations

from functools import partial
from itertools import chain
from math import atan2, cos, degrees, exp, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, root

from auv_fmu.remus.hull import ACROSS, Hull
from auv_fmu.remus.prestero import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Coefficients
from auv_fmu.remus.remus100 import (
    Form,
    Parameters,
    RemusState,
    accelerations,
    advance,
    begin,
    inertia_of,
    tail_forces,
)
from auv_fmu.remus.tail import Tail
from orchestrator.runs.scenario import read_scenario

#: His tables, with a d for the dot of an added mass.
TABLE = """
    Xdu -9.30e-1, Xuu -1.62, Xwq -3.55e1, Xqq -1.93, Xvr 3.55e1, Xrr -1.93,
    Ydv -3.55e1, Ydr 1.93, Yvv -1.31e3, Yrr 6.32e-1, Yuv -2.86e1, Ywp 3.55e1, Yur 5.22, Ypq 1.93,
    Zdw -3.55e1, Zdq -1.93, Zww -1.31e2, Zqq -6.32e-1, Zuw -2.86e1, Zuq -5.22, Zvp -3.55e1,
    Zrp 1.93, Kdp -7.04e-2, Kpp -1.30e-1, Mdw -1.93, Mdq -4.88, Mww 3.18, Mqq -1.88e2, Muw 2.40e1,
    Muq -2.00, Mvp -1.93, Mrp 4.86, Ndv 1.93, Ndr -4.88, Nvv -3.18, Nrr -9.40e1, Nuv -2.40e1,
    Nwp -1.93, Nur -2.00, Npq -4.86
"""
C = {name: float(value) for name, value in (entry.split() for entry in TABLE.split(","))}
W, B, M_KG, ZG, IXX, IYY, IZZ = 299.0, 306.0, 30.48, 1.96e-2, 0.177, 3.45, 3.45
YUUDR, NUUDR, ZUUDS, MUUDS = 9.64, -6.15, -9.64, -6.15

PARAMETERS = Parameters(
    hull=Hull(mass=M_KG, gravity=W / M_KG, r_bg=(0.0, 0.0, ZG), net_buoyancy=B - W),
    tail=Tail(x=-0.638, lift_r=1.413, lift_s=1.413),
    form=Form.COEFFICIENTS,
)
STILL, AMIDSHIPS = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


HIS_MASS = [
    [M_KG - C["Xdu"], 0, 0, 0, M_KG * ZG, 0],
    [0, M_KG - C["Ydv"], 0, -M_KG * ZG, 0, -C["Ydr"]],
    [0, 0, M_KG - C["Zdw"], 0, -C["Zdq"], 0],
    [0, -M_KG * ZG, 0, IXX - C["Kdp"], 0, 0],
    [M_KG * ZG, 0, -C["Mdw"], 0, IYY - C["Mdq"], 0],
    [0, -C["Ndv"], 0, 0, 0, IZZ - C["Ndr"]],
]


def his_forces(nu, phi=0.0, theta=0.0, rudder=0.0, planes=0.0):
    """The right sides of his equations with x_g = y_g = 0, about the centre of buoyancy."""
    u, v, w, p, q, r = nu
    X = (
        -(W - B) * sin(theta) + C["Xuu"] * u * abs(u) + (C["Xwq"] - M_KG) * w * q
        + C["Xqq"] * q**2 + (C["Xvr"] + M_KG) * v * r + C["Xrr"] * r**2 - M_KG * ZG * p * r
    )  # fmt: skip
    Y = (
        (W - B) * cos(theta) * sin(phi) + C["Yvv"] * v * abs(v) + C["Yrr"] * r * abs(r)
        + C["Yuv"] * u * v + (C["Ywp"] + M_KG) * w * p + (C["Yur"] - M_KG) * u * r
        - M_KG * ZG * q * r + C["Ypq"] * p * q + YUUDR * u**2 * rudder
    )  # fmt: skip
    Z = (
        (W - B) * cos(theta) * cos(phi) + C["Zww"] * w * abs(w) + C["Zqq"] * q * abs(q)
        + C["Zuw"] * u * w + (C["Zuq"] + M_KG) * u * q + (C["Zvp"] - M_KG) * v * p
        + M_KG * ZG * (p**2 + q**2) + C["Zrp"] * r * p + ZUUDS * u**2 * planes
    )  # fmt: skip
    K = (
        -ZG * W * cos(theta) * sin(phi) + C["Kpp"] * p * abs(p) - (IZZ - IYY) * q * r
        - M_KG * ZG * (w * p - u * r)
    )  # fmt: skip
    M = (
        -ZG * W * sin(theta) + C["Mww"] * w * abs(w) + C["Mqq"] * q * abs(q)
        + (C["Mrp"] - (IXX - IZZ)) * r * p + M_KG * ZG * (v * r - w * q) + C["Muq"] * u * q
        + C["Muw"] * u * w + C["Mvp"] * v * p + MUUDS * u**2 * planes
    )  # fmt: skip
    N = (
        C["Nvv"] * v * abs(v) + C["Nrr"] * r * abs(r) + C["Nuv"] * u * v
        + (C["Npq"] - (IYY - IXX)) * p * q + C["Nwp"] * w * p + C["Nur"] * u * r
        + NUUDR * u**2 * rudder
    )  # fmt: skip
    return np.array([X, Y, Z, K, M, N])


def our_forces(parameters, nu, phi=0.0, theta=0.0, rudder=0.0, planes=0.0):
    """Mass matrix times accelerations."""
    state = RemusState(STILL, (phi, theta, 0.0), tuple(nu), (rudder, planes, 0.0), STILL)
    mass = inertia_of(parameters)
    return np.array(mass.M) @ accelerations(parameters, mass, state)


def test_start_values_are_his_tables():
    c = Coefficients()
    members = chain(*(
        [f"{axis}{member}" for member in group]
        for axis, group in zip("XYZKMN", (SURGE, SWAY, HEAVE, ROLL, PITCH, YAW), strict=True)
    ))  # fmt: skip
    values = chain(c.X, c.Y, c.Z, c.K, c.M, c.N)
    assert dict(zip(members, values, strict=True)) == C
    assert c.inertia == (IXX, IYY, IZZ)


@given(
    nu=st.tuples(*(st.floats(-2.0, 2.0),) * 6), phi=st.floats(-3.0, 3.0), theta=st.floats(-1.5, 1.5)
)
def test_masses_and_forces_are_as_in_his_equations(nu, phi, theta):
    ours = our_forces(PARAMETERS, nu, phi, theta)
    assert ours == pytest.approx(his_forces(nu, phi, theta), rel=1e-9, abs=1e-9)
    assert np.array(inertia_of(PARAMETERS).M) == pytest.approx(np.array(HIS_MASS), rel=1e-12)


@given(u=st.floats(0.1, 3.0), delta=st.floats(-0.26, 0.26))
def test_fins_give_his_forces_and_moments(u, delta):
    """To their published three digits; his rudder is positive to port."""
    state = RemusState(STILL, STILL, (u, 0, 0, 0, 0, 0), (-delta, delta, 0.0), STILL)
    _, Y, Z, _, M, N = tail_forces(PARAMETERS.tail, state)
    scale = u * u * delta
    expected = YUUDR * scale, ZUUDS * scale, MUUDS * scale, NUUDR * scale
    found = Y, Z, M, N
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-12)


@pytest.mark.parametrize("speed", [1.06, 1.5])
def test_the_steady_turn_with_full_rudder_is_his(speed):
    """Within 0.5 %: past our fins flows u^2 + v^2, past his u^2. At 1.5 m/s, 0.257 rad/s."""

    def turn(forces, rudder):
        def residual(x):
            v, r = x
            return forces((sqrt(speed**2 - v * v), v, 0, 0, 0, r), rudder=rudder)[[1, 5]]

        return root(residual, (-0.1, 0.2)).x

    # Held upright, as in his equations of the horizontal plane.
    his = turn(his_forces, radians(-15.0))
    assert turn(partial(our_forces, PARAMETERS), radians(15.0)) == pytest.approx(his, rel=5e-3)
    assert his[1] == pytest.approx(0.257 * speed / 1.5, rel=2e-3)


def test_the_scenario_has_his_vehicle():
    found = {str(name): value for name, value in read_scenario("remus-prestero").parameters.items()}
    hull, tail = PARAMETERS.hull, PARAMETERS.tail
    assert found["plant.hull"] == "coefficients"
    assert found["plant.mass"] * Hull().gravity == pytest.approx(W, rel=1e-4)
    assert (found["plant.mass"], found["plant.r_bg.z"]) == (hull.mass, hull.r_bg[2])
    assert found["plant.net_buoyancy"] == hull.net_buoyancy
    for component in ("plant", "allocation"):
        fins = (found[f"{component}.fin.{name}"] for name in ("x", "lift.r", "lift.s"))
        assert tuple(fins) == (tail.x, tail.lift_r, tail.lift_s)


# Weight and buoyancy


def forces_on_fossens_hull(u, w):
    """Lift, drag and low-speed damping of the spheroid, by Beard and McLain's formulas."""
    span, area = 0.19, 0.7 * 1.6 * 0.19
    aspect, alpha, speed = span**2 / area, atan2(w, u), hypot(u, w)
    C_L = pi * aspect / (1 + sqrt(1 + (aspect / 2) ** 2)) * alpha
    C_D = 0.42 * pi * (span / 2) ** 2 / area + C_L**2 / (pi * 0.7 * aspect)
    lift, drag = (0.5 * 1026 * speed**2 * area * c for c in (C_L, C_D))
    M = inertia_of(Parameters()).M
    return (
        lift * sin(alpha) - drag * cos(alpha) - M[0, 0] / 20 * exp(-3 * speed) * u,
        -lift * cos(alpha) - drag * sin(alpha) - M[2, 2] / 20 * w,
    )


def test_a_buoyant_vehicle_rises_as_fast_as_its_buoyancy_balances_its_drag():
    """Fossen's hull rises level, and the lift at its angle of attack makes it glide ahead."""
    net = 7.0
    buoyant = Parameters(hull=Hull(net_buoyancy=net))
    state = begin(buoyant, STILL)
    for _ in range(5_000):
        state = advance(buoyant, state, AMIDSHIPS, STILL, STILL, 0.02)
    u, w = root(lambda x: np.add(forces_on_fossens_hull(*x), (0.0, -net)), (0.3, -0.3)).x
    assert w < -0.25
    assert state.nu == pytest.approx((u, 0.0, w, 0.0, 0.0, 0.0), abs=1e-4)
    assert state.euler == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)


def test_presteros_vehicle_at_rest_rises_as_his_equations_say():
    """At 0.23 m/s, nearly as by his drag in heave on its own."""

    def residual(x):
        u, w, theta = x
        return his_forces((u, 0, w, 0, 0, 0), theta=theta)[[0, 2, 4]]

    u, w, theta = root(residual, (0.0, -0.2, 0.0)).x
    assert w == pytest.approx(-sqrt((B - W) / 131.0), rel=0.02)
    ours = our_forces(PARAMETERS, (u, 0, w, 0, 0, 0), theta=theta)
    assert ours == pytest.approx(np.zeros(6), abs=1e-6)


@pytest.mark.parametrize("speed", [1.3, 1.5, 2.0])
@pytest.mark.parametrize("net", [7.0, -3.0])
def test_fossens_vehicle_keeps_its_depth_with_the_trim_of_statics(speed, net):
    """Nose down if it is buoyant: pitch and stern planes balance buoyancy and righting moment."""
    vehicle = Parameters(hull=Hull(net_buoyancy=net))
    per_angle = 0.5 * 1026 * 2 * 0.00665 * 0.7 * speed**2
    weight = vehicle.hull.mass * vehicle.hull.gravity

    def planes(theta):
        return -weight * 0.02 * sin(theta) / (0.8 * per_angle)

    def heave(theta):
        _, Z = forces_on_fossens_hull(speed * cos(theta), speed * sin(theta))
        return Z - net * cos(theta) - per_angle * planes(theta)

    theta = brentq(heave, -0.6, 0.6)
    assert theta * net < 0.0
    if (speed, net) == (1.5, 7.0):
        trim = degrees(theta), degrees(planes(theta))
        assert trim == pytest.approx((-5.2, 3.7), abs=0.05)
    nu = (speed * cos(theta), 0.0, speed * sin(theta), 0.0, 0.0, 0.0)
    force = our_forces(vehicle, nu, theta=theta, planes=planes(theta))
    assert force[[2, 4]] == pytest.approx((0.0, 0.0), abs=1e-9)


def test_presteros_stern_planes_hold_7_newtons_at_a_speed_and_not_below_another():
    """9.1 degrees at 1.5 m/s; the fins' 15 degrees are enough from 1.1 m/s on."""

    def trim(forces, speed):
        def residual(x):
            theta, planes = x
            nu = (speed * cos(theta), 0, speed * sin(theta), 0, 0, 0)
            return forces(nu, theta=theta, planes=planes)[[2, 4]]

        return root(residual, (-0.05, -0.1)).x

    for speed, angle in ((1.5, 9.1), (1.1, 15.0)):
        theta, planes = trim(his_forces, speed)
        assert planes == pytest.approx(radians(-angle), rel=0.01)
        assert trim(partial(our_forces, PARAMETERS), speed) == (
            pytest.approx((theta, planes), rel=1e-2)
        )


def test_cross_flow_of_a_cylinder_is_nearly_his_heave_and_a_tenth_of_his_sway():
    """His table has -1310 for sway and -131 for heave; the page says -156 and -11 for strips."""
    per_length = 0.5 * 1030 * 0.19 * ACROSS
    assert per_length * 1.33 == pytest.approx(156, abs=0.5)
    assert per_length * 2 * (1.33 / 2) ** 4 / 4 == pytest.approx(11, abs=0.5)
    assert C["Yvv"] == 10.0 * C["Zww"]
