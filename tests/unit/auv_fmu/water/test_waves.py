"""Waves: spectrum, directions, dispersion and the motion of the water, compared with theory."""

from itertools import pairwise
from math import cos, exp, hypot, pi, sin, sqrt, tau

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import beta

from auv_fmu.water import waves
from auv_fmu.water.waves import MOST, Spectrum, Waves
from support.tiers import slow

G = 9.81
JONSWAP, PIERSON_MOSKOWITZ = Spectrum.JONSWAP, Spectrum["PIERSON-MOSKOWITZ"]

seeds = st.integers(-(2**31), 2**31 - 1)
depths = st.sampled_from((0.0, 3.0, 12.0, 60.0, 4000.0))
places = st.tuples(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(0.1, 2.9))
times = st.floats(0.0, 1e4)


def density(sea, omega):
    """S of DNV-RP-C205 up to a factor, written down again."""
    peak = tau / sea.Tp
    s = omega**-5 * exp(-1.25 * (peak / omega) ** 4)
    if sea.spectrum == JONSWAP:
        width = 0.07 if omega <= peak else 0.09
        s *= sea.gamma ** exp(-0.5 * ((omega - peak) / (width * peak)) ** 2)
    return s


def share_below(sea, omega):
    """Share of the energy between frequency zero and the highest one, by adaptive quadrature."""
    peak, highest = tau / sea.Tp, sea.highest * tau / sea.Tp

    def energy(end):
        cuts = [x for x in (0.8 * peak, peak, 1.2 * peak) if x < end]
        edges = [0.3 * peak, *cuts, end]
        return sum(
            quad(lambda x: density(sea, x), a, b, epsabs=0.0, epsrel=1e-10)[0]
            for a, b in pairwise(edges)
        )

    return energy(omega) / energy(highest)


def used(sea, depth=0.0):
    return np.array(waves.components(sea, depth, G))[: sea.n]


def moved(sea, depth, position, t):
    return waves.motion(sea, waves.components(sea, depth, G), depth, position, t)


# Spectrum


@pytest.mark.parametrize("spectrum", [PIERSON_MOSKOWITZ, JONSWAP])
@pytest.mark.parametrize(("n", "seed"), [(1, 5), (7, 1), (32, 1), (MOST, -3)])
@pytest.mark.parametrize("gamma", [1.0, 3.3, 7.0])
def test_each_wave_is_in_its_own_equal_share_of_the_energy(spectrum, n, seed, gamma):
    """So its spectrum is as close to S as n lines can be; the integral of S is off by 1e-4."""
    sea = Waves(spectrum=spectrum, gamma=gamma, n=n, seed=seed)
    omegas = used(sea)[:, 0]
    for i in range(0, n, 3):
        share = share_below(sea, omegas[i])
        assert (i - 1e-4 * n) / n <= share <= (i + 1 + 1e-4 * n) / n


@given(Hs=st.floats(0.0, 20.0), n=st.integers(1, MOST))
def test_variance_of_the_surface_follows_from_the_significant_wave_height(Hs, n):
    a = waves.amplitude(Waves(Hs=Hs, n=n))
    assert n * a * a / 2 == pytest.approx(Hs * Hs / 16, rel=1e-14)


def record(sea, hours, step):
    """Elevation of the surface at a place."""
    rows = waves.components(sea, 0.0, G)
    instants = np.arange(0.0, 3600.0 * hours, step)
    return np.array(
        [waves.motion(sea, rows, 0.0, (10.0, 20.0, 0.0), float(t)).elevation for t in instants]
    )


