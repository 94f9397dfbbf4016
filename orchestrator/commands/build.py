"""`auv-fmu build`, `new` and `gains`: build FMUs, write templates, check gains."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path

from fmus.kinds import NATIVE, PYTHON
from orchestrator.commands.options import (
    add_fmi,
    add_kind,
    add_options,
    add_out,
    add_platforms,
    add_set,
    assignments,
)
from orchestrator.commands.streams import OK, describe, finished, say, show
from orchestrator.machine.errors import InputError
from orchestrator.runs import bundle
from orchestrator.runs.bundle import DEFAULT_FOLDERS
from orchestrator.runs.own_components import (
    LIKENESSES,
    build_own,
    changes,
    new_component,
    new_controller,
)
from orchestrator.runs.request import Files
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.proof import gain_check


def add_build(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu build`."""
    describe(
        parser,
        "Build the bundle (every FMU, and auv.ssp), or the FMU of your own component. Files that "
        "are up to date are not rebuilt.",
        "build --kind native --out dist",
    )
    add_kind(parser)
    add_fmi(parser)
    add_platforms(parser, f"--kind {NATIVE}")
    parser.add_argument(
        "script",
        nargs="?",
        type=Path,
        metavar="SCRIPT.py|DIR",
        help="your own component: a script with the function outputs, the folder of such a "
        "script, or a script with a PythonFMU class (only for --kind "
        f"{PYTHON}); its FMU is written next to it; default: build the bundle",
    )
    folders = f"{DEFAULT_FOLDERS[PYTHON]} or {DEFAULT_FOLDERS[NATIVE]}"
    add_out(parser, f"{folders}, or the folder of SCRIPT.py")
    add_options(parser, Files, "force")
    parser.add_argument(
        "--loader",
        choices=("native", "plain"),
        help=f"loader in the FMUs of --kind {PYTHON}: native (for any host; needs Linux and a C "
        "compiler) or plain (only for hosts that are Python programs); default: native if there "
        "is a C compiler",
    )
    parser.add_argument(
        "--arrays",
        action="store_true",
        help="with --fmi 3: vectors and matrices whose elements have one unit are arrays; of the "
        "bundle no SSP is written then",
    )
    parser.add_argument(
        "--watch",
        action="store_true",
        help="rebuild each time that SCRIPT.py, or a module beside it, changes; Ctrl-C ends it",
    )
    parser.set_defaults(action=_build)


def add_new(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu new`."""
    describe(parser, "Create the files of your own component.", "new component my_filter")
    kinds = parser.add_subparsers(required=True, metavar="KIND", help="kind of component")
    component = kinds.add_parser(
        "component", help="create a folder with a component for both kinds of FMU, and its tests"
    )
    describe(
        component,
        "Create a folder with a component in one Python file, from which both kinds of FMU are "
        "built, and its tests, a scenario that runs it and a README.",
        "new component water_tank --like plant",
    )
    _add_place(component, "component", "WaterTank or water_tank")
    start = component.add_mutually_exclusive_group()
    start.add_argument(
        "--like",
        choices=LIKENESSES,
        default=LIKENESSES[0],
        help="what to start from: controller (PID with limits), plant (a tank), filter (low-pass "
        f"of second order) or empty (the minimum); default: {LIKENESSES[0]}",
    )
    start.add_argument(
        "--from",
        dest="source",
        type=Path,
        metavar="FILE",
        help="start from the neural network of dense layers in an .onnx or .npz file, or from a "
        "planner that follows the track in a .csv file",
    )
    component.set_defaults(action=_component)
    controller = kinds.add_parser(
        "controller", help="create a folder with a controller for the closed loop, ready to run"
    )
    describe(
        controller,
        "Create a folder with a controller in the language of equations, its FMU, its tests, a "
        "scenario that runs it in the closed loop and a README.",
        "new controller my_law",
    )
    _add_place(controller, "controller", "MyLaw or my_law")
    controller.add_argument(
        "--python",
        action="store_true",
        help="make it a script with a class of PythonFMU, which may use numpy, scipy and any other "
        "package; it has no tests, and its FMU needs Python",
    )
    controller.set_defaults(action=_controller)


def _add_place(parser: argparse.ArgumentParser, what: str, examples: str) -> None:
    """Add the name and folder of a new component."""
    parser.add_argument("name", metavar="NAME", help=f"name of the {what}, for example {examples}")
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        metavar="DIR",
        help="folder to create; default: its name in lower case, as water_tank/",
    )


def add_gains(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu gains`."""
    describe(
        parser,
        "Check whether the gains meet the conditions of Theorems 1 and 2.",
        "gains --set controller.k_d=2",
    )
    add_set(parser)
    parser.set_defaults(action=_gains)


def _build(options: argparse.Namespace) -> int:
    if options.script is not None:
        return _watch(options) if options.watch else _build_own(options)
    if options.watch:
        raise InputError("--watch is for your own component: name its script")
    folder = options.out or DEFAULT_FOLDERS[options.kind]
    # FMUs of the other kind are made in a moment.
    heard = {"hear": say} if options.kind == NATIVE else {}
    written = bundle.build_bundle(folder, force=options.force, **heard, **_form(options))
    show(*written)
    state = "built" if written else "up to date"
    show(f"{folder} is {state}, {_described(bundle.settings_of(folder))}")
    return OK


def _form(options: argparse.Namespace) -> bundle.Form:
    return bundle.Form(
        kind=options.kind,
        fmi=options.fmi,
        loader=options.loader,
        platforms=options.platforms,
        arrays=options.arrays,
    )


def _build_own(options: argparse.Namespace) -> int:
    built = build_own(
        options.script,
        options.out,
        force=options.force,
        hear=lambda line: None if options.watch else say(line),
        **_form(options),
    )
    show(f"{built}, {datetime.now():%H:%M:%S}" if options.watch else built)
    return OK


def _watch(options: argparse.Namespace) -> int:
    """Build at once and after each change, until Ctrl-C; mistakes do not end it."""
    for _ in changes(options.script):
        try:
            _build_own(options)
        except InputError as error:
            say(str(error))
        if not finished():
            break
    return OK


def _described(settings: Mapping[str, str]) -> str:
    """Describe the settings of a build."""
    if settings["kind"] == PYTHON:
        return f"with the {settings['loader']} loader"
    return f"FMI {settings['fmi']}.0 for {settings['platforms']}, by {settings['compiler']}"


def _controller(options: argparse.Namespace) -> int:
    return _next_steps(new_controller(options.name, options.folder, python=options.python))


def _component(options: argparse.Namespace) -> int:
    return _next_steps(new_component(options.name, options.folder, options.like, options.source))


def _next_steps(files: list[Path]) -> int:
    """Show the new files and the next commands."""
    show(*files)
    script, tests = files[0], [path for path in files[1:] if path.suffix == ".py"]
    [scenario] = [path for path in files if path.suffix == ".toml"]
    show(f"edit {script}, then {'test, ' * len(tests)}build and run it:")
    if tests and find_spec("pytest") is None:
        show("  pip install pytest")
    show(*(f"  pytest {test}" for test in tests))
    show(f"  auv-fmu build {script}")
    show(f"  auv-fmu run {scenario} --out {script.parent}{os.sep}results")
    return OK


def _gains(options: argparse.Namespace) -> int:
    system = closed_loop(bundle.current_fmus()).with_parameters(assignments(options))
    show(*gain_check(system).splitlines())
    return OK
