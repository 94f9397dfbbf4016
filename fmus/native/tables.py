"""The ports of a component as tables in C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module

from auv_fmu import euler
from fmus.ports.port import FAULT, H_MAX, Port, Value

_HEAD = f"""\
/* The ports: a value reference is a place in the first table.
 *
 * Made from the declaration of the ports. The columns are name, type, causality, variability,
 * place of the value, start, minimum, maximum, choices; inputs and outputs lie at their numbers.
 */
#include <float.h>
#include <stddef.h>

/* From auv_fmu/euler.py. */
static const double ROUNDING = {euler.ROUNDING!r};
static const double LARGEST_STATE = {euler.LARGEST_STATE!r};
static const double MOST_INTERNAL_STEPS = {float(euler.MOST_INTERNAL_STEPS)!r};

#define PARAMETER_AT(member) offsetof(parameter_values, member)
"""


def tables(package: str) -> str:
    """The file ports.h of a component, for example of `fmus.auv_plant`."""
    module = import_module(f"{package}.ports")
    ports: Sequence[Port] = (*module.PORTS, FAULT)
    places = {FAULT.name: "0", H_MAX.name: "PARAMETER_AT(h_max)"}
    for name, path in module.PARAMETERS.paths.items():
        places[name] = f"PARAMETER_AT(model.{_member(path)})"
    references = {
        causality: [
            i for i, port in enumerate(ports) if (port.causality, port.kind) == (causality, "Real")
        ]
        for causality in ("input", "output")
    }
    for found in references.values():
        places |= {ports[reference].name: str(place) for place, reference in enumerate(found)}
    rows = "".join(f"    {{{_row(port, places)}}},\n" for port in ports)
    return "\n".join(
        (
            _HEAD,
            *(_choices(port) for port in ports if port.choices),
            f"static const port ports[] = {{\n{rows}}};\n",
            f"enum {{ N_PORTS = {len(ports)} }};\n",
            *(_references(causality, found) for causality, found in references.items()),
        )
    )


def _member(path: Sequence[str | int]) -> str:
    """The member of a structure: a tuple of Python is one with an array `v`."""
    first, *rest = path
    return str(first) + "".join(f".v[{p}]" if isinstance(p, int) else f".{p}" for p in rest)


def _row(port: Port, places: Mapping[str, str]) -> str:
    choices = _choices_name(port) if port.choices else "NULL"
    return ", ".join(
        (
            f'"{port.name}"',
            port.kind.upper(),
            port.causality.upper(),
            port.variability.upper(),
            places[port.name],
            _number(port, port.start or 0.0),
            "-DBL_MAX" if port.minimum is None else _number(port, port.minimum),
            "DBL_MAX" if port.maximum is None else _number(port, port.maximum),
            choices,
            str(len(port.choices)),
        )
    )


def _number(port: Port, value: Value) -> str:
    """The number that stands for a value."""
    meant = port.meaning(value)
    assert isinstance(meant, (float, int))
    return repr(float(meant))


def _choices_name(port: Port) -> str:
    return f"choices_of_{port.name.replace('.', '_')}"


def _choices(port: Port) -> str:
    rows = ", ".join(f'{{"{text}", {number}}}' for text, number in port.choices.items())
    return f"static const choice {_choices_name(port)}[] = {{{rows}}};\n"


def _references(causality: str, places: Sequence[int]) -> str:
    """The value references of the Real ports of a causality; C has no empty arrays."""
    numbers = ", ".join(f"FIRST_REFERENCE + {place}" for place in places or [0])
    return f"static const uint32_t {causality}_references[] = {{{numbers}}};\n"
