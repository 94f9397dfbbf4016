"""An FMU and its description."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import fmpy
from fmpy.model_description import ModelDescription, ValidationError

from orchestrator.cosim.variables import (
    TYPES,
    Terminal,
    Value,
    Variable,
    complete,
    terminals_of,
    variables_of,
)
from orchestrator.machine.disk import has_slash
from orchestrator.machine.errors import Findings, InputError, did_you_mean, reason, shortened
from orchestrator.machine.texts import finite, integer, real
from orchestrator.machine.user_files import unpack, unpacked_folder

_CAUSALITIES = {
    "structuralParameter", "parameter", "calculatedParameter", "input", "output", "local",
    "independent",
}  # fmt: skip

#: Attributes that fmpy reads like numbers of Python, which include 1_000, and digits of any script.
_INTEGERS = {
    "kg", "m", "s", "A", "K", "mol", "cd", "rad", "valueReference", "value", "index",
    "dependencies", "derivative", "previous", "clocks",
}  # fmt: skip
_REALS = {"factor", "offset", "min", "max"}

#: Attributes with several numbers.
_LISTS = {"dependencies", "clocks"}

#: Elements in which attributes of these names may have other meanings.
_OTHERS = {"VendorAnnotations", "Annotations", "Start"}

#: Supported versions of FMI.
_VERSIONS = ("2.0", "3.0")

#: Prefix of this program's name in descriptions of FMUs.
_OWN = "auv-fmu "


class Described(NamedTuple):
    """A description and its flaw; None: it is valid."""

    description: ModelDescription
    flaw: Exception | None

    def remark(self) -> str | None:
        """Describe the flaw in one line."""
        if isinstance(self.flaw, ValidationError):
            first, *others = map(str, self.flaw.problems)
            return first + f" (and {len(others)} more problems)" * bool(others)
        return None if self.flaw is None else reason(self.flaw)


def read_description(folder: Path) -> Described:
    """Read the description in the folder of an unpacked FMU, valid or not.

    Raises:
        Exception: of any kind; it cannot be read.

    """
    flaw: Exception | None = None
    try:
        description = fmpy.read_model_description(folder)
    except Exception as error:
        flaw = error
        try:
            description = fmpy.read_model_description(folder, validate=False)
        except Exception:
            raise flaw from None
    if description.fmiMajorVersion == 3:
        complete(description, ElementTree.parse(folder / "modelDescription.xml").getroot())
    return Described(description, flaw)


@lru_cache(maxsize=256)
def described(fmu: Path, folder: Path) -> Described:
    """Read the description of an FMU for co-simulation, once.

    Args:
        fmu: the file.
        folder: into which it is unpacked.

    Raises:
        InputError: it is not such an FMU.

    """
    file = folder / "modelDescription.xml"
    if not file.is_file():
        raise InputError(f"{fmu}: not a readable FMU: it holds no {file.name}")
    try:
        root: ElementTree.Element
        # The version is tested first, since everything else depends on it.
        with file.open("rb") as source:
            _, root = next(ElementTree.iterparse(source, ["start"]))
        version = root.get("fmiVersion")
        if version not in _VERSIONS:
            usable = " or ".join(_VERSIONS)
            raise InputError(f"{fmu}: is of FMI {version}; only FMUs of FMI {usable} are supported")
        read = read_description(folder)
    except InputError:
        raise
    except KeyError as error:
        why = f"it refers to {error}, which does not exist"
        raise InputError(f"{fmu}: not a readable FMU: {why}") from error
    except Exception as error:
        raise InputError(f"{fmu}: not a readable FMU: {reason(error)}") from error
    implementation = read.description.coSimulation
    if implementation is None:
        scheduled = read.description.modelExchange is None
        which = "scheduled execution" if scheduled else "model exchange"
        raise InputError(f"{fmu}: is for {which} only; only co-simulation is supported")
    if read.description.guid is None:
        raise InputError(f"{fmu}: not a readable FMU: its description has no guid")
    identifier = implementation.modelIdentifier
    if not identifier or has_slash(identifier):
        raise InputError(f"{fmu}: its model identifier {identifier!r} names no library")
    if read.flaw is not None:
        variables = read.description.modelVariables
        is_clear = len({variable.name for variable in variables}) == len(variables)
        if not is_clear or any(v.causality not in _CAUSALITIES for v in variables):
            raise InputError(f"{fmu}: not a readable FMU: {reason(read.flaw)}")
        for text in _misread(file):
            raise InputError(f"{fmu}: not a readable FMU: {text}")
    return read


def _misread(file: Path) -> Iterator[str]:
    """Yield a line for each number that Python would misread, or that is not a number."""
    for element in _elements(ElementTree.parse(file).getroot()):
        if element.tag == "Item":
            for name in sorted({"name", "value"} - element.attrib.keys()):
                yield f"an <Item> of an enumeration has no {name}"
        for name in sorted(element.attrib.keys() & (_INTEGERS | _REALS)):
            text = element.attrib[name]
            try:
                for number in text.split() if name in _LISTS else [text]:
                    (integer if name in _INTEGERS else real)(number)
            except ValueError:
                shown = shortened(repr(text))
                yield f"{name} of <{element.tag}> is {shown}, which is not a number"


def _elements(parent: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """Yield all elements in another one, except vendors' and start values."""
    for element in parent:
        if element.tag not in _OTHERS:
            yield element
            yield from _elements(element)


