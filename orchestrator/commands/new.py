"""`auv-fmu new`."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from orchestrator.commands.options import OK
from orchestrator.commands.streams import show
from orchestrator.runs.own_controller import BASES, new_controller


def add_to(commands: Any) -> None:
    """Add these commands to the parser."""
    new = commands.add_parser("new", help="begin something of your own")
    kinds = new.add_subparsers(required=True, metavar="KIND")
    controller = kinds.add_parser("controller", help="a folder with a controller that runs")
    controller.add_argument("name", metavar="NAME", help="of the controller, MyLaw or my_law")
    controller.add_argument(
        "folder", nargs="?", type=Path, metavar="DIR", help="to make; default: NAME/"
    )
    controller.add_argument(
        "--base",
        choices=BASES,
        default=BASES[0],
        help="plain: PythonFMU alone; hardened: the base of the bundle's components, which checks "
        f"values, saves states and survives exceptions; default: {BASES[0]}",
    )
    controller.set_defaults(action=_controller)


def _controller(options: argparse.Namespace) -> int:
    script, scenario, *others = new_controller(options.name, options.folder, options.base)
    for path in (script, scenario, *others):
        show(path)
    show(f"change {script}, then build and run it:")
    show(f"  auv-fmu build {script}")
    show(f"  auv-fmu run {scenario} --out {script.parent}{os.sep}results")
    return OK