@pytest.mark.parametrize(
    ("spectrum", "records"), [(JONSWAP, 1), *slow((JONSWAP, 12), (PIERSON_MOSKOWITZ, 12))]
)
def test_spectrum_of_records_of_three_hours_is_the_analytic_one(spectrum, records):
    """Energies of ten bands, from periodograms with a window of Hann.

    Of n lines with equal shares, the number in a band is that of whole shares within it, and one of
    two neighbours at each edge: its deviation is at most sqrt(1/2). Five deviations are allowed.
    """
    sea, step = Waves(spectrum=spectrum, n=MOST), 0.5
    edges = tau / sea.Tp * np.array([0.5, 0.8, 0.9, 0.97, 1.03, 1.1, 1.25, 1.5, 1.9, 2.6, 4.05])
    found, heights = np.zeros(len(edges) - 1), []
    for seed in range(records):
        surface = record(sea._replace(seed=seed), 3.0, step)
        window = np.hanning(len(surface))
        power = np.abs(np.fft.rfft(surface * window)) ** 2
        power *= 2.0 / (len(surface) * np.sum(window**2))
        omegas = tau * np.fft.rfftfreq(len(surface), step)
        found += [power[(a <= omegas) & (omegas < b)].sum() for a, b in pairwise(edges)]
        heights.append(4.0 * surface.std())
    shares = np.diff(
        [share_below(sea, omega) for omega in (*edges[:-1], tau / sea.Tp * sea.highest)]
    )
    allowed = 5.0 * sqrt(0.5 / records) / MOST
    np.testing.assert_allclose(found / records / (sea.Hs**2 / 16.0), shares, atol=allowed)
    # Beats of neighbouring lines over three hours: 2 % of the variance at the most.
    np.testing.assert_allclose(heights, sea.Hs, rtol=0.02)


def test_no_record_of_three_hours_repeats():
    """The correlation of the surface with itself, sum of cos(omega_i lag) / n, never comes back."""
    for seed in range(20):
        omegas = used(Waves(n=32, seed=seed))[:, 0]
        lags = np.arange(200.0, 10_800.0, 0.25)
        assert np.cos(np.outer(lags, omegas)).mean(axis=1).max() < 0.9


@given(seed=seeds)
def test_another_seed_is_another_sea(seed):
    first, second = (used(Waves(n=4, seed=s)) for s in (seed, -seed + 1))
    assert np.array_equal(first, used(Waves(n=4, seed=seed)))
    assert not np.any(first[:, 4] == second[:, 4])


def test_phases_are_uniform():
    """The mean of exp(i phase) of 100 seas of 32 waves: 3200 steps of a walk, 5 deviations."""
    phases = np.concatenate([used(Waves(seed=seed))[:, 4] for seed in range(100)])
    assert abs(np.exp(1j * phases).mean()) < 5.0 / sqrt(len(phases))
    assert 0.0 <= phases.min() < 0.01 < tau - 0.01 < phases.max() < tau


# Directions


@given(s=st.floats(0.1, 100.0), share=st.floats(0.001, 0.999))
def test_directions_have_the_distribution_of_the_spreading(s, share):
    """sin^2(angle / 2) has the beta distribution of 1/2 and s + 1/2."""
    angle = waves.deviation(s, share)
    one_side = beta.cdf(sin(angle / 2) ** 2, 0.5, s + 0.5)
    assert one_side == pytest.approx(abs(2 * share - 1), abs=2e-3)
    assert angle * (share - 0.5) >= 0.0


@pytest.mark.parametrize("s", [1.0, 4.0, 10.0, 50.0])
@pytest.mark.parametrize("seed", range(5))
def test_mean_direction_and_spread_are_those_asked_for(s, seed):
    """The mean of exp(i (angle - mean)) is s / (s + 1); of 64 waves, to about two shares of 64."""
    sea = Waves(s=s, seed=seed, direction=2.0, n=MOST)
    rows = used(sea)
    mean = (rows[:, 2] + 1j * rows[:, 3]).mean()
    assert abs(mean) == pytest.approx(s / (s + 1.0), abs=0.03)
    assert np.angle(mean) == pytest.approx(2.0, abs=0.06)
    np.testing.assert_allclose(np.hypot(rows[:, 2], rows[:, 3]), 1.0, rtol=1e-15)


def test_waves_without_spreading_all_go_in_the_mean_direction():
    rows = used(Waves(s=0.0, direction=0.7))
    assert np.all(rows[:, 2:4] == (cos(0.7), sin(0.7)))


