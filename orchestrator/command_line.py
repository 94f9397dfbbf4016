"""The command line `auv-fmu`: one function for each of its commands."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from orchestrator import bundle, gains
from orchestrator.animation import animate, check_format
from orchestrator.errors import InputError
from orchestrator.experiment import (
    DEFAULT_STEP,
    Request,
    Run,
    loaded,
    make_writable,
    perform,
    write,
)
from orchestrator.export import FORMATS
from orchestrator.figures import is_drawable
from orchestrator.hosts import HOSTS, compare
from orchestrator.master import ORDERS
from orchestrator.reference import verify, write_reference
from orchestrator.report import write_report
from orchestrator.scenario import names, read_scenario
from orchestrator.system import PortName, port_name

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = _parser().parse_args(arguments)
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
    build.add_argument(
        "--loader",
        choices=("native", "plain"),
        help="native: the FMUs also run in hosts that are no Python programs; needs a C compiler "
        "and is the default where there is one",
    )
    build.set_defaults(action=_build)

    listing = commands.add_parser("list", help="list the scenarios")
    listing.set_defaults(action=_list)

    run = commands.add_parser("run", help="run a scenario, a scenario file or an SSP")
    run.add_argument("scenario", metavar="SCENARIO|FILE.toml|FILE.ssp")
    run.add_argument("--stop-time", type=float, metavar="S", help="end of the run [s]")
    run.add_argument("--step", type=float, metavar="S", help="communication step [s]")
    run.add_argument("--order", choices=ORDERS, default=ORDERS[0], help="order of evaluation")
    _add_set(run)
    run.add_argument("--out", type=Path, metavar="DIR", help="default: results/SCENARIO/")
    run.set_defaults(action=_run)

    check = commands.add_parser("gains", help="check the conditions of Theorems 1 and 2")
    _add_set(check)
    check.set_defaults(action=_gains)

    report = commands.add_parser("report", help="run all scenarios and compare with the paper")
    report.add_argument("--out", type=Path, default=Path("results", "report"), metavar="DIR")
    report.set_defaults(action=_report)

    film = commands.add_parser("animate", help="write a film of a scenario")
    film.add_argument("scenario", metavar="SCENARIO|FILE.toml|FILE.ssp")
    film.add_argument("--stop-time", type=float, metavar="S", help="end of the run [s]")
    _add_set(film)
    film.add_argument(
        "--out", type=Path, metavar="FILE", help="a .gif or .mp4; default: results/SCENARIO.gif"
    )
    film.set_defaults(action=_animate)

    _add_exchange(commands)
    return parser


def _add_exchange(commands: Any) -> None:
    """Commands for the exchange with other tools."""
    export = commands.add_parser("export", help="write a scenario for other tools")
    export.add_argument("scenario", metavar="SCENARIO|FILE.toml|FILE.ssp")
    export.add_argument("--format", choices=FORMATS, default="ssp")
    export.add_argument("--step", type=float, metavar="S", help="communication step [s]")
    _add_set(export)
    export.add_argument("--out", type=Path, metavar="DIR", help="default: exports/SCENARIO/")
    export.set_defaults(action=_export)

    others = commands.add_parser("hosts", help="run a scenario in other co-simulation tools")
    others.add_argument("host", nargs="*", metavar="HOST", help=f"of {', '.join(HOSTS)}")
    others.add_argument("--scenario", default="fig4", metavar="SCENARIO|FILE.toml|FILE.ssp")
    others.add_argument("--steps", type=int, default=5000, metavar="N")
    others.set_defaults(action=_hosts)

    check = commands.add_parser("verify", help="compare a table from another tool with ours")
    check.add_argument("table", type=Path, metavar="RESULT.csv")
    check.add_argument("--scenario", default="fig4", metavar="SCENARIO|FILE.toml|FILE.ssp")
    check.add_argument("--tolerance", type=float, default=1e-6)
    _add_set(check)
    check.set_defaults(action=_verify)

    reference = commands.add_parser("reference", help="write reference results of every FMU")
    reference.add_argument("--out", type=Path, default=Path("reference"), metavar="DIR")
    reference.set_defaults(action=_reference)

    docs = commands.add_parser("docs", help="write the pages of the components")
    docs.add_argument("--out", type=Path, default=Path("docs", "components"), metavar="DIR")
    docs.set_defaults(action=_docs)


def _add_set(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="COMPONENT.PARAMETER=VALUE",
        help="change a parameter; may be repeated",
    )


def _assignments(options: argparse.Namespace) -> dict[PortName, str]:
    return dict(_assignment(text) for text in options.set)


def _assignment(text: str) -> tuple[PortName, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise InputError(f"--set {text}: write COMPONENT.PARAMETER=VALUE")
    return port_name(name.strip()), value.strip()


def _build(options: argparse.Namespace) -> int:
    written = bundle.build(options.out, options.loader)
    for path in written:
        print(path)
    state = "built" if written else "up to date"
    print(f"{options.out} is {state}, with the {bundle.loader_of(options.out)} loader")
    return OK


def _list(_: argparse.Namespace) -> int:
    for name in names():
        print(f"{name:10} {read_scenario(name).title}")
    return OK


def _run(options: argparse.Namespace) -> int:
    request = Request(
        options.stop_time, options.step, options.order, _assignments(options), progress=True
    )
    if not options.scenario.endswith(".ssp"):
        read_scenario(options.scenario)
    folder = options.out or Path("results", Path(options.scenario).stem)
    make_writable(folder)
    runs = perform(options.scenario, request)
    for values in write(runs, folder):
        _print_summary(values)
    print(f"written to {folder}{os.sep}")
    return _status(runs)


def _status(runs: Sequence[Run]) -> int:
    """Exit status of some runs, after saying what went wrong in them."""
    status = OK
    for run in runs:
        for message in run.result.messages:
            print(f"auv-fmu: {message}", file=sys.stderr)
        if run.result.failure is not None:
            print(f"auv-fmu: {run.scenario.name} {run.result.failure}", file=sys.stderr)
            status = FAILED
    return status


def _print_summary(values: Mapping[str, Any]) -> None:
    rows = {
        "l2_effort": "L2 effort u, q, r [N.s^1/2, N.m.s^1/2]",
        "peak_command": "peak command u, q, r [N, N.m]",
        "saturated_fraction": "share of saturated steps u, q, r",
        "total_variation": "total variation u, q, r [N, N.m]",
        "final_error": "largest error x, y, z in the last 5 s [m]",
    }
    print(values["scenario"])
    for key, label in rows.items():
        if key in values:
            print(f"  {label:44}" + "".join(f"{value:11.4g}" for value in values[key]))


def _gains(options: argparse.Namespace) -> int:
    print(gains.check(_assignments(options)))
    return OK


def _report(options: argparse.Namespace) -> int:
    make_writable(options.out)
    for path in write_report(options.out):
        print(path)
    return OK


def _animate(options: argparse.Namespace) -> int:
    path = options.out or Path("results", f"{Path(options.scenario).stem}.gif")
    check_format(path)
    make_writable(path.parent)
    request = Request(options.stop_time, parameters=_assignments(options), progress=True)
    [run] = perform(options.scenario, request, companions=False)
    if not is_drawable("open-loop", run.result):
        raise InputError(f"{options.scenario}: has no vehicle to show")
    label = f", {run.scenario.label}" if run.scenario.label else ""
    animate(f"{run.scenario.name}{label}", run.result, path)
    print(path)
    return _status([run])


def _export(options: argparse.Namespace) -> int:
    folder = options.out or Path("exports", Path(options.scenario).stem)
    make_writable(folder)
    with loaded(options.scenario) as (scenario, system):
        system = replace(
            system.with_parameters(_assignments(options)),
            name=scenario.name,
            stop_time=scenario.stop_time or system.stop_time,
            step=options.step or scenario.step or system.step or DEFAULT_STEP,
        )
        system.check()
        for path in FORMATS[options.format](system, float(system.step or DEFAULT_STEP), folder):
            print(path)
    return OK


def _verify(options: argparse.Namespace) -> int:
    with loaded(options.scenario) as (_, system):
        system = system.with_parameters(_assignments(options))
        print(verify(options.table, system, options.tolerance))
    return OK


def _reference(options: argparse.Namespace) -> int:
    make_writable(options.out)
    bundle.build(bundle.DEFAULT_FOLDER)
    for path in write_reference(bundle.DEFAULT_FOLDER, options.out):
        print(path)
    return OK


def _docs(options: argparse.Namespace) -> int:
    make_writable(options.out)
    for path in bundle.run_fmus("packaging.documentation", options.out):
        print(path)
    return OK


def _hosts(options: argparse.Namespace) -> int:
    unknown = set(options.host) - HOSTS.keys()
    if unknown:
        raise InputError(f"no host {', '.join(sorted(unknown))}; there are {', '.join(HOSTS)}")
    with loaded(options.scenario) as (_, system):
        step = system.step or DEFAULT_STEP
        verdicts = compare(system, options.host or list(HOSTS), options.steps, step)
    print(f"{'host':13} {'package':34} {'max deviation':>14} {'steps/s':>8}  worst port")
    for verdict in verdicts:
        if verdict.failure is not None:
            print(f"{verdict.host:13} {verdict.package:34} {verdict.failure}")
            continue
        host = HOSTS[verdict.host]
        note = f" ({host.why})" if host.why else ""
        note += "" if verdict.agrees else f", above {host.bound:g}"
        print(
            f"{verdict.host:13} {verdict.package:34} {verdict.deviation:14.2e} "
            f"{verdict.steps_per_second:8.0f}  {verdict.port}{note}"
        )
    return OK if all(verdict.agrees for verdict in verdicts) else FAILED


if __name__ == "__main__":
    sys.exit(main())
