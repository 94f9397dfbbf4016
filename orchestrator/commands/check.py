"""`auv-fmu check`: find mistakes in files without running them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

from fmpy.validation import validate_fmu

from orchestrator.commands.options import add_variant
from orchestrator.commands.streams import BAD_INPUT, OK, describe, show
from orchestrator.cosim import Component, check_binary, read_component
from orchestrator.machine.children import run_module
from orchestrator.machine.errors import Findings, InputError, last_line, reason
from orchestrator.machine.user_files import unpack
from orchestrator.program.components import refusals
from orchestrator.runs.preparation import FALLBACK_STOP_TIME, load_scenario, outdated, prepare
from orchestrator.runs.request import Request

#: Surprises for the user of an FMU, by a flag of its description and its surprising value.
_SURPRISES = {
    ("canBeInstantiatedOnlyOncePerProcess", True): "allows one instance per process: each "
    "further one runs in a separate process",
    ("needsExecutionTool", True): "needs the program that it was made with",
    ("canHandleVariableCommunicationStepSize", False): "takes only steps of a fixed length: the "
    "stop time must be a multiple of the step",
    ("canRunAsynchronuously", True): "may compute a step while its host continues",
    ("canGetAndSetFMUstate", False): "cannot save its state: a run of it cannot be resumed",
}


def add_check(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu check`."""
    describe(
        parser,
        "Validate an FMU, an SSP, a scenario, a study or your own component (NAME.py or its "
        "folder) without running it, and list every problem. A component is imported, which runs "
        "its module. Exit status: 0 without problems, else 2.",
        "check my_scenario.toml",
    )
    parser.add_argument(
        "file", metavar="FILE|DIR|SCENARIO", help="file, folder or scenario to validate"
    )
    add_variant(parser)
    parser.set_defaults(action=_check)


def _check(options: argparse.Namespace) -> int:
    findings = Findings()
    if _is_own(Path(options.file)):
        look = _script
    elif options.file.endswith(".fmu"):
        look = _fmu
    else:
        look = _study if _is_study(options.file) else _system
    remarks = look(options, findings)
    for kind, texts in (
        ("problem", findings.problems),
        ("note", findings.notes),
        ("info", remarks),
    ):
        for text in texts:
            show(f"{kind}: {text}")
    if findings.problems or findings.notes:
        return BAD_INPUT
    show(f"{options.file}: no problems found")
    return OK


def _is_own(path: Path) -> bool:
    """Tell whether a path is a script, or a folder with a component, to be imported.

    A folder with a system or an FMU is not, whatever else is in it.

    """
    others = ("OspSystemStructure.xml", "modelDescription.xml")
    if any((path / name).is_file() for name in others) or any(path.glob("*.ssd")):
        return False
    return path.suffix == ".py" or (path / f"{path.resolve().name}.py").is_file()


def _is_study(file: str) -> bool:
    if not file.endswith(".toml"):
        return False
    from orchestrator.studies.study import is_study  # noqa: PLC0415

    return is_study(Path(file))


