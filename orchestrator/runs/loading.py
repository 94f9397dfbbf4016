"""Load a system by name: a scenario of the bundle, or a file that brings its own FMUs."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from fmus.discovery import ORIGIN, origin_of
from fmus.kinds import AUTO, FMI_VERSIONS, NATIVE, FmiVersion, KindName
from orchestrator.cosim import Component, PortName, System, read_component, read_osp, read_ssp
from orchestrator.figures.run_figures import check_figure
from orchestrator.machine.errors import Findings, InputError
from orchestrator.machine.user_files import is_folder
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.scenario import Scenario, names, read_scenario, scenario_of
from orchestrator.runs.wiring import check_built, closed_loop
from orchestrator.vehicle.cautions import differing_vehicle

T = TypeVar("T")


def load(
    name: str | Path | Mapping[str, Any],
    kind: KindName = AUTO,
    *,
    fmi: FmiVersion = FMI_VERSIONS[0],
    variant: str | None = None,
    strict: bool = False,
) -> System:
    """Read the system of a scenario, of an SSP or of another file, with its experiment.

    Harmless flaws give a warning.

    Args:
        name: name of a scenario, path of a .toml file, an SSP, an FMU or libcosim's
            OspSystemStructure.xml, or a dictionary with the entries of a scenario file. An
            unpacked SSP and the folder of an OspSystemStructure.xml also work.
        kind: kind of the bundle's FMUs: `python`, `native`, or `auto`, native where available.
        fmi: their version of FMI, `2` or `3`.
        variant: name of a system description in an SSP; None: the default.
        strict: treat warnings as errors.

    Raises:
        InputError: there is no such scenario, or its system cannot be put together.

    """
    with notes_as_warnings(strict) as findings:
        scenario, system = load_scenario(name, kind, fmi, variant, findings)
        left = left_behind(scenario)
        for note in [left] if left else doubts_of(system):
            findings.note(note)
        findings.refuse()
    return replace(
        system,
        name=scenario.name,
        stop_time=first_given(scenario.stop_time, system.stop_time),
        step=first_given(scenario.step, system.step),
    )


@contextmanager
def notes_as_warnings(strict: bool = False, stacklevel: int = 4) -> Iterator[Findings]:
    """Collect findings whose notes become Python's warnings.

    Args:
        strict: treat them as errors.
        stacklevel: of the warnings; by default, they are for the caller of the caller.

    """
    findings = Findings(strict)
    yield findings
    for note in findings.notes:
        warnings.warn(note, stacklevel=stacklevel)


def load_scenario(
    name: str | Path | Mapping[str, Any],
    kind: str = AUTO,
    fmi: str = FMI_VERSIONS[0],
    variant: str | None = None,
    findings: Findings | None = None,
) -> tuple[Scenario, System]:
    """Load a scenario and its system.

    Args:
        name: of a scenario of the bundle, or path of a .toml file, an SSP, an FMU, or libcosim's
            OspSystemStructure.xml; an SSP and the latter may also be a folder; or what a scenario
            file would hold.
        kind: of the bundle's FMUs: `python`, `native` or `auto`; FMUs that a file names are as
            they are.
        fmi: their version of FMI, `2` or `3`; the Python kind has only the first.
        variant: which of the descriptions in an SSP; None: the default.
        findings: takes what is wrong with it; None: harmless flaws are ignored, and an FMU that is
            older than its script gives a warning.

    Raises:
        InputError: there is no such scenario, or its system cannot be put together.

    """
    scenario, system = _loaded(name, kind, fmi, variant, findings)
    for component in system.components.values():
        if text := outdated(component):
            if findings is None:
                warnings.warn(text, stacklevel=2)
            else:
                findings.note(text)
    return scenario, system


def outdated(component: Component) -> str | None:
    """Warn that the FMU of a user's script is older than the script; None: it is not."""
    record = component.folder / ORIGIN
    origin = origin_of(record.read_bytes()) if record.is_file() else None
    # Under another name it has been kept, and the script is meant to be newer.
    if origin is None or component.fmu.name != origin.fmu:
        return None
    changed = origin.changed(component.fmu)
    if not changed:
        return None
    command = f"auv-fmu build {origin.place(component.fmu) / origin.script}"
    command += f" --kind {NATIVE}" * (origin.kind == NATIVE)
    command += " --fmi 3" * (component.description.fmiMajorVersion == 3)
    command += f" --out {component.fmu.parent}" * (origin.folder != ".")
    return (
        f"{component.name}: {component.fmu} is older than {changed[0]}; build it again ({command}) "
        "or give it another name"
    )


