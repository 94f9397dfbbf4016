"""An FMU in C that passes its input on, in proportion and integrated, and systems of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from orchestrator.cosim import System
from support.small_fmus import connected, description, unknown, variable, write

_SOURCE = Path(__file__).with_name("relay.c")

#: Ports in the order of the C source: outputs after two inputs, then parameters.
INPUTS, OUTPUTS, PARAMETERS = ("u", "v"), ("g", "y", "t", "h"), ("a", "c")


def relay(folder: Path, declares: bool = True, step: float | None = None) -> Path:
    """The FMU.

    Args:
        folder: for it.
        declares: whether it says what its outputs depend on.
        step: that it was made for [s].

    """
    fmu = folder / f"relay-{declares:d}-{step}.fmu"
    if fmu.exists():
        return fmu
    causes = dict.fromkeys(INPUTS, "input") | dict.fromkeys(OUTPUTS, "output")
    causes |= dict.fromkeys(PARAMETERS, "parameter")
    variables = [variable(name, i, causes[name]) for i, name in enumerate(causes)]
    # Only g follows from an input, the first one, at once.
    declared = ("1", "", "", "") if declares else (None,) * 4
    text = description(
        "relay",
        variables,
        (unknown(3 + i, dependencies) for i, dependencies in enumerate(declared)),
        experiment="" if step is None else f'<DefaultExperiment stepSize="{step}"/>',
    )
    return write(fmu, text, _SOURCE)


def system_of(
    fmus: Mapping[str, Path],
    wires: Mapping[str, str] | None = None,
    parameters: Mapping[str, float] | None = None,
    **others: object,
) -> System:
    """A system of such FMUs.

    Args:
        fmus: by the names of the components.
        wires: sources by targets.
        parameters: by `component.parameter`.
        others: further attributes of the system.

    """
    return connected("relays", fmus, wires, parameters, **others)
