"""Claims compared with runs whose numbers are calculated by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from auv_fmu.paper.vehicle import Vehicle, accelerations
from orchestrator.cosim import PortName, Table
from orchestrator.paper import claims
from orchestrator.paper.claims import (
    CLAIMS,
    Approach,
    Claim,
    KeptRun,
    approach_of,
    errors,
    largest_error_after,
    total_variation_until,
    turning_radius,
)
from orchestrator.vehicle.signals import STANDARD, tracking_error
from support.tables import table_of
from support.texts import numbers_in, tells

ELL = 0.35
ONES, TWOS, THREES = (1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (3.0, 3.0, 3.0)


def kept_run(table=None, **metrics):
    return KeptRun(metrics, table or Table())


def claim_of(judge) -> Claim:
    found, *_ = (claim for claim in CLAIMS if claim.judge is judge)
    return found


def test_errors_of_all_rows_are_the_tracking_error():
    rng = np.random.default_rng(1)
    names = [*STANDARD.posture, *STANDARD.y_d, *STANDARD.applied, *STANDARD.commanded]
    columns = {name.replace(".", "__"): rng.normal(size=9) for name in names}
    table = table_of(np.arange(9.0), {PortName.read(STANDARD.ell): 0.35}, **columns)
    np.testing.assert_allclose(errors(table), tracking_error(table), rtol=1e-13, atol=1e-15)


def test_titles_differ():
    assert len({claim.title for claim in CLAIMS}) == len(CLAIMS)


def test_turning_radius_is_speed_by_yaw_rate():
    """3-4-5: a speed of 0.5 m/s at 2 rad/s is a radius of 0.25 m."""
    table = table_of(np.arange(3.0), plant__nu__u=0.3, plant__nu__v=-0.4, plant__nu__r=-2.0)
    assert turning_radius(table) == pytest.approx(0.25)
    found = claims.turning(kept_run(table))
    assert numbers_in(found.ours) == [0.25, 0.5]
    assert found.verdict.startswith("**differs**") and tells(found.verdict, [0.417])


def test_turning_radius_of_the_paper_would_agree():
    table = table_of(np.arange(3.0), plant__nu__u=0.6, plant__nu__v=0.0, plant__nu__r=1.0)
    verdict = claims.turning(kept_run(table)).verdict
    assert verdict.startswith("agrees") and tells(verdict, [1.0])


def test_efforts_agree_within_a_tenth_of_the_published_ones():
    found = claims.effort_proposed(kept_run(l2_effort=(260.0, 20.0, 53.0)))
    assert found.verdict.startswith("**differs**") and numbers_in(found.verdict) == [2, 0.5, 1]
    assert numbers_in(found.ours) == [260, 20, 53]
    published = claims.effort_pd(kept_run(l2_effort=(235.0 * 1.09, 163.0 * 0.91, 172.0)))
    assert published.verdict.startswith("agrees")
    assert numbers_in(published.verdict) == [1.09, 0.91, 1]
    one_far = claims.effort_pd(kept_run(l2_effort=(235.0, 163.0, 172.0 * 1.11)))
    assert one_far.verdict.startswith("**differs**")


def test_efforts_by_59_as_printed_differ_unless_both_are_near():
    near = kept_run(rms_effort=(130.0, 40.0, 53.0)), kept_run(rms_effort=(235.0, 163.0, 172.0))
    assert claims.effort_as_printed(*near).verdict.startswith("agrees")
    far = kept_run(rms_effort=(13.0, 4.0, 5.3))
    assert claims.effort_as_printed(far, near[1]).verdict.startswith("**differs**")


def test_efforts_as_a_sum_are_norms_by_the_root_of_h_and_the_time():
    """sqrt(0.02 * 200) is 2."""
    run = {"stop_time": 200.0, "step": 0.02}
    five = kept_run(l2_effort=(260.0, 40.0, 106.0), **run)
    found = claims.effort_as_a_sum(five, kept_run(l2_effort=(470.0, 163.0, 344.0), **run))
    assert numbers_in(found.ours)[:7] == [130, 20, 53, 235, 81.5, 172, 200]
    assert numbers_in(found.verdict)[:6] == [1, 0.5, 1] * 2
    assert found.verdict.startswith("**differs**")


def test_final_errors_are_divided_by_the_published_ones():
    error = (0.02, 0.02, 0.03)
    ours = kept_run(final_error=error)
    assert numbers_in(claims.final_error_proposed(ours).verdict) == [2, 1, 0.5]
    assert numbers_in(claims.final_error_proposed(ours).ours) == [*error]
    assert numbers_in(claims.final_error_pd(ours).verdict) == [5, 20, 30]


@pytest.mark.parametrize(
    ("judge", "true", "false"),
    [
        (
            claims.no_saturation,
            [kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.0, 0.0))],
            [kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.1, 0.0))],
        ),
        (
            claims.convergence,
            [kept_run(final_error=(0.01, 0.09, 0.0))],
            [kept_run(final_error=(0.01, 0.11, 0.0))],
        ),
        (
            claims.proposed_does_not_saturate,
            [kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.0, 0.0))] * 2,
            [
                kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.0, 0.0)),
                kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.0, 0.1)),
            ],
        ),
        (
            claims.pd_saturates,
            [kept_run(peak_command=ONES, saturated_fraction=(0.1, 0.1, 0.1))],
            [kept_run(peak_command=ONES, saturated_fraction=(0.1, 0.0, 0.1))],
        ),
        (
            claims.pd_chatters,
            [kept_run(total_variation=ONES), kept_run(total_variation=TWOS)],
            [kept_run(total_variation=TWOS), kept_run(total_variation=(3.0, 3.0, 1.0))],
        ),
        (
            # Medians: one draw of five changes nothing.
            claims.pd_chatters_with_noise,
            [kept_run(total_variation=ONES)] * 4
            + [kept_run(total_variation=THREES)]
            + [kept_run(total_variation=TWOS)] * 5,
            [kept_run(total_variation=TWOS)] * 5
            + [kept_run(total_variation=THREES)] * 2
            + [kept_run(total_variation=ONES)] * 3,
        ),
        (
            claims.no_saturation_with_noise,
            [kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.0, 0.0))] * 10,
            [kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.0, 0.0))] * 9
            + [kept_run(peak_command=ONES, saturated_fraction=(0.0, 0.0, 0.001))],
        ),
        (
            claims.pd_is_accurate,
            [kept_run(final_error=TWOS), kept_run(final_error=ONES)],
            [kept_run(final_error=(2.0, 0.5, 2.0)), kept_run(final_error=ONES)],
        ),
        (
            claims.smoother_and_less_accurate,
            [
                kept_run(total_variation=TWOS, final_error=ONES),
                kept_run(total_variation=ONES, final_error=TWOS),
            ],
            [
                kept_run(total_variation=TWOS, final_error=ONES),
                kept_run(total_variation=(1.0, 3.0, 1.0), final_error=TWOS),
            ],
        ),
        (
            claims.gradual_degradation,
            [kept_run(final_error=error) for error in (ONES, TWOS, THREES)],
            [kept_run(final_error=error) for error in (ONES, THREES, TWOS)],
        ),
    ],
)
def test_verdict_follows_from_the_numbers(judge, true, false):
    assert claim_of(judge).finding(true).verdict.startswith("agrees")
    assert claim_of(judge).finding(false).verdict.startswith("**differs**")


def test_accuracy_is_a_ratio():
    found = claims.pd_is_accurate(
        kept_run(final_error=(2.0, 3.0, 4.0)), kept_run(final_error=(1.0, 0.5, 0.1))
    )
    assert numbers_in(found.ours) == [2, 6, 40]


def applied(values):
    """Three signals of one course, sampled each second."""
    return table_of(
        np.arange(float(len(values))), **{k.replace(".", "__"): values for k in STANDARD.applied}
    )


def test_total_variation_counts_the_steps_until_a_time():
    """|2 - 5| + |5 - 4| in each of three signals: the next step ends later."""
    table = applied([2.0, 5.0, 4.0, 50.0, 100.0])
    assert total_variation_until(table, 3.0).tolist() == [3.0 + 1.0] * 3


def test_the_largest_peak_of_all_draws_counts():
    runs = [
        kept_run(peak_command=(i, 20.0 - i, 5.0), saturated_fraction=(0.0, i * 1e-4, 0.0))
        for i in range(10)
    ]
    found = claims.no_saturation_with_noise(*runs)
    assert tells(found.ours, (5, 4, 20, 5, 9, 15, 5, 0.09))


def test_severe_chattering_is_compared_in_the_first_minute():
    smooth, rough = applied([1.0, 2.0, 0.0]), applied([1.0, 5.0, 0.0])
    found = claims.pd_chatters_severely(kept_run(smooth), kept_run(rough))
    assert found.verdict.startswith("agrees") and numbers_in(found.verdict) == [4, 4, 4]
    assert claims.pd_chatters_severely(kept_run(rough), kept_run(smooth)).verdict.startswith("**")


def still(offsets):
    """A level vehicle at rest in the origin, and a reference that is so far along y."""
    posture = {f"plant__eta__{k}": 0.0 for k in ("x", "y", "z", "phi", "theta", "psi")}
    reference = dict(
        zip((k.replace(".", "__") for k in STANDARD.y_d), (ELL, offsets, 0.0), strict=True)
    )
    time = np.arange(float(len(offsets))) * 20.0
    return table_of(time, {PortName("plant", "ell"): ELL}, **posture, **reference)


def test_largest_error_ignores_the_start():
    """The control point lies ell ahead of the vehicle, so the error is the offset."""
    table = still(np.array([9.0, 8.0, 7.0, 0.5, -0.75]))
    assert largest_error_after(table, 40.0) == pytest.approx(0.75)
    assert largest_error_after(table, 100.0) == 0.0
    runs = [kept_run(still(np.array([9.0, 9.0, 9.0, e]))) for e in (0.1, 0.2, 0.3)]
    assert claims.gradual_degradation_on_the_way(*runs).verdict == "agrees"
    assert claims.gradual_degradation_on_the_way(*runs[::-1]).verdict == "**differs**"


def arriving(force, steps=10):
    """A vehicle that pushes until the reference is 0.5 m away, in steps of 20 s."""
    offsets = np.array([30.0] * steps + [0.5])
    table = still(offsets)
    columns = {name.replace(".", "__"): table[name] for name in table.columns}
    pushes = {name.replace(".", "__"): 0.0 for name in STANDARD.applied}
    pushes |= {"plant__tau_applied__u": np.broadcast_to(force, steps + 1)}
    return table_of(table.time, dict(table.parameters), **columns, **pushes)


@given(arrays(float, 11, elements=st.floats(-80.0, 80.0)))
def test_no_force_has_less_effort_than_its_impulse_takes(force):
    """The effort by its definition, (59) without 1/T_f; the last row begins no step."""
    found = approach_of(arriving(force))
    assert found.duration == 200.0
    effort = np.sqrt(20.0 * np.sum(force[:-1] ** 2))
    assert found.least_effort <= effort * (1.0 + 1e-12) + 1e-12
    # Without the step, the same force is not contradicted later.
    coded = np.sqrt(np.sum(force[:-1] ** 2) / found.duration)
    assume(coded > 1e-9)
    assert found.contradicts_until(coded, 20.0) <= found.duration * (1.0 + 1e-9)


def test_a_constant_force_has_the_least_effort():
    """5 N for 200 s: 1,000 N.s, 5 sqrt(200) N.s^0.5; half the effort takes four times as long."""
    found = approach_of(arriving(5.0))
    assert found.impulse == pytest.approx(1000.0)
    assert found.least_effort == pytest.approx(5.0 * np.sqrt(200.0))
    assert found.soonest(found.least_effort / 2.0) == pytest.approx(800.0)


@given(st.lists(st.floats(0.0, 80.0), min_size=50, max_size=200))
def test_damping_needs_an_impulse(forces):
    """Straight on from rest, by (2): d11 times the way, and what the speed at its end takes.

    31 m against 30 kg/s are 930 N.s, which an effort of 130 N.s^0.5 gives in 51 s at the soonest.
    """
    h, u, x, vehicle = 0.02, 0.0, 0.0, Vehicle()
    for force in forces:
        du, *_ = accelerations(vehicle, (u, 0.0, 0.0, 0.0, 0.0), 0.0, (force, 0.0, 0.0), (0.0,) * 5)
        x, u = x + h * u, u + h * du
    impulse, duration = h * sum(forces), h * len(forces)
    assert impulse == pytest.approx(vehicle.d11 * x + vehicle.m11 * u)
    effort = np.sqrt(h * np.sum(np.square(forces)))
    assert Approach(duration, vehicle.d11 * x).least_effort <= effort * (1.0 + 1e-12) + 1e-12
    assert Approach(0.0, vehicle.d11 * 31.0).soonest(130.0) == pytest.approx(51.0, abs=0.5)


def test_efforts_are_compared_with_the_impulse_of_the_approach():
    """1,000 N.s in 200 s: 71 N.s^0.5, which 130 and 235 exceed; 4,000 N.s take 283."""
    enough, short = kept_run(arriving(5.0)), kept_run(arriving(20.0))
    assert claims.effort_of_the_way(enough, enough).verdict.startswith("agrees")
    found = claims.effort_of_the_way(enough, short)
    assert tells(found.ours, (1000, 200, 4000, 200), (70.7, 283))
    # (1,000 N.s)^2 / 200 s / (130 N)^2, in steps of 20 s.
    assert tells(found.verdict, (0.0148, 0.0724))
    assert found.verdict.startswith("**differs**")
    away = kept_run(still(np.array([9.0, 8.0])))
    assert claims.effort_of_the_way(away, enough).verdict == "none"


def estimating(largest, **metrics):
    estimates = {k.replace(".", "__"): 0.5 for k in STANDARD.theta_hat} | {
        "controller__theta_hat[2]": largest
    }
    return kept_run(table_of(np.arange(2.0), **estimates), **metrics)


def test_estimates_are_bounded():
    found = claims.bounded_estimates(estimating(17.0))
    assert found.verdict == "agrees"
    assert tells(found.ours, (17, 1))
    assert claims.bounded_estimates(estimating(np.inf)).verdict == "**differs**"


def test_more_effort_means_effort_gain_and_chattering():
    """For each actuator: a sum of newtons and newton metres could hide one that falls."""
    runs = [
        estimating(i, l2_effort=np.multiply(i, (3.0, 4.0, 12.0)), total_variation=(i, i, i))
        for i in (1.0, 2.0, 3.0)
    ]
    found = claims.more_effort(*runs)
    assert tells(found.ours, (3, 4, 12, 6, 8, 24, 9, 12, 36), (1, 1, 1, 2, 2, 2, 3, 3, 3))
    assert found.verdict == "agrees"
    for less in (
        estimating(1.5, l2_effort=(30.0, 40.0, 120.0), total_variation=THREES),
        estimating(3.0, l2_effort=(30.0, 7.0, 120.0), total_variation=THREES),
        estimating(3.0, l2_effort=(30.0, 40.0, 120.0), total_variation=(3.0, 3.0, 1.5)),
    ):
        assert claims.more_effort(*runs[:2], less).verdict == "**differs**"


def test_intolerable_chattering_is_saturation():
    quiet = kept_run(peak_command=(61.0, 22.9, 22.8), saturated_fraction=(0.0, 0.0, 0.0))
    assert claims.intolerable_chattering(quiet).verdict.startswith("**not seen**")
    rough = kept_run(peak_command=(610.0, 22.9, 22.8), saturated_fraction=(0.5, 0.0, 0.0))
    assert claims.intolerable_chattering(rough).verdict == "agrees"


def test_gains_of_the_paper_miss_30_and_31():
    """Reading 10: lambda_min(K_2 Lambda) = 10 is not above 15, nor lambda_d2 = 30 above 192."""
    found = claim_of(claims.gains_meet_the_conditions).finding([])
    assert tells(found.ours, (30, 10, 15, 31, 30)), "(30) 10 < 15, (31) 30"
    assert found.verdict.startswith("**differs**")


def test_no_gains_make_the_region_arbitrarily_large():
    """2 lambda_d2 / (m11 m66 / (m22 ell^3)) = 0.12."""
    found = claim_of(claims.region_is_arbitrarily_large).finding([])
    assert tells(found.ours, (124.9,), (42, 0.12))
    assert found.verdict.startswith("**differs**")


def test_a_run_that_ended_early_gives_no_verdict():
    stopped = kept_run(failure="a mast has broken")
    found = claim_of(claims.pd_chatters).finding([kept_run(total_variation=ONES), stopped])
    assert found.ours.endswith("a mast has broken") and found.verdict == "none"
