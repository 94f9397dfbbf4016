"""The command line as Markdown, from its parser, for `tools/pages.py`."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterator, Sequence

from orchestrator.commands.main import COMMANDS, parser
from orchestrator.paper.page import table

#: How wide a usage is at most.
_WIDTH = 80


def command_line() -> str:
    """A section for each command: what it does, its usage, and what its arguments mean."""
    return "\n\n".join(
        section
        for name, command in commands(parser(COMMANDS)).items()
        for section in _sections(f"auv-fmu {name}", COMMANDS[name][1], command)
    )


def commands(of: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The commands that a parser has, by name."""
    groups = (one for one in of._actions if isinstance(one, argparse._SubParsersAction))
    return {name: command for group in groups for name, command in group.choices.items()}


def _sections(
    name: str, meaning: str, command: argparse.ArgumentParser, level: int = 2
) -> Iterator[str]:
    below = commands(command)
    actions = [
        one
        for one in command._actions
        if not isinstance(one, argparse._HelpAction | argparse._SubParsersAction)
    ]
    # First what must be given.
    actions.sort(key=lambda one: bool(one.option_strings))
    yield f"{'#' * level} `{name}`"
    yield command.description or f"{meaning[0].upper()}{meaning[1:]}."
    if not below:
        yield f"```text\n{_usage(name, actions)}\n```"
    if command.epilog:
        _, _, example = command.epilog.partition("Example: ")
        yield f"Example:\n\n```sh\n{example}\n```"
    if actions:
        yield table(("argument", "meaning"), [(_written(one), _meaning(one)) for one in actions])
    [texts] = [
        {choice.dest: choice.help or "" for choice in one._choices_actions}
        for one in command._actions
        if isinstance(one, argparse._SubParsersAction)
    ] or [{}]
    for one, subcommand in below.items():
        yield from _sections(f"{name} {one}", texts[one], subcommand, level + 1)


def _usage(name: str, actions: Sequence[argparse.Action]) -> str:
    # A part is never broken.
    parts = (_part(one).replace(" ", "\0") for one in actions)
    lines = textwrap.wrap(
        " ".join((name.replace(" ", "\0"), *parts)),
        _WIDTH,
        subsequent_indent=" " * (len(name) + 1),
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines).replace("\0", " ")


def _part(one: argparse.Action) -> str:
    """An argument in a usage."""
    written = " ".join(filter(None, (*one.option_strings[-1:], _value(one))))
    is_optional = one.option_strings or one.nargs in ("?", "*")
    dots = "..." if one.nargs in ("*", "+") or isinstance(one, argparse._AppendAction) else ""
    return f"[{written}]{dots}" if is_optional else written + dots


def _written(one: argparse.Action) -> str:
    """An argument in the table."""
    return f"`{' '.join(filter(None, (*one.option_strings, _value(one))))}`".replace("|", r"\|")


def _value(one: argparse.Action) -> str:
    if one.nargs == 0:
        return ""
    if isinstance(one.metavar, str):
        return one.metavar
    return "|".join(map(str, one.choices)) if one.choices else one.dest.upper()


def _meaning(one: argparse.Action) -> str:
    text = (one.help or "").replace("%%", "%").replace("|", r"\|")
    says_none = one.default in (None, False, [], argparse.SUPPRESS) or "default:" in text
    return text if says_none else f"{text}; default: {one.default}"
