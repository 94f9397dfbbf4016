"""Ports that controllers share."""

from __future__ import annotations

from fmus.ports.controllers import command
from fmus.ports.port import Port, inputs


def test_command_depends_on_the_inputs_that_are_said():
    known = inputs("y", {"x": "m"}, "Place")
    about = "Commanded force and moments (21), not limited"
    assert command("(21)", known) == tuple(
        Port(
            f"tau.{k}", "output", "continuous", "Real", f"{about}: {k}", unit, feedthrough=("y.x",)
        )
        for k, unit in (("u", "N"), ("q", "N.m"), ("r", "N.m"))
    )
