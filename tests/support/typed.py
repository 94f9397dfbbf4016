"""An FMU of FMI 3.0 with ports of every type, arrays among them, and a few that no run touches."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import fmpy

from orchestrator.cosim import System, Value
from support.small_fmus import connected, description_of_fmi3, write

_SOURCE = Path(__file__).with_name("typed.c")
_HEADERS = Path(fmpy.__file__).parent / "c-code"

#: Types of the inputs `u_TYPE` and outputs `y_TYPE`, in the order of their value references.
SCALARS = (
    "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Enumeration", "Boolean", "String",
)  # fmt: skip

#: Values for these that the next larger or smaller type could not hold, or a double.
VALUES: Mapping[str, Value] = {
    "Float64": 0.1, "Float32": -(2.0**-149), "Int8": -128, "UInt8": 255, "Int16": -(2**15),
    "UInt16": 2**16 - 1, "Int32": -(2**31), "UInt32": 2**32 - 1, "Int64": -(2**63) + 1,
    "UInt64": 2**64 - 1, "Enumeration": 4, "Boolean": True, "String": "ä b",
}  # fmt: skip

#: Value references of the others.
(TIME, X, END_AT, EARLY_AT, GAIN, M, V, W, STEPS, N, COUNTER, COUNTS_FROM, COMPLAINS, NAMES, JOINED,
 *_) = range(20)  # fmt: skip

_FIRST = 15

_ROWS, _SIZE = '<Dimension start="2"/>', f'<Dimension valueReference="{N}"/>'


def _variable(kind: str, name: str, reference: int, causality: str, start: str = "",
              inside: str = "", **more: str) -> str:  # fmt: skip
    if kind == "String":
        inside += "".join(f'<Start value="{text}"/>' for text in start.split(",") if start)
    elif start:
        more["start"] = start
    if kind == "Enumeration":
        more["declaredType"] = "Mode"
    attributes = "".join(f' {key}="{value}"' for key, value in more.items())
    return (
        f'<{kind} name="{name}" valueReference="{reference}" causality="{causality}"{attributes}>'
        f"{inside}</{kind}>"
    )


_OTHERS = (
    _variable("Float64", "time", TIME, "independent"),
    _variable("Float64", "x", X, "output", initial="calculated"),
    _variable("Float64", "end_at", END_AT, "parameter", "1e300"),
    _variable("Float64", "early_at", EARLY_AT, "parameter", "1e300"),
    _variable("Float64", "gain", GAIN, "parameter", "1", _ROWS, variability="tunable"),
    _variable("Float64", "M", M, "parameter", "1 2 3 4 5 6", _ROWS + _SIZE),
    _variable("Float64", "v", V, "input", "0 0 0.5", _SIZE),
    _variable("Float64", "w", W, "output", inside=_ROWS),
    _variable("Int16", "steps", STEPS, "output", inside=_SIZE),
    _variable("UInt64", "n", N, "structuralParameter", "3"),
    _variable("UInt64", "counter", COUNTER, "output"),
    _variable("UInt64", "counts_from", COUNTS_FROM, "parameter", "0"),
    _variable("Boolean", "complains", COMPLAINS, "parameter", "false"),
    _variable("String", "names", NAMES, "parameter", "a,b", _ROWS),
    _variable("String", "joined", JOINED, "output", inside=_ROWS),
    '<Binary name="bytes" valueReference="90" causality="input"><Start value="00"/></Binary>',
    '<Clock name="clock" valueReference="91" causality="input" intervalVariability="triggered"/>',
)

_STARTS = {"Boolean": "false", "String": "said", "Enumeration": "1"}

_FREE = (X, STEPS, COUNTER)


def text() -> str:
    """Its modelDescription.xml."""
    variables = [*_OTHERS]
    for i, kind in enumerate(SCALARS):
        start = _STARTS.get(kind, "0")
        variables.append(_variable(kind, f"u_{kind}", _FIRST + 2 * i, "input", start))
        variables.append(_variable(kind, f"y_{kind}", _FIRST + 2 * i + 1, "output"))
    outputs = dict.fromkeys(_FREE, "") | {W: f"{V}", JOINED: f"{_FIRST + 24}"}
    outputs |= {_FIRST + 2 * i + 1: f"{_FIRST + 2 * i}" for i in range(len(SCALARS))}
    structure = "".join(
        f'<{tag} valueReference="{reference}" dependencies="{dependencies}"/>'
        for tag in ("Output", "InitialUnknown")
        for reference, dependencies in outputs.items()
    )
    types = (
        '<TypeDefinitions><EnumerationType name="Mode"><Item name="calm" value="1"/>'
        '<Item name="storm" value="4"/></EnumerationType></TypeDefinitions>'
    )
    attributes = (
        'canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true" '
        'canSerializeFMUState="true" providesDirectionalDerivatives="true" hasEventMode="true"'
    )
    found = description_of_fmi3("typed", "".join(variables), structure, attributes)
    return found.replace("<ModelVariables>", f"{types}<ModelVariables>")


def build(folder: Path, *options: str, change: tuple[str, str] = ("", "")) -> Path:
    """The FMU; the test is skipped where there is no compiler.

    Args:
        folder: for it.
        options: of the compiler.
        change: a text in its description, and what stands there instead.

    """
    fmu = folder / "typed.fmu"
    content = text().replace(*change)
    headers = f"-I{_HEADERS}"
    return write(fmu, content, _SOURCE, headers, *options, platform=fmpy.platform_tuple)


def system_of(
    fmu: Path,
    names: str = "a",
    wires: Mapping[str, str] | None = None,
    parameters: Mapping[str, Value] | None = None,
) -> System:
    """Instances of the FMU with names of one letter, and what feeds what, by the targets."""
    return connected("typed", dict.fromkeys(names, fmu), wires, parameters)