@dataclass(frozen=True)
class Component:
    """An FMU in a system.

    Attributes:
        name: of the instance.
        fmu: the file.
        description: of modelDescription.xml.
        digest: SHA-256 of the file as it was read, which runs and which records name.

    """

    name: str
    fmu: Path
    description: ModelDescription
    digest: str

    @property
    def folder(self) -> Path:
        """Folder of the unpacked FMU.

        Raises:
            InputError: it was read in another process, and the file has changed.

        """
        return unpacked_folder(self.fmu, self.digest)

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The FMU's supported variables by name."""
        return variables_of(self.description).known

    @property
    def unsupported(self) -> Mapping[str, str]:
        """Reasons why other variables are not supported, by name."""
        return variables_of(self.description).unsupported

    @property
    def remainder(self) -> str:
        """Line about the unsupported variables."""
        return f"{shortened(', '.join(self.unsupported))}: not supported, and ignored"

    @cached_property
    def arrays(self) -> dict[str, list[Variable]]:
        """Elements of each array, in their order."""
        elements: dict[str, list[Variable]] = {}
        for variable in self.variables.values():
            if variable.shape:
                elements.setdefault(variable.array, []).append(variable)
        return elements

    @cached_property
    def terminals(self) -> dict[str, Terminal]:
        """Terminals by name.

        Raises:
            InputError: the file that lists them cannot be read.

        """
        try:
            return terminals_of(self.folder)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from None

    @property
    def runs_python(self) -> bool:
        """True if PythonFMU has made the FMU."""
        return runs_python(self.folder)

    @property
    def is_ours(self) -> bool:
        """True if this program has built the FMU."""
        return (self.description.generationTool or "").startswith(_OWN)

    @property
    def is_once_per_process(self) -> bool:
        """True if a process may hold only one instance of the FMU."""
        return bool(self.description.coSimulation.canBeInstantiatedOnlyOncePerProcess)

    @property
    def takes_any_step(self) -> bool:
        """True if its steps may differ in length."""
        return bool(self.description.coSimulation.canHandleVariableCommunicationStepSize)

    @property
    def gives_derivatives(self) -> bool:
        """True if it provides derivatives of outputs by inputs."""
        return bool(self.description.coSimulation.providesDirectionalDerivative)

    @property
    def takes_linear_inputs(self) -> bool:
        """True if it can go back to the beginning of a step and interpolate inputs."""
        capabilities = self.description.coSimulation
        return bool(capabilities.canGetAndSetFMUstate and capabilities.canInterpolateInputs)

    @property
    def gives_state(self) -> bool:
        """True if its whole state can be saved as bytes and restored."""
        capabilities = self.description.coSimulation
        return bool(capabilities.canGetAndSetFMUstate and capabilities.canSerializeFMUstate)

    def variable(self, name: str) -> Variable:
        """Return one variable of the FMU.

        Raises:
            InputError: there is no such variable.

        """
        if name not in self.variables:
            _, unsupported, other_names = variables_of(self.description)
            if why := unsupported.get(name) or other_names.get(name):
                raise InputError(f"{self.name}.{name} {why}")
            hint = did_you_mean(name, self.variables)
            raise InputError(f"{self.name} has no port or parameter {name!r}{hint}")
        return self.variables[name]

    def elements(self, name: str) -> list[Variable]:
        """Return the elements of an array, or a scalar variable.

        Raises:
            InputError: there is no such variable.

        """
        return self.arrays.get(name) or [self.variable(name)]

    def having(self, causality: str) -> list[Variable]:
        """Return the variables of one causality, in the order of the description."""
        return [v for v in self.variables.values() if v.causality == causality]

    def by_type(self, causality: str) -> dict[str, list[Variable]]:
        """Return the variables of one causality by type, as FMI calls move them."""
        by_type: dict[str, list[Variable]] = {}
        for variable in self.having(causality):
            by_type.setdefault(variable.type, []).append(variable)
        return {fmi_type: by_type[fmi_type] for fmi_type in TYPES if fmi_type in by_type}

    def start(self, name: str) -> Value | None:
        """Return the start value of a variable, in its type, if the description has one.

        Raises:
            InputError: there is no such variable.

        """
        variable = self.variable(name)
        if variable.start is None:
            return None
        return variable.typed(variable.start, f"{self.name}.{name}")

    @property
    def starts(self) -> Mapping[str, Value]:
        """Valid start values of the description."""
        return _starts_of(self.description)

    def experiment(self, name: str) -> float | None:
        """Return a number of its DefaultExperiment, such as `stopTime` [s], or None."""
        stated = getattr(self.description.defaultExperiment, name, None)
        with suppress(ValueError):
            return None if stated is None else finite(stated, name)
        return None

    @property
    def step(self) -> float | None:
        """Step of the description [s], or None."""
        step = self.experiment("stepSize")
        return step if step is not None and step > 0.0 else None

    def is_settable(self, name: str) -> bool:
        """Return True for a variable that can be set before a run (FMI 2.0.4, section 2.2.7).

        Raises:
            InputError: there is no such variable.

        """
        variable = self.variable(name)
        return variable.causality == "input" or (
            variable.variability != "constant"
            and variable.initial in ("exact", "approx")
            # Arrays keep the sizes of the description.
            and variable.causality != "structuralParameter"
        )

    def is_continuous(self, name: str) -> bool:
        """Return True for a variable that may change at any time (FMI 2.0.4, section 2.2.7)."""
        variable = self.variable(name)
        return variable.family == "Real" and variable.variability in (None, "continuous")

    def has_feedthrough(self, output: str) -> bool:
        """Return True for an output that depends on an input of the same instant."""
        return output in self._feedthrough

    @cached_property
    def _feedthrough(self) -> frozenset[str]:
        return _feedthrough_of(self.description)


