"""The model the proof works on: (4) to (8), (14) and (15), in matrices.

The controller needs none of these matrices. They are here to check properties of the paper and
the conditions of its theorems, and never run inside an FMU, so they are numpy arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import jacobian
from auv_fmu.vehicle import Vehicle

Matrix = np.ndarray[Any, Any]


def kinematic_matrix(theta: float, psi: float) -> Matrix:
    """S(eta) of (5), (5, 3): actuated velocity (u, q, r) to d/dt (x, y, z, theta, psi).

    Args:
        theta, psi: pitch and yaw [rad]; the last row has a pole at theta = +-pi/2.

    """
    S = np.zeros((5, 3))
    S[:3, 0] = rotation_from_euler(0.0, theta, psi)[0]
    S[3, 1] = 1.0
    S[4, 2] = 1.0 / np.cos(theta)
    return S


def kinematic_disturbance(theta: float, psi: float, w: Matrix) -> Matrix:
    """delta(eta, w) of (5), (5,): what sway and heave w = (v, w) [m/s] add to d eta/dt."""
    _, e2, e3 = rotation_from_euler(0.0, theta, psi)
    return np.concatenate([w[0] * np.array(e2) + w[1] * np.array(e3), np.zeros(2)])


@dataclass(frozen=True)
class ActuatedDynamics:
    """Matrices of (6), and of (7) and (8), for one vehicle."""

    vehicle: Vehicle

    @property
    def M_1(self) -> Matrix:
        """Inertia of (6)."""
        return np.diag([self.vehicle.m11, self.vehicle.m55, self.vehicle.m66])

    @property
    def D_1(self) -> Matrix:
        """Damping of (6)."""
        return np.diag([self.vehicle.d11, self.vehicle.d55, self.vehicle.d66])

    @property
    def M_1_bar(self) -> Matrix:
        """Inertia of (8)."""
        return np.diag([self.vehicle.m22, self.vehicle.m33])

    @property
    def D_1_bar(self) -> Matrix:
        """Damping of (8)."""
        return np.diag([self.vehicle.d22, self.vehicle.d33])

    def C_1(self, w: Matrix) -> Matrix:
        """Centripetal and Coriolis matrix of (6), (3, 3), at sway and heave w [m/s]."""
        m11, m22, m33 = self.vehicle.m11, self.vehicle.m22, self.vehicle.m33
        return np.array(
            [
                [0.0, m33 * w[1], -m22 * w[0]],
                [(m11 - m33) * w[1], 0.0, 0.0],
                [(m22 - m11) * w[0], 0.0, 0.0],
            ]
        )

    def G_1(self, theta: float) -> Matrix:
        """Righting moment of (6), (3,) [N, N.m, N.m]."""
        return np.array([0.0, self.vehicle.righting_pitch * np.sin(theta), 0.0])

    def C_1_bar(self, v: Matrix) -> Matrix:
        """Centripetal and Coriolis forces of (7) in sway and heave, (2,) [N].

        (8) prints a matrix of three columns that multiplies v = (u, q, r) and holds m11 u; the
        product is (m11 u r, -m11 u q), as in (2).
        """
        u, q, r = v
        return np.array([self.vehicle.m11 * u * r, -self.vehicle.m11 * u * q])


def J(theta: float, psi: float, ell: float) -> Matrix:
    """The Jacobian (11) as a matrix, (3, 3)."""
    return np.column_stack(jacobian(rotation_from_euler(0.0, theta, psi), ell))


def J_dot(theta: float, psi: float, dtheta: float, dpsi: float, ell: float) -> Matrix:
    """Time derivative of (11), (3, 3), while the attitude turns at (dtheta, dpsi) [rad/s].

    J = R P with a constant P, and dR/dt = R S(omega) with the rates of a body without roll.
    """
    R = np.column_stack(rotation_from_euler(0.0, theta, psi))
    p, q, r = -dpsi * np.sin(theta), dtheta, dpsi * np.cos(theta)
    S_omega = np.array([[0.0, -r, q], [r, 0.0, -p], [-q, p, 0.0]])
    rate: Matrix = R @ S_omega @ R.T @ J(theta, psi, ell)
    return rate


def M_2(vehicle: Vehicle, theta: float, psi: float, ell: float) -> Matrix:
    """M_2 = J^-T M_1 J^-1 of (15), (3, 3) [kg]."""
    J_inverse: Matrix = np.linalg.inv(J(theta, psi, ell))
    return J_inverse.T @ ActuatedDynamics(vehicle).M_1 @ J_inverse


def D_2(vehicle: Vehicle, theta: float, psi: float, ell: float) -> Matrix:
    """D_2 = J^-T D_1 J^-1 of (15), (3, 3) [kg/s]."""
    J_inverse: Matrix = np.linalg.inv(J(theta, psi, ell))
    return J_inverse.T @ ActuatedDynamics(vehicle).D_1 @ J_inverse


def G_2(vehicle: Vehicle, theta: float, psi: float, ell: float) -> Matrix:
    """G_2 = J^-T G_1 of (15), (3,) [N]."""
    return np.linalg.inv(J(theta, psi, ell)).T @ ActuatedDynamics(vehicle).G_1(theta)


def C_2(vehicle: Vehicle, theta: float, psi: float, dy: Matrix, ell: float) -> Matrix:
    """C_2 = -J^-T M_1 J^-1 dJ/dt J^-1 of (15), (3, 3) [kg/s].

    C_2(eta, dy) has no sway and heave to turn by: the (u, q, r) that dJ/dt is taken at are those of
    (13) with J_delta left out. With v and w the attitude turns differently, and P2.2 holds only for
    the rate of M_2 that leaves them out too, which is how it is tested.

    Args:
        vehicle: parameters.
        theta, psi: pitch and yaw [rad].
        dy: velocity of the control point [m/s]; the attitude turns as (4) says for
            (u, q, r) = J^-1 dy, without sway and heave.
        ell: distance of the control point [m].

    """
    J_inverse: Matrix = np.linalg.inv(J(theta, psi, ell))
    *_, dtheta, dpsi = kinematic_matrix(theta, psi) @ J_inverse @ dy
    rate = J_dot(theta, psi, dtheta, dpsi, ell)
    return -J_inverse.T @ ActuatedDynamics(vehicle).M_1 @ J_inverse @ rate @ J_inverse
