"""The plan of a run, checked before any FMU is loaded, and its identity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from math import lcm
from platform import python_version
from typing import ClassVar, Literal, get_args

from orchestrator.cosim.experiment import FEEDTHROUGH, LINEAR, Experiment
from orchestrator.cosim.fmi.isolated import Isolation
from orchestrator.cosim.loop import COMPILED, choose_loop
from orchestrator.cosim.stages import Arrangement, Stage, Stages, arrange, stages_of
from orchestrator.cosim.system import System
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import PACKAGES, Identity, code_of


@dataclass(frozen=True)
class Plan:
    """A system that is ready for :func:`.simulation.simulate_plan`: see :func:`make_plan`.

    Attributes:
        system: to run.
        experiment: times, steps and order.
        decimations: number of communication steps in one step of each component.
        rings: all rings of direct feedthroughs.
        arrangement: of the components where all rings are solved; after initialisation, the one
            that the run takes.
        remarks: lines for the user.
        isolation: settings of separate processes, one for each FMU; None: all FMUs run in this
            process.
        loop: makes the steps, one of `LOOPS`; all loops make the same rows.

    """

    system: System
    experiment: Experiment
    decimations: Mapping[str, int]
    rings: Sequence[Sequence[str]]
    arrangement: Arrangement
    remarks: Sequence[str] = ()
    isolation: Isolation | None = None
    loop: str = "python"

    #: Loops that can be asked for; the first takes the compiled one where it is available.
    Loop = Literal["auto", "python", "compiled"]
    LOOPS: ClassVar[tuple[Loop, ...]] = get_args(Loop)

    def stages(self, *, latest: bool = False) -> Stages[Stage]:
        """Return the stages of every step.

        Args:
            latest: if set, stages take all outputs that the stages before them have computed.

        """
        return stages_of(self.system, self.arrangement, self.decimations, latest=latest)

    def identity(self, events: Sequence[object] = (), inputs: str = "") -> Identity:
        """Return everything that decides the rows of a run.

        Code counts as a whole, comments included: to repeat a run is better than to take it for
        another one. Loop and processes are not part of it, since the rows are the same; neither are
        the locations of FMUs and the name of a scenario.

        Args:
            events: of the run.
            inputs: digest of the values of inputs over time; empty: inputs keep their values.

        """
        system = self.system
        return {
            "the code": code_of("orchestrator.cosim"),
            "the version of Python": python_version(),
            **{f"the version of {package}": version(package) for package in PACKAGES},
            # Their order is the order of the columns, and decides where a ring is opened.
            "the components": ", ".join(system.components),
            **{f"the FMU of {name}": part.digest for name, part in system.components.items()},
            # A conversion of units is part of the transformation.
            **{f"what feeds {wire.target}": repr(wire) for wire in system.connections},
            **{f"the step of {name}": repr(float(step)) for name, step in system.steps.items()},
            **{
                str(name): repr(value)
                for name, value in system.parameters.items()
                if repr(value) != repr(system.components[name.component].starts.get(name.port))
            },
            **{name: repr(value) for name, value in vars(self.experiment).items()},
            "the events": repr(tuple(events)),
            "the inputs": inputs,
        }


def make_plan(
    system: System,
    experiment: Experiment,
    isolation: Isolation | None = None,
    loop: str = "python",
) -> Plan:
    """Check a system and its experiment before any FMU is loaded.

    Where an FMU takes only steps of one length, a last, shorter step is left out.

    Args:
        system: to run.
        experiment: times, step, order and coupling.
        isolation: settings of separate processes, one for each FMU; None: all FMUs run in this
            process.
        loop: makes the steps, one of :attr:`Plan.LOOPS`.

    Raises:
        InputError: the system or its steps are not usable, no step is left, or the loop is not
            available.

    """
    if loop not in Plan.LOOPS:
        raise InputError(f"loop {loop!r}: use one of {', '.join(Plan.LOOPS)}")
    system.check()
    system.check_order(experiment.order)
    if experiment.coupling == LINEAR:
        _check_linear(system)
    every = system.decimations(experiment.step)
    closed = system.rings()
    arrangement = arrange(system, experiment.order or FEEDTHROUGH, closed)
    remarks = tuple(
        f"{name}: {component.remainder}"
        for name, component in system.components.items()
        if component.unsupported
    )
    rigid = [name for name, component in system.components.items() if not component.takes_any_step]
    period = lcm(*(every[name] for name in rigid))
    whole = experiment.full_steps // period * period
    if rigid and whole != experiment.rows - 1:
        why = f"{', '.join(rigid)}: takes only steps of a fixed length, so"
        if whole == 0:
            shortest = period * experiment.step
            raise InputError(f"{why} the run must last at least one step, {shortest:g} s")
        end = experiment.time(whole)
        remarks += (f"{why} the run ends with the last whole step, at t = {end:.12g} s",)
        experiment = replace(experiment, stop_time=end)
    if loop == COMPILED:
        # Only this choice may not be available.
        choose_loop(loop, experiment, isolation)
    return Plan(system, experiment, every, closed, arrangement, remarks, isolation, loop)


def _check_linear(system: System) -> None:
    """Check that the components of a system can be stepped with linear inputs.

    Raises:
        InputError: a component with fed inputs cannot go back, or its inputs cannot change in a
            step; or a component takes longer steps.

    """
    for name, component in system.components.items():
        if system.feeding[name] and not component.takes_linear_inputs:
            raise InputError(
                f"coupling linear: {name} cannot go back to the beginning of a step and let its "
                "inputs change in it (canGetAndSetFMUstate, canInterpolateInputs)"
            )
    if system.steps:
        raise InputError(
            f"coupling linear: {', '.join(system.steps)}: takes longer steps; leave them out"
        )
