"""Systems of several vehicles, each in a system of its own."""

from __future__ import annotations

from dataclasses import replace

from orchestrator.cosim import System


def fleet_of(system: System, n: int, between: str = ".") -> System:
    """Several of a loop side by side: `auv1.plant` and so on, nothing between them.

    Args:
        one: the loop.
        n: how many.
        between: what parts the name of a vehicle from the name of a component.

    """
    all_of_them = [
        system.renamed({name: f"auv{i}{between}{name}" for name in system.components})
        for i in range(1, n + 1)
    ]
    return replace(
        system,
        name="fleet",
        components={name: part for loop in all_of_them for name, part in loop.components.items()},
        connections=tuple(wire for loop in all_of_them for wire in loop.connections),
        parameters={port: value for loop in all_of_them for port, value in loop.parameters.items()},
        steps={name: step for loop in all_of_them for name, step in loop.steps.items()},
        left_open={port for loop in all_of_them for port in loop.left_open},
    )
