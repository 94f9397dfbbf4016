"""An FMU and what its description says about it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from fmpy.model_description import ModelDescription, ModelVariable

from orchestrator.machine.errors import Findings, InputError, did_you_mean
from orchestrator.machine.user_files import folder_of, unpacked
from orchestrator.system.description import described
from orchestrator.system.values import Value, finite, typed

#: The versions of FMI that a system can be written with, and those that the master can step.
WRITABLE, RUNNABLE = ("2.0", "3.0"), ("2.0",)


@dataclass(frozen=True)
class Component:
    """An FMU in a system.

    Attributes:
        name: of the instance.
        fmu: the file.
        description: what its modelDescription.xml says.
        digest: SHA-256 of the file as it was read. That is what runs, and what records name.

    """

    name: str
    fmu: Path
    description: ModelDescription
    digest: str

    @property
    def folder(self) -> Path:
        """The folder into which it has been unpacked.

        Raises:
            InputError: it was read in another process, and the file is another one now.

        """
        return folder_of(self.fmu, self.digest)

    @cached_property
    def variables(self) -> dict[str, ModelVariable]:
        """The FMU's variables by name."""
        return {variable.name: variable for variable in self.description.modelVariables}

    @property
    def is_once_per_process(self) -> bool:
        """Whether a process may hold one instance of the FMU only."""
        return bool(self.description.coSimulation.canBeInstantiatedOnlyOncePerProcess)

    @property
    def takes_any_step(self) -> bool:
        """Whether its steps may differ in length."""
        return bool(self.description.coSimulation.canHandleVariableCommunicationStepSize)

    @property
    def gives_derivatives(self) -> bool:
        """Whether it can say how outputs change with inputs."""
        return bool(self.description.coSimulation.providesDirectionalDerivative)

    @property
    def takes_linear_inputs(self) -> bool:
        """Whether it can go back to the beginning of a step, and its inputs change in one."""
        of = self.description.coSimulation
        return bool(of.canGetAndSetFMUstate and of.canInterpolateInputs)

    @property
    def gives_state(self) -> bool:
        """Whether its whole state can be had as bytes, and taken on from them."""
        of = self.description.coSimulation
        return bool(of.canGetAndSetFMUstate and of.canSerializeFMUstate)

    def variable(self, name: str) -> ModelVariable:
        """One variable of the FMU.

        Raises:
            InputError: there is no such variable.

        """
        if name not in self.variables:
            hint = did_you_mean(name, self.variables)
            raise InputError(f"{self.name} has no port or parameter {name!r}{hint}")
        return self.variables[name]

    def having(self, causality: str) -> list[ModelVariable]:
        """The variables of one causality, in the order of the description."""
        return [v for v in self.description.modelVariables if v.causality == causality]

    def start(self, name: str) -> Value | None:
        """The start value of a variable, in its type; None: its description names none.

        Raises:
            InputError: there is no such variable.

        """
        variable = self.variable(name)
        if variable.start is None:
            return None
        return typed(f"{self.name}.{name}", variable, variable.start)

    @cached_property
    def starts(self) -> dict[str, Value]:
        """Start values that the description names, except nonsense, which is of no use."""
        values: dict[str, Value] = {}
        for name in self.variables:
            with suppress(InputError):
                value = self.start(name)
                values |= {} if value is None else {name: value}
        return values

    def experiment(self, name: str) -> float | None:
        """What its DefaultExperiment says, such as `stopTime` [s]; None: no number, or nothing."""
        stated = getattr(self.description.defaultExperiment, name, None)
        with suppress(ValueError):
            return None if stated is None else finite(stated, name)
        return None

    def is_settable(self, name: str) -> bool:
        """Whether a variable takes a value before the first step (FMI 2.0.4, section 2.2.7).

        Raises:
            InputError: there is no such variable.

        """
        variable = self.variable(name)
        return variable.causality == "input" or (
            variable.variability != "constant" and variable.initial in ("exact", "approx")
        )

    def is_continuous(self, name: str) -> bool:
        """Whether a variable may change at any time (FMI 2.0.4, section 2.2.7)."""
        variable = self.variable(name)
        return variable.type == "Real" and variable.variability in (None, "continuous")

    def has_feedthrough(self, output: str) -> bool:
        """Whether an output depends on an input of the same instant."""
        return output in self._feedthrough

    @cached_property
    def _feedthrough(self) -> frozenset[str]:
        """An FMU that does not say must be taken to have it (FMI 2.0.4, section 2.2.8)."""
        free = {
            unknown.variable.name
            for unknown in self.description.outputs
            if unknown.dependencies is not None
            and not any(variable.causality == "input" for variable in unknown.dependencies)
        }
        return frozenset(variable.name for variable in self.having("output")) - free


def read_component(
    name: str,
    fmu: Path,
    versions: Sequence[str] = RUNNABLE,
    findings: Findings | None = None,
) -> Component:
    """An FMU as a component.

    Args:
        name: of the instance.
        fmu: the file.
        versions: of FMI that it may have.
        findings: take note of what is wrong with its description, and does no harm.

    Raises:
        InputError: the file is missing or is no such FMU for co-simulation.

    """
    folder, digest = unpacked(fmu)
    found = described(fmu, folder, tuple(versions))
    if findings is not None and (remark := found.remark()):
        findings.note(f"{name}: the description of {fmu.name} is not valid: {remark}")
    return Component(name, fmu, found.description, digest)
