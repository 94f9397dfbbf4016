"""The user's own indices that are functions of a result."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from functools import partial
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np
import pytest

from orchestrator import Result, simulate, sweep
from orchestrator.machine.errors import InputError
from orchestrator.studies import own_functions as module
from orchestrator.studies.own_functions import OwnFunction, own_functions

STUDY = {"scenario": "fig4", "stop_time": 1.0, "vary": {"plant.eta0.z": [-2.0, 3.0]}}


def deepest(result: Result) -> float:
    return float(result["plant.eta.z"].max())


def of_the_run(result: Result) -> dict[str, float]:
    """Numbers from the table, its parameters and its indices."""
    return {
        "start": result.parameters["plant.eta0.z"],
        "effort": result.metrics()["l2_effort"][0],
        "first": result.step_values("plant.tau")[0, 1],
        "never": np.nan,
    }


def depths(result: Result) -> np.ndarray:
    return result.group("plant.eta.z", "planner.y_d.z")[-1]


def fails_below(result: Result) -> float:
    if result["plant.eta.z"][0] > 0.0:
        raise ValueError("too deep")
    return 0.0


INDICES = {"deepest": deepest, "of_the_run": of_the_run, "depths": depths}


def test_result_and_study_give_the_same_numbers_in_both_engines(tmp_path):
    """`expected` is from the columns of runs by `simulate`."""
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    runs = [simulate("fig4", {"plant.eta0.z": z}, stop_time=1.0) for z in (-2.0, 3.0)]
    expected = {
        "deepest": [max(run["plant.eta.z"]) for run in runs],
        "of_the_run.start": [-2.0, 3.0],
        "of_the_run.effort": [run.metrics()["l2_effort"][0] for run in runs],
        "of_the_run.first": [run["plant.tau.q"][0] for run in runs],
        "of_the_run.never": [np.nan, np.nan],
        "depths[1]": [run["plant.eta.z"][-1] for run in runs],
        "depths[2]": [run["planner.y_d.z"][-1] for run in runs],
    }
    tried = runs[1].metrics(INDICES)
    assert tried.keys() == runs[1].metrics().keys() | INDICES.keys()
    assert tried["deepest"] == expected["deepest"][1]
    assert tried["of_the_run"]["effort"] == expected["of_the_run.effort"][1]
    assert tried["depths"] == [expected[f"depths[{i}]"][1] for i in (1, 2)]
    figures = {"deep": {"kind": "bands", "x": "plant.eta0.z", "show": ["deepest", "depths[1]"]}}
    for engine in ("fmu", "batch"):
        folder = tmp_path / engine
        study = {**STUDY, "figures": figures}
        made = sweep(study, indices=INDICES, engine=engine, kind="native", out=folder, workers=1)
        for name, values in expected.items():
            assert np.array_equal(made[name], values, equal_nan=True), name
        assert (folder / "deep.png").is_file()
    assert made.record["made_of"]["indices"].keys() == INDICES.keys()
    changed = {**INDICES, "deepest": fails_below}
    with pytest.raises(InputError, match="holds another study, which differs in indices"):
        sweep(study, indices=changed, engine=engine, kind="native", out=folder, workers=1)


def test_an_exception_is_the_failure_of_its_run(tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    made = sweep(STUDY, indices={"shallow": fails_below}, engine="batch", out=tmp_path)
    assert made["failure"].tolist() == [None, "index shallow: ValueError: too deep"]
    assert made["shallow"][0] == 0.0 and np.isnan(made["shallow"][1])


@pytest.mark.parametrize(
    ("name", "function", "words"),
    [
        ("two words", deepest, "index 'two words': a name has"),
        ("l2_effort", deepest, "index l2_effort: the name is taken"),
        ("failure", deepest, "index failure: the name is taken"),
        ("word", 3, "index word: 3 is not a function"),
        ("repr", repr, "index repr: returned '<Result fig4: .*; return a number, or a list"),
        ("rows", attrgetter("rows"), "index rows: returned array"),
        ("depth", itemgetter("depth"), "index depth: KeyError: .*'depth'"),
    ],
)
def test_mistakes_are_reported_before_the_study_begins(tmp_path, name, function, words):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    with pytest.raises(InputError, match=words):
        sweep(STUDY, indices={name: function}, engine="batch", out=tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_a_run_with_other_members_than_the_first_fails():
    run = simulate("fig4", stop_time=0.1)
    own = OwnFunction("low", lambda result: {"b": 1.0}, ("low.a",))
    with pytest.raises(InputError, match=r"index low: gives low\.b, but at first low\.a"):
        own.values(run)


def test_a_function_that_cannot_be_sent_is_named(monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    assert own_functions({"deepest": deepest})[0].function is deepest
    with pytest.raises(
        InputError, match=r"index deep: cannot be sent to other processes \(.*install"
    ):
        own_functions({"deep": lambda result: 0.0})
    # A process that is spawned has no prompt.
    monkeypatch.setattr(deepest, "__module__", "__main__")
    monkeypatch.setattr(sys.modules["__main__"], "deepest", deepest, raising=False)
    monkeypatch.delattr(sys.modules["__main__"], "__file__", raising=False)
    with pytest.raises(InputError, match="index deepest: cannot be sent to other processes: ins"):
        own_functions({"deepest": deepest})


def test_lambdas_are_sent_with_their_content():
    pytest.importorskip("cloudpickle", reason="needs the extra `studies`")
    limit = 2.0
    [own] = own_functions({"deep": lambda result: limit})
    assert pickle.loads(pickle.dumps(own)).function(None) == 2.0


SCRIPT = """
LIMIT, WORDS = {limit}, {{"a", "b", "c"}}

def helper(x):
    {comment}
    return [y for y in x if y > LIMIT or y in {{"a", "b", "c"}}]

def index(result, least={least}):
    return helper(result.time){sign}1, WORDS
"""

PLAIN = {"limit": 1.0, "comment": "", "least": 0, "sign": "+"}


def digest(changes: dict[str, object], made: str = "index") -> str:
    """Hash of a function of the script."""
    scope: dict[str, Any] = {"__name__": "script", "partial": partial}
    exec(SCRIPT.format(**PLAIN | changes), scope)
    return OwnFunction("i", eval(made, scope)).digest


def test_a_function_is_another_if_what_it_uses_is():
    plain = digest({})
    assert digest({"comment": "# As before."}) == plain
    changes = [{"limit": 2.0}, {"least": 1}, {"sign": "-"}]
    others = {*map(digest, changes)} | {digest({}, f"partial(index, least={n})") for n in (1, 2)}
    assert len(others - {plain}) == 5


def test_a_function_is_the_same_in_another_process():
    """Its sets have another order there."""
    code = f"{SCRIPT.format(**PLAIN)}\nfrom {module.__name__} import OwnFunction as Own\n"
    digests = {
        subprocess.run(
            [sys.executable, "-c", f"{code}print(Own('i', index).digest)"],
            env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, check=True,
        ).stdout
        for seed in "12"
    }  # fmt: skip
    assert len(digests) == 1
