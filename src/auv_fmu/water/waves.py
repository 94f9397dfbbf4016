"""Waves of a random sea: a sum of regular ones, by linear theory, in deep or in shallow water.

The sea has the spectrum of Pierson and Moskowitz with two parameters (Bretschneider's spectrum),

    S(omega) = 5/16 Hs^2 omega_p^4 / omega^5 exp(-5/4 (omega_p / omega)^4),

or the JONSWAP spectrum, the same times gamma^exp(-((omega / omega_p - 1) / width)^2 / 2), with
width 0.07 below the peak and 0.09 above it, scaled to the same variance Hs^2 / 16. Both are cut off
above a highest frequency before they are scaled. The spectra, and the spreading cos^2s(angle / 2)
about the mean direction, are as in DNV-RP-C205.

Each of n regular waves has an equal share of this variance. Its frequency is random within its
share of the spectrum, so no record repeats, and its phase is random. Directions have equal shares
of the spreading, in the order of a Weyl sequence, so that neighbours in frequency differ most.

The energy below omega is exp(-5/4 (omega_p / omega)^4) for Pierson and Moskowitz. The JONSWAP
spectrum is integrated over this energy, so that no cut-off is needed below the peak.

A regular wave of amplitude a moves water of depth h, at the depth z below its still surface, with

    a omega cosh(k (h - z)) / sinh(k h) cos(chi)    in the direction of the wave,
    a omega sinh(k (h - z)) / sinh(k h) sin(chi)    upwards, and the surface is raised by
    a cos(chi),  chi = k (distance in its direction) - omega t + phase,  and
    omega^2 = g k tanh(k h)                         is the dispersion relation.
"""

from __future__ import annotations

import math
from enum import IntEnum
from math import cos, exp, expm1, fmod, log, pi, sin, sqrt, tanh, tau
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.random_numbers import (
    WAVE_DIRECTIONS,
    WAVE_FREQUENCIES,
    WAVE_PHASES,
    start,
    uniform,
)
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3

#: Most regular waves of a sea.
MOST = 64

#: Largest exponent of the spreading; narrower ones need finer angles than :data:`_ANGLES`.
_NARROWEST = 100.0

#: Spectra, in functional form because of the hyphen in the name.
Spectrum = IntEnum("Spectrum", {"NONE": 0, "PIERSON-MOSKOWITZ": 1, "JONSWAP": 2})

#: Regular waves in rows of (omega [rad/s], k [rad/m], cosine and sine of the direction, phase
#: [rad]); rows that a sea does not use are zero.
Components = Annotated[Matrix, 64, 5]

#: The exponent of the spectrum of Pierson and Moskowitz at its peak, and JONSWAP's widths.
_DECAY = 1.25
_WIDTH_BELOW = 0.07
_WIDTH_ABOVE = 0.09

#: Largest height of a wave of permanent form in deep water, as a share of its length.
_STEEPEST = 0.142

#: Numbers of intervals: of equal energy for a spectrum, of equal angle for a spreading.
_CELLS = 1024
_ANGLES = 360

#: Step of the Weyl sequence: the golden ratio, less one.
_GOLDEN = (sqrt(5.0) - 1.0) / 2.0

#: Steps of Newton's method, and a change of the wave number, as a share, at which it stops.
_NEWTON = 30
_CONVERGED = 1e-15

_STILL: Vector3 = (0.0, 0.0, 0.0)


class Waves(NamedTuple):
    """A random sea; the defaults are a slight to moderate one."""

    spectrum: Annotated[
        Spectrum, Variable("1", "Spectrum of the waves: none, pierson-moskowitz or jonswap")
    ] = Spectrum.JONSWAP
    Hs: Annotated[float, Variable("m", "Significant wave height (Hs)", 0.0)] = 1.0
    Tp: Annotated[float, Variable("s", "Period of the peak of the spectrum (Tp)", POSITIVE)] = 7.0
    gamma: Annotated[float, Variable("1", "JONSWAP peak enhancement factor (gamma)", 1.0, 10.0)] = (
        3.3
    )
    highest: Annotated[
        float,
        Variable("1", "Highest frequency of the waves, as a multiple of the peak's", 1.0, 10.0),
    ] = 4.0
    direction: Annotated[
        float, Variable("rad", "Mean direction that the waves go to: 0 north, pi/2 east")
    ] = 0.0
    s: Annotated[
        float,
        Variable("1", "Spreading exponent s of cos^2s(angle/2); 0: long-crested", 0.0, _NARROWEST),
    ] = 10.0
    n: Annotated[
        int,
        Variable("1", "Number of regular waves that the sea is the sum of", 1, MOST, name="count"),
    ] = 32
    seed: Annotated[int, Variable("1", "Seed of frequencies, phases and directions")] = 1


