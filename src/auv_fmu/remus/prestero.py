"""The hull of the REMUS in the form of Prestero (2001): products of velocities with coefficients.

T. Prestero, Verification of a Six-Degree of Freedom Simulation Model for the REMUS Autonomous
Underwater Vehicle, thesis, MIT and WHOI, 2001. Not in the paper. The names of the coefficients are
his: `Y.uv` is Y_uv, and `Y.dv` the added mass that he writes with a dot above the v. Where his
table has adjusted and computed values, these are the adjusted ones; the page of the component says
which. Everything refers to the centre of buoyancy.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix
from auv_fmu.language.quantities import Members
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, Vector6
from auv_fmu.remus.hull import Hull, Inertia, mass_matrix

Vector8 = tuple[float, float, float, float, float, float, float, float]

INERTIA: Members = dict.fromkeys("xyz", "kg.m2")
SURGE: Members = {"du": "kg", "uu": "kg/m", "wq": "kg", "qq": "kg.m", "vr": "kg", "rr": "kg.m"}
SWAY: Members = {
    "dv": "kg", "dr": "kg.m", "vv": "kg/m", "rr": "kg.m",
    "uv": "kg/m", "wp": "kg", "ur": "kg", "pq": "kg.m",
}  # fmt: skip
HEAVE: Members = {
    "dw": "kg", "dq": "kg.m", "ww": "kg/m", "qq": "kg.m",
    "uw": "kg/m", "uq": "kg", "vp": "kg", "rp": "kg.m",
}  # fmt: skip
ROLL: Members = {"dp": "kg.m2", "pp": "kg.m2"}
PITCH: Members = {
    "dw": "kg.m", "dq": "kg.m2", "ww": "kg", "qq": "kg.m2",
    "uw": "kg", "uq": "kg.m", "vp": "kg.m", "rp": "kg.m2",
}  # fmt: skip
YAW: Members = {
    "dv": "kg.m", "dr": "kg.m2", "vv": "kg", "rr": "kg.m2",
    "uv": "kg", "wp": "kg.m", "ur": "kg.m", "pq": "kg.m2",
}  # fmt: skip


class Coefficients(NamedTuple):
    """Coefficients of the hull with fixed fins, and its moments of inertia."""

    inertia: Annotated[
        Vector3,
        Variable(INERTIA, "Moments of inertia about the centre of buoyancy", POSITIVE),
    ] = (0.177, 3.45, 3.45)
    X: Annotated[Vector6, Variable(SURGE, "Coefficients of the surge force")] = (
        -0.93, -1.62, -35.5, -1.93, 35.5, -1.93,
    )  # fmt: skip
    Y: Annotated[Vector8, Variable(SWAY, "Coefficients of the sway force")] = (
        -35.5, 1.93, -1310.0, 0.632, -28.6, 35.5, 5.22, 1.93,
    )  # fmt: skip
    Z: Annotated[Vector8, Variable(HEAVE, "Coefficients of the heave force")] = (
        -35.5, -1.93, -131.0, -0.632, -28.6, -5.22, -35.5, 1.93,
    )  # fmt: skip
    K: Annotated[tuple[float, float], Variable(ROLL, "Coefficients of the roll moment")] = (
        -0.0704, -0.13,
    )  # fmt: skip
    M: Annotated[Vector8, Variable(PITCH, "Coefficients of the pitch moment")] = (
        -1.93, -4.88, 3.18, -188.0, 24.0, -2.0, -1.93, 4.86,
    )  # fmt: skip
    N: Annotated[Vector8, Variable(YAW, "Coefficients of the yaw moment")] = (
        1.93, -4.88, -3.18, -94.0, -24.0, -1.93, -2.0, -4.86,
    )  # fmt: skip


def inertia(coefficients: Coefficients, hull: Hull) -> Inertia:
    """Mass matrix with added mass; the other effects of added mass are in the coefficients.

    Args:
        coefficients: of the hull.
        hull: its mass and its centre of mass.

    """
    m = hull.mass
    x, y, z = hull.r_bg
    i_x = coefficients.inertia[0] - m * (y * y + z * z)
    i_y = coefficients.inertia[1] - m * (x * x + z * z)
    i_z = coefficients.inertia[2] - m * (x * x + y * y)
    X, Y, Z = coefficients.X, coefficients.Y, coefficients.Z
    K, M, N = coefficients.K, coefficients.M, coefficients.N
    whole = mass_matrix(hull, (i_x, i_y, i_z), (-X[0], -Y[0], -Z[0], -K[0], -M[1], -N[1]))
    coupling = Matrix(
        (
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, Y[1]),
            (0.0, 0.0, 0.0, 0.0, Z[1], 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, M[0], 0.0, 0.0, 0.0),
            (0.0, N[0], 0.0, 0.0, 0.0, 0.0),
        )
    )
    return Inertia(i_x, i_y, i_z, 0.0, 0.0, 0.0, 0.0, whole - coupling)


def forces(coefficients: Coefficients, nu_r: Vector6) -> Vector6:
    """Force of the water on the hull, apart from its accelerations.

    Args:
        coefficients: of the hull.
        nu_r: (u, v, w, p, q, r) through the water [m/s, rad/s], body frame.

    Returns:
        Force and moment (u, v, w, p, q, r) [N, N.m], body frame.

    """
    u, v, w, p, q, r = nu_r
    _, uu, wq, qq, vr, rr = coefficients.X
    X = uu * u * abs(u) + wq * w * q + qq * q * q + vr * v * r + rr * r * r
    _, _, vv, rr, uv, wp, ur, pq = coefficients.Y
    Y = vv * v * abs(v) + rr * r * abs(r) + uv * u * v + wp * w * p + ur * u * r + pq * p * q
    _, _, ww, qq, uw, uq, vp, rp = coefficients.Z
    Z = ww * w * abs(w) + qq * q * abs(q) + uw * u * w + uq * u * q + vp * v * p + rp * r * p
    K = coefficients.K[1] * p * abs(p)
    _, _, ww, qq, uw, uq, vp, rp = coefficients.M
    M = ww * w * abs(w) + qq * q * abs(q) + uw * u * w + uq * u * q + vp * v * p + rp * r * p
    _, _, vv, rr, uv, wp, ur, pq = coefficients.N
    N = vv * v * abs(v) + rr * r * abs(r) + uv * u * v + wp * w * p + ur * u * r + pq * p * q
    return X, Y, Z, K, M, N
