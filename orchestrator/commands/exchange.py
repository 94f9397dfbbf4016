"""`auv-fmu export`, `release`, `hosts` and `verify`: exchange systems and results with tools."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from fmus.kinds import AUTO, NATIVE
from orchestrator.commands.options import (
    add_fmi,
    add_kind,
    add_options,
    add_out,
    add_platforms,
    add_set,
    add_system,
    assignments,
    read_system,
)
from orchestrator.commands.streams import FAILED, OK, describe, say, show
from orchestrator.cosim import Exchange, Experiment, System, write_osp, write_ssp
from orchestrator.exchange.carried import Carried
from orchestrator.exchange.hosts import BOUND, HOSTS, compare, fmi_of
from orchestrator.exchange.release import write_release
from orchestrator.exchange.verify import TOLERANCE, verify
from orchestrator.machine.compilers import Platform, platforms
from orchestrator.machine.errors import InputError, listed
from orchestrator.program.files import ProgramFiles, write_files
from orchestrator.program.fmu import SystemModel, write_fmu
from orchestrator.runs.folder import replace_files
from orchestrator.runs.preparation import (
    DEFAULT_STEP,
    FALLBACK_STOP_TIME,
    brings_its_own,
    first_given,
    left_behind,
    load,
    prepare,
)
from orchestrator.runs.request import Files, Request
from orchestrator.runs.scenario import Scenario, read_events, read_scenario

#: Formats of an export.
EXPORT_FORMATS = SSP, OSP, FMU, C = "ssp", "osp", "fmu", "c"

#: Options of `export` that apply to one format only.
_OF_FORMAT = {"flat": SSP, "connectors": SSP, "single": C}

#: Tools that do not set parameters of a type, by the type.
_LEAVING = {"Enumeration": "libcosim and ecos", "String": "OMSimulator and others"}

#: Options of `verify` that apply to tables only.
_OF_TABLES = ("scenario", "step", "order", "initial", "events", "set")


def add_export(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu export`."""
    describe(
        parser,
        "Write a scenario for other tools: its FMUs, connections and parameters, or all of it as "
        "one FMU, or as a program in C.",
        "export fig4 --format osp --out exports/fig4",
    )
    add_system(parser)
    parser.add_argument(
        "--format",
        choices=EXPORT_FORMATS,
        default=SSP,
        help="output format: ssp (SSP archive), osp (folder for libcosim), fmu (one FMU in C, "
        "without Python) or c (one program in C, for your own); default: ssp",
    )
    parser.add_argument(
        "--flat",
        action="store_true",
        help="write a flat SSP, for tools without nested systems (libcosim, ecos, OMSimulator's "
        "C++ program): auv1.plant becomes auv1_plant, and each component has a copy of its FMU",
    )
    parser.add_argument(
        "--connectors",
        action="store_true",
        help="give the system of an SSP connectors, for tools that take it as one component: its "
        "components' outputs, and inputs without feed or value",
    )
    parser.add_argument(
        "--single",
        action="store_true",
        help=f"write the program of --format {C} in single precision: float instead of double",
    )
    add_options(parser, Request, "step", "strict")
    add_kind(parser)
    add_fmi(parser, f"--format {FMU}")
    add_platforms(parser, f"--kind {NATIVE} or --format {FMU}")
    add_set(parser)
    add_out(parser, "exports/SCENARIO/")
    add_options(parser, Files, "force")
    parser.set_defaults(action=_export)