def _study(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Check a study as `sweep` does before its first run; returns remarks."""
    # Their import takes half a second.
    from orchestrator.studies.study import read_study  # noqa: PLC0415
    from orchestrator.studies.sweep import Means, check_installed, prepare_study  # noqa: PLC0415

    with findings.collecting():
        study = read_study(options.file)
        check_installed(("scipy",) * (study.sample is not None))
        prepare_study(study, Means())
        return [*filter(None, [study.sample and study.sample.remark])]
    return []


def _script(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Check a component of the user's own; there are no remarks."""
    with TemporaryDirectory() as folder:
        process = run_module("fmus.check", options.file, "--out", folder)
        if process.returncode != 0:
            raise InputError(last_line(process.stderr))
        for text in process.stdout.splitlines():
            findings.problem(text)
        for fmu in sorted(Path(folder).glob("*.fmu")):
            for text in validate_fmu(str(fmu)):
                findings.problem(f"{options.file}: {text}")
    return []


def _fmu(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Check an FMU; returns remarks."""
    component = examine(Path(options.file), findings)
    if component is None:
        return []
    if text := outdated(component):
        findings.note(text)
    return _binary(component, findings) + list(surprises(component))


def _binary(component: Component, findings: Findings) -> list[str]:
    """Check the library of an FMU; returns remarks."""
    with findings.collecting():
        if not check_binary(component):
            return ["has no binary for this machine: a run compiles its sources first"]
    return []


def _system(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Check a system as a whole, then its components; returns remarks."""
    remarks: list[str] = []
    with findings.collecting():
        scenario, system = load_scenario(options.file, variant=options.variant, findings=findings)
        for name, component in system.components.items():
            known = (*_binary(component, findings), *surprises(component))
            remarks += [f"{name}: {text}" for text in known]
        request = Request()
        if scenario.stop_time is None and system.stop_time is None:
            remarks.append("has no stop time: a run needs --stop-time")
            request = Request(stop_time=(system.start_time or 0.0) + FALLBACK_STOP_TIME)
        prepared = prepare(scenario, system, request)
        for text in refusals(prepared.system):
            findings.problem(text)
        remarks += [
            f"{', '.join(ring)}: a ring of direct feedthroughs, which is solved if the FMUs "
            "compute their outputs between steps, else delayed by a step"
            for ring in prepared.plan.rings
        ]
        remarks += prepared.doubts()
    return remarks


def examine(fmu: Path, findings: Findings) -> Component | None:
    """Note all mistakes in an FMU.

    Returns:
        The FMU; None: it cannot be run.

    """
    with findings.collecting():
        # A validator may fail on references to nothing, so they are looked for first.
        for text in list(_dangling(fmu)) or _flaws(fmu):
            findings.note(text)
        component = read_component(fmu.stem, fmu)
        for name in component.variables:
            try:
                component.start(name)
            except InputError as error:
                findings.note(f"start value of {error}")
        seen: dict[tuple[str, int], str] = {}
        for variable in (*component.having("input"), *component.having("parameter")):
            name = variable.array
            other = seen.setdefault((variable.type, variable.reference), name)
            if other != name:
                findings.note(f"{other} and {name} share a value reference: setting one sets both")
        return component
    return None


def surprises(component: Component) -> Iterator[str]:
    """Yield abilities that an FMU lacks, and its differences from most FMUs."""
    if component.unsupported:
        yield component.remainder
    if any(variable.type == "Clock" for variable in component.description.modelVariables):
        yield "has Clocks: if it cannot do without them, it ends a run before the first step"
    for (flag, value), text in _SURPRISES.items():
        if getattr(component.description.coSimulation, flag) is value:
            yield text
    try:
        if terminals := component.terminals:
            yield f"has the terminals {', '.join(terminals)}, which wires may connect"
    except InputError as error:
        yield str(error).removeprefix(f"{component.name}: ")
    if component.having("input") and all(
        unknown.dependencies is None for unknown in component.description.outputs
    ):
        yield "does not say what its outputs depend on: each is taken to depend on all inputs"


def _flaws(fmu: Path) -> list[str]:
    """Find violations of the standard's schema and rules in the description."""
    if not (unpack(fmu).folder / "modelDescription.xml").is_file():
        # The reader of the FMU reports that.
        return []
    try:
        return [str(problem) for problem in validate_fmu(str(fmu))]
    except Exception as error:
        return [reason(error)]


def _dangling(fmu: Path) -> Iterator[str]:
    """Find references in the structure of the model to variables that do not exist."""
    try:
        root = ElementTree.parse(unpack(fmu).folder / "modelDescription.xml").getroot()
    except (OSError, ElementTree.ParseError):
        return
    known = range(1, 1 + len(root.findall("ModelVariables/ScalarVariable")))
    for unknown in root.iterfind("ModelStructure//Unknown"):
        for index in (unknown.get("index", ""), *unknown.get("dependencies", "").split()):
            if not (index.isascii() and index.isdecimal()) or int(index) not in known:
                yield (
                    f"its model structure refers to variable {index!r}, which does not exist: "
                    f"there are {len(known)}"
                )
