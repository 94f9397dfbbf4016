"""What is read off runs, and what follows for the printed table, from numbers known by hand."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from orchestrator.cosim.system.names import PortName
from orchestrator.paper import choices
from orchestrator.paper.choices import (
    END_TIMES,
    FIVE_DEGREES,
    FORMULAS,
    OF_RUNS,
    OF_RUNS_OF_FIVE,
    PD,
    PROPOSED,
    PUBLISHED,
    SIGNALS,
    as_read,
    runs,
)
from orchestrator.paper.measures import Approach, errors, numbers_of
from orchestrator.paper.printed_table import section, write_variants
from orchestrator.paper.variants import moved
from orchestrator.runs.loading import load_scenario
from orchestrator.runs.preparation import prepare
from orchestrator.runs.request import Request
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Point
from orchestrator.vehicle.signals import STANDARD, tracking_error
from support.tables import table_of
from support.variants import (
    APPLIED,
    COMMANDED,
    EXCHANGED,
    L2,
    PRINTED_ORDER,
    SQUARE,
    SUM,
    T_F,
    found,
    planted,
    spread,
)

COLUMNS = (*STANDARD.posture, *STANDARD.y_d, *STANDARD.applied, *STANDARD.commanded)


def run_of(rows=10_001, **columns):
    """A run of 200 s in steps of 20 ms; what is not given is zero."""
    zeros = dict.fromkeys((name.replace(".", "__") for name in COLUMNS), 0.0)
    known = {PortName.read(STANDARD.ell): 0.35}
    return table_of(0.02 * np.arange(rows), known, **{**zeros, **columns})


def test_numbers_are_read_off_rows():
    """A constant force has the effort |F| sqrt(T); the last row begins no step; e_f is of 5 s."""
    force = np.full(10_001, 3.0)
    force[-1] = 1e6
    # The control point is 0.35 m ahead, which is up at a pitch of 90 degrees; and y_d comes nearer.
    y_d = 1.0 + 0.35 + 2.0 / (1.0 + 0.02 * np.arange(10_001))
    found = numbers_of(
        run_of(
            plant__tau_applied__u=force,
            plant__tau__q=-2.0 * force,
            plant__eta__x=1.0,
            planner__y_d__x=y_d,
            planner__y_d__z=5.0,
        ),
        END_TIMES,
    )
    for time in (20.0, 57.0, 200.0):
        applied, commanded = found[:, T_F[time]]
        e_f = (2.0 / (1.0 + time - 5.0), 0.0, 5.0)
        np.testing.assert_allclose(applied, [3.0 * np.sqrt(time), 0, 0, *e_f], atol=1e-12)
        np.testing.assert_allclose(commanded, [0, 6.0 * np.sqrt(time), 0, *e_f], atol=1e-12)


def test_errors_of_all_rows_are_the_tracking_error():
    rng = np.random.default_rng(1)
    table = run_of(9, **{name.replace(".", "__"): rng.normal(size=9) for name in COLUMNS})
    np.testing.assert_allclose(errors(table), tracking_error(table), rtol=1e-13, atol=1e-15)


def test_a_run_that_ends_early_has_no_numbers():
    assert np.isnan(numbers_of(run_of(9_000), END_TIMES)).all()


def test_formulas_are_those_that_someone_would_code():
    """By the rows themselves, at every end time."""
    tau = np.random.default_rng(2).uniform(-80.0, 80.0, (10_000, 3))
    columns = zip(STANDARD.applied, np.vstack((tau, [0.0] * 3)).T, strict=True)
    numbers = numbers_of(
        run_of(**{name.replace(".", "__"): tau for name, tau in columns}), END_TIMES
    )
    for time in (20.0, 82.0, 200.0):
        taken = tau[: round(time / 0.02)]
        for formula, coded in (
            (L2, np.sqrt(np.sum(taken**2 * 0.02, axis=0))),
            (SUM, np.sqrt(np.sum(taken**2, axis=0) / time)),
            (SQUARE, np.mean(taken**2, axis=0)),
        ):
            for order, places in ((PRINTED_ORDER, [0, 1, 2]), (EXCHANGED, [0, 2, 1])):
                six = as_read(numbers, order, formula)[APPLIED, T_F[time]]
                np.testing.assert_allclose(six[:3], coded[places], rtol=1e-10)


def test_the_score_is_a_sum_of_logarithms():
    found = planted()
    assert found.ours.score == pytest.approx(12 * np.log(2.0))
    assert found.ours.factor == pytest.approx(2.0)
    assert found.ours.options == (0, 0, APPLIED, PRINTED_ORDER, L2, T_F[100.0])
    assert found.ours.bands is None
    assert found.scores.shape == (2, 2, len(SIGNALS), 2, 3, len(T_F))


def test_every_reading_combines_with_every_other():
    """Commanded signals, the last two exchanged, as sums at 98 s: L2 / 1.4."""
    six = np.array([182.0, 74.2, 56.0, 0.01, 0.02, 0.06]) / PUBLISHED[PROPOSED]
    pd = np.array([329.0, 240.8, 228.2, 0.004, 0.001, 0.001]) / PUBLISHED[PD]
    where = (0, 0, COMMANDED, T_F[98.0])
    found = planted(proposed={where: six}, pd={where: pd})
    nearest = found.nearest(consistent=False)
    assert nearest.options == (0, 0, COMMANDED, EXCHANGED, SUM, T_F[98.0])
    assert nearest.score == pytest.approx(0.0, abs=1e-12)


def test_the_nearest_variant_is_found():
    """All is as printed in a rough sea; in a calm one, half of it is printed."""
    rough, calm = (1, 1, APPLIED, T_F[60.0]), (0, 1, COMMANDED, T_F[80.0])
    found = planted(proposed={rough: 1.0, calm: 0.5}, pd={(*rough[:1], 0, *rough[2:]): 1.0})
    # The sum at 200 s has twelve numbers of which six are twice what is printed.
    assert found.nearest(consistent=True).score == pytest.approx(6 * np.log(2.0))
    assert found.nearest(consistent=True).options[-2:] == (SUM, T_F[200.0])
    assert found.nearest(consistent=False).options == (*rough[:3], PRINTED_ORDER, L2, rough[-1])
    assert found.nearest(consistent=False).factor == pytest.approx(1.0)
    far = 6 * np.log(2.0)
    np.testing.assert_allclose(found.best_with_each(0, consistent=False), [far, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.best_with_each(1, consistent=False), [far, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.best_with_each(0, consistent=True), [far, np.inf])


def test_the_pd_controller_has_no_observer_to_choose():
    found = planted(pd={(0, 0, APPLIED, T_F[60.0]): 1.0})
    for observer in (0, 1):
        variant = found.variant((0, observer, APPLIED, PRINTED_ORDER, L2, T_F[60.0]))
        assert variant.score == pytest.approx(6 * np.log(2.0))
        np.testing.assert_allclose(variant.numbers[PD], PUBLISHED[PD])


def test_how_many_are_near_at_once():
    """Three of the proposed controller's at one end time, two of PD's at another: six at once.

    The six efforts are so as sums at 200 s.
    """
    near, end = (0, 0, APPLIED), T_F[60.0]
    found = planted(
        proposed={(*near, end, 0): 1.09, (*near, end, 1): 0.91, (*near, end, 2): 1.2},
        pd={(*near, T_F[200.0], 3): 1.0, (*near, T_F[200.0], 4): 1.0},
    )
    assert [found.most_within(tolerance) for tolerance in (0.05, 0.1, 0.25)] == [8, 8, 8]


def test_ranges_are_of_what_has_arrived_and_of_what_is_consistent():
    calm, rough, lost = (0, 0, APPLIED, 50), (1, 0, APPLIED, 50), (0, 1, APPLIED, 50)
    found = planted(proposed={(*calm, 0): 0.5, (*rough, 0): 0.1, (*lost, 0): 0.01, (*lost, 5): 1e3})
    printed = PUBLISHED[PROPOSED][0]
    assert found.span(PROPOSED, True, L2).low[0] == pytest.approx(0.5 * printed)
    assert found.span(PROPOSED, False, L2).low[0] == pytest.approx(0.1 * printed)
    assert found.span(PROPOSED, False, L2).high[0] == pytest.approx(2.0 * printed)
    # At 70 s and 20 s the step's root is 1.18 and 0.63.
    assert found.span(PROPOSED, True, SUM).low[0] == pytest.approx(0.5 * printed / np.sqrt(1.4))
    assert found.span(PROPOSED, True, SUM).high[0] == pytest.approx(2.0 * printed / np.sqrt(0.4))
    assert found.span(PROPOSED, True).high[0] == pytest.approx((2.0 * printed) ** 2 / 20.0)
    # What contradicts nothing has its efforts in the order that is printed.
    assert found.span(PROPOSED, True, L2).low[1] == pytest.approx(80.0)
    assert found.span(PROPOSED, False, L2).high[1] == pytest.approx(106.0)
    assert found.ways_of(PROPOSED) == [Approach(40.0, 1000.0)] * 2


def test_how_near_all_six_efforts_are_at_once():
    """What contradicts something, or is lost, is not looked at."""
    where, lost = (0, 0, COMMANDED, T_F[72.0]), (0, 1, APPLIED, T_F[50.0])
    efforts = {(*where, i): effort for i, effort in enumerate((1.2, 0.9, 1.32))}
    far = {lost: 1.0, (*lost, 4): 1e3, (1, 0, APPLIED, T_F[60.0]): 1.0}
    pd = {(0, 0, *where[2:]): 1.14, (0, 0, *lost[2:]): 1.0, (1, 0, APPLIED, T_F[60.0]): 1.0}
    assert planted(proposed={**efforts, **far}, pd=pd).efforts_within(L2) == pytest.approx(0.32)
    assert planted().efforts_within(L2) == pytest.approx(1.0)
    # At 200 s the sum is half of L2.
    assert planted().efforts_within(SUM) == pytest.approx(0.0, abs=1e-12)


def test_a_run_that_has_failed_is_no_variant():
    found = planted(proposed={(0, 0): np.nan, (1, 0): 0.9})
    assert np.isinf(found.scores[0, 0]).all()
    assert found.nearest(consistent=True).options[:2] == (0, 1)
    assert np.isfinite(found.span(PROPOSED, consistent=False).low).all()


def test_numbers_that_depend_on_the_start_are_medians_with_a_band():
    six = planted()
    chaotic = six.over_starts(six.ours, spread(0.5, 1.5, 3.0))
    assert chaotic.options == six.ours.options
    assert chaotic.score == pytest.approx(12 * np.log(1.5))
    for scenario, published in PUBLISHED.items():
        np.testing.assert_allclose(chaotic.numbers[scenario], 1.5 * published)
        np.testing.assert_allclose(chaotic.bands[scenario].low, 0.5 * published)
        np.testing.assert_allclose(chaotic.bands[scenario].high, 3.0 * published)
    assert six.over_starts(six.ours, spread(1.999, 2.0, 2.001)).bands is None


def test_bands_are_read_as_their_variant_is():
    """As sums at 98 s: L2 / 1.4."""
    six = planted()
    variant = six.variant((0, 0, APPLIED, EXCHANGED, SUM, T_F[98.0]))
    found = six.over_starts(variant, spread(0.5, 1.4, 3.0))
    np.testing.assert_allclose(found.numbers[PROPOSED][:3], [130.0, 53.0, 40.0])
    np.testing.assert_allclose(found.bands[PD].high[:3], np.array([235, 172, 163]) * 3.0 / 1.4)


def test_the_section_says_what_was_planted():
    met = (1, 1, APPLIED, T_F[60.0])
    text = section(found(planted(proposed={met: 1.0}, pd={(1, 0, *met[2:]): 1.0})))
    row = "| proposed effort u | 130 | 260 | 130 | 130 | 260 (130 to 650) | **260 to 260** |"
    assert row in text
    assert (
        "- nearest of all: sea: rough; observer: fast; T_f = 60 s; the score is 8.32 at 50 s"
        in text
    )
    assert "- ours: T_f = 100 s; the score is 8.32 at 90 s and 8.32 at 110 s." in text
    assert "The numbers of nearest of five depend on that" in text
    assert "with the L2 norm, what is never reached is proposed effort u, " in text
    assert "with the sum without the step, what is never reached is proposed e_f x" in text
    assert "At most 12, 12, 12 of the twelve" in text and "6, 6, 6 with five" in text
    # 1,000 N.s in 40 s: 158 N.s^0.5; with 130 it takes 59.2 s. As a sum, 158 / sqrt(0.02 T).
    assert "at least 158 N·√s: with the printed 130 it would take 59.2 s" in text
    assert "contradicts nothing from T_f = 74 s on" in text
    assert "| sea | rough |  | 0.00 | 4.1: calm |" in text


def test_every_combination_has_a_row_as_it_is_read_best(tmp_path):
    met = (1, 1, APPLIED, T_F[60.0])
    met_in_a_rough_sea = planted(proposed={met: 1.0}, pd={(1, 0, *met[2:]): 1.0})
    write_variants(tmp_path / "variants.csv", found(met_in_a_rough_sea))
    with (tmp_path / "variants.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    # Four of six degrees of freedom, and four of five.
    assert len(rows) == 2 * (2 * 2)
    best = min(rows, key=lambda row: float(row["score"]))
    assert (best["sea"], best["observer"], best["T_f"]) == ("rough", "fast", "60 s")
    assert best["formula of the efforts"] == FORMULAS[L2].text
    assert float(best["proposed effort q"]) == pytest.approx(40.0)
    assert rows[0]["formula of the efforts"] == FORMULAS[SUM].text


def test_starts_are_moved_by_no_more_than_is_said():
    """From where the variant itself starts, by the number of the start, and else nothing."""
    engine = BatchEngine({PD: load_scenario(PD)[1]})
    for options, start in (({}, (2.0, 6.0, 0.0)), ({"plant.eta0.y": -3.0}, (2.0, -3.0, 0.0))):
        run = Point(0, PD, {"plant.roll": False, **options}, 200.0, 0.02)
        starts = []
        for made in moved(engine, run, range(50)):
            parameters = dict(made.parameters)
            starts.append([parameters.pop(f"plant.eta0.{axis}") for axis in "xyz"])
            assert parameters == {"plant.roll": False}
        away = np.abs(np.subtract(starts, start))
        assert away.max() <= 1.0001e-6 and away.max() > 0.9e-6
        assert len({tuple(x) for x in starts}) == 50
        assert next(moved(engine, run, [7])).parameters["plant.eta0.x"] == starts[7][0]


def test_five_degrees_of_freedom_contradict_nothing_else():
    for choice in OF_RUNS_OF_FIVE:
        assert choice.options and not any(option.against for option in choice.options)
    [vehicle] = [choice for choice in OF_RUNS_OF_FIVE if choice.name == "vehicle"]
    assert [dict(option.parameters) for option in vehicle.options] == [{"plant.roll": False}]
    assert [choice.name for choice in OF_RUNS_OF_FIVE] == [choice.name for choice in OF_RUNS]


def test_runs_are_all_combinations_and_ours_comes_first():
    proposed, pd = list(runs(PROPOSED)), list(runs(PD))
    sizes = {choice.name: len(choice.options) for choice in OF_RUNS}
    alone = [len(choice.options) for choice in OF_RUNS if choice.of_proposed]
    assert len(proposed) == np.prod(list(sizes.values()))
    assert len(pd) == len(proposed) / np.prod(alone)
    assert len({(run.order, *sorted(run.parameters.items())) for run in proposed}) == len(proposed)
    assert not proposed[0].parameters and proposed[0].order is None
    assert all(choice.options[choice.ours] == choice.options[0] for choice in OF_RUNS)


def scenarios_and_options():
    for scenario in (PROPOSED, PD):
        for choice in (
            *OF_RUNS,
            *(each for each in OF_RUNS_OF_FIVE if each.options == (FIVE_DEGREES,)),
        ):
            for option in choices.choice_options(choice, scenario):
                if option.parameters:
                    yield pytest.param(scenario, option, id=f"{scenario}-{option.text}")


@pytest.mark.parametrize(("scenario", "option"), list(scenarios_and_options()))
def test_every_option_changes_the_system(scenario, option):
    """Each parameter is there, takes the value, and has another one in the scenario."""
    system = prepare(*load_scenario(scenario), Request()).system
    for name, value in option.parameters.items():
        changed = system.with_parameters({PortName.read(name): value})
        variable = system.component(PortName.read(name).component).variable(
            PortName.read(name).port
        )
        assert changed.value(PortName.read(name)) != system.value(PortName.read(name))
        assert variable.shown(changed.value(PortName.read(name))) == value