# Cached: thousands of components may share an FMU.


@lru_cache(maxsize=256)
def _starts_of(description: ModelDescription) -> Mapping[str, Value]:
    values: dict[str, Value] = {}
    for name, variable in variables_of(description).known.items():
        if variable.start is not None:
            with suppress(InputError):
                values[name] = variable.typed(variable.start, name)
    return values


@lru_cache(maxsize=256)
def _feedthrough_of(description: ModelDescription) -> frozenset[str]:
    """Outputs without stated dependencies count, too (FMI 2.0.4, section 2.2.8)."""
    free = {
        unknown.variable.name
        for unknown in description.outputs
        if unknown.dependencies is not None
        and not any(variable.causality == "input" for variable in unknown.dependencies)
    }
    variables = variables_of(description).known.values()
    return frozenset(v.name for v in variables if v.causality == "output" and v.array not in free)


def runs_python(folder: Path) -> bool:
    """Return True for an unpacked FMU that PythonFMU has made."""
    return (folder / "resources" / "slavemodule.txt").is_file()


def read_component(
    name: str,
    fmu: Path,
    findings: Findings | None = None,
) -> Component:
    """Read an FMU as a component.

    Args:
        name: of the instance.
        fmu: the file.
        findings: receives notes on harmless flaws of its description.

    Raises:
        InputError: the file is missing, or is not an FMU for co-simulation.

    """
    folder, digest = unpack(fmu)
    read = described(fmu, folder)
    if findings is not None and (remark := read.remark()):
        findings.note(f"{name}: the description of {fmu.name} is not valid: {remark}")
    return Component(name, fmu, read.description, digest)
