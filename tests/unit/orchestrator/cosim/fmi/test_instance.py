"""The calls of a component in a run, in this process and in a separate one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import c_double
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cosim.component import read_component
from orchestrator.cosim.connection import PortName
from orchestrator.cosim.fmi.instance import ComponentFailed, Instance, Log
from orchestrator.cosim.fmi.isolated import Isolation, place_instances
from orchestrator.cosim.row import Row
from orchestrator.cosim.stages import member, step_members
from orchestrator.cosim.system import System
from orchestrator.machine.interrupts import held_interrupts
from orchestrator.runs.wiring import closed_loop
from support.mixed import Shape, build

STEP = 0.02

PLACES = pytest.mark.parametrize("place", ["here", "isolated"])


@contextmanager
def ready(system: System, place: str) -> Iterator[tuple[Instance, Row]]:
    """Return the instance of a system of one component, initialised, and the row."""
    with held_interrupts() as interrupts:
        isolation = Isolation() if place == "isolated" else None
        with place_instances(system.components, Log(), isolation, lambda: interrupts) as instances:
            row = Row(system, instances)
            ((name, instance),) = instances.items()
            instance.enter_initialization(system.parameters_of(name))
            instance.exchange()
            instance.exit_initialization()
            yield instance, row


def stepped(instance: Instance, row: Row, first: int, n: int) -> np.ndarray:
    """Return the rows after some steps, beginning with step number `first`."""
    rows = np.empty((n, len(row.values)))
    for i in range(n):
        step_members([member(instance)], c_double((first + i) * STEP), c_double(STEP))
        rows[i] = row.values
    return rows


@PLACES
@pytest.mark.parametrize("kind", ["dist", "native"])
def test_a_state_continues_in_another_instance_bit_for_bit(request, kind: str, place: str):
    """A plant with noise: ten steps equal three and seven more from the state between."""
    plant = closed_loop(request.getfixturevalue(kind)).components["plant"]
    pushed = System("pushed", {"plant": plant}, ()).with_parameters(
        {PortName("plant", "tau.u"): 10.0, PortName("plant", "noise.std"): 0.01}
    )
    with ready(pushed, place) as (instance, row):
        stepped(instance, row, 0, 3)
        state = instance.state()
        whole = stepped(instance, row, 3, 7)
        instance.restore(state)
        again = stepped(instance, row, 3, 7)
    with ready(pushed, place) as (other, row):
        other.restore(state)
        resumed = stepped(other, row, 3, 7)
    assert np.ptp(whole, axis=0).max() > 0.0
    assert again.tobytes() == whole.tobytes()
    assert resumed.tobytes() == whole.tobytes()


@PLACES
def test_an_fmu_that_gives_no_state_is_named(tmp_path: Path, place: str):
    component = read_component("stubborn", build(tmp_path, Shape((1, 0, 0, 0), (1, 0, 0, 0))))
    assert not component.gives_state
    with ready(System("one", {"stubborn": component}, ()), place) as (instance, _):
        for call in (instance.state, lambda: instance.restore(b"")):
            with pytest.raises(
                ComponentFailed, match="stubborn: its FMU does not provide its state"
            ):
                call()


@PLACES
@pytest.mark.parametrize("kind", ["dist", "native"])
def test_bytes_that_are_not_a_state_are_refused(request, kind: str, place: str):
    plant = closed_loop(request.getfixturevalue(kind)).components["plant"]
    with (
        ready(System("one", {"plant": plant}, ()), place) as (instance, _),
        pytest.raises(ComponentFailed, match="plant: state refused"),
    ):
        instance.restore(b"nonsense")
