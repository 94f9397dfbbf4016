"""What is read off runs, and what follows for the printed table, from numbers known by hand."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from orchestrator.analysis.signals import COMMANDED as COMMANDED_PORTS
from orchestrator.experiments.preparation import Request, loaded, prepare
from orchestrator.master.experiment import Experiment
from orchestrator.master.observer import Header
from orchestrator.master.table import Table
from orchestrator.paper import choices
from orchestrator.paper.choices import END_TIMES, OF_RUNS, PD, PROPOSED, SIGNALS, runs
from orchestrator.paper.measures import Way
from orchestrator.paper.printed_table import section
from orchestrator.paper.sensitivity import PUBLISHED
from orchestrator.paper.table import write_variants
from orchestrator.paper.variants import numbers_of
from orchestrator.studies.engine import Outcome
from orchestrator.system.names import port_name
from support.variants import APPLIED, COMMANDED, EXCHANGED, T_F, planted


def test_numbers_are_those_of_the_indices_and_of_the_commands():
    """A constant command has the effort |F| sqrt(T); the first row ends no step."""
    indices = {
        time: {f"l2_effort.{k}": i * time for i, k in enumerate("uqr", 1)}
        | {f"final_error.{k}": i / time for i, k in enumerate("xyz", 1)}
        for time in END_TIMES
    }
    outcomes = [Outcome(0, indices[time]) for time in END_TIMES]
    rows = np.tile([0.0, 3.0, -4.0, 5.0], (10_001, 1))
    rows[:, 0] = 0.02 * np.arange(len(rows))
    rows[0, 1:] = 1e6
    table = Table.of(Header(COMMANDED_PORTS, Experiment(200.0, 0.02), {}), rows)
    numbers = numbers_of(outcomes, table)
    for time in (20.0, 57.0, 200.0):
        e_f = np.arange(1, 4) / time
        for signal, effort in (
            (APPLIED, np.multiply(time, (1, 2, 3))),
            (EXCHANGED, np.multiply(time, (1, 3, 2))),
            (COMMANDED, np.multiply(np.sqrt(time), (3.0, 4.0, 5.0))),
        ):
            np.testing.assert_allclose(numbers[signal, T_F[time]], [*effort, *e_f])


def test_the_score_is_a_sum_of_logarithms():
    found = planted()
    assert found.ours.score == pytest.approx(12 * np.log(2.0))
    assert found.ours.factor == pytest.approx(2.0)
    assert found.ours.options == (0, 0, APPLIED, T_F[100.0])
    assert found.scores.shape == (2, 2, len(SIGNALS), len(T_F))


def test_the_nearest_variant_is_found():
    """All is as printed in a rough sea; in a calm one, half of it is printed."""
    rough, calm = (1, 1, APPLIED, T_F[60.0]), (0, 1, COMMANDED, T_F[80.0])
    found = planted(proposed={rough: 1.0, calm: 0.5}, pd={(*rough[:1], 0, *rough[2:]): 1.0})
    # Half of what is printed is as far away as twice of it.
    assert found.nearest(consistent=True).score == pytest.approx(12 * np.log(2.0))
    assert found.nearest(consistent=False).options == rough
    assert found.nearest(consistent=False).factor == pytest.approx(1.0)
    far = 12 * np.log(2.0)
    np.testing.assert_allclose(found.best_with_each(0, consistent=False), [far, 0.0], atol=1e-12)
    np.testing.assert_allclose(
        found.best_with_each(1, consistent=False), [far / 2, 0.0], atol=1e-12
    )
    np.testing.assert_allclose(found.best_with_each(0, consistent=True), [far, np.inf])


def test_the_pd_controller_has_no_observer_to_choose():
    found = planted(pd={(0, 0, APPLIED, T_F[60.0]): 1.0})
    for observer in (0, 1):
        variant = found.variant((0, observer, APPLIED, T_F[60.0]))
        assert variant.score == pytest.approx(6 * np.log(2.0))
        np.testing.assert_allclose(variant.numbers[PD], PUBLISHED[PD])


def test_how_many_are_near_at_once():
    """Three of the proposed controller's at one end time, two of PD's at another: three at once."""
    near, end = (0, 0, APPLIED), T_F[60.0]
    found = planted(
        proposed={(*near, end, 0): 1.09, (*near, end, 1): 0.91, (*near, end, 2): 1.2},
        pd={(*near, end + 1, 3): 1.0, (*near, end + 1, 4): 1.0},
    )
    assert [found.most_within(tolerance) for tolerance in (0.05, 0.1, 0.25)] == [2, 2, 3]


def test_ranges_are_of_what_has_arrived_and_of_what_is_consistent():
    calm, rough, lost = (0, 0, APPLIED, 50), (1, 0, APPLIED, 50), (0, 1, APPLIED, 50)
    found = planted(proposed={(*calm, 0): 0.5, (*rough, 0): 0.1, (*lost, 0): 0.01, (*lost, 5): 1e3})
    printed = PUBLISHED[PROPOSED][0]
    assert found.span(PROPOSED, consistent=True).low[0] == pytest.approx(0.5 * printed)
    assert found.span(PROPOSED, consistent=False).low[0] == pytest.approx(0.1 * printed)
    assert found.span(PROPOSED, consistent=False).high[0] == pytest.approx(2.0 * printed)
    assert found.ways_of(PROPOSED) == [Way(40.0, 1000.0)] * 2


def test_a_run_that_has_failed_is_no_variant():
    found = planted(proposed={(0, 0): np.nan, (1, 0): 0.9})
    assert np.isinf(found.scores[0, 0]).all()
    assert found.nearest(consistent=True).options[:2] == (0, 1)
    assert np.isfinite(found.span(PROPOSED, consistent=False).low).all()


def test_the_section_says_what_was_planted():
    text = section(planted(proposed={(1, 1, APPLIED, T_F[60.0]): 1.0}))
    assert (
        "| proposed L2 effort u [N·√s] | 130 | 260 | 260 | 130 | **260 to 260** | 130 to 260 |"
        in text
    )
    assert "- nearest of all: sea: rough; observer: fast; T_f = 60 s." in text
    assert "At most 6, 6, 6 of the twelve numbers" in text
    # 1,000 N.s in 40 s: 158 N.s^0.5; with 130 it takes 59.2 s.
    assert "at least 158 N·√s: with the printed 130 it would take 59.2 s" in text
    assert "| sea | rough |  | 4.16 | 4.1: calm |" in text


def test_every_combination_has_a_row_at_its_best_end_time(tmp_path):
    found = planted(proposed={(1, 1, APPLIED, T_F[60.0]): 1.0})
    write_variants(tmp_path / "variants.csv", found)
    with (tmp_path / "variants.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * len(SIGNALS)
    best = min(rows, key=lambda row: float(row["score"]))
    assert (best["sea"], best["observer"], best["T_f"]) == ("rough", "fast", "60 s")
    assert float(best["proposed L2 effort q [N·m·√s]"]) == pytest.approx(40.0)


def test_runs_are_all_combinations_and_ours_comes_first():
    proposed, pd = list(runs(PROPOSED)), list(runs(PD))
    sizes = {choice.name: len(choice.options) for choice in OF_RUNS}
    alone = [len(choice.options) for choice in OF_RUNS if choice.of_proposed]
    assert len(proposed) == np.prod(list(sizes.values()))
    assert len(pd) == len(proposed) / np.prod(alone)
    assert len({(run.order, *sorted(run.parameters.items())) for run in proposed}) == len(proposed)
    assert not proposed[0].parameters and proposed[0].order == "gauss-seidel"
    assert all(choice.options[choice.ours] == choice.options[0] for choice in OF_RUNS)


def scenarios_and_options():
    for scenario in (PROPOSED, PD):
        for choice in OF_RUNS:
            for option in choices.options_of(choice, scenario):
                if option.parameters:
                    yield pytest.param(scenario, option, id=f"{scenario}-{option.text}")


@pytest.mark.parametrize(("scenario", "option"), list(scenarios_and_options()))
def test_every_option_changes_the_system(scenario, option):
    """Each parameter is there, takes the value, and has another one in the scenario."""
    system = prepare(*loaded(scenario), Request()).system
    for name, value in option.parameters.items():
        assert system.value(port_name(name)) != value
        changed = system.with_parameters({port_name(name): value})
        assert changed.value(port_name(name)) == value
