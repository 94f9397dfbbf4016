"""FMUs that end the run by themselves: its last row is that of the time that they have come to."""

from __future__ import annotations

from dataclasses import replace

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2Discard, fmi2LastSuccessfulTime

from orchestrator.cosim.experiment import ORDERS
from orchestrator.cosim.system.component import read_component
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from support.others import WAYS, build, run, system_of
from support.texts import mentions, tells
from support.tiers import slow

EVERY_WAY = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)

_STEP = 0.1
_ANY, _ONE = (f'canHandleVariableCommunicationStepSize="{how}"' for how in ("true", "false"))
_FEEDTHROUGH = ('<Unknown index="2" dependencies=""/>', '<Unknown index="2" dependencies="1"/>')

#: When nobody ends.
_NEVER = 100.0


def a_ring_of(folder, ends, rigid=""):
    """Three FMUs in a ring, in which the outputs of the first two feed through.

    Each adds (1 + u) h to what it gives, which is that and u, but for the last.
    """
    components = {}
    for name, end in zip("abc", ends, strict=True):
        own = folder / name
        own.mkdir()
        fmu = build(
            own,
            f"ENDS_AT={end}",
            _ONE if name in rigid else _ANY,
            change=_FEEDTHROUGH if name != "c" else ("", ""),
        )
        components[name] = read_component(name, fmu)
    wires = tuple(
        Connection(PortName(source, "y"), PortName(target, "u"))
        for source, target in ("ab", "bc", "ca")
    )
    gain = {PortName(name, "gain"): 0.5 * (name != "c") for name in "abc"}
    return System("ends", components, wires, gain)


