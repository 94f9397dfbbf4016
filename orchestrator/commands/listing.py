"""`auv-fmu list`, with few imports, so that it takes no time."""

from __future__ import annotations

import argparse
import tomllib

from orchestrator.commands.streams import OK, describe, show
from orchestrator.runs import SCENARIOS_FOLDER, names_in


def add_list(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu list`."""
    describe(parser, "List the scenarios with their titles.", "list")
    parser.set_defaults(action=_list)


def _list(_: argparse.Namespace) -> int:
    names = names_in(SCENARIOS_FOLDER)
    width = max(map(len, names))
    for name in names:
        content = tomllib.loads((SCENARIOS_FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
        show(f"{name:{width}}  {content['title']}")
    return OK
