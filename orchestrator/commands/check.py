"""`auv-fmu check`: what is wrong with files, without running them."""

from __future__ import annotations

import argparse
from pathlib import Path

from orchestrator.commands.options import add_variant
from orchestrator.commands.streams import BAD_INPUT, OK, show
from orchestrator.formats.examination import examine, surprises
from orchestrator.machine.errors import Findings
from orchestrator.master.fmi.binary import binary_of, check_binary
from orchestrator.runs.loading import loaded
from orchestrator.runs.preparation import SOME_TIME, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import impossible_paths
from orchestrator.studies.study import is_study
from orchestrator.studies.study_file import read_study
from orchestrator.system.component import Component
from orchestrator.system.graph import rings


def add_check(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `auv-fmu check`."""
    parser.add_argument("file", metavar="FILE|DIR|SCENARIO", help="what is looked at, not run")
    add_variant(parser)
    parser.set_defaults(action=_check)


def _check(options: argparse.Namespace) -> int:
    findings = Findings()
    look = _fmu if options.file.endswith(".fmu") else _system
    if is_study(options.file):
        look = _study
    to_know = look(options, findings)
    for kind, texts in (
        ("problem", findings.problems),
        ("note", findings.notes),
        ("to know", to_know),
    ):
        for text in texts:
            show(f"{kind}: {text}")
    if findings.problems or findings.notes:
        return BAD_INPUT
    show(f"{options.file}: nothing is wrong with it")
    return OK


def _study(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Look at the file of a study, and not at what it runs; there is nothing more to be known."""
    with findings.collecting():
        read_study(options.file)
    return []


def _fmu(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Look at an FMU; returns what is to be known of it."""
    component = examine(Path(options.file), findings)
    if component is None:
        return []
    return _binary(component, findings) + list(surprises(component))


def _binary(component: Component, findings: Findings) -> list[str]:
    """Look at the library of an FMU; returns what is to be known of it."""
    with findings.collecting():
        check_binary(component, component.folder)
        if not binary_of(component, component.folder).is_file():
            return ["has no binary for this machine: a run compiles its sources first"]
    return []


def _system(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Look at a system as a whole, then at its components; returns what is to be known of it."""
    to_know: list[str] = []
    with findings.collecting():
        scenario, system = loaded(options.file, variant=options.variant, findings=findings)
        for name, component in system.components.items():
            known = (*_binary(component, findings), *surprises(component))
            to_know += [f"{name}: {text}" for text in known]
        request = Request()
        if scenario.stop_time is None and system.stop_time is None:
            to_know.append("names no stop time: a run wants --stop-time")
            request = Request(stop_time=(system.start_time or 0.0) + SOME_TIME)
        prepared = prepare(scenario, system, request)
        for text in impossible_paths(prepared.system):
            findings.problem(text)
        to_know += [
            f"{', '.join(ring)}: a ring of direct feedthroughs, which is solved where the FMUs "
            "compute their outputs between steps, and else delayed by a step"
            for ring in rings(prepared.system)
        ]
        to_know += prepared.doubts()
    return to_know
