"""Options of the command line and keywords of Python are the fields of the same dataclasses."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import fields
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from orchestrator import simulate, sweep
from orchestrator.commands.many_runs import add_sweep
from orchestrator.commands.options import from_options
from orchestrator.commands.run_command import add_run
from orchestrator.machine.errors import InputError
from orchestrator.runs.request import Files, Options, Request
from orchestrator.studies.sweep import Means

#: Arguments in Python only.
OF_SIMULATE = {
    "system", "parameters", "progress", "variant", "checkpoint", "checkpoint_every", "resume",
}  # fmt: skip
OF_SWEEP = {"study", "indices", "out", "progress"}

#: Options of the command line, and the values that they give.
GIVEN: Mapping[type[Any], Mapping[str, Any]] = {
    Request: {
        "--stop-time 2.5": 2.5,
        "--step 0.01": 0.01,
        "--order a,b": ("a", "b"),
        "--coupling linear": "linear",
        "--kind native": "native",
        "--events mine.toml": "mine.toml",
        "--inputs a.csv --inputs b.csv": [Path("a.csv"), Path("b.csv")],
        "--loop compiled": "compiled",
        "--isolate": True,
        "--step-timeout 3": 3.0,
        "--strict": True,
    },
    Files: {
        "--interval 0.1": 0.1,
        "--columns a.*,b": "a.*,b",
        "--format parquet": "parquet",
        "--no-figures": True,
        "--real-time 2": 2.0,
        "--checkpoint-every 4": 4.0,
        "--resume": True,
        "--force": True,
    },
    Means: {
        "--engine batch": "batch",
        "--kind python": "python",
        "--loop python": "python",
        "--scheduler tcp://here": "tcp://here",
        "--workers 3": 3,
        "--points 9": 9,
        "--force": True,
    },
}


def hints(function: Callable[..., Any]) -> dict[str, Any]:
    """The types and defaults of arguments."""
    types = get_type_hints(function)
    return {
        name: (types[name], parameter.default)
        for name, parameter in signature(function).parameters.items()
    }


@pytest.mark.parametrize(
    ("add", "declared", "others"),
    [
        (add_run, [Request, Files], {"scenario", "variant", "set", "out"}),
        (add_sweep, [Means], {"study", "out"}),
    ],
)
def test_every_option_gives_its_value_and_its_default(add, declared, others):
    parser = argparse.ArgumentParser(add_help=False)
    add(parser)
    names = {
        option[2:].split()[0].replace("-", "_") for group in declared for option in GIVEN[group]
    }
    assert {action.dest for action in parser._actions} == names | others
    for group in declared:
        assert from_options(group, parser.parse_args(["fig4"])) == group()
        for option, value in GIVEN[group].items():
            name, *_ = words = option.split()
            found = from_options(group, parser.parse_args(["fig4", *words]))
            attribute = name[2:].replace("-", "_")
            assert getattr(found, attribute) == value != getattr(group(), attribute)


@pytest.mark.parametrize("wrong", ["--kind nativ", "--loop fast", "--step often", "--format xls"])
def test_an_option_takes_no_other_value(wrong, capsys):
    parser = argparse.ArgumentParser()
    add_run(parser)
    with pytest.raises(SystemExit):
        parser.parse_args(["fig4", *wrong.split()])
    assert wrong.split()[0] in capsys.readouterr().err


@pytest.mark.parametrize("name", ["interval", "real_time", "checkpoint_every"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_times_that_are_not_positive_are_refused(name, value):
    with pytest.raises(InputError, match=f"{value:g}"):
        Files(**{name: value})


def test_simulate_has_the_options_as_keywords_with_their_types():
    taken = hints(simulate)
    assert [*taken][:2] == ["system", "parameters"]
    assert taken.keys() - OF_SIMULATE == {field.name for field in fields(Options)}
    assert taken["stop_time"] == (float | None, None)
    assert taken["steps"] == (Mapping[str, float], {})
    kinds = {parameter.kind for parameter in [*signature(simulate).parameters.values()][2:]}
    assert kinds == {Parameter.KEYWORD_ONLY}


def test_wrong_arguments_are_type_errors_of_the_function():
    with pytest.raises(TypeError, match=r"^simulate\(\) .*'stop_tim'"):
        simulate("fig4", stop_tim=1.0)
    with pytest.raises(TypeError, match=r"^simulate\(\) .*'system'"):
        simulate()
    with pytest.raises(TypeError, match=r"^simulate\(\) too many"):
        simulate("fig4", {}, 1.0)


def test_keywords_of_sweep_are_the_means():
    types = get_type_hints(Means)
    taken = {name: hint for name, hint in hints(sweep).items() if name not in OF_SWEEP}
    assert taken == {field.name: (types[field.name], field.default) for field in fields(Means)}


def test_every_keyword_arrives(monkeypatch):
    """Each with its own value."""
    asked: list[Any] = []

    def note(*arguments: Any, **_: Any) -> None:
        asked[:] = arguments
        raise StopIteration

    preparation = "orchestrator.runs.preparation"
    monkeypatch.setattr(f"{preparation}.load_scenario", lambda *_, **options: (None, None))
    monkeypatch.setattr(f"{preparation}.prepare", note)
    monkeypatch.setattr("orchestrator.studies.sweep.complete_study", note)
    names = hints(simulate).keys() - OF_SIMULATE | {"parameters"}
    given = {name: {name: name} for name in names}
    with pytest.raises(StopIteration):
        simulate("fig4", **given)
    assert {name: getattr(asked[-1], name) for name in names} == given
    # It accepts no other values.
    monkeypatch.setattr(Means, "__post_init__", lambda _: None)
    given = {name: name for name in hints(sweep).keys() - OF_SWEEP}
    with pytest.raises(StopIteration):
        sweep({"scenario": "fig4", "vary": {"step": [0.01, 0.02]}}, out="place", **given)
    assert asked[1:3] == [Means(**given), Path("place")]
