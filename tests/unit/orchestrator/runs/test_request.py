"""Keywords of Python, fields of requests and options of the command line are the same."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from inspect import signature
from pathlib import Path
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest

from orchestrator import simulate, sweep
from orchestrator.commands.many_runs import add_sweep
from orchestrator.commands.run_command import add_run
from orchestrator.cosim.experiment import ORDERS
from orchestrator.runs.request import Files, Request, option_fields
from orchestrator.studies.sweep import Means

Declared = dict[str, tuple[Any, Any]]

#: What only Python has a keyword for, or only a request.
OF_SIMULATE = {"system", "progress", "variant", "checkpoint"}
OF_REQUESTS = {"scenario", "real_time"}
OF_SWEEP = {"study", "out", "progress"}

#: Of the fields of :class:`Files`, what `simulate` takes: a result in memory has no files.
CHECKPOINTS = {"checkpoint_every", "resume"}


def keywords(function: Callable[..., Any]) -> Declared:
    """The types and defaults of arguments."""
    hints = get_type_hints(function)
    return {
        name: (hints[name], one.default) for name, one in signature(function).parameters.items()
    }


def fields_of(declared: type[Any]) -> Declared:
    """The types and defaults of fields; what is empty by default is None in Python."""
    hints = get_type_hints(declared)
    return {
        one.name: (hints[one.name], None if one.default is MISSING else one.default)
        for one in fields(declared)
    }


def less(declared: Declared, names: set[str]) -> Declared:
    assert names <= declared.keys()
    return {name: one for name, one in declared.items() if name not in names}


def test_keywords_of_simulate_are_the_fields_of_a_request():
    taken = less(keywords(simulate), OF_SIMULATE)
    files = {name: one for name, one in fields_of(Files).items() if name in CHECKPOINTS}
    wanted = less(fields_of(Request), OF_REQUESTS) | files
    # In Python a mapping may be missing, and events are no name of a scenario that has them.
    wanted["parameters"] = (Mapping[str, object] | None, None)
    wanted["steps"] = (wanted["steps"][0] | None, None)
    [_, *tables] = get_args(wanted["events"][0])
    wanted["events"] = (tables[0] | None, None)
    assert taken == wanted


def test_keywords_of_sweep_are_the_means():
    assert less(keywords(sweep), OF_SWEEP) == fields_of(Means)


@pytest.mark.parametrize(
    ("add", "declared", "others"),
    [
        (add_run, [Request, Files], {"scenario", "variant", "set", "out"}),
        (add_sweep, [Means], {"study", "out"}),
    ],
)
def test_options_are_the_fields(add, declared, others):
    """By name, default and type; only a run's parameters and steps have no option of their name."""
    parser = argparse.ArgumentParser(add_help=False)
    add(parser)
    options = {one.dest: one for one in parser._actions}
    named = {}
    for one in declared:
        named |= {name: fields_of(one)[name] for name in option_fields(one)}
    without = {name for one in declared for name in fields_of(one)} - named.keys()
    assert without == ({"scenario", "parameters", "steps"} if Request in declared else set())
    assert options.keys() == named.keys() | others
    for name, (hint, default) in named.items():
        option = options[name]
        assert option.option_strings == ["--" + name.replace("_", "-")]
        assert option.default == default
        of = [hint] if get_origin(hint) is Literal else get_args(hint) or [hint]
        kinds = set(of) - {NoneType}
        words = [word for kind in kinds if get_origin(kind) is Literal for word in get_args(kind)]
        if option.nargs == 0:
            assert (kinds, default) == ({bool}, False)
        elif isinstance(option.type, type):
            assert option.type in kinds
        elif option.choices is not None:
            # What the command line takes is what a type checker takes.
            assert (kinds, words) == ({Literal[tuple(option.choices)]}, list(option.choices))
        else:
            assert str in kinds or words == list(ORDERS)


def test_every_keyword_arrives(monkeypatch):
    """With a value that no other one has."""
    asked: list[Any] = []

    def note(*arguments: Any, **options: Any) -> None:
        asked[:] = arguments
        raise StopIteration

    monkeypatch.setattr(
        "orchestrator.runs.simulate.load_scenario", lambda *_, **options: (None, None)
    )
    monkeypatch.setattr("orchestrator.runs.simulate.prepare", note)
    monkeypatch.setattr("orchestrator.studies.sweep.complete_study", note)
    names = keywords(simulate).keys() - OF_SIMULATE - CHECKPOINTS
    given = {name: {name: name} for name in names}
    with pytest.raises(StopIteration):
        simulate("fig4", **given)
    assert {name: getattr(asked[-1], name) for name in names} == given
    # Its check wants good values.
    monkeypatch.setattr(Means, "__post_init__", lambda _: None)
    given = {name: name for name in keywords(sweep).keys() - OF_SWEEP}
    with pytest.raises(StopIteration):
        sweep({"scenario": "fig4", "vary": {"step": [0.01, 0.02]}}, out="place", **given)
    assert asked[1:3] == [Means(**given), Path("place")]
