"""The tool for the printed table, compared with indices of FMUs and formulas by hand."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.cosim import PortName
from orchestrator.paper.claims import approach_of
from orchestrator.runs.preparation import load_scenario
from orchestrator.studies.batch_engine import BatchEngine
from printed_table import (
    CHOICES,
    END_TIMES,
    FIVE,
    MOVED,
    OF_PROPOSED,
    PRINTED,
    QUANTILES,
    SCENARIOS,
    SIX,
    TITLES,
    Variants,
    as_read,
    quantiles,
    run_of,
    score,
    single,
    six_of,
)
from support.markdown import DOCS
from support.runs import InThisProcess

PAGE = DOCS / "explanation" / "table.md"

T_F = {time: i for i, time in enumerate(END_TIMES.tolist())}

#: The first two options of these are tried, and ours of all others.
TRIED = ("eps_t of the proposed controller", "order")


@pytest.fixture(scope="module")
def engine():
    return BatchEngine({name: load_scenario(name)[1] for name in SCENARIOS})


@pytest.fixture(scope="module")
def variants(engine):
    few = {name: some[: 2 if name in TRIED else 1] for name, some in CHOICES.items()}
    return Variants(InThisProcess(), few, lambda points: single(engine, points), 2)


def test_formulas_are_those_that_someone_would_code():
    """From the rows, at several end times."""
    tau = np.random.default_rng(2).uniform(-80.0, 80.0, (10_000, 6))
    l2 = np.sqrt(np.cumsum(tau**2 * 0.02, axis=0))[np.round(END_TIMES / 0.02).astype(int) - 1]
    twelve = np.tile(0.01, (len(END_TIMES), 12))
    twelve[:, [0, 1, 2, 6, 7, 8]] = l2
    for time in (20.0, 82.0, 200.0):
        taken = tau[: round(time / 0.02)]
        for formula, coded in enumerate(
            (
                np.sqrt(np.sum(taken**2 * 0.02, axis=0)),
                np.sqrt(np.sum(taken**2, axis=0) / time),
                np.mean(taken**2, axis=0),
            )
        ):
            for order, places in enumerate(([0, 1, 2, 3, 4, 5], [0, 2, 1, 3, 5, 4])):
                read = as_read(twelve, order, formula)[T_F[time]]
                np.testing.assert_allclose(read[[0, 1, 2, 6, 7, 8]], coded[places], rtol=1e-10)
                assert (read[[3, 4, 5, 9, 10, 11]] == 0.01).all()


def test_the_score_is_a_sum_of_logarithms():
    assert score(2.0 * PRINTED) == pytest.approx(12 * np.log(2.0))
    assert score(0.5 * PRINTED) == pytest.approx(12 * np.log(2.0))
    assert score(PRINTED) == 0.0


def test_ours_is_what_the_scenarios_give_and_the_page_shows(variants):
    ours = variants.twelve[0, 0, T_F[100.0]]
    for name in SCENARIOS:
        result = simulate(name, stop_time=100.0, kind="native")
        metrics = result.metrics()
        values = [*metrics["l2_effort"], *metrics["final_error"]]
        np.testing.assert_allclose(ours[SIX[name]], values, rtol=1e-11)
        assert variants.ways[name][0] == pytest.approx(approach_of(result), rel=1e-12)
    page = PAGE.read_text(encoding="utf-8")
    for title, printed, value in zip(TITLES, PRINTED, ours, strict=True):
        assert f"\n| {title} | {printed:g} | {value:.3g} | " in page
    assert f"\n| score |  | {variants.scores[0, 0, T_F[100.0], 0]:.2f} | " in page


def test_options_have_the_numbers_of_runs(variants):
    """Jacobi order, eps_t = 1, as sums without the step at 57 s; for PD eps_t stays 10."""
    [i] = [
        i
        for i, chosen in enumerate(variants.chosen)
        if all(chosen[name] is CHOICES[name][1] for name in TRIED)
    ]
    read = as_read(variants.twelve[i, 0], 0, 1)[T_F[57.0]]
    for name, parameters in (("fig5", {"controller.eps_t": 1.0}), ("fig5-pd", {})):
        result = simulate(name, parameters, stop_time=57.0, order="jacobi", kind="native")
        applied = result.step_values(*(f"plant.tau_applied.{k}" for k in "uqr"))
        efforts = np.sqrt(np.sum(applied**2, axis=0) / 57.0)
        expected = [*efforts, *result.metrics()["final_error"]]
        np.testing.assert_allclose(read[SIX[name]], expected, rtol=1e-11)


def test_what_contradicts_the_paper_is_not_consistent(engine):
    few = {name: some[: 2 if name == "plant" else 1] for name, some in CHOICES.items()}
    found = Variants(InThisProcess(), few, lambda points: single(engine, points), 2)
    assert np.isfinite(found.scores).all()
    assert np.isinf(found.consistent[1]).all()
    assert np.isinf(found.consistent[0, ..., 3:]).all()
    assert (found.consistent[0, ..., :3] == found.scores[0, ..., :3]).all()


def test_moved_starts_are_runs_of_the_fmus_from_the_same_starts(engine):
    """With five degrees of freedom, whose numbers depend on the last bits."""
    starts = range(3, 6)
    found = quantiles(engine, run_of("fig5-pd", {"vehicle": FIVE}), starts)
    sixes = []
    for number in starts:
        away = np.random.default_rng(number).uniform(-MOVED, MOVED, 3)
        start = dict(zip("xyz", np.add((2.0, 6.0, 0.0), away).tolist(), strict=True))
        values = {"plant.roll": False, **{f"plant.eta0.{k}": x for k, x in start.items()}}
        metrics = simulate("fig5-pd", values, stop_time=120.0, kind="native").metrics()
        sixes.append([*metrics["l2_effort"], *metrics["final_error"]])
    expected = np.quantile(sixes, QUANTILES, axis=0)
    np.testing.assert_allclose(found[:, 0, T_F[120.0]], expected, rtol=1e-9)


def test_a_run_that_ends_early_has_no_numbers(engine):
    short = run_of("fig5", {})._replace(stop_time=180.0)
    assert np.isnan(six_of(engine.table(short))).all()


def test_runs_are_all_combinations_and_ours_comes_first():
    everything = [dict(zip(CHOICES, some, strict=True)) for some in product(*CHOICES.values())]
    runs = {
        name: {json.dumps(run_of(name, some), sort_keys=True) for some in everything}
        for name in SCENARIOS
    }
    alone = np.prod([len(CHOICES[name]) for name in OF_PROPOSED])
    assert len(runs["fig5"]) == len(everything) == alone * len(runs["fig5-pd"])
    assert not run_of("fig5", everything[0]).parameters
    assert run_of("fig5", everything[0]).order is None


OPTIONS = [
    (scenario, option)
    for scenario, name in product(SCENARIOS, CHOICES)
    if scenario == "fig5" or name not in OF_PROPOSED
    for option in (*CHOICES[name], FIVE)
    if option.parameters
]


@pytest.mark.parametrize(("scenario", "option"), OPTIONS)
def test_every_option_changes_the_system(scenario, option):
    """Each parameter exists, accepts the value, and has another one in the scenario."""
    _, system = load_scenario(scenario)
    for name, value in option.parameters.items():
        changed = system.with_parameters({PortName.read(name): value})
        variable = system.component(PortName.read(name).component).variable(
            PortName.read(name).port
        )
        assert changed.value(PortName.read(name)) != system.value(PortName.read(name))
        assert variable.shown(changed.value(PortName.read(name))) == value
