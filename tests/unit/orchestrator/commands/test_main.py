"""Every command says what it does and gives an example that its own parser takes."""

from __future__ import annotations

import argparse
import shlex

import pytest

from orchestrator.commands.main import COMMANDS, parser


def commands_of(one):
    """The parsers of a parser's commands, by name."""
    [found] = [a for a in one._actions if isinstance(a, argparse._SubParsersAction)]
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
