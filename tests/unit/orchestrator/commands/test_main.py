"""Every command has a description, and an example that its parser accepts."""

from __future__ import annotations

import argparse
import logging
import shlex

import pytest

from orchestrator.commands.main import COMMANDS, parser
from orchestrator.commands.streams import shown_log
from orchestrator.runs import bundle


def commands_of(parser):
    """The parsers of a parser's commands, by name."""
    [found] = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    return found.choices


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_a_description_and_an_example_that_parses(name):
    command = commands_of(parser([name]))[name]
    assert command.description.endswith(".")
    program, *arguments = shlex.split(command.epilog.removeprefix("Example: "))
    assert (program, arguments[0]) == ("auv-fmu", name)
    assert callable(parser(arguments).parse_args(arguments).action)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_says_what_it_is(name):
    for action in commands_of(parser([name]))[name]._actions:
        assert action.help, action.option_strings or action.dest


@pytest.mark.parametrize("name", COMMANDS)
def test_a_misspelt_option_of_any_command_is_answered_with_its_usage_and_a_suggestion(name, capsys):
    """Each option without its third letter."""
    command = commands_of(parser([name]))[name]
    _, _, *words = shlex.split(command.epilog.removeprefix("Example: "))
    for action in command._actions:
        option = max(action.option_strings, key=len, default="")
        wrong = option[:4] + option[5:]
        if len(option) < 6 or any(
            known.startswith(wrong) for known in command._option_string_actions
        ):
            continue
        with pytest.raises(SystemExit, match="2"):
            parser([name]).parse_args([name, *words, wrong])
        usage, line = capsys.readouterr().err.splitlines()
        assert usage.startswith(f"usage: auv-fmu {name} ")
        assert wrong in line and option in line.partition("did you mean")[2]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_misspelt_command_is_answered_with_a_suggestion(name, capsys):
    with pytest.raises(SystemExit, match="2"):
        parser([]).parse_args([f"{name}{name[-1]}"])
    usage, line = capsys.readouterr().err.splitlines()
    assert usage.startswith("usage: auv-fmu ") and len(usage) < 80
    assert line.endswith("?") and name in line.partition("did you mean")[2]


def test_a_misspelt_choice_is_answered_with_a_suggestion_or_with_all(capsys):
    for value, answer in (("parqet", "did you mean parquet?"), ("xlsx", "csv, parquet")):
        with pytest.raises(SystemExit, match="2"):
            parser(["run"]).parse_args(["run", "fig4", "--format", value])
        assert answer in capsys.readouterr().err


def test_help_lists_every_command():
    listed = [line.split()[0] for line in parser().format_help().splitlines() if line[:2] == "  "]
    assert set(COMMANDS) <= set(listed)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["fig4"], "no command 'fig4'; did you mean auv-fmu run fig4?"),
        (["run", "fig4", "--stop-time", "x"], "argument --stop-time: 'x' is not a number"),
        (["hosts", "--steps", "1.5"], "argument --steps: '1.5' is not a whole number"),
    ],
)
def test_what_is_not_a_command_or_a_number_is_named(capsys, words, message):
    with pytest.raises(SystemExit, match="2"):
        parser(words).parse_args(words)
    assert capsys.readouterr().err.endswith(f"error: {message}\n")


def test_what_the_program_logs_is_shown_while_a_command_runs(capsys):
    log = logging.getLogger("auv_fmu")
    with shown_log():
        log.warning("building")
    log.warning("nothing")
    assert capsys.readouterr().err == "auv-fmu: building\n"


def no_compiler(_: object) -> None:
    raise OSError("there is no C compiler")


@pytest.mark.parametrize(("find", "kind"), [(lambda _: None, "native"), (no_compiler, "python")])
def test_auto_is_the_kind_that_can_be_built(monkeypatch, find, kind):
    monkeypatch.setattr(bundle, "compiler_for", find)
    words = ["build", "--kind", "auto"]
    assert parser(words).parse_args(words).kind == kind