def add_release(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu release`."""
    describe(
        parser,
        "Write the archives of a release: every FMU, for all platforms.",
        "release --out release",
    )
    add_out(parser, Path("release"))
    add_options(parser, Files, "force")
    parser.set_defaults(action=_release)


def add_hosts(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu hosts`."""
    describe(
        parser,
        "Run a scenario in other co-simulation tools and compare their results with auv-fmu's.",
        "hosts fmpy ecos --steps 1000",
    )
    beside = [name for name, host in HOSTS.items() if not host.pins]
    parser.add_argument(
        "host",
        nargs="*",
        metavar="HOST",
        help=f"tool to run: {', '.join(HOSTS)}; default: {', '.join(beside)}. The others are "
        "installed at first use, each into its own environment in the user's cache folder",
    )
    parser.add_argument("--all", action="store_true", help="run in every tool")
    _add_scenario(parser)
    add_kind(parser)
    add_fmi(parser)
    parser.add_argument(
        "--steps", type=int, default=5000, metavar="N", help="number of steps; default: 5000"
    )
    parser.set_defaults(action=_hosts)


def add_verify(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu verify`."""
    describe(
        parser,
        "Compare a table from another tool with a run of the same scenario, or run the reference "
        "experiments of an FMU and compare them with the results that it carries.",
        "verify their_result.csv --scenario fig4",
    )
    parser.add_argument(
        "table",
        type=Path,
        metavar="RESULT.csv|FILE.fmu",
        help="table with a `time` column, or FMU with reference experiments (FMI-LS-REF)",
    )
    _add_scenario(parser)
    parser.add_argument(
        "--tolerance",
        type=float,
        help="largest allowed deviation, relative to the larger of 1 and the port's largest value; "
        f"default: {TOLERANCE:g}; for an FMU, as its experiment states",
    )
    parser.add_argument(
        "--step",
        type=float,
        metavar="S",
        help="communication step of the tool's run [s]; default: the scenario's or FMU's, else "
        f"{DEFAULT_STEP:g}",
    )
    parser.add_argument(
        "--order",
        type=Experiment.read_order,
        metavar=f"{'|'.join(Experiment.ORDERS)}|NAME,...",
        help="order in which the tool steps the components: "
        f"{', '.join(Experiment.ORDERS)}, or the names of all components, joined by + where they "
        "are stepped side by side; default: whichever of "
        f"{', '.join(Experiment.ORDERS)} matches better",
    )
    parser.add_argument(
        "--initial",
        choices=Exchange.INITIAL,
        default=Exchange.INITIAL[0],
        help="when the tool first exchanges values: full (in initialisation mode), none (just "
        "before the first step) or zero (inputs keep their start values, or zeros, during the "
        f"first step); default: {Exchange.INITIAL[0]}",
    )
    parser.add_argument(
        "--verbose", action="store_true", help="name everything that was not compared"
    )
    parser.add_argument(
        "--events",
        metavar="SCENARIO|FILE.toml",
        help="scenario whose events happened in the tool's run; default: none",
    )
    add_set(parser)
    parser.set_defaults(action=partial(_verify, parser.get_default))


def _add_scenario(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scenario",
        default="fig4",
        metavar="SCENARIO|FILE|DIR",
        help="scenario to run; default: fig4",
    )


def _export(options: argparse.Namespace) -> int:
    scenario, system = _exported(options)
    ends = scenario.stop_time is not None or system.stop_time is not None
    request = Request(
        # A system without a stop time is written without one.
        stop_time=None if ends else (system.start_time or 0.0) + FALLBACK_STOP_TIME,
        step=options.step,
        parameters=assignments(options),
        strict=options.strict,
    )
    prepared = prepare(scenario, system, request)
    experiment = prepared.experiment
    system = replace(
        prepared.system,
        name=prepared.scenario.name,
        stop_time=experiment.stop_time if ends else None,
        step=experiment.step,
    )
    if left := left_behind(prepared.scenario):
        say(f"warning: {left}")
    for family, tools in _LEAVING.items():
        if options.format == SSP and (names := [*map(str, system.changed(family))]):
            say(
                f"warning: {listed(names)}: parameters of type {family}, which {tools} "
                "leave as they are in the FMU"
            )
    folder = options.out or Path("exports", prepared.scenario.stem)
    title = prepared.scenario.title or system.name
    with replace_files(folder, force=options.force) as staging:
        if options.format == FMU:
            model = SystemModel(prepared.plan, system.name, title)
            written = write_fmu(model, staging, options.fmi, options.platforms, say)
        elif options.format == C:
            program = ProgramFiles(prepared.plan, prepared.scenario.stem, title, options.single)
            written = write_files(program, staging)
        elif options.format == OSP:
            written = write_osp(system, staging)
        else:
            written = write_ssp(system, staging, flat=options.flat, connectors=options.connectors)
    for path in written:
        show(folder / path.relative_to(staging))
    return OK


def _exported(options: argparse.Namespace) -> tuple[Scenario, System]:
    """Read the scenario and system to export.

    Raises:
        InputError: options contradict each other, or an FMU lacks a platform.

    """
    for name, format_name in _OF_FORMAT.items():
        if getattr(options, name) and options.format != format_name:
            raise InputError(f"--{name} applies only to --format {format_name}: leave it out")
    if options.platforms and options.format == C:
        raise InputError(f"--platforms does not apply to --format {C}, which compiles nothing")
    if options.format in (FMU, C):
        # It is made from the sources of the components, whatever kind their FMUs are.
        return read_system(options, AUTO)
    if options.platforms and options.kind != NATIVE:
        raise InputError(f"--platforms needs --kind {NATIVE} or --format {FMU}")
    scenario, system = read_system(options, options.kind, options.fmi, options.platforms)
    if options.platforms:
        _check_platforms(system, platforms(options.fmi, options.platforms))
    return scenario, system


def _check_platforms(system: System, wanted: Sequence[Platform]) -> None:
    """Raise an InputError if an FMU, which is the user's, lacks a library for a platform."""
    for component in system.components.values():
        # It may be of another version of FMI, with other names.
        known = platforms(str(component.description.fmiMajorVersion), "all")
        binaries = component.folder / "binaries"
        there = {one for each in known if (binaries / each.name).is_dir() for one in each.machines}
        if lacking := [each.name for each in wanted if not there.issuperset(each.machines)]:
            raise InputError(
                f"{component.fmu}: has no library for {listed(lacking)}; build it with --platforms"
            )


def _release(options: argparse.Namespace) -> int:
    show(*write_release(options.out, say, force=options.force))
    return OK


def _hosts(options: argparse.Namespace) -> int:
    unknown = set(options.host) - HOSTS.keys()
    if unknown:
        raise InputError(f"no host {', '.join(sorted(unknown))}; there are {', '.join(HOSTS)}")
    system = load(options.scenario, options.kind, fmi=options.fmi)
    hosts = (not options.all and options.host) or [
        name
        for name, host in HOSTS.items()
        if fmi_of(system) in host.fmi and (options.all or not host.pins)
    ]
    verdicts = compare(system, hosts, options.steps, system.step or DEFAULT_STEP, say)
    version = f"FMI {fmi_of(system)}"
    kind = version if brings_its_own(options.scenario) else f"{options.kind}, {version}"
    columns = f"{'kind':15} {'order':42} {'deviation':>9} {'us/step':>8}  worst port"
    show(f"{'host':14} {'version':28} {columns}")
    agree = True
    for verdict in verdicts:
        host = HOSTS[verdict.host]
        text = verdict.failure
        if text is None:
            order = f"{host.initial}: {host.order}{', after' if host.turned else ''}"
            microseconds = 1e6 / verdict.steps_per_second
            note = "" if verdict.agrees else f", above {BOUND:g}"
            text = f"{order:42} {verdict.deviation:9.1e} {microseconds:8.1f}  {verdict.port}{note}"
        show(f"{verdict.host:14} {verdict.package:28} {kind:15} {text}")
        agree &= verdict.agrees
    return OK if agree else FAILED


def _verify(default: Callable[[str], object], options: argparse.Namespace) -> int:
    if options.table.suffix == ".fmu":
        for name in _OF_TABLES:
            if getattr(options, name) != default(name):
                raise InputError(f"--{name} applies only to tables: leave it out for an FMU")
        return _verify_carried(options)
    system = load(options.scenario).with_parameters(assignments(options))
    system = replace(system, step=first_given(options.step, system.step))
    tables = read_scenario(options.events).events if options.events else ()
    certificate = verify(
        options.table,
        system,
        TOLERANCE if options.tolerance is None else options.tolerance,
        options.order,
        events=read_events(options.events, tables, system),
        initial=options.initial,
        verbose=options.verbose,
    )
    show(*certificate.splitlines())
    return OK


def _verify_carried(options: argparse.Namespace) -> int:
    """Compare an FMU with the results that it carries; all of them must agree."""
    carried = Carried(options.table, options.verbose)
    show(f"{options.table.name}: FMI-LS-REF {carried.version}")
    for note in carried.notes:
        say(f"warning: {note}")
    judged = []
    for verdict in carried.verdicts(options.tolerance):
        show(f"{verdict.name}: {verdict.text}")
        for note in verdict.notes:
            say(f"warning: {verdict.name}: {note}")
        judged += [] if verdict.agrees is None else [verdict.agrees]
    if not judged:
        raise InputError(f"{options.table}: carries no reference results")
    counted = f"{sum(judged)} of {len(judged)} experiments with results agree"
    if not all(judged):
        raise InputError(f"{options.table}: {counted}")
    show(counted)
    return OK