@given(direction=st.floats(-pi, pi), seed=seeds, t=times, place=places, depth=depths)
def test_a_regular_wave_runs_in_its_direction_at_its_phase_velocity(
    direction, seed, t, place, depth
):
    """And under its crest the water moves with it."""
    sea = Waves(n=1, s=0.0, direction=direction, seed=seed)
    [[omega, k, *_]] = used(sea, depth)
    x, y, z = place
    later, way = t + 0.3, 0.3 * omega / k
    ahead = (x + way * cos(direction), y + way * sin(direction), z)
    first, second = moved(sea, depth, place, t), moved(sea, depth, ahead, later)
    assert first.elevation == pytest.approx(second.elevation, abs=1e-8)
    np.testing.assert_allclose(first.velocity, second.velocity, atol=1e-7)
    level = first.velocity[0] * cos(direction) + first.velocity[1] * sin(direction)
    assert level * first.elevation >= -1e-12


# Dispersion


@given(omega=st.floats(0.05, 20.0), depth=st.floats(0.1, 5000.0))
def test_wave_numbers_satisfy_the_dispersion_relation(omega, depth):
    k = waves.wave_number(omega, depth, G)
    assert G * k * np.tanh(k * depth) == pytest.approx(omega * omega, rel=1e-12)


@given(omega=st.floats(0.05, 20.0))
def test_deep_and_shallow_water_are_the_limits_of_the_dispersion_relation(omega):
    """omega^2 = g k, and omega = k sqrt(g h)."""
    deep = waves.wave_number(omega, 0.0, G)
    assert deep == pytest.approx(omega * omega / G, rel=1e-15)
    assert waves.wave_number(omega, 20.0 / deep, G) == pytest.approx(deep, rel=1e-15)
    shallow = 1e-6 / deep
    assert waves.wave_number(omega, shallow, G) == pytest.approx(
        omega / sqrt(G * shallow), rel=1e-6
    )


@given(omega=st.floats(0.3, 3.0))
def test_waves_break_at_a_seventh_of_their_length_and_at_nine_tenths_of_the_depth(omega):
    """Miche: 0.142 lambda tanh(k h), which in shallow water is 0.142 2 pi h = 0.89 h."""
    length = tau * G / omega**2
    assert waves.highest_regular(omega, 0.0, G) == pytest.approx(0.142 * length)
    assert waves.highest_regular(omega, 1e-4, G) == pytest.approx(0.892e-4, rel=1e-3)


# Motion of the water

SEA = Waves(Hs=0.8, Tp=5.0, n=12, s=4.0, direction=0.5, seed=9)


@pytest.mark.parametrize("z", [0.0, 0.5, 2.0, 10.0])
def test_motion_decays_with_depth_as_exp_of_minus_k_z(z):
    sea = Waves(n=1, s=0.0)
    [[_, k, *_]] = used(sea)
    top, below = moved(sea, 0.0, (0.0, 0.0, 0.0), 3.0), moved(sea, 0.0, (0.0, 0.0, z), 3.0)
    np.testing.assert_allclose(below.velocity, np.multiply(exp(-k * z), top.velocity), rtol=1e-13)
    np.testing.assert_allclose(
        below.acceleration, np.multiply(exp(-k * z), top.acceleration), rtol=1e-13
    )
    assert below.elevation == top.elevation


@given(k=st.floats(0.01, 5.0), depth=st.floats(0.5, 60.0), part=st.floats(0.0, 1.0))
def test_attenuation_follows_hyperbolic_functions(k, depth, part):
    assume(k * depth < 300.0)
    z = part * depth
    level, up = waves.attenuation(k, z, depth)
    assert level == pytest.approx(np.cosh(k * (depth - z)) / np.sinh(k * depth), rel=1e-11)
    assert up == pytest.approx(np.sinh(k * (depth - z)) / np.sinh(k * depth), rel=1e-11, abs=1e-300)


