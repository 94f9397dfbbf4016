"""The C sources of a component: its equations, translated, and its ports, as tables."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from textwrap import wrap

from auv_fmu import euler
from fmus.native.functions import function_in_c
from fmus.native.glue import glue
from fmus.native.layout import LINE_WIDTH
from fmus.native.program import Program
from fmus.native.shapes import in_c
from fmus.ports.definition import Definition
from fmus.ports.port import FAULT, H_MAX, Port, Value

_HEAD = """\
/* {title}
 *
 * Translated from the Python text of its equations, function by function, in the order in which
 * they need each other. A name begins with the module that the function stands in.{citation}
 */
#include "arithmetic.h"
"""


@cache
def translated(definition: Definition) -> str:
    """The equations of a component, and the functions that the component calls.

    Raises:
        Untranslatable: its text is outside the language of equations.

    """
    program = Program(function_in_c)
    calls = glue(program, definition.behaviour)
    citation = "".join(f"\n * {line}" for line in wrap(definition.origin.citation, LINE_WIDTH - 3))
    sections = [
        _HEAD.format(title=definition.summary, citation=citation),
        *program.structures.values(),
        *program.constants.values(),
        *(function.text for function in program.functions.values()),
        calls,
    ]
    return "\n\n".join(sections) + "\n"


_PORTS_HEAD = f"""\
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


def tables(definition: Definition) -> str:
    """The file ports.h of a component."""
    ports = (*definition.ports, FAULT)
    places = {FAULT.name: "0", H_MAX.name: "PARAMETER_AT(h_max)"}
    for name, path in definition.parameters.paths.items():
        places[name] = f"PARAMETER_AT(model.{_member(path)})"
    references = {
        causality: [i for i, port in enumerate(definition.ports) if port.causality == causality]
        for causality in ("input", "output")
    }
    real_inputs = sum(ports[i].type == "Real" for i in references["input"])
    for found in references.values():
        places |= {ports[reference].name: str(place) for place, reference in enumerate(found)}
    rows = "".join(f"    {{{_row(port, places)}}},\n" for port in ports)
    return "\n".join(
        (
            _PORTS_HEAD,
            *(_choices(port) for port in ports if port.choices),
            f"static const port ports[] = {{\n{rows}}};\n",
            f"enum {{ N_PORTS = {len(ports)}, REAL_INPUTS = {real_inputs} }};\n",
            *(_references(causality, found) for causality, found in references.items()),
        )
    )


def _member(path: Sequence[str | int]) -> str:
    """The member of a structure: a tuple of Python is one with an array `v`."""
    first, *rest = path
    names = (f".v[{part}]" if isinstance(part, int) else f".{in_c(part)}" for part in rest)
    return in_c(str(first)) + "".join(names)


def _row(port: Port, places: Mapping[str, str]) -> str:
    choices = _choices_name(port) if port.choices else "NULL"
    return ", ".join(
        (
            f'"{port.name}"',
            port.type.upper(),
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
    return f"choices_of_{re.sub(r'[^A-Za-z0-9]', '_', port.name)}"


def _choices(port: Port) -> str:
    rows = ", ".join(f'{{"{text}", {number:d}}}' for text, number in port.choices.items())
    return f"static const choice {_choices_name(port)}[] = {{{rows}}};\n"


def _references(causality: str, places: Sequence[int]) -> str:
    """The value references of the ports of a causality; C has no empty arrays."""
    numbers = ", ".join(f"FIRST_REFERENCE + {place}" for place in places or [0])
    return f"static const uint32_t {causality}_references[] = {{{numbers}}};\n"
