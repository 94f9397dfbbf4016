"""Random numbers in the language of equations: the minimal standard generator, in floats.

x' = a x mod m with m = 2^31 - 1, after Park and Miller, "Random number generators: good ones are
hard to find", Communications of the ACM 31 (1988), and with the multiplier a = 48271 that they
recommended in 1993. C++ has the same generator as `std::minstd_rand`. a x is below 2^47, so floats
hold it exactly, and Python and C give the same numbers on every platform.

The state of a generator is a whole number from 1 to m - 1, to be kept in the state of a component:

    state = start(seed, MESSAGE_LOSSES)
    state, u = uniform(state)
    state, n = gaussian(state)

It is not a generator for secrets, and repeats after 2^31 - 2 numbers. All sequences are parts of
this one cycle: a seed and a stream only choose where one begins.
"""

from __future__ import annotations

from math import cos, fmod, log, sqrt, tau

#: m, the prime 2^31 - 1.
MODULUS = 2147483647.0

#: a, a primitive root of m.
MULTIPLIER = 48271.0

#: Streams. Phases of waves and losses of messages share one: a sea and a link with the same seed
#: draw the same numbers, so give them different seeds.
WAVE_FREQUENCIES = 0
WAVE_PHASES = 1
WAVE_DIRECTIONS = 2
CURRENT_VARIATION = 3
MESSAGE_LOSSES = 1
DEPTH_SENSOR = 4
ATTITUDE_SENSOR = 5
DVL = 6
IMU = 7
POSITION_FIX = 8

#: Splits a seed or a state into two halves.
_HALF = 65536.0

#: Makes every 32-bit integer positive.
_SHIFT = 2147483648.0


def after(state: float) -> float:
    """Next state of the generator.

    Args:
        state: a whole number from 1 to m - 1.

    """
    return fmod(MULTIPLIER * state, MODULUS)


def mixed(state: float) -> float:
    """A state that is a non-linear function of another one.

    The generator only multiplies, so states that differ little, or by a small factor, give
    correlated sequences. The product of a state and its own lower half avoids this.

    Args:
        state: a whole number from 1 to m - 1.

    """
    k = 0
    while k < 4:
        state = fmod(after(state) * (1.0 + fmod(state, _HALF)), MODULUS)
        k = k + 1
    return state


def start(seed: int, stream: int) -> float:
    """State of a generator at its start.

    Args:
        seed: any 32-bit integer. Two seeds give the same sequence with a probability of 4e-9,
            because there are more seeds than states; in stream 0, 6400 and 23455 do.
        stream: from 0 to 32767; streams of one seed begin at different states.

    """
    number = seed + _SHIFT
    lower = fmod(number, _HALF)
    upper = (number - lower) / _HALF
    state = mixed(1.0 + lower)
    state = mixed(fmod(state + upper, MODULUS - 1.0) + 1.0)
    return mixed(fmod(state + stream, MODULUS - 1.0) + 1.0)


def uniform(state: float) -> tuple[float, float]:
    """Next state, and a number between 0 and 1, never 0 or 1.

    Args:
        state: a whole number from 1 to m - 1.

    """
    state = after(state)
    return state, state / MODULUS


def normal(u: float, v: float) -> float:
    """A standard normal number from two that are uniform, after Box and Muller (1958).

    Args:
        u: determines the angle; between 0 and 1.
        v: determines the radius; between 0 and 1. Take the later one of two successive numbers: the
            successor of a small number is a times it, so the largest radii would have equal angles.

    """
    return sqrt(-2.0 * log(v)) * cos(tau * u)


def gaussian(state: float) -> tuple[float, float]:
    """State after two numbers, and a standard normal number made of them.

    Args:
        state: a whole number from 1 to m - 1.

    """
    state, u = uniform(state)
    state, v = uniform(state)
    return state, normal(u, v)
