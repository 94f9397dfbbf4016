"""`auv-fmu table`: what it reads off its runs against the indices of runs of FMUs."""

from __future__ import annotations

import json

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.paper import table
from orchestrator.paper.choices import OF_RUNS, PD, PROPOSED, SIGNALS, Choice
from orchestrator.paper.measures import way_of
from orchestrator.paper.variants import all_variants

pytest.importorskip("numba", reason="needs the extra `studies`")

#: The first two options of these, and ours of all others.
TRIED = ("eps_t of the proposed controller", "order")


def reduced(choice: Choice) -> Choice:
    return choice._replace(options=choice.options[: 2 if choice.name in TRIED else 1])


class Here:
    def results(self, tasks, unit):
        for key, task in tasks.items():
            yield key, task()


@pytest.fixture(scope="module")
def found():
    return all_variants(Here(), [reduced(choice) for choice in OF_RUNS])


def test_ours_is_what_the_scenarios_give(found):
    numbers = found.ours.numbers
    for scenario in (PROPOSED, PD):
        result = simulate(scenario, stop_time=100.0, kind="native")
        metrics = result.metrics()
        np.testing.assert_allclose(
            numbers[scenario], [*metrics["l2_effort"], *metrics["final_error"]], rtol=1e-12
        )
        assert found.ways_of(scenario)[0] == pytest.approx(way_of(result), rel=1e-12)


def test_options_are_those_of_the_runs(found):
    """Jacobi order, eps_t = 1, 57 s; for PD eps_t stays 10."""
    axes = [choice.name for choice in found.choices]
    options = list(found.ours.options)
    for name in TRIED:
        options[axes.index(name)] = 1
    options[-1] = [option.text for option in found.choices[-1].options].index("57 s")
    variant = found.variant(tuple(options))
    for scenario, parameters in ((PROPOSED, {"controller.eps_t": 1.0}), (PD, {})):
        result = simulate(scenario, parameters, stop_time=57.0, order="jacobi", kind="native")
        metrics = result.metrics()
        np.testing.assert_allclose(
            variant.numbers[scenario], [*metrics["l2_effort"], *metrics["final_error"]], rtol=1e-12
        )


def test_the_command_leaves_table_variants_and_record(found, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(table, "all_variants", lambda crew: found)
    assert main(["table", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        str(tmp_path / name) for name in ("table.md", "variants.csv")
    ]
    record = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert record["command"] == ["auv-fmu", "table", "--out", str(tmp_path)]
    assert record["files"] == ["run.json", "table.md", "variants.csv"]
    rows = (tmp_path / "variants.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + 2 * 2 * len(SIGNALS)
    assert "| proposed L2 effort u [N·√s] | 130 | 183 |" in (tmp_path / "table.md").read_text()