@given(k=st.floats(1e-6, 1e9), z=st.floats(0.0, 1e9))
def test_attenuation_never_overflows(k, z):
    """Water of 1e9 m is like deep water, if waves are short against that."""
    assume(k > 1e-6)
    level, up = waves.attenuation(k, z, 1e9)
    assert 0.0 <= up <= level < 1e300
    assert level <= exp(-k * z) * (1.0 + 1e-9)


@given(place=places, t=times, depth=depths)
def test_the_flow_is_free_of_sources_and_of_rotation(place, t, depth):
    """Central differences of the velocity; their errors are some 1e-9 of it."""
    h = 1e-3
    rows = waves.components(SEA, depth, G)

    def at(axis, way):
        moved_place = tuple(x + way * h * (i == axis) for i, x in enumerate(place))
        return np.array(waves.motion(SEA, rows, depth, moved_place, t).velocity)

    gradient = np.array([(at(axis, 1) - at(axis, -1)) / (2 * h) for axis in range(3)])
    assert np.trace(gradient) == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(gradient, gradient.T, atol=1e-6)


@given(place=places, t=times, depth=depths)
def test_acceleration_is_the_derivative_of_the_velocity_at_a_place(place, t, depth):
    h, rows = 1e-3, waves.components(SEA, depth, G)
    late, early = (waves.motion(SEA, rows, depth, place, t + way * h) for way in (1, -1))
    derived = np.subtract(late.velocity, early.velocity) / (2 * h)
    actual = waves.motion(SEA, rows, depth, place, t).acceleration
    np.testing.assert_allclose(actual, derived, atol=1e-5)


@given(place=places, t=times, depth=depths)
def test_the_surface_moves_with_the_water_and_bears_no_pressure(place, t, depth):
    """At z = 0: d elevation/dt = -w, and du/dt = -g grad elevation. At the bottom w = 0."""
    h, rows = 1e-3, waves.components(SEA, depth, G)
    x, y, _ = place

    def surface(dx, dy, dt):
        return waves.motion(SEA, rows, depth, (x + dx, y + dy, 0.0), t + dt)

    now = surface(0.0, 0.0, 0.0)
    rise = (surface(0.0, 0.0, h).elevation - surface(0.0, 0.0, -h).elevation) / (2 * h)
    assert -now.velocity[2] == pytest.approx(rise, abs=1e-5)
    slope = (
        (surface(h, 0.0, 0.0).elevation - surface(-h, 0.0, 0.0).elevation) / (2 * h),
        (surface(0.0, h, 0.0).elevation - surface(0.0, -h, 0.0).elevation) / (2 * h),
    )
    np.testing.assert_allclose(now.acceleration[:2], np.multiply(-G, slope), atol=1e-5)
    if depth:
        assert waves.motion(SEA, rows, depth, (x, y, depth), t).velocity[2] == 0.0


@given(place=places, t=times, z=st.floats(0.0, 1e308), depth=depths)
def test_above_still_water_and_in_the_bottom_water_moves_as_at_their_surfaces(place, t, z, depth):
    rows = waves.components(SEA, depth, G)
    x, y, _ = place
    above, top = (waves.motion(SEA, rows, depth, (x, y, at), t) for at in (-z, 0.0))
    assert above == top
    if depth:
        under, bottom = (waves.motion(SEA, rows, depth, (x, y, depth + at), t) for at in (z, 0.0))
        assert under == bottom


def test_particles_in_deep_water_run_in_circles():
    """Horizontal and vertical velocity of a regular wave have one amplitude, a omega."""
    sea = Waves(n=1, s=0.0)
    [[omega, *_]] = used(sea)
    for t in range(10):
        u, v, w = moved(sea, 0.0, (0.0, 0.0, 0.0), 0.7 * t).velocity
        assert hypot(u, v, w) == pytest.approx(waves.amplitude(sea) * omega, rel=1e-13)


def test_a_sea_without_spectrum_is_still():
    sea = Waves(spectrum=Spectrum.NONE)
    assert moved(sea, 10.0, (1.0, 2.0, 3.0), 4.0) == ((0.0,) * 3, (0.0,) * 3, (0.0,) * 5, 0.0)
