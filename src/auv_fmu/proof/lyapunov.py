"""The Lyapunov function (34), or (55), and its composite errors (17) and (19)."""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu.language.vectors import Rotation, Vector3, sub, sub_scaled
from auv_fmu.paper.control_point import actuated_velocity
from auv_fmu.paper.saturation import Saturation, integral, saturation
from auv_fmu.paper.vehicle import Vehicle


class Errors(NamedTuple):
    """Errors in (34), with the true state of the vehicle."""

    e: Vector3  #: tracking error y - y_d [m]
    z: Vector3  #: estimation error y - y_hat [m]
    r_1: Vector3  #: composite error (17) [m/s]
    r_2: Vector3  #: composite error (19) [m/s]


def composite_errors(
    dy: Vector3,
    dy_d: Vector3,
    dy_hat: Vector3,
    e_z: Vector3,
    z: Vector3,
    lambda_: float,
    s: Saturation,
) -> tuple[Vector3, Vector3]:
    """Equations (17) and (19): r_1 = dy - dy_r and r_2 = dy - dy_o [m/s].

    Args:
        dy, dy_d, dy_hat: true, desired and estimated velocity of the control point [m/s].
        e_z: e - z = y_hat - y_d [m].
        z: estimation error of the observer [m].
        lambda_: diagonal entry of Lambda [m/s].
        s: saturation function.

    """
    dy_r = sub_scaled(dy_d, lambda_, saturation(s, e_z))  # (16)
    dy_o = sub_scaled(dy_hat, lambda_, saturation(s, z))  # (18)
    return sub(dy, dy_r), sub(dy, dy_o)


def potential(e: Vector3, z: Vector3, K2: Vector3, s: Saturation) -> float:
    """Sums over k_2i in (34) and (55) [J].

    Args:
        e, z: tracking and estimation error [m].
        K2: diagonal of K_2 [N].
        s: saturation function.

    """
    return sum(k * (integral(s, e_i - z_i) + integral(s, z_i)) for k, e_i, z_i in zip(K2, e, z))


def kinetic(vehicle: Vehicle, rotation: Rotation, r: Vector3, ell: float) -> float:
    """r^T M_2 r / 2 [J], with M_2 = J^-T M_1 J^-1 of (15): v^T M_1 v / 2 at v = J^-1 r.

    Args:
        vehicle: parameters.
        rotation: body to earth.
        r: composite error [m/s], earth frame.
        ell: distance of the control point [m].

    """
    v_u, v_q, v_r = actuated_velocity(rotation, r, (0.0, 0.0), ell)
    return 0.5 * (vehicle.m11 * v_u * v_u + vehicle.m55 * v_q * v_q + vehicle.m66 * v_r * v_r)


def lyapunov(
    vehicle: Vehicle,
    rotation: Rotation,
    errors: Errors,
    K2: Vector3,
    s: Saturation,
    ell: float,
) -> float:
    """Equation (34) or (55): V [J] without its last term, which needs the unknown theta.

    Args:
        vehicle: parameters.
        rotation: body to earth.
        errors: at the same instant.
        K2: diagonal of K_2 [N].
        s: saturation function.
        ell: distance of the control point [m].

    """
    e, z, r_1, r_2 = errors
    return (
        potential(e, z, K2, s)
        + kinetic(vehicle, rotation, r_1, ell)
        + kinetic(vehicle, rotation, r_2, ell)
    )
