"""The Lyapunov function (34), or (55), and the composite errors (17) and (19) it is made of."""

from __future__ import annotations

from auv_fmu.control_point import actuated_velocity
from auv_fmu.observer import observer_velocity
from auv_fmu.output_feedback import virtual_reference
from auv_fmu.saturation import Integral, Saturation
from auv_fmu.types import Rotation, Vector3
from auv_fmu.vehicle import Vehicle


def kinetic(vehicle: Vehicle, rotation: Rotation, ell: float, r: Vector3) -> float:
    """R' M_2 r / 2 [J], with M_2 = J^-T M_1 J^-1 of (15): v' M_1 v / 2 at v = J^-1 r.

    Args:
        vehicle: parameters.
        rotation: body to earth.
        ell: distance of the control point [m].
        r: composite error [m/s], earth frame.

    """
    u, q, s = actuated_velocity(rotation, ell, r, (0.0, 0.0))
    return 0.5 * (vehicle.m11 * u * u + vehicle.m55 * q * q + vehicle.m66 * s * s)


def composite_errors(
    dy: float, dy_d: float, e_z: float, dy_hat: float, z: float, lambda_: float, s: Saturation
) -> tuple[float, float]:
    """r_1 = dy/dt - dy_r/dt and r_2 = dy/dt - dy_o/dt, one axis: equations (17) and (19).

    Args:
        dy, dy_d, dy_hat: true, desired and estimated velocity of the control point [m/s].
        e_z: e - z = y_hat - y_d [m].
        z: estimation error that the observer has seen [m].
        lambda_: diagonal entry of Lambda [m/s].
        s: saturation function.

    """
    dy_r = virtual_reference(dy_d, s(e_z)[0], lambda_)
    dy_o = observer_velocity(dy_hat, s(z)[0], lambda_)
    return dy - dy_r, dy - dy_o


def lyapunov(
    vehicle: Vehicle,
    rotation: Rotation,
    ell: float,
    K2: Vector3,
    integral: Integral,
    e: Vector3,
    z: Vector3,
    r_1: Vector3,
    r_2: Vector3,
) -> float:
    """(34) or (55) without its last term, which needs the unknown theta.

    Args:
        vehicle: parameters.
        rotation: body to earth.
        ell: distance of the control point [m].
        K2: diagonal of K_2 [N].
        integral: of the saturation function.
        e: tracking error [m].
        z: estimation error [m].
        r_1, r_2: composite errors (17) and (19) [m/s].

    """
    potential = sum(k * (integral(e_i - z_i) + integral(z_i)) for k, e_i, z_i in zip(K2, e, z))
    return potential + kinetic(vehicle, rotation, ell, r_1) + kinetic(vehicle, rotation, ell, r_2)