class Gradient(NamedTuple):
    """Gradient of the velocity of waves [1/s]: irrotational, so symmetric, with zz = -xx - yy."""

    xx: float
    xy: float
    yy: float
    xz: float
    yz: float


class WaveMotion(NamedTuple):
    """Motion of the water by waves at a place."""

    velocity: Vector3  #: [m/s], earth frame
    acceleration: Vector3  #: [m/s2], earth frame, at the fixed place
    gradient: Gradient  #: velocity gradient
    elevation: float  #: elevation of the surface above still water [m]


def wave_number(omega: float, depth: float, g: float) -> float:
    """Wave number k of the dispersion relation, by Newton's method [rad/m].

    Args:
        omega: angular frequency [rad/s].
        depth: of the water [m]; 0: deep water.
        g: acceleration of gravity [m/s2].

    """
    deep = omega * omega / g
    if depth == 0.0:
        return deep
    y = deep * depth
    kh, k = y / sqrt(tanh(y)), 0
    change = kh
    while abs(change) > _CONVERGED * kh and k < _NEWTON:
        t = tanh(kh)
        change = (kh * t - y) / (t + kh * (1.0 - t * t))
        kh = kh - change
        k = k + 1
    return kh / depth


def highest_regular(omega: float, depth: float, g: float) -> float:
    """Height at which a regular wave breaks, after Miche: 0.142 of its length times tanh(k h) [m].

    Args:
        omega: its angular frequency [rad/s].
        depth: of the water [m]; 0: deep water.
        g: acceleration of gravity [m/s2].

    """
    k = wave_number(omega, depth, g)
    steepest = _STEEPEST * tau / k
    return steepest if depth == 0.0 else steepest * tanh(k * depth)


def frequency(share: float) -> float:
    """Frequency, as a multiple of the peak's, below which a share of the energy lies.

    Args:
        share: of a spectrum of Pierson and Moskowitz, above 0 and below 1.

    """
    return math.pow(_DECAY / -log(share), 0.25)


def enhancement(waves: Waves, ratio: float) -> float:
    """Ratio of the spectrum to the one of Pierson and Moskowitz, up to a factor.

    Args:
        waves: parameters.
        ratio: of the frequency to that of the peak.

    """
    if waves.spectrum != Spectrum.JONSWAP:
        return 1.0
    off = (ratio - 1.0) / (_WIDTH_BELOW if ratio <= 1.0 else _WIDTH_ABOVE)
    return math.pow(waves.gamma, exp(-0.5 * off * off))


def frequencies(waves: Waves) -> Annotated[Vector, 64]:
    """Frequencies of all regular waves, as multiples of the peak's; 0 for those not used.

    Args:
        waves: parameters.

    """
    below = exp(-_DECAY / math.pow(waves.highest, 4.0))
    energy = 0.0
    for i in range(_CELLS):
        energy += enhancement(waves, frequency((i + 0.5) / _CELLS * below))
    found = Vector(0.0 for _ in range(MOST))
    state = start(waves.seed, WAVE_FREQUENCIES)
    lower, upper, cell = 0.0, 0.0, -1
    for i in range(waves.n):
        state, u = uniform(state)
        wanted = (i + u) / waves.n * energy
        while upper < wanted and cell < _CELLS - 1:
            cell = cell + 1
            lower = upper
            upper = lower + enhancement(waves, frequency((cell + 0.5) / _CELLS * below))
        share = (cell + (wanted - lower) / (upper - lower)) / _CELLS
        found = found.replaced(i, frequency(share * below))
    return found


def spread(s: float, angle: float) -> float:
    """Density of directions at an angle from the mean, up to a factor: cos^2s(angle / 2).

    Args:
        s: exponent.
        angle: at most pi [rad].

    """
    return math.pow(cos(0.5 * angle), 2.0 * s)


def deviation(s: float, share: float) -> float:
    """Angle from the mean direction below which a share of the directions lies [rad].

    Args:
        s: exponent of the spreading; 0: there is none.
        share: of all directions, from 0 to 1.

    """
    if s == 0.0:
        return 0.0
    half = 0.0
    for i in range(_ANGLES):
        half += spread(s, (i + 0.5) * pi / _ANGLES)
    # Both sides are equal, so look for a share of one of them.
    wanted = abs(2.0 * share - 1.0) * half
    lower, upper, cell = 0.0, 0.0, -1
    while upper < wanted and cell < _ANGLES - 1:
        cell = cell + 1
        lower = upper
        upper = lower + spread(s, (cell + 0.5) * pi / _ANGLES)
    angle = 0.0
    if cell >= 0:
        angle = (cell + (wanted - lower) / (upper - lower)) * pi / _ANGLES
    return angle if share >= 0.5 else -angle


