"""Distances between the references of a formation and its leader's, as formation.md proves them.

The filter of the heading takes psi', which is at most `turn_chi`, to chi', chi'' and e by transfer
functions with a triple pole at -omega. The largest that comes out is the integral of the absolute
value of the impulse response; with tau = omega t these are

    chi':  omega (3 tau - tau^2) exp(-tau)        integral 1 + 10 exp(-3)
    chi'': omega times the derivative of that     2 omega (f(t_1) - f(t_2)), f = (3 t - t^2) exp(-t)
    e:     (1 + tau - tau^2) exp(-tau)            integral 2 (g^2 + g) exp(-g) / omega

with t_1, t_2 = (5 -+ sqrt(13)) / 2, where f has its extremes, and g = (1 + sqrt(5)) / 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, hypot, inf, sqrt, tanh
from typing import NamedTuple

from auv_fmu.guidance.formation import (
    MOST,
    PEAK_ACCELERATION,
    PEAK_SPEED,
    Estimator,
    Parameters,
    offset,
)
from auv_fmu.language.vectors import distance, norm

_GOLDEN = (1.0 + sqrt(5.0)) / 2
_EXTREMES = (5.0 - sqrt(13.0)) / 2, (5.0 + sqrt(13.0)) / 2


def _response(tau: float) -> float:
    """The impulse response from psi' to chi', over omega."""
    return (3.0 * tau - tau * tau) * exp(-tau)


#: Largest |chi'| over turn_chi, |chi''| over omega turn_chi, and |e| omega over turn_chi.
RATE_GAIN = 1.0 + 10.0 * exp(-3.0)
ACCELERATION_GAIN = 2.0 * (_response(_EXTREMES[0]) - _response(_EXTREMES[1]))
LAG_GAIN = 2.0 * (_GOLDEN * _GOLDEN + _GOLDEN) * exp(-_GOLDEN)


class Bounds(NamedTuple):
    """Bounds of a reference in a formation, relative to its leader's reference."""

    distance: float  #: bound on |y_d - y_0| [m]
    speed: float  #: bound on |dy_d| [m/s]
    acceleration: float  #: bound on |ddy_d| [m/s2]


def reference_bounds(parameters: Parameters, speed: float, acceleration: float) -> Bounds:
    """Bounds of the reference of a vehicle whose leader is known.

    Args:
        parameters: of its planner.
        speed: bound of |dy_0| [m/s].
        acceleration: bound of |ddy_0| [m/s2].

    """
    stages = parameters.stages
    places = [offset(parameters, k) for k in range(stages.n)]
    # No two changes overlap, and a place is at no end farther than at one of them.
    far = max(norm(place) for place in places)
    moving = accelerating = 0.0
    for k in range(1, min(stages.n, MOST)):
        way, T = distance(places[k], places[k - 1]), stages.duration[k - 1]
        moving = max(moving, PEAK_SPEED * way / T)
        accelerating = max(accelerating, PEAK_ACCELERATION * way / (T * T))
    rate = RATE_GAIN * parameters.turn_chi
    turning = ACCELERATION_GAIN * parameters.omega_chi * parameters.turn_chi
    return Bounds(
        far,
        speed + moving + rate * far,
        # S d and d_h are at right angles.
        acceleration + accelerating + 2 * rate * moving + sqrt(turning**2 + rate**4) * far,
    )


# An estimated leader


class Messages(NamedTuple):
    """The messages of a link; all times are multiples of the planner's step."""

    period: float  #: between two that are sent [s]
    delay: tuple[float, float]  #: least and largest age of one that arrives [s]
    gap: int  #: most periods between two of which none between them is lost


class Estimate(NamedTuple):
    """Errors of the estimate of a leader, in each direction."""

    z: float  #: bound of |z| [m]
    velocity: float  #: bound of the error of dy_hat_o [m/s]
    position: float  #: bound of the error of y_hat [m]


def is_stable(estimator: Estimator, period: float, delay: float) -> bool:
    """True if small errors vanish, with a message every period that is always as late.

    Between two messages z decays to phi z, and its integral is I z. So from just before one message
    to the next, z and the error q of the velocity become

        phi (z + period q)  and  q - lambda k_d I (z + period q)

    a map of determinant phi and trace 1 + phi - period lambda k_d I: Jury's conditions for it are
    those below.

    Args:
        estimator: of the follower.
        period: between messages [s].
        delay: age of a message that arrives [s].

    """
    lambda_, k_d = estimator.lambda_, estimator.k_d
    steps = 10_000
    h, phi, integral = period / steps, 1.0, 0.0
    for j in range(steps):
        later = phi * exp(-h * (lambda_ + k_d - lambda_ * k_d * (delay + (j + 0.5) * h)))
        integral += h * (phi + later) / 2
        phi = later
    return phi < 1.0 and period * lambda_ * k_d * integral < 2.0 * (1.0 + phi)


class Hold(NamedTuple):
    """Factors of z from one message to the next."""

    duration: float  #: [s]
    phi: tuple[float, float]  #: least and largest remaining share
    pull: tuple[float, float]  #: least and largest effect of the velocity's error [1/s]


#: Bounds of |z| that are tried, as shares of the largest z that is corrected.
_TRIED = [0.02 * 1.15**i for i in range(28)] + [1.0]

#: Norms that are tried: how much of z weighs as much as the velocity's error, over the period, and
#: the difference between the weight of both together and the sum of their weights.
_WEIGHTS = [0.2 * 1.25**i for i in range(14)]
_COUPLINGS = [0.1 * i for i in range(-9, 10)]


