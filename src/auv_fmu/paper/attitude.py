"""Attitude: T_1 of (1) for any roll, the unit quaternion, and Euler angles.

The paper writes (1) with Euler angles, whose yaw rate has a pole when the vehicle points
straight up or down. The simulated vehicle does so in Figs. 5 and 6, so it integrates a unit
quaternion instead and reports Euler angles (reading 2).
"""

from __future__ import annotations

from math import asin, atan2, cos, sin, sqrt

from auv_fmu.language.vectors import Rotation, Vector3, Vector4


def rotation_from_euler(phi: float, theta: float, psi: float) -> Rotation:
    """Rotation matrix from body to earth; with phi = 0 it is T_1(eta_2) of (1).

    Args:
        phi, theta, psi: roll, pitch and yaw [rad], applied in the order yaw, pitch, roll.

    Returns:
        Columns (R e1, R e2, R e3).

    """
    c_phi, s_phi = cos(phi), sin(phi)
    c_theta, s_theta = cos(theta), sin(theta)
    c_psi, s_psi = cos(psi), sin(psi)
    return (
        (c_psi * c_theta, s_psi * c_theta, -s_theta),
        (
            s_theta * c_psi * s_phi - s_psi * c_phi,
            s_theta * s_psi * s_phi + c_psi * c_phi,
            c_theta * s_phi,
        ),
        (
            s_theta * c_psi * c_phi + s_psi * s_phi,
            s_theta * s_psi * c_phi - c_psi * s_phi,
            c_theta * c_phi,
        ),
    )


def rotate(rotation: Rotation, x: Vector3) -> Vector3:
    """R x: a vector from the body frame to the earth frame."""
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = rotation
    x0, x1, x2 = x
    return (
        a0 * x0 + b0 * x1 + c0 * x2,
        a1 * x0 + b1 * x1 + c1 * x2,
        a2 * x0 + b2 * x1 + c2 * x2,
    )


def rotate_back(rotation: Rotation, x: Vector3) -> Vector3:
    """R^T x: a vector from the earth frame to the body frame."""
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = rotation
    x0, x1, x2 = x
    return (
        a0 * x0 + a1 * x1 + a2 * x2,
        b0 * x0 + b1 * x1 + b2 * x2,
        c0 * x0 + c1 * x1 + c2 * x2,
    )


def quaternion_from_euler(phi: float, theta: float, psi: float) -> Vector4:
    """Unit quaternion (scalar first) of the rotation of :func:`rotation_from_euler`."""
    c_phi, s_phi = cos(phi / 2), sin(phi / 2)
    c_theta, s_theta = cos(theta / 2), sin(theta / 2)
    c_psi, s_psi = cos(psi / 2), sin(psi / 2)
    return (
        c_phi * c_theta * c_psi + s_phi * s_theta * s_psi,
        s_phi * c_theta * c_psi - c_phi * s_theta * s_psi,
        c_phi * s_theta * c_psi + s_phi * c_theta * s_psi,
        c_phi * c_theta * s_psi - s_phi * s_theta * c_psi,
    )


def rotation_from_quaternion(quaternion: Vector4) -> Rotation:
    """Rotation matrix from body to earth of a unit quaternion, as its columns."""
    a, b, c, d = quaternion
    return (
        (1 - 2 * (c * c + d * d), 2 * (b * c + a * d), 2 * (b * d - a * c)),
        (2 * (b * c - a * d), 1 - 2 * (b * b + d * d), 2 * (c * d + a * b)),
        (2 * (b * d + a * c), 2 * (c * d - a * b), 1 - 2 * (b * b + c * c)),
    )


def euler_from_rotation(rotation: Rotation) -> Vector3:
    """Roll, pitch and yaw [rad] of a rotation, pitch within +-pi/2.

    If the vehicle is vertical, roll and yaw are not unique, but together they are: from them
    :func:`rotation_from_euler` restores the rotation.
    """
    (r11, r21, r31), (_, _, r32), (_, _, r33) = rotation
    # Rounding can take this product of quaternion components out of [-1, 1] by one ulp.
    sin_theta = -1.0 if r31 > 1.0 else 1.0 if r31 < -1.0 else -r31
    return atan2(r32, r33), asin(sin_theta), atan2(r21, r11)


def euler_without_roll(rotation: Rotation) -> Vector3:
    """Roll, pitch and yaw [rad] of a rotation without roll, also beyond the vertical."""
    (_, _, r31), (r12, r22, _), (_, _, r33) = rotation
    return 0.0, atan2(-r31, r33), atan2(-r12, r22)


def quaternion_rates(quaternion: Vector4, omega: Vector3) -> Vector4:
    """Time derivative of the attitude for the body rates omega = (p, q, r) [rad/s]."""
    a, b, c, d = quaternion
    p, q, r = omega
    return (
        -0.5 * (b * p + c * q + d * r),
        0.5 * (a * p + c * r - d * q),
        0.5 * (a * q + d * p - b * r),
        0.5 * (a * r + b * q - c * p),
    )


def normalised(quaternion: Vector4) -> Vector4:
    """Unit quaternion of the same direction.

    Raises:
        ZeroDivisionError: the quaternion is zero.

    """
    a, b, c, d = quaternion
    norm = sqrt(a * a + b * b + c * c + d * d)
    return a / norm, b / norm, c / norm, d / norm