def _loaded(
    name: str | Path | Mapping[str, Any],
    kind: str,
    fmi: str,
    variant: str | None,
    findings: Findings | None,
) -> tuple[Scenario, System]:
    if isinstance(name, Mapping):
        if variant is not None:
            raise InputError("a dictionary has no variants; only an SSP can have them")
        return _of_the_bundle(scenario_of(name), kind, fmi)
    path = Path(name)
    read = _reader(path)
    if variant is not None and read is not read_ssp:
        raise InputError(f"{name}: has no variants; only an SSP can have them")
    if read is None:
        return _of_the_bundle(read_scenario(str(name)), kind, fmi)
    check_brings_its_own(str(name), kind, fmi)
    system = read_ssp(path, variant, findings) if read is read_ssp else read(path, findings)
    whole = path.resolve()
    named = whole.parent if path.name in _STRUCTURES else whole
    return Scenario(named.stem, title=path.name or named.name), system


def _of_the_bundle(scenario: Scenario, kind: str, fmi: str) -> tuple[Scenario, System]:
    """A scenario, with a value for each port, and its system."""
    check_figure(scenario.figure)
    system = closed_loop(current_fmus(kind, fmi), scenario)
    return replace(scenario, parameters=system.expanded(scenario.parameters)), system


def read_fmu(path: Path, findings: Findings | None = None) -> System:
    """A system of one FMU, with the experiment that it was made for.

    Raises:
        InputError: the file is missing, or is no FMU that can be run.

    """
    name = re.sub(r"\W", "_", path.stem)
    check_built(path)
    component = read_component(name, path, findings=findings)
    return System(
        name=path.stem,
        components={name: component},
        connections=(),
        start_time=component.experiment("startTime"),
        stop_time=component.experiment("stopTime"),
        step=component.step,
    )


#: Names of descriptions in folders: of SSP, and of OSP.
_STRUCTURES = ("SystemStructure.ssd", "OspSystemStructure.xml")

#: Readers of files other than scenarios, by ending.
_READERS: Mapping[str, Callable[..., System]] = {
    ".ssp": read_ssp,
    ".ssd": read_ssp,
    ".xml": read_osp,
    ".fmu": read_fmu,
}


def is_path(name: str) -> bool:
    """Tell whether a name is a path; otherwise it names a scenario."""
    return name.endswith((".toml", *_READERS))


def _reader(path: Path) -> Callable[..., System] | None:
    """The reader of a file or folder; None: it is a scenario."""
    if path.suffix in _READERS or str(path) in names() or not is_folder(path):
        return _READERS.get(path.suffix)
    of_ssp, of_osp = ((path / name).is_file() for name in _STRUCTURES)
    return read_osp if of_osp and not of_ssp else read_ssp


def brings_its_own(name: str) -> bool:
    """Tell whether a system comes with its own FMUs, so that there is no choice of kind."""
    return _reader(Path(name)) is not None


def left_behind(scenario: Scenario) -> str | None:
    """The parts of a scenario that are lost when only its system is kept, in words."""
    has = {"events": bool(scenario.events), "inputs": scenario.inputs is not None}
    names = " and ".join(name for name, there in has.items() if there)
    return (
        f"{scenario.name}: only the system is used, without the scenario's {names}"
        if names
        else None
    )


def check_brings_its_own(name: str, kind: str, fmi: str = FMI_VERSIONS[0]) -> None:
    """Check that no other FMUs are asked for than the ones that a system comes with.

    Raises:
        InputError: it would not have any effect.

    """
    if kind == NATIVE or fmi != FMI_VERSIONS[0]:
        raise InputError(f"{name}: brings its own FMUs; kind and fmi apply only to the bundle's")


def doubts_of(system: System, given: Collection[PortName] = ()) -> list[str]:
    """Warnings about things that may be forgotten: inputs without a source, parts of a vehicle."""
    if len(system.components) == 1:
        # No other component could feed it.
        return []
    warned = system.unfed_inputs(given), differing_vehicle(system)
    return [text for text in warned if text is not None]


def first_given(*values: T | None) -> T | None:
    """The first of some values that is not None."""
    return next((value for value in values if value is not None), None)