def estimate_bounds(
    estimator: Estimator,
    messages: Messages,
    acceleration: float,
    speed: float = 0.0,
    h: float = 0.02,
) -> Estimate:
    """Bounds of the estimate, for a leader whose acceleration is bounded in each direction.

    Infinite where the proof does not reach: it takes messages that are never older than `age_max`,
    errors z that never reach `z_max`, and a norm in which every message brings errors together.

    Args:
        estimator: of the follower.
        messages: that reach it.
        acceleration: bound of the leader's, in each direction [m/s2].
        speed: bound of its velocity at the start, in each direction [m/s].
        h: step of the planner [s].

    """
    T, (early, late), gap = messages.period, messages.delay, messages.gap
    if gap * T + late <= estimator.age_max:
        for share in _TRIED:
            z_max = share * estimator.z_max
            holds = [
                held(estimator, age, round((m * T + later - age) / h), h, tanh(z_max) / z_max)
                for m in range(1, gap + 1)
                for age in sorted({early, late})
                for later in sorted({early, late})
            ]
            found = min(
                (
                    _bounds(messages, holds, acceleration, speed, weight * T, coupling)
                    for weight in _WEIGHTS
                    for coupling in _COUPLINGS
                ),
                key=lambda bounds: bounds.position,
            )
            if found.z <= z_max:
                return found
    return Estimate(inf, inf, inf)


def held(estimator: Estimator, age: float, steps: int, h: float, least: float) -> Hold:
    """Change of z while no message comes, in steps of Euler's scheme.

    In a step z loses the share h (k_d + lambda (1 - k_d age) s(z) / z), with the age at its end,
    and the velocity's error h k_d lambda s(z).

    Args:
        estimator: of the follower.
        age: of the message at the beginning [s].
        steps: how many.
        h: step [s].
        least: of s(z) / z, which is at most 1.

    """
    lambda_, k_d = estimator.lambda_, estimator.k_d
    slow, fast, most, fewest = 1.0, 1.0, 0.0, 0.0
    for j in range(steps):
        most += h * k_d * lambda_ * slow
        fewest += h * k_d * lambda_ * least * fast
        share = lambda_ * (1.0 - k_d * (age + (j + 1) * h))
        slow *= 1.0 - h * (k_d + min(share, least * share))
        fast *= max(0.0, 1.0 - h * (k_d + max(share, least * share)))
    return Hold(steps * h, (fast, slow), (fewest, most))


def _bounds(
    messages: Messages,
    holds: Sequence[Hold],
    acceleration: float,
    speed: float,
    weight: float,
    coupling: float,
) -> Estimate:
    """Bounds from the norm |x|^2 = a^2 + 2 coupling a q + q^2, with a = z / weight.

    x = (z, q) just before a message. A message after m periods, and what follows it, takes x to

        (phi (z + m T q), q - pull (z + m T q))

    and adds phi and -pull times what the leader's acceleration has made of its velocity within the
    m periods, and what it makes of it until the next message.
    """
    T, late, gap = messages.period, messages.delay[1], messages.gap
    longest = max(hold.duration for hold in holds)
    oldest, rest = gap * T + late, acceleration * gap * T * (gap * T / 2 + late)
    shape = _Norm(weight, coupling)
    level = shape.of(0.0, speed + acceleration * oldest)
    for _, phis, pulls in holds:
        for phi in phis:
            for pull in pulls:
                added = shape.of(phi, -pull) * rest + shape.of(0.0, 1.0) * acceleration * longest
                for m in range(1, gap + 1):
                    kept = shape.gain(phi, phi * m * T, -pull, 1.0 - pull * m * T)
                    if kept >= 1.0:
                        return Estimate(inf, inf, inf)
                    level = max(level, added / (1.0 - kept))
    most = max(hold.pull[1] for hold in holds)
    times = [m * T for m in range(gap + 1)]
    z = max(shape.most(1.0, t) for t in times) * level + rest
    velocity = (
        max(shape.most(-pull, 1.0 - pull * t) for t in times for pull in (0.0, most)) * level
        + most * rest
        + acceleration * longest
    )
    return Estimate(z, velocity, z + oldest * velocity + acceleration * oldest**2 / 2)


class _Norm(NamedTuple):
    """sqrt(a^2 + 2 c a q + q^2) with a = z / weight: a length in other coordinates (a', q').

    a' = a sqrt(1 - c^2), q' = q + c a.
    """

    weight: float
    c: float

    def of(self, z: float, q: float) -> float:
        """The norm of (z, q)."""
        a = z / self.weight
        return sqrt(a * a + 2 * self.c * a * q + q * q)

    def most(self, b: float, d: float) -> float:
        """The largest b z + d q of all (z, q) of norm 1."""
        root = sqrt(1.0 - self.c * self.c)
        return hypot((b * self.weight - d * self.c) / root, d)

    def gain(self, a: float, b: float, c: float, d: float) -> float:
        """The norm of the matrix ((a, b), (c, d))."""
        w, root = self.weight, sqrt(1.0 - self.c * self.c)

        def mapped(z: float, q: float) -> tuple[float, float]:
            after_a, after_q = (a * z + b * q) / w, c * z + d * q
            return after_a * root, after_q + self.c * after_a

        # The columns of the matrix in the other coordinates; of its two singular values the larger.
        (e, g), (f, k) = mapped(w / root, -self.c / root), mapped(0.0, 1.0)
        return (hypot(e + k, g - f) + hypot(e - k, g + f)) / 2
