"""The plan of a run, checked before any FMU is loaded, and its identity."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from importlib.util import find_spec
from math import lcm
from pathlib import Path
from platform import python_version

from orchestrator.cosim.experiment import FEEDTHROUGH, LINEAR, Experiment, Order, decimations
from orchestrator.cosim.stages import Arrangement, arrange
from orchestrator.cosim.system.graph import rings
from orchestrator.cosim.system.structure import System
from orchestrator.machine.errors import InputError

#: Packages whose versions the rows depend on.
PACKAGES = ("auv-fmu", "pythonfmu", "fmpy", "numpy")

#: All that decides the numbers of a run: by names in words, each as text.
Identity = Mapping[str, str]


@dataclass(frozen=True)
class Plan:
    """A system that is ready for :func:`.simulation.simulate_plan`: see :func:`make_plan`.

    Attributes:
        system: that is run.
        experiment: until when, in which steps and which order.
        decimations: how many communication steps one step of each component takes.
        rings: all rings of direct feedthroughs.
        arrangement: of its components where all rings are solved; once they are initialised, the
            one that is taken.
        remarks: lines for the user of a run.

    """

    system: System
    experiment: Experiment
    decimations: Mapping[str, int]
    rings: Sequence[Sequence[str]]
    arrangement: Arrangement
    remarks: Sequence[str] = ()


def make_plan(system: System, experiment: Experiment) -> Plan:
    """Check what can be checked before an FMU is loaded.

    Where an FMU takes steps of one length only, a last, shorter step is left out.

    Raises:
        InputError: the system or its steps are not usable, or no step is left.

    """
    system.check()
    check_order(system, experiment.order)
    if experiment.coupling == LINEAR:
        _check_linear(system)
    every = decimations(system, experiment.step)
    closed = rings(system)
    arrangement = arrange(system, experiment.order or FEEDTHROUGH, closed)
    remarks = tuple(
        f"{name}: {component.remainder}"
        for name, component in system.components.items()
        if component.left_alone
    )
    rigid = [name for name, component in system.components.items() if not component.takes_any_step]
    period = lcm(*(every[name] for name in rigid))
    whole = experiment.full_steps // period * period
    if not rigid or whole == experiment.rows - 1:
        return Plan(system, experiment, every, closed, arrangement, remarks)
    why = f"{', '.join(rigid)}: takes only steps of a fixed length, so"
    if whole == 0:
        shortest = period * experiment.step
        raise InputError(f"{why} the run must last at least one step, {shortest:g} s")
    end = experiment.time(whole)
    remark = f"{why} the run ends with the last whole step, at t = {end:.12g} s"
    shorter = replace(experiment, stop_time=end)
    return Plan(system, shorter, every, closed, arrangement, (*remarks, remark))


def _check_linear(system: System) -> None:
    """Check that the components of a system can be stepped with linear inputs.

    Raises:
        InputError: one that others feed cannot go back, or its inputs cannot change in a step; or
            one takes longer steps.

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


def check_order(system: System, order: Order | None) -> None:
    """Check that an order that is stated names each component once.

    Raises:
        InputError: it does not.

    """
    if order is None or isinstance(order, str):
        return
    for name in order:
        system.component(name)
    stated = Counter(order)
    twice = [name for name, n in stated.items() if n > 1]
    missing = [name for name in system.components if name not in stated]
    for names, what in ((twice, "twice"), (missing, "not at all")):
        if names:
            raise InputError(
                f"order {','.join(order)}: names {', '.join(names)} {what}; it must name every "
                "component once"
            )


def identity(plan: Plan, events: Sequence[object] = (), inputs: str = "") -> Identity:
    """List all that decides the rows of a run.

    Code counts by whole rooms, comments included: it is better to make a run once too often than to
    take another one for it. What other rooms decide is in the plan, the events and the inputs.

    How the steps are made, in which loop and process, is not in it: the rows are the same. Nor is
    where an FMU lies, or what a scenario is called.

    Args:
        plan: what is run.
        events: that happen to it.
        inputs: digest of the values of inputs over time; empty: they keep their values.

    """
    system = plan.system
    return {
        "the code": code_of("orchestrator.cosim"),
        "the version of Python": python_version(),
        **{f"the version of {package}": version(package) for package in PACKAGES},
        # Their order is the order of the columns, and says where a ring is opened.
        "the components": ", ".join(system.components),
        **{f"the FMU of {name}": part.digest for name, part in system.components.items()},
        # What follows from the units of the two ends is in the transformation.
        **{f"what feeds {wire.target}": repr(wire) for wire in system.connections},
        **{f"the step of {name}": repr(float(step)) for name, step in system.steps.items()},
        **_parameters(system),
        **{name: repr(value) for name, value in vars(plan.experiment).items()},
        "the events": repr(tuple(events)),
        "the inputs": inputs,
    }


def _parameters(system: System) -> dict[str, str]:
    """Those that are set to another value than the FMU's own."""
    return {
        str(name): repr(value)
        for name, value in system.parameters.items()
        if repr(value) != repr(system.components[name.component].starts.get(name.port))
    }


def differences(one: Identity, other: Identity) -> list[str]:
    """The entries in which two identities differ, by their names."""
    return sorted(dict(one.items() ^ other.items()))


def digest_of(*identities: Identity) -> str:
    """An identity, or several in their order, as a short text."""
    return sha256(json.dumps(identities, sort_keys=True).encode()).hexdigest()


@cache
def code_of(*packages: str) -> str:
    """Digest of the code of some packages, in Python and C."""
    digest = sha256()
    for package in packages:
        specification = find_spec(package)
        assert specification is not None and specification.submodule_search_locations
        [root] = specification.submodule_search_locations
        sources = (path for path in Path(root).rglob("*") if path.suffix in (".c", ".h", ".py"))
        for path in sorted(sources):
            digest.update(f"{package}/{path.relative_to(root).as_posix()}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()
