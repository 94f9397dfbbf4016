"""The BlueROV2 Heavy by Fossen's vectorial formulas, to compare with.

M, C, D and g as matrices, for any centre of mass, from T. I. Fossen, Handbook of Marine Craft
Hydrodynamics and Motion Control (2011): (3.16), (3.19), (3.56), (4.6), (6.37), (6.43), Euler angles
by (2.18) and (2.28). Numbers of Table A1 of von Benzon et al. (2022), doi:10.3390/jmse10121898.
Nothing here is taken from `auv_fmu`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray

MASS, GRAVITY, RHO, VOLUME = 13.5, 9.82, 1000.0, 0.0134
INERTIA = np.diag((0.26, 0.23, 0.37))
R_G, R_B = np.zeros(3), np.array((0.0, 0.0, -0.01))
ADDED = np.diag((6.36, 7.12, 18.68, 0.189, 0.135, 0.222))
LINEAR = np.diag((13.7, 0.0, 33.0, 0.0, 0.8, 0.0))
QUADRATIC = np.array((141.0, 217.0, 190.0, 1.19, 0.47, 1.5))

#: The published angles by which the first thruster of four is turned about the vertical [rad], and
#: the angles of the direction of the horizontal ones; of the third, 3 pi / 4 is printed, with which
#: the four would not be symmetrical.
HORIZONTAL, VERTICAL = (0.156, 0.111, 0.085), (0.12, 0.218, 0.0)
TURNED = (0.0, 5.05, 1.91, np.pi), (0.0, 4.15, 1.01, np.pi)
DIRECTED = (0.0, np.pi / 2, 3 * np.pi / 2, np.pi)

#: Thrust of a T200 at 16 V [kgf], for pulses of 1100 to 1900 us every 20 us: "T200 Public
#: Performance Data 10-20 V", Blue Robotics, September 2019.
T200 = np.array((
    -4.0695, -3.8691, -3.6560, -3.3112, -2.9937, -2.7079, -2.4539, -2.1954, -1.9414, -1.6692,
    -1.4379, -1.2020, -1.0206, -0.8210, -0.6486, -0.4808, -0.3221, -0.1814, -0.0680, 0.0,
    0.0, 0.0, 0.0771, 0.2177, 0.3992, 0.6033, 0.8165, 1.0342, 1.2791, 1.5377,
    1.8234, 2.1228, 2.4313, 2.7578, 3.1071, 3.4201, 3.8192, 4.2547, 4.6493, 5.0122,
    5.2450,
))  # fmt: skip
PULSES = np.linspace(1100.0, 1900.0, 41)
KGF = 9.80665


def turn_about_z(angle: float) -> Array:
    """The rotation about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def published_positions() -> Array:
    """The positions by the published angles, (8, 3) [m]."""
    first = [turn_about_z(angle) @ HORIZONTAL for angle in TURNED[0]]
    return np.array([*first, *(turn_about_z(angle) @ VERTICAL for angle in TURNED[1])])


def positions() -> Array:
    """The positions mirrored at the axes, which the angles are rounded from, (8, 3) [m]."""
    signs = np.array(((1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1)))
    return np.concatenate((signs * HORIZONTAL, signs * VERTICAL))


def directions() -> Array:
    """The directions of positive thrusts, (8, 3)."""
    first = np.array((1.0, -1.0, 0.0)) / np.sqrt(2.0)
    return np.array([*(turn_about_z(a) @ first for a in DIRECTED), *(((0.0, 0.0, -1.0),) * 4)])


def effect() -> Array:
    """B: force and moment per thrust, (6, 8)."""
    e = directions()
    return np.concatenate((e, np.cross(positions(), e)), axis=1).T


def S(a: Array) -> Array:
    """The matrix of a cross product."""
    return np.array(((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0)))


def rotation(euler: Array) -> Array:
    """Body to earth."""
    (cf, ct, cp), (sf, st, sp) = np.cos(euler), np.sin(euler)
    return np.array((
        (cp * ct, -sp * cf + cp * st * sf, sp * sf + cp * cf * st),
        (sp * ct, cp * cf + sf * st * sp, -cp * sf + st * sp * cf),
        (-st, ct * sf, ct * cf),
    ))  # fmt: skip


