"""Every refusal says in one line what was refused and why, and with which status."""

from __future__ import annotations

import json
from math import inf, nan
from typing import Any

import pytest
from pythonfmu.enums import Fmi2Status

from fmus.python.callbacks import ANSWER
from support.instances import ClassInstance


def unknown(slave) -> int:
    """The first value reference that is none."""
    return len(slave._store.ports)


def from_json(**changes: Any):
    """A state with some parts changed."""

    def call(slave):
        saved = json.loads(json.dumps(slave._get_fmu_state()))
        slave._set_fmu_state({**saved, **changes})

    return call


def from_bytes(content: bytes):
    return lambda slave: slave._set_fmu_state(slave._fmu_state_from_bytes(content))


def terminated_then(call):
    def both(slave):
        slave.terminate()
        call(slave)

    return both


#: What is done to a DisturbanceGenerator that has been initialised, and what it says.
REASONS = {
    "no Real has the value reference 16": lambda s: s.get_real([unknown(s)]),
    "no Integer has the value reference 16": lambda s: s.set_integer([unknown(s)], [1]),
    "no Boolean has the value reference 0": lambda s: s.get_boolean([0]),
    "no String has the value reference 4294967295": lambda s: s.set_string([-1], ["a"]),
    "tau_w.u is an output and cannot be set": lambda s: s.set_real([6], [1.0]),
    "fault is an output and cannot be set": lambda s: s.set_boolean([15], [True]),
    "nu.u = nan: must be finite": lambda s: s.set_real([0], [nan]),
    "A_f = inf: must be finite": lambda s: s.set_real([12], [inf]),
    "fmi2SetReal is not allowed when terminated": terminated_then(lambda s: s.set_real([0], [1.0])),
    "fmi2SetString is not allowed when terminated": terminated_then(lambda s: s.set_string([], [])),
    "fmi2SetupExperiment is not allowed when stepping": lambda s: s.setup_experiment(0.0),
    "fmi2EnterInitializationMode is not allowed when stepping": (
        lambda s: s.enter_initialization_mode()
    ),
    "fmi2ExitInitializationMode is not allowed when terminated": terminated_then(
        lambda s: s.exit_initialization_mode()
    ),
    "step refused at t = 1 s: step -0.5 s is negative": lambda s: s.do_step(1.0, -0.5),
    "step refused at t = 1 s: time 1.0 and step nan must be finite": lambda s: s.do_step(1.0, nan),
    "step refused at t = nan s: time nan and step 0.5 must be finite": lambda s: s.do_step(
        nan, 0.5
    ),
    "step from 9.5 s to 10.5 s: the stop time is 10 s": lambda s: (
        from_json(stop_time=10.0)(s),
        s.do_step(9.5, 1.0),
    ),
    "fmi2DoStep is not allowed when terminated": terminated_then(lambda s: s.do_step(2.0, 0.5)),
    "state refused: the bytes are not a state": from_bytes(b"[1]"),
    "state refused: the bytes are not a state ": from_bytes(b"\xff"),
    "state refused: the bytes were changed since they were written": from_bytes(b"{}"),
    "state refused: not a state of fmus.disturbance_generator.DisturbanceGenerator": (
        from_json(identity="another")
    ),
    "state refused: it has missing or unknown parts": from_json(more=1),
    "state refused: 'bogus' is not a mode": from_json(mode="bogus"),
    "state refused: it has a state before the initialisation": from_json(mode="instantiated"),
    "state refused: its stop time is not after its start time": from_json(stop_time=-1.0),
    "state refused: its fault is neither true nor false": from_json(fault=0),
    "state refused: its outputs are neither fresh nor not": from_json(fresh=0),
    "state refused: it has missing or unknown parameters": from_json(parameters={}),
    "state refused: its values do not match the ports": from_json(inputs=[1.0]),
    "state refused: its values do not match the ports ": from_json(outputs=7),
    "state refused: it has steps without a state": from_json(state=None),
    "state refused: [0.0] instead of 0 values": from_json(state=[0.0]),
    "state refused: [1.0] instead of 0 values": from_json(draws=[1.0]),
    "state refused: '0' is not of type float": from_json(start_time="0"),
}

#: What is discarded; all else fails.
DISCARDED = ("must be finite", "negative")


@pytest.mark.parametrize("reason", REASONS)
def test_reason_is_logged_once_and_answered_each_time(reason):
    driver = ClassInstance("DisturbanceGenerator")
    discarded = any(words in reason for words in DISCARDED)
    status = Fmi2Status.discard if discarded else Fmi2Status.error
    for _ in range(2):
        REASONS[reason](driver.slave)
    [message] = [entry for entry in driver.slave.log_queue if entry.category != ANSWER]
    assert (message.msg, message.status) == (reason.strip(), status)
    assert driver.answers() == [status] * 2
    assert driver.get("fault") is discarded


def test_only_the_first_of_several_values_is_named():
    """The others have not been looked at: none of them is taken."""
    driver = ClassInstance("DisturbanceGenerator")
    driver.slave.set_real([0, 1, 2], [1.0, nan, inf])
    assert driver.messages() == ["nu.v = nan: must be finite"]
    assert driver.answers() == [Fmi2Status.discard]
    assert driver.slave.get_real([0, 1, 2]) == [0.0] * 3


def test_each_value_that_cannot_be_read_is_named():
    driver = ClassInstance("DisturbanceGenerator")
    driver.set(nu__u=7.0)
    assert driver.slave.get_real([0, 97, 98]) == [7.0, 0.0, 0.0]
    assert driver.messages() == [f"no Real has the value reference {n}" for n in (97, 98)]
