"""`auv-fmu build`, `list` and `gains`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from orchestrator.analysis import gains
from orchestrator.commands.options import OK, add_out, add_set, assignments
from orchestrator.commands.streams import show
from orchestrator.experiments import bundle
from orchestrator.experiments.own_controller import build_own
from orchestrator.experiments.scenario import names, read_scenario
from orchestrator.experiments.wiring import closed_loop


def add_to(commands: Any) -> None:
    """Add these commands to the parser."""
    build = commands.add_parser(
        "build", help="build every FMU and the bundle auv.ssp, or a component of your own"
    )
    build.add_argument(
        "script",
        nargs="?",
        type=Path,
        metavar="SCRIPT.py",
        help="a slave of PythonFMU, whose FMU is built beside it; default: the bundle",
    )
    add_out(build, None, f"{bundle.DEFAULT_FOLDER}, or the folder of SCRIPT.py")
    build.add_argument(
        "--loader",
        choices=("native", "plain"),
        help="native: the FMUs also run in hosts that are no Python programs; needs a C compiler "
        "and is the default where there is one",
    )
    build.set_defaults(action=_build)

    listing = commands.add_parser("list", help="list the scenarios")
    listing.set_defaults(action=_list)

    check = commands.add_parser("gains", help="check the conditions of Theorems 1 and 2")
    add_set(check)
    check.set_defaults(action=_gains)


def _build(options: argparse.Namespace) -> int:
    if options.script is not None:
        show(build_own(options.script, options.out, options.loader))
        return OK
    folder = options.out or bundle.DEFAULT_FOLDER
    written = bundle.build(folder, options.loader)
    for path in written:
        show(path)
    state = "built" if written else "up to date"
    show(f"{folder} is {state}, with the {bundle.loader_of(folder)} loader")
    return OK


def _list(_: argparse.Namespace) -> int:
    for name in names():
        show(f"{name:10} {read_scenario(name).title}")
    return OK


def _gains(options: argparse.Namespace) -> int:
    system = closed_loop(bundle.current_fmus()).with_parameters(assignments(options))
    show(*gains.check(system).splitlines())
    return OK