def coriolis(M: Array, nu: Array) -> Array:
    """C(nu) from a mass matrix."""
    a = M[:3, :3] @ nu[:3] + M[:3, 3:] @ nu[3:]
    b = M[3:, :3] @ nu[:3] + M[3:, 3:] @ nu[3:]
    zero = np.zeros((3, 3))
    return np.block([[zero, -S(a)], [-S(a), -S(b)]])


def restoring(euler: Array, W: float, B: float) -> Array:
    """g(eta) in component form."""
    (phi, theta, _), (x_g, y_g, z_g), (x_b, y_b, z_b) = euler, R_G, R_B
    s, c, sf, cf = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
    return np.array((
        (W - B) * s,
        -(W - B) * c * sf,
        -(W - B) * c * cf,
        -(y_g * W - y_b * B) * c * cf + (z_g * W - z_b * B) * c * sf,
        (z_g * W - z_b * B) * s + (x_g * W - x_b * B) * c * cf,
        -(x_g * W - x_b * B) * c * sf - (y_g * W - y_b * B) * s,
    ))  # fmt: skip


class Water(NamedTuple):
    """Velocity [m/s] and acceleration [m/s2] of the water, earth frame."""

    velocity: Array = np.zeros(3)
    acceleration: Array = np.zeros(3)


#: Water at rest.
STILL = Water()


def accelerations(euler: Array, nu: Array, tau: Array, water: Water = STILL) -> Array:
    """d nu/dt over ground by M_RB dnu + C_RB nu + M_A dnu_r + C_A nu_r + D nu_r + g = tau + tau_FK.

    tau_FK is the force of the pressure in accelerating water on the displaced volume, at its
    centre.
    """
    R = rotation(euler)
    nu_c = np.concatenate((R.T @ water.velocity, np.zeros(3)))
    # The water's velocity in the turning body frame.
    dnu_c = np.concatenate((R.T @ water.acceleration - np.cross(nu[3:], nu_c[:3]), np.zeros(3)))
    M_RB = np.block([
        [MASS * np.eye(3), -MASS * S(R_G)],
        [MASS * S(R_G), INERTIA - MASS * S(R_G) @ S(R_G)],
    ])  # fmt: skip
    nu_r = nu - nu_c
    D = LINEAR + np.diag(QUADRATIC * np.abs(nu_r))
    push = RHO * VOLUME * (R.T @ water.acceleration)
    tau_FK = np.concatenate((push, np.cross(R_B, push)))
    rest = (
        tau
        + tau_FK
        - coriolis(M_RB, nu) @ nu
        - coriolis(ADDED, nu_r) @ nu_r
        - D @ nu_r
        - restoring(euler, MASS * GRAVITY, RHO * GRAVITY * VOLUME)
    )
    return np.linalg.solve(M_RB + ADDED, rest + ADDED @ dnu_c)


def euler_rates(euler: Array, omega: Array) -> Array:
    """Rates of roll, pitch and yaw."""
    phi, theta, _ = euler
    t, c, sf, cf = np.tan(theta), np.cos(theta), np.sin(phi), np.cos(phi)
    T = np.array(((1.0, sf * t, cf * t), (0.0, cf, -sf), (0.0, sf / c, cf / c)))
    return T @ omega


def response(
    thrust: Callable[[float], Array], times: Array, T: float, water: Water = STILL
) -> Array:
    """Motion from rest in open loop: eta and nu, (len(times), 12).

    Args:
        thrust: steady thrusts over time [N]; each thruster follows with the time constant T [s].
        times: of the rows, from 0 on [s].
        water: with a constant velocity.

    """
    B = effect()

    def rate(t: float, x: Array) -> Array:
        euler, nu, f = x[3:6], x[6:12], x[12:]
        return np.concatenate((
            rotation(euler) @ nu[:3],
            euler_rates(euler, nu[3:]),
            accelerations(euler, nu, B @ f, water),
            (thrust(t) - f) / T,
        ))  # fmt: skip

    found = solve_ivp(
        rate, (times[0], times[-1]), np.zeros(20), "LSODA", times, rtol=1e-10, atol=1e-12,
        max_step=0.05,
    )  # fmt: skip
    return found.y[:12].T
