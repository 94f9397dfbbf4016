"""The model the proof works on: (4) to (8), (11), (14), (15), and error dynamics, in matrices.

The controller does not need these matrices. They are here to check properties of the paper and
the conditions of its theorems, and never run inside an FMU, so they are numpy arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from auv_fmu.language.vectors import Rotation, Vector3, scale
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.vehicle import Vehicle

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
        """Centripetal and Coriolis matrix of (8), (2, 3), at v = (u, q, r) [m/s, rad/s].

        It multiplies v: (7) prints w behind it, for which it has a column too many, and (2) has the
        product (m11 u r, -m11 u q).
        """
        m11_u = self.vehicle.m11 * v[0]
        return np.array([[0.0, 0.0, m11_u], [0.0, -m11_u, 0.0]])


def jacobian(rotation: Rotation, ell: float) -> tuple[Vector3, Vector3, Vector3]:
    """J(eta) of (11) as its columns, for (u, q, r)."""
    e1, e2, e3 = rotation
    return e1, scale(-ell, e3), scale(ell, e2)


def J(theta: float, psi: float, ell: float) -> Matrix:
    """The Jacobian (11) as a matrix, (3, 3)."""
    return np.column_stack(jacobian(rotation_from_euler(0.0, theta, psi), ell))


def J_delta(theta: float, psi: float, w: Matrix) -> Matrix:
    """J_delta(eta, w) of (12), (3,): what sway and heave w = (v, w) [m/s] add to dy/dt."""
    return kinematic_disturbance(theta, psi, w)[:3]


def drift(ell: float) -> Matrix:
    """The derivative of J^-1 J_delta by w, (3, 2) [1/m].

    J^-1 J_delta = (0, -w / ell, v / ell) at every attitude, so its derivative by eta is zero.
    """
    return np.array([[0.0, 0.0], [0.0, -1.0 / ell], [1.0 / ell, 0.0]])


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
    """C_2 = -J^-T M_1 J^-1 dJ/dt J^-1 of (15), (3, 3) [kg/s], linear in a velocity.

    Along a motion dJ/dt follows from (u, q, r) = J^-1 (dy - J_delta), so C_2 stands at the velocity
    dy - J_delta there. The paper writes C_2(eta, dy), and works with it as a function that is
    linear in dy: at that velocity sway and heave are left out of the rate of J.

    Args:
        vehicle: parameters.
        theta, psi: pitch and yaw [rad].
        dy: velocity of the control point [m/s]; the attitude turns as (4) says for
            (u, q, r) = J^-1 dy.
        ell: distance of the control point [m].

    """
    J_inverse: Matrix = np.linalg.inv(J(theta, psi, ell))
    *_, dtheta, dpsi = kinematic_matrix(theta, psi) @ J_inverse @ dy
    rate = J_dot(theta, psi, dtheta, dpsi, ell)
    return -J_inverse.T @ ActuatedDynamics(vehicle).M_1 @ J_inverse @ rate @ J_inverse


def d(vehicle: Vehicle, theta: float, psi: float, w: Matrix, dy: Matrix, ell: float) -> Matrix:
    """d(eta, w, dy) as printed below (15), (3,) [N], without its term in d(J^-1 J_delta)/d eta = 0.

    Args:
        vehicle: parameters.
        theta, psi: pitch and yaw [rad].
        w: sway and heave (v, w) [m/s].
        dy: velocity of the control point [m/s].
        ell: distance of the control point [m].

    """
    model = ActuatedDynamics(vehicle)
    J_inverse: Matrix = np.linalg.inv(J(theta, psi, ell))
    v, v_delta = J_inverse @ dy, drift(ell) @ w
    coriolis = model.C_1_bar(v) @ v - 2.0 * model.C_1_bar(v_delta) @ v
    force: Matrix = J_inverse.T @ (model.C_1(w) @ v + _forced_drift(model, coriolis, ell))
    return force


def d_missing(
    vehicle: Vehicle, theta: float, psi: float, w: Matrix, dy: Matrix, ell: float
) -> Matrix:
    """The part that d of (15) lacks, (3,) [N]: linear in dy, and zero without sway and heave.

    C_1_bar(v) v at v = J^-1 dy - J^-1 J_delta is expanded below (14) as if C_1_bar(a) b were
    C_1_bar(b) a. (It has C_1_bar(J^-1 J_delta) = 0, so that the mixed terms as printed vanish.) And
    C_2(eta, dy) turns the attitude by dy, not by dy - J_delta.

    Args:
        vehicle, theta, psi, w, dy, ell: as for :func:`d`.

    """
    model = ActuatedDynamics(vehicle)
    J_inverse: Matrix = np.linalg.inv(J(theta, psi, ell))
    v, v_delta = J_inverse @ dy, drift(ell) @ w
    coriolis = model.C_1_bar(v_delta) @ v - model.C_1_bar(v) @ v_delta
    turning = C_2(vehicle, theta, psi, J_delta(theta, psi, w), ell) @ dy
    force: Matrix = J_inverse.T @ _forced_drift(model, coriolis, ell) - turning
    return force


def tau_w2(
    vehicle: Vehicle,
    theta: float,
    psi: float,
    w: Matrix,
    tau_w1: Matrix,
    tau_w1_bar: Matrix,
    ell: float,
) -> Matrix:
    """tau_w2(eta, w, t) of (15), (3,) [N].

    Args:
        vehicle, theta, psi, w, ell: as for :func:`d`.
        tau_w1: disturbance of (6), in u, q, r [N, N.m].
        tau_w1_bar: disturbance of (7), in v, w [N].

    """
    model = ActuatedDynamics(vehicle)
    v_delta = drift(ell) @ w
    unactuated = model.D_1_bar @ w + tau_w1_bar + model.C_1_bar(v_delta) @ v_delta
    actuated = tau_w1 - model.C_1(w) @ v_delta - model.D_1 @ v_delta
    J_inverse: Matrix = np.linalg.inv(J(theta, psi, ell))
    force: Matrix = J_inverse.T @ (actuated + _forced_drift(model, unactuated, ell))
    return force


def _forced_drift(model: ActuatedDynamics, force: Matrix, ell: float) -> Matrix:
    """M_1 d(J^-1 J_delta)/dw M_1_bar^-1 times a force in sway and heave, (3,) [N, N.m]."""
    forced: Matrix = model.M_1 @ drift(ell) @ np.linalg.solve(model.M_1_bar, force)
    return forced


# The error dynamics (20), (25) and (28): what they lump into xi, chi_1 and chi_2


def chi_1(
    vehicle: Vehicle, theta: float, psi: float, w: Matrix, dy_r: Matrix, r_1: Matrix, ell: float
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
