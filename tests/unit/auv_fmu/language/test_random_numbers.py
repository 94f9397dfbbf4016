"""Random numbers in the language of equations."""

from math import erf, isqrt, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.language.random_numbers import MODULUS, after, gaussian, start, uniform

seeds = st.integers(-(2**31), 2**31 - 1)
streams = st.integers(0, 32767)
states = st.integers(1, int(MODULUS) - 1)


def drawn(state, draw, n):
    numbers = []
    for _ in range(n):
        state, number = draw(state)
        numbers.append(number)
    return np.array(numbers)


def test_it_is_the_generator_that_the_standard_of_cpp_names():
    """The 10,000th number of a minstd_rand from 1 is 399268537 (C++11, [rand.predef])."""
    state = 1.0
    for _ in range(10_000):
        state = after(state)
    assert state == 399268537.0


@given(state=states)
def test_it_is_exact_in_floats(state):
    assert after(float(state)) == 48271 * state % (2**31 - 1)


@given(seed=seeds, stream=streams)
def test_every_seed_gives_a_state(seed, stream):
    state = start(seed, stream)
    assert state == int(state)
    assert 1 <= state < MODULUS


def starts(seeds: np.ndarray) -> np.ndarray:
    """The states that many seeds begin at in stream 0, in integers."""
    m, number = 2**31 - 1, seeds + 2**31

    def mixed(state: np.ndarray) -> np.ndarray:
        for _ in range(4):
            state = (48271 * state % m) * (1 + state % 65536) % m
        return state

    state = mixed(1 + number % 65536)
    state = mixed((state + number // 65536) % (m - 1) + 1)
    return mixed(state % (m - 1) + 1)


def test_sequences_of_two_seeds_are_one_as_rarely_as_is_said():
    """300,000 seeds have some 4e-9 * 300,000^2 / 2 = 180 pairs, with a deviation of 13."""
    seeds = np.unique(np.random.default_rng(1).integers(-(2**31), 2**31, 300_000))
    states = starts(seeds)
    assert [start(int(seed), 0) for seed in seeds[:50]] == [*states[:50]]
    pairs = len(states) - len(np.unique(states))
    assert 140 < pairs < 240
    assert start(6400, 0) == start(23455, 0)


@pytest.mark.parametrize(
    "pairs",
    [
        [((seed, 0), (seed + 1, 0)) for seed in range(1, 3001)],
        [((seed, 0), (2 * seed, 0)) for seed in range(1, 3001)],
        [((seed, 0), (seed, 1)) for seed in range(1, 3001)],
        [((7, stream), (7, stream + 1)) for stream in range(3000)],
        [((seed, 0), (seed + 65536, 0)) for seed in range(1, 3001)],
    ],
)
def test_sequences_of_neighbouring_seeds_have_nothing_in_common(pairs):
    """Correlations of 3000 pairs are normal with a deviation of 1/sqrt(3000); 5 of them allowed."""
    first, second = (
        np.array([drawn(start(*pair[side]), uniform, 3) for pair in pairs]) for side in (0, 1)
    )
    for k in range(3):
        correlation = np.corrcoef(first[:, k], second[:, k])[0, 1]
        assert abs(correlation) < 5 / sqrt(3000)
        # Twice the other one, less its whole part: what a generator without mixing gives.
        folded = np.corrcoef(2 * first[:, k] % 1, second[:, k])[0, 1]
        assert abs(folded) < 5 / sqrt(3000)
        assert abs(first[:, k].mean() - 0.5) < 5 / sqrt(12 * 3000)


def test_uniform_numbers_fill_their_interval_evenly():
    """Kolmogorov's test at a level of 1e-6: sqrt(n) D < 2.69."""
    numbers = np.sort(drawn(start(3, 0), uniform, 40_000))
    places = (np.arange(40_000) + 0.5) / 40_000
    assert sqrt(40_000) * np.abs(numbers - places).max() < 2.69
    assert 0.0 < numbers[0] < numbers[-1] < 1.0


def test_gaussian_numbers_are_normal_and_independent():
    """Kolmogorov's test, the fourth moment (deviation sqrt(96/n)), and neighbours."""
    n = 40_000
    numbers = drawn(start(5, 0), gaussian, n)
    ordered = np.sort(numbers)
    share = np.array([(1 + erf(x / sqrt(2))) / 2 for x in ordered])
    assert sqrt(n) * np.abs(share - (np.arange(n) + 0.5) / n).max() < 2.69
    assert abs(np.mean(numbers**4) - 3.0) < 5 * sqrt(96 / n)
    assert abs(np.corrcoef(numbers[1:], numbers[:-1])[0, 1]) < 5 / sqrt(n)


def test_the_modulus_is_prime_and_the_multiplier_has_the_full_period():
    """a^((m-1)/p) is not 1 for any prime factor p of m - 1 = 2 3^2 7 11 31 151 331."""
    m = 2**31 - 1
    assert all(m % k for k in range(2, isqrt(m) + 1))
    factors = (2, 3, 7, 11, 31, 151, 331)
    assert m - 1 == 2 * 9 * 7 * 11 * 31 * 151 * 331
    assert all(pow(48271, (m - 1) // p, m) != 1 for p in factors)