def instantiated(component):
    """A component before its initialisation mode ends."""
    slave = FMU2Slave(
        guid="others",
        unzipDirectory=fmpy.extract(str(component.fmu)),
        modelIdentifier="others",
        instanceName=component.name,
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.setReal([2], [0.5 * (component.name != "c")])
    slave.enterInitializationMode()
    return slave


def end_of(slave, t, h):
    """When a slave has ended in a step [s]; None: it has not."""
    try:
        slave.doStep(t, h)
    except FMICallException as error:
        if error.status != fmi2Discard:
            raise
        return slave.getRealStatus(fmi2LastSuccessfulTime)
    return None


def plain_rows(system, order):
    """What calls of fmpy give, one after the other, until somebody ends.

    Args:
        system: a ring of :func:`a_ring_of`.
        order: one of our orders.

    """

    def pass_on():
        """Along the ring; one that has ended takes nothing any more."""
        for name in "abc":
            u[name] = y[fed[name]]
            if name not in ended:
                slaves[name].setReal([0], [u[name]])
            y[name] = slaves[name].getReal([1])[0]

    slaves = {name: instantiated(component) for name, component in system.components.items()}
    fed, u = dict(zip("abc", "cab", strict=True)), dict.fromkeys("abc", 0.0)
    for _ in range(3):
        for name, source in fed.items():
            slaves[name].setReal([0], [u[name]])
            u[name] = slaves[source].getReal([1])[0]
    for slave in slaves.values():
        slave.exitInitializationMode()
    y = {name: slave.getReal([1])[0] for name, slave in slaves.items()}
    rows, end, ended = [[0.0, *u.values(), *y.values()]], None, set()
    while end is None:
        t, time = ((len(rows) + more) * _STEP for more in (-1, 0))
        # What does not feed through is taken at t_k.
        u["a"] = y["c"]
        for stage in "abc" if order == "gauss-seidel" else ["abc"]:
            h = _STEP if end is None or end > time - 1e-9 else end - t
            u |= {name: y[fed[name]] for name in stage if order != "feedthrough"}
            for name in stage:
                slaves[name].setReal([0], [u[name]])
                if own := end_of(slaves[name], t, h):
                    end = own
                    ended.add(name)
            y |= {name: slaves[name].getReal([1])[0] for name in stage}
        if order == "feedthrough":
            pass_on()
        rows.append([time if end is None or end > time - 1e-9 else end, *u.values(), *y.values()])
    for slave in slaves.values():
        slave.freeInstance()
    return np.array(rows)


def rows_of(table):
    names = [f"{name}.{port}" for port in "uy" for name in "abc"]
    return np.column_stack([table.time, *(table[name] for name in names)])


@EVERY_WAY
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("who", ["b", *slow("a", "c")])
@pytest.mark.parametrize(("at", "n"), [(0.5, 6), (0.45, 6), (0.02, 2)])
def test_the_last_row_is_that_of_the_time_which_the_fmu_has_come_to(
    tmp_path, way, order, who, at, n
):
    """With the step done, and cut short; other components as far as they can come to that time."""
    system = a_ring_of(tmp_path, [at if name == who else _NEVER for name in "abc"])
    table = run(system, 1.0, _STEP, order=order, **way)
    expected = plain_rows(system, order)
    assert table.failure is None
    assert mentions(table.ending.remark, f"t = {at:g} s: {who} {at:g} s")
    assert len(table) == len(expected) == n
    assert table.time[-1] == pytest.approx(at, rel=1e-15)
    assert np.array_equal(rows_of(table), expected)


def two_by_themselves(folder, ends, **variants):
    """Two FMUs, a and b, that give 1 + 2 t."""
    ring = a_ring_of(folder, [*ends, _NEVER], **variants)
    values = {PortName(name, port): 1.0 for name in "ab" for port in ("gain", "u")}
    components = {name: ring.components[name] for name in "ab"}
    return replace(ring, components=components, connections=(), parameters=values)


@EVERY_WAY
def test_who_is_at_another_time_in_the_last_row_is_named(tmp_path, way):
    table = run(two_by_themselves(tmp_path, [0.45, _NEVER]), **way)
    assert mentions(table.ending.remark, "t = 0.45 s: a 0.45 s; b")
    assert table["a.y"][-1] == pytest.approx(1.9)
    assert table["b.y"][-1] == pytest.approx(2.0)


@EVERY_WAY
def test_the_others_come_to_a_time_that_ends_a_run_if_they_can(tmp_path, way):
    """Stepped after the one that ends, one that takes steps of any length stands where it does."""
    order = ("a", "b", "c")
    ring = a_ring_of(tmp_path, [0.45, _NEVER, _NEVER], rigid="c")
    table = run(ring, order=order, **way)
    assert " c " in table.ending.remark.partition("; ")[2]
    assert table["c.y"][-1] == table["c.y"][-2]


@EVERY_WAY
def test_a_run_ends_at_the_earliest_of_two_ends_in_one_step(tmp_path, way):
    table = run(two_by_themselves(tmp_path, [0.47, 0.43]), **way)
    assert mentions(table.ending.remark, "t = 0.43 s: b 0.43 s; a")
    assert table["b.y"][-1] == pytest.approx(1.86)


@EVERY_WAY
def test_the_others_go_on_until_the_time_at_which_a_slow_one_has_ended(tmp_path, way):
    system = replace(two_by_themselves(tmp_path, [0.75, _NEVER]), steps={"a": 0.4})
    table = run(system, **way)
    assert table.failure is None
    assert tells(table.ending.remark, (0.75, 0.75)) and ";" not in table.ending.remark
    assert table.time == pytest.approx([*(0.1 * k for k in range(8)), 0.75])
    assert table["b.y"] == pytest.approx(1.0 + 2.0 * table.time)
    assert table["a.y"] == pytest.approx([1.0] * 4 + [1.8] * 4 + [2.5])


@EVERY_WAY
def test_an_end_at_the_stop_time_completes_the_run(tmp_path, way):
    system = two_by_themselves(tmp_path, [0.25, _NEVER])
    table = run(system, 0.25, **way)
    assert table.failure is None
    assert table.time.tolist() == [0.0, 0.1, 0.2, 0.25]
    assert table["b.y"] == pytest.approx(1.0 + 2.0 * table.time)


@EVERY_WAY
def test_one_that_gives_nothing_at_its_end_ends_the_run_before_that_step(tmp_path, way):
    table = run(system_of(build(tmp_path, "MUTE")), **way)
    assert table.failure is None
    assert tells(table.ending.remark, (0.4, 0.5))
    assert len(table) == 5