def components(waves: Waves, depth: float, g: float) -> Components:
    """The regular waves of a sea.

    Args:
        waves: parameters.
        depth: of the water [m]; 0: deep water.
        g: acceleration of gravity [m/s2].

    """
    rows = Matrix((0.0 for _ in range(5)) for _ in range(MOST))
    if waves.spectrum == Spectrum.NONE:
        return rows
    ratios = frequencies(waves)
    state = start(waves.seed, WAVE_PHASES)
    _, offset = uniform(start(waves.seed, WAVE_DIRECTIONS))
    for i in range(waves.n):
        omega = ratios[i] * tau / waves.Tp
        state, u = uniform(state)
        share = fmod(offset + i * _GOLDEN, 1.0)
        angle = waves.direction + deviation(waves.s, share)
        k = wave_number(omega, depth, g)
        rows = rows.replaced(i, Vector((omega, k, cos(angle), sin(angle), tau * u)))
    return rows


def amplitude(waves: Waves) -> float:
    """Amplitude of each regular wave [m]: n times half its square is the variance Hs^2 / 16.

    Args:
        waves: parameters.

    """
    return waves.Hs / sqrt(8.0 * waves.n)


def attenuation(k: float, z: float, depth: float) -> tuple[float, float]:
    """cosh(k (h - z)) / sinh(k h) and sinh(k (h - z)) / sinh(k h), without overflow.

    Args:
        k: wave number [rad/m].
        z: depth below still water, from 0 to that of the bottom [m].
        depth: h of the water [m]; 0: it is deep.

    """
    direct = exp(-k * z)
    if depth == 0.0:
        return direct, direct
    reflected = exp(-2.0 * k * (depth - z))
    whole = -expm1(-2.0 * k * depth)
    return direct * (1.0 + reflected) / whole, direct * -expm1(-2.0 * k * (depth - z)) / whole


def clamped(z: float, depth: float) -> float:
    """z, limited to the water: from 0 to the depth [m].

    Args:
        z: depth below still water [m].
        depth: of the water [m]; 0: deep water.

    """
    if z < 0.0:
        return 0.0
    return depth if 0.0 < depth < z else z


def motion(waves: Waves, rows: Components, depth: float, position: Vector3, t: float) -> WaveMotion:
    """Motion of the water by waves.

    Args:
        waves, rows: parameters, and the regular waves for them.
        depth: of the water [m]; 0: deep water.
        position: (x, y, z) [m], earth frame, z down from the surface of still water.
        t: time [s].

    """
    if waves.spectrum == Spectrum.NONE:
        return WaveMotion(_STILL, _STILL, Gradient(0.0, 0.0, 0.0, 0.0, 0.0), 0.0)
    x, y, z = position
    z = clamped(z, depth)
    a = amplitude(waves)
    u, v, w, du, dv, dw, elevation = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    xx, xy, yy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0
    for row in rows:
        omega, k, north, east, phase = row
        if omega == 0.0:
            break
        chi = k * (north * x + east * y) - omega * t + phase
        level, up = attenuation(k, z, depth)
        c, s = cos(chi), sin(chi)
        speed = a * omega * level * c
        u += north * speed
        v += east * speed
        w -= a * omega * up * s
        rate = a * omega * omega * level * s
        du += north * rate
        dv += east * rate
        dw += a * omega * omega * up * c
        ahead, down = -a * omega * k * level * s, -a * omega * k * up * c
        xx += north * north * ahead
        xy += north * east * ahead
        yy += east * east * ahead
        xz += north * down
        yz += east * down
        elevation += a * c
    return WaveMotion((u, v, w), (du, dv, dw), Gradient(xx, xy, yy, xz, yz), elevation)


def along(gradient: Gradient, velocity: Vector3) -> Vector3:
    """(velocity . grad) of the waves' velocity: the convective acceleration [m/s2].

    Args:
        gradient: of the waves.
        velocity: of the point that moves [m/s], earth frame.

    """
    xx, xy, yy, xz, yz = gradient
    u, v, w = velocity
    return xx * u + xy * v + xz * w, xy * u + yy * v + yz * w, xz * u + yz * v - (xx + yy) * w
