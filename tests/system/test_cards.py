"""Programs on graphics cards: compiled for them by NVRTC, and run on the processor as C++."""

from __future__ import annotations

import pickle
import re
from functools import cache
from random import Random

import numpy as np
import pytest

from orchestrator import sweep
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from orchestrator.program import card
from orchestrator.program.card import CardProgram, Cards, find_cards
from orchestrator.program.cuda import in_cuda
from orchestrator.program.library import Source
from orchestrator.program.session import stepped_program
from orchestrator.runs.preparation import load, prepare_options
from orchestrator.runs.request import SystemOptions
from orchestrator.runs.scenario import names
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.columns import Outcomes, Point, Points
from support.nvrtc import compiled, library
from support.processor_card import ProcessorCard
from support.tiers import slow

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

KIND = "native"

#: The oldest processor that CUDA 13 compiles for, and the one of the H100 and H200.
ARCHITECTURES = ("compute_75", "compute_90")

#: Memory of a card that holds some thirty runs of Fig. 4 [bytes].
SMALL = 2**18


class Keeping(Cards):
    """Cards that keep the source of the last program."""

    def __call__(self, source: Source) -> CardProgram:
        self.source = source
        return super().__call__(source)


@cache
def engine(scenario: str) -> tuple[BatchEngine, Keeping]:
    """An engine on two cards."""
    cards = Keeping("", [ProcessorCard(), ProcessorCard()])
    made = BatchEngine({scenario: load(scenario, KIND)}, runners=cards)
    made.prepare(Point(0, scenario, {}, 1.0, 0.02))
    return made, cards


def some_runs(scenario: str, n: int, seconds: float) -> Points:
    """Runs that differ in places, seeds, inertia, steps and lengths."""
    random, system = Random(scenario), load(scenario, KIND)
    plants = [name for name, part in system.components.items() if "noise.std" in part.variables]
    points = []
    for number in range(n):
        values = {}
        for plant in plants:
            values[f"{plant}.eta0.x"] = random.uniform(-1.0, 1.0)
            values[f"{plant}.noise.std"] = random.choice([0.0, 0.001])
            values[f"{plant}.noise.seed"] = random.randrange(10**6)
        step = random.choice([0.02, 0.03])
        points.append(Point(number, scenario, values, seconds + 0.01 * number, step))
    return Points.of(points)


def joined(made: BatchEngine, points: Points) -> Outcomes:
    return Outcomes.joined([*made.outcomes(points)])


def assert_same(found: Outcomes, expected: Outcomes) -> None:
    assert found.columns == expected.columns
    assert found.numbers.tolist() == expected.numbers.tolist()
    np.testing.assert_array_equal(found.indices.view(np.int64), expected.indices.view(np.int64))
    assert found.failures.each() == expected.failures.each()
    assert found.cautions.each() == expected.cautions.each()


@pytest.mark.skipif(library() is None, reason="NVRTC is not installed")
@pytest.mark.parametrize("scenario", ["fig4", *slow(*(name for name in names() if name != "fig4"))])
def test_programs_are_cuda(scenario):
    _, cards = engine(scenario)
    for text in in_cuda(cards.source):
        for architecture in ARCHITECTURES:
            assert compiled(text, f"-arch={architecture}", "--Ofast-compile=max")


@pytest.mark.skipif(library() is None, reason="NVRTC is not installed")
def test_programs_for_single_steps_are_cuda():
    options = SystemOptions("fig4", {})
    program = stepped_program(prepare_options(options, is_open=True).plan, is_quick=True)
    for text in in_cuda(program.source):
        assert compiled(text, f"-arch={ARCHITECTURES[1]}", "--Ofast-compile=max")


@pytest.mark.skipif(library() is None, reason="NVRTC is not installed")
def test_values_of_steps_are_in_registers():
    _, cards = engine("fig4")
    code = compiled(in_cuda(cards.source).steps, "-arch=compute_90").decode()
    [size] = re.findall(r"\.entry advance.*?__local_depot\d+\[(\d+)\]", code, re.DOTALL)
    # There is only the copy of the generator whose address is passed.
    assert int(size) < 128


@pytest.mark.parametrize("scenario", ["fig4", *slow("sea", "remus", "formation-lost-link", "path")])
def test_runs_equal_the_processor(scenario):
    made, _ = engine(scenario)
    points = some_runs(scenario, 12, 2.0)
    expected = joined(BatchEngine({scenario: load(scenario, KIND)}), points)
    assert np.isfinite(expected.indices).any()
    assert_same(joined(made, points), expected)


def test_runs_of_a_new_controller_equal_the_processor(tmp_path, monkeypatch):
    """It passes the address of a matrix that it makes in an expression, as C allows."""
    monkeypatch.chdir(tmp_path)
    main(["new", "controller", "law", "."])
    test_runs_equal_the_processor("law.toml")
    _, cards = engine("law.toml")
    assert "&(Matrix" in cards.source.text


def test_studies_equal_the_processor(tmp_path, monkeypatch):
    """A study on two small cards: its blocks do not fit, and runs fail."""
    pq = pytest.importorskip("pyarrow.parquet", reason="needs the extra `studies`")
    monkeypatch.setattr(card, "find_cards", lambda _: [ProcessorCard(SMALL), ProcessorCard(SMALL)])
    study = {
        "scenario": "fig5",
        "stop_time": 1.0,
        "vary": {"controller.observer": ["euler", "exact"], "plant.h_max": [0.02, 0.002]},
        "sample": {
            "n": 32,
            "range": {
                "plant.noise.seed": [1, 1_000_000],
                "|plant.nu0.u, plant.nu0.v, plant.nu0.w|": {
                    "from": 0.1, "to": 200.0, "spacing": "log",
                },
            },
        },
        "parameters": {"plant.noise.std": 0.001},
    }  # fmt: skip
    results = [
        sweep({**study, "engine": engine}, out=tmp_path / engine) for engine in ("batch", "gpu")
    ]
    expected, found = (pq.read_table(result.folder / "runs.parquet") for result in results)
    assert found.equals(expected)
    assert 0 < results[0].failed < results[0].runs
    assert results[1].record["cards"] == [ProcessorCard.name] * 2


def test_functions_need_rows(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    monkeypatch.setattr(card, "find_cards", lambda _: [ProcessorCard()])
    with pytest.raises(InputError, match=r"need rows, .* use --engine batch"):
        sweep(
            {"scenario": "fig4", "sample": {"n": 2, "range": {"plant.m11": [20.0, 30.0]}},
             "engine": "gpu"},
            indices={"depth": lambda result: 0.0}, out=tmp_path,
        )  # fmt: skip


def test_workers_take_their_own_cards(monkeypatch):
    """An engine that is sent to a worker brings the text, and finds cards there."""
    made, _ = engine("fig4")
    sent = pickle.dumps(made)
    monkeypatch.setattr(card, "find_cards", lambda _: [ProcessorCard()])
    points = some_runs("fig4", 3, 0.1)
    assert_same(joined(pickle.loads(sent), points), joined(made, points))


def test_machine_without_a_card(monkeypatch):
    monkeypatch.setattr(card, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"^a graphics card needs CuPy: pip install .*; instead$"):
        find_cards("instead")
