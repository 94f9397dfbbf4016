"""The command line: `auv-fmu build | list | run`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from orchestrator import bundle
from orchestrator.errors import InputError
from orchestrator.figures import FIGURES, draw
from orchestrator.master import ORDERS, simulate
from orchestrator.metrics import metrics
from orchestrator.result import Result
from orchestrator.scenario import Scenario, names, port_name, read_scenario
from orchestrator.ssp import read_ssp
from orchestrator.system import PortName, System

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

#: Communication step of the paper [s], for systems that name none.
DEFAULT_STEP = 0.02


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        return int(options.action(options))
    except InputError as error:
        print(f"auv-fmu: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("auv-fmu: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone; nothing more can be told to anybody.
        sys.stderr.close()
        return FAILED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="auv-fmu",
        description="Co-simulate an autonomous underwater vehicle with limited torque and "
        "without velocity sensors, from FMI 2.0 components.",
    )
    parser.add_argument("--version", action="version", version=version("auv-fmu"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    build = commands.add_parser("build", help="build every FMU and the bundle auv.ssp")
    build.add_argument("--out", type=Path, default=bundle.DEFAULT_FOLDER, metavar="DIR")
    build.set_defaults(action=_build)

    listing = commands.add_parser("list", help="list the scenarios")
    listing.set_defaults(action=_list)

    run = commands.add_parser("run", help="run a scenario, a scenario file or an SSP")
    run.add_argument("scenario", metavar="SCENARIO|FILE.toml|FILE.ssp")
    run.add_argument("--stop-time", type=float, metavar="S", help="end of the run [s]")
    run.add_argument("--step", type=float, metavar="S", help="communication step [s]")
    run.add_argument("--order", choices=ORDERS, default=ORDERS[0], help="order of evaluation")
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="COMPONENT.PARAMETER=VALUE",
        help="change a parameter; may be repeated",
    )
    run.add_argument("--out", type=Path, metavar="DIR", help="default: results/SCENARIO/")
    run.set_defaults(action=_run)
    return parser


def _build(options: argparse.Namespace) -> int:
    written = bundle.build(options.out)
    for path in written:
        print(path)
    if not written:
        print(f"{options.out} is up to date")
    return OK


def _list(_: argparse.Namespace) -> int:
    for name in names():
        print(f"{name:10} {read_scenario(name).title}")
    return OK


def _run(options: argparse.Namespace) -> int:
    changes = dict(_assignment(text) for text in options.set)
    scenario, archive = _scenario_and_archive(options.scenario)
    if scenario.figure not in FIGURES:
        raise InputError(
            f"{options.scenario}: no figure {scenario.figure!r}; use one of {', '.join(FIGURES)}"
        )
    folder = options.out or Path("results", scenario.name)
    _make_writable(folder)
    with TemporaryDirectory(prefix="auvfmu") as unpacked:
        system = read_ssp(archive, Path(unpacked))
        system = system.with_parameters(scenario.parameters).with_parameters(changes)
        stop_time = _first_given(options.stop_time, scenario.stop_time, system.stop_time)
        if stop_time is None:
            raise InputError(f"{options.scenario}: names no stop time; give one with --stop-time")
        step = _first_given(options.step, scenario.step, system.step, DEFAULT_STEP)
        assert step is not None
        result = simulate(system, stop_time, step, options.order, progress=True)
        _write(system, scenario, result, folder)
    for message in result.messages:
        print(f"auv-fmu: {message}", file=sys.stderr)
    if result.failure is not None:
        print(f"auv-fmu: {scenario.name} {result.failure}", file=sys.stderr)
        return FAILED
    return OK


def _first_given(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)


def _assignment(text: str) -> tuple[PortName, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise InputError(f"--set {text}: write COMPONENT.PARAMETER=VALUE")
    return port_name(name.strip()), value.strip()


def _scenario_and_archive(name: str) -> tuple[Scenario, Path]:
    if name.endswith(".ssp"):
        return Scenario(Path(name).stem, title=Path(name).name), Path(name)
    scenario = read_scenario(name)
    bundle.build(bundle.DEFAULT_FOLDER)
    return scenario, bundle.DEFAULT_FOLDER / bundle.ARCHIVE


def _make_writable(folder: Path) -> None:
    """Find out before the run, not after it, that the results cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write into {folder}: {error}; choose --out DIR") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"cannot write into {folder}: no permission; choose --out DIR")


def _write(system: System, scenario: Scenario, result: Result, folder: Path) -> None:
    result.write_csv(folder / "result.csv")
    values = metrics(system, result, scenario.name)
    text = json.dumps(values, indent=2)
    (folder / "metrics.json").write_text(text + "\n", encoding="utf-8")
    if result.computed > 1 and _is_closed_loop(result):
        draw(scenario.figure, scenario.title, result, folder, scenario.name)
    _print_summary(values, folder)


def _is_closed_loop(result: Result) -> bool:
    """Whether the figures' ports are there: a user's own system may have others."""
    return {"plant.tau.u", "plant.dy.x", "planner.y_d.x", "controller.dy_hat.x"} <= set(
        result.columns
    )


def _print_summary(values: dict[str, Any], folder: Path) -> None:
    rows = {
        "l2_effort": "L2 effort u, q, r [N.s^1/2, N.m.s^1/2]",
        "peak_command": "peak command u, q, r [N, N.m]",
        "saturated_fraction": "share of saturated steps u, q, r",
        "final_error": "largest error x, y, z in the last 5 s [m]",
    }
    for key, label in rows.items():
        if key in values:
            print(f"{label:46}" + "".join(f"{value:10.4g}" for value in values[key]))
    print(f"written to {folder}{os.sep}")
