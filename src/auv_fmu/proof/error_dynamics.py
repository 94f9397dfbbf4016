"""The error dynamics (20), (25) and (28): what they lump into xi, chi_1 and chi_2."""

from __future__ import annotations

from auv_fmu.proof.control_point_model import C_2, D_2, G_2, M_2, Matrix, d
from auv_fmu.vehicle import Vehicle


def chi_1(
    vehicle: Vehicle,
    theta: float,
    psi: float,
    w: Matrix,
    dy_r: Matrix,
    r_1: Matrix,
    ell: float,
) -> Matrix:
    """chi_1 below (25), (3,) [N]: what (26) bounds.

    Args:
        vehicle: parameters.
        theta, psi: pitch and yaw [rad].
        w: sway and heave (v, w) [m/s].
        dy_r: velocity of the virtual reference (16) [m/s].
        r_1: composite error (17) [m/s].
        ell: distance of the control point [m].

    """
    damping = d(vehicle, theta, psi, w, dy_r, ell) - d(vehicle, theta, psi, w, dy_r + r_1, ell)
    lumped: Matrix = damping - C_2(vehicle, theta, psi, dy_r, ell) @ r_1
    return lumped


def chi_2(
    vehicle: Vehicle,
    theta: float,
    psi: float,
    w: Matrix,
    dy_r: Matrix,
    r_1: Matrix,
    r_2: Matrix,
    ell: float,
) -> Matrix:
    """chi_2 below (28), (3,) [N]: what (29) bounds.

    Args:
        vehicle, theta, psi, w, dy_r, r_1, ell: as for :func:`chi_1`.
        r_2: composite error (19) [m/s].

    """
    damping = d(vehicle, theta, psi, w, dy_r, ell) - d(vehicle, theta, psi, w, dy_r + r_1, ell)
    lumped: Matrix = (
        C_2(vehicle, theta, psi, dy_r + r_1, ell) @ r_2
        - C_2(vehicle, theta, psi, r_1, ell) @ (2.0 * dy_r + r_1)
        - D_2(vehicle, theta, psi, ell) @ r_1
        + damping
    )
    return lumped


def xi(
    vehicle: Vehicle,
    theta: float,
    psi: float,
    w: Matrix,
    dy_r: Matrix,
    ddy_r: Matrix,
    disturbance: Matrix,
    ell: float,
) -> Matrix:
    """xi below (20), (3,) [N]: what rho = G theta bounds.

    Args:
        vehicle, theta, psi, w, dy_r, ell: as for :func:`chi_1`.
        ddy_r: acceleration of the virtual reference [m/s2].
        disturbance: tau_w2 of (15) [N].

    """
    lumped: Matrix = (
        -M_2(vehicle, theta, psi, ell) @ ddy_r
        - C_2(vehicle, theta, psi, dy_r, ell) @ dy_r
        - d(vehicle, theta, psi, w, dy_r, ell)
        - D_2(vehicle, theta, psi, ell) @ dy_r
        - G_2(vehicle, theta, psi, ell)
        - disturbance
    )
    return lumped
