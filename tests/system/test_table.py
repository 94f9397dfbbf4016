"""`auv-fmu table`: what it reads off its runs against the indices of runs of FMUs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.paper import printed_table
from orchestrator.paper.choices import OF_RUNS, OF_RUNS_OF_FIVE, PD, PROPOSED, PUBLISHED, Choice
from orchestrator.paper.measures import approach_of
from orchestrator.paper.printed_table import NUMBERS
from orchestrator.paper.variants import FARTHEST_START, all_variants
from support.runs import InThisProcess

pytest.importorskip("pyarrow", reason="needs the extra `studies`")

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "table.md"

#: The first two options of these, and ours of all others.
TRIED = ("eps_t of the proposed controller", "order")


def reduced(choice: Choice) -> Choice:
    return choice._replace(options=choice.options[: 2 if choice.name in TRIED else 1])


#: Starts of five degrees of freedom that are compared, and others that are printed.
SEARCHED, SHOWN = range(3), range(3, 6)


@pytest.fixture(scope="module")
def found():
    six, five = ([reduced(choice) for choice in choices] for choices in (OF_RUNS, OF_RUNS_OF_FIVE))
    return all_variants(InThisProcess(), six, five, SEARCHED, SHOWN)


def test_ours_is_what_the_scenarios_give(found):
    numbers = found.six.ours.numbers
    for scenario in (PROPOSED, PD):
        result = simulate(scenario, stop_time=100.0, kind="native")
        metrics = result.metrics()
        np.testing.assert_allclose(
            numbers[scenario], [*metrics["l2_effort"], *metrics["final_error"]], rtol=1e-11
        )
        assert found.six.ways_of(scenario)[0] == pytest.approx(approach_of(result), rel=1e-12)
    # With six degrees of freedom 1e-6 m at the start is nothing.
    assert found.printed[0].options == found.six.ours.options and found.printed[0].bands is None


def test_the_page_shows_ours(found):
    """All other columns take all variants."""
    page = PAGE.read_text(encoding="utf-8")
    for scenario, published in PUBLISHED.items():
        ours = found.six.ours.numbers[scenario]
        for name, printed, value in zip(NUMBERS[scenario], published, ours, strict=True):
            assert f"\n| {name} | {printed:g} | {value:.3g} | " in page
    assert f"\n| score |  | {found.six.ours.score:.2f} | " in page


def test_options_are_those_of_the_runs(found):
    """Jacobi order, eps_t = 1, as sums without the step at 57 s; for PD eps_t stays 10."""
    names = [choice.name for choice in found.six.choices]
    options = list(found.six.ours.options)
    for name in (*TRIED, "formula of the efforts"):
        options[names.index(name)] = 1
    options[-1] = [option.text for option in found.six.choices[-1].options].index("57 s")
    variant = found.six.variant(tuple(options))
    for scenario, parameters in ((PROPOSED, {"controller.eps_t": 1.0}), (PD, {})):
        result = simulate(scenario, parameters, stop_time=57.0, order="jacobi", kind="native")
        applied = result.step_values(*(f"plant.tau_applied.{k}" for k in "uqr"))
        np.testing.assert_allclose(
            variant.numbers[scenario],
            [*np.sqrt(np.sum(applied**2, axis=0) / 57.0), *result.metrics()["final_error"]],
            rtol=1e-11,
        )


def test_five_degrees_of_freedom_are_medians_over_starts_with_a_band(found):
    """Runs of the FMUs from the same starts, which have the same bits."""
    shown, names = found.printed[-1], [choice.name for choice in found.five.choices]
    options = {
        name: choice.options[i].parameters
        for name, choice, i in zip(names, found.five.choices, shown.options, strict=True)
    }
    signal, order, formula, end = shown.options[-4:]
    time = float(found.five.choices[-1].options[end].text.removesuffix(" s"))
    order_of_evaluation = found.five.choices[names.index("order")].options
    assert (signal, order) == (0, 0) and formula < 2
    for scenario in (PROPOSED, PD):
        sixes = []
        for number in SHOWN:
            away = np.random.default_rng(number).uniform(-FARTHEST_START, FARTHEST_START, 3)
            start = dict(zip("xyz", np.add((2.0, 6.0, 0.0), away).tolist(), strict=True))
            parameters = {"plant.roll": False, **{f"plant.eta0.{k}": x for k, x in start.items()}}
            if scenario == PROPOSED:
                parameters |= options["eps_t of the proposed controller"]
            result = simulate(
                scenario,
                parameters,
                stop_time=time,
                order=order_of_evaluation[shown.options[names.index("order")]].order or None,
                kind="native",
            )
            metrics = result.metrics()
            factor = (0.02 * time) ** (-0.5 * formula)
            sixes.append([*np.multiply(metrics["l2_effort"], factor), *metrics["final_error"]])
        low, median, high = np.quantile(sixes, (0.1, 0.5, 0.9), axis=0)
        np.testing.assert_allclose(shown.numbers[scenario], median, rtol=1e-9)
        np.testing.assert_allclose(shown.bands[scenario].low, low, rtol=1e-9)
        np.testing.assert_allclose(shown.bands[scenario].high, high, rtol=1e-9)


def test_the_command_leaves_table_variants_and_record(found, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(printed_table, "all_variants", lambda crew: found)
    assert main(["table", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        str(tmp_path / name) for name in ("table.md", "variants.csv")
    ]
    record = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert record["command"] == ["auv-fmu", "table", "--out", str(tmp_path)]
    assert record["files"] == ["run.json", "table.md", "variants.csv"]
    rows = (tmp_path / "variants.csv").read_text(encoding="utf-8").splitlines()
    # With six degrees of freedom, and with five.
    assert len(rows) == 1 + 2 * (2 * 2)
    assert "| proposed effort u | 130 | 183 |" in (tmp_path / "table.md").read_text()
