"""FMUs as other tools make them: one source in C, compiled with one peculiarity or another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orchestrator.cosim import Experiment, Isolation, System, Table
from support.runs import run_table
from support.small_fmus import connected, description, enumeration, unknown, variable, write

_SOURCE = Path(__file__).with_name("others.c")

#: Ways to run a system, as arguments of :func:`run`.
WAYS = {
    "python": {"loop": "python"},
    "compiled": {"loop": "compiled"},
    "isolated": {"isolation": Isolation(20.0)},
}

_MODE = ' declaredType="Mode"'
_VARIABLES = (
    '<ScalarVariable name="u" valueReference="0" causality="input"><Real/></ScalarVariable>',
    variable("y", 1, "output"),
    variable("gain", 2, "parameter", start=1),
    variable("stubborn", 3, "parameter", start=1),
    variable("mode", 0, "input", "Enumeration", 1, _MODE),
    variable("mode_y", 1, "output", "Enumeration", inside=_MODE),
    variable("on", 0, "input", "Boolean"),
    variable("fault", 1, "output", "Boolean"),
    variable("count", 4, "parameter", "Integer"),
    variable("said", 0, "input", "String", "start"),
    variable("heard", 1, "output", "String"),
)

#: Outputs, by their places among the variables.
_OUTPUTS = (2, 6, 8, 11)

_TYPES = f"<TypeDefinitions>{enumeration('Mode', {'calm': 1, 'storm': 4})}</TypeDefinitions>"


def build(
    folder: Path,
    peculiarity: str = "",
    attributes: str = 'canHandleVariableCommunicationStepSize="true"',
    platform: str = "linux64",
    change: tuple[str, str] = ("", ""),
) -> Path:
    """An FMU; the test is skipped where there is no compiler.

    Args:
        folder: for it.
        peculiarity: one of the names that the source looks for; none: it has none.
        attributes: of the element CoSimulation of its description.
        platform: for which its library is said to be.
        change: a text in its description, and what stands there instead.

    """
    define = [f"-D{peculiarity}"] * bool(peculiarity)
    unknowns = [unknown(index, "") for index in _OUTPUTS]
    text = description("others", _VARIABLES, unknowns, attributes, _TYPES).replace(*change)
    fmu = folder / f"{peculiarity or 'plain'}.fmu"
    return write(fmu, text, _SOURCE, *define, platform=platform)


def system_of(fmu: Path, names: str = "a", wires: dict[str, str] | None = None) -> System:
    """Instances of an FMU with names of one letter, and what feeds what, by the targets."""
    return connected("others", dict.fromkeys(names, fmu), wires)


def run(
    system: System, stop_time: float = 1.0, step: float = 0.1, order: str = "jacobi", **how: Any
) -> Table:
    """All rows of a run."""
    return run_table(system, Experiment(stop_time, step, order), **how)
