"""The ports of a component in C, as tables, and the types of its state's numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import IntEnum
from itertools import groupby
from typing import Any

from auv_fmu.paper import euler
from fmus.language.types import Record, Type, type_of
from fmus.native.emit import members, quoted
from fmus.ports.definition import Definition
from fmus.ports.description import variables_of
from fmus.ports.exchange import places_of_states
from fmus.ports.groups import is_class, reals_first, scalars_of
from fmus.ports.port import FAULT, H_MAX, Port

_HEAD = f"""\
/* The ports; the index in the first table follows from the value reference.
 *
 * Generated from the declaration of the ports. The columns are name, type, causality, variability,
 * place of the value, start, minimum, maximum, choices. The place of an input or output is its
 * index among them, Reals first.
 */
#include <float.h>
#include <stddef.h>

/* From auv_fmu/paper/euler.py. */
static const double ROUNDING = {euler.ROUNDING!r};
static const double LARGEST_STATE = {euler.LARGEST_STATE!r};
static const double MOST_INTERNAL_STEPS = {float(euler.MOST_INTERNAL_STEPS)!r};

#define PARAMETER_AT(member) offsetof(parameter_values, member)
"""

#: Types of the state's numbers in C, by their types in Python.
_TYPES = {float: "REAL", int: "INTEGER", bool: "BOOLEAN"}


def tables(definition: Definition, arrays: bool = False) -> str:
    """Write the file ports.h of a component."""
    behaviour = definition.behaviour
    places = places_of(definition, "model") | {H_MAX: "PARAMETER_AT(h_max)"}
    continuous = places_of_states(behaviour)
    return port_tables(definition.ports, places, scalars_of(behaviour.state), arrays, continuous)


def places_of(definition: Definition, owner: str) -> dict[str, str]:
    """Return the places of parameters but `h_max`, by name, in a member of a structure."""
    type_ = type_of(definition.behaviour.parameters)
    paths = definition.parameters.paths.items()
    return {name: f"PARAMETER_AT({owner}{_member(type_, path)})" for name, path in paths}


def port_tables(
    ports: Sequence[Port],
    parameters: Mapping[str, str],
    state: Iterable[Any],
    arrays: bool = False,
    continuous: Sequence[int] = (),
) -> str:
    """Write the file ports.h.

    Args:
        ports: all ports but `fault`.
        parameters: places of the parameters.
        state: types of the state's numbers.
        arrays: True if vectors and matrices of one unit are array variables.
        continuous: places of the continuous states among the numbers.

    """
    values = {
        causality: reals_first([port for port in ports if port.causality == causality])
        for causality in ("input", "output")
    }
    places = {FAULT.name: "0", **parameters}
    for some in values.values():
        places |= {port.name: str(place) for place, port in enumerate(some)}
    ports = (*ports, FAULT)
    names = names_of_choices(ports)
    rows = "".join(f"    {{{_row(port, places, names)}}},\n" for port in ports)
    return "\n".join(
        (
            _HEAD,
            *(_choices(names[port.name], port.choices) for port in ports if port.choices),
            f"static const port ports[] = {{\n{rows}}};\n",
            f"enum {{ N_PORTS = {len(ports)} }};\n",
            *(_arrays(ports) if arrays else ()),
            *(_references(causality, some, ports) for causality, some in values.items()),
            *_counts(values),
            *_state(state),
            _continuous(continuous),
        )
    )


def _arrays(ports: Sequence[Port]) -> Iterator[str]:
    """Write the number of elements for each value reference, which is 1 for a scalar."""
    sizes = [1] * len(ports)
    for reference, _, elements in variables_of(ports, arrays=True):
        sizes[reference - 1] = len(elements)
    yield f"#define ARRAYS\nstatic const size_t elements[] = {{{', '.join(map(str, sizes))}}};\n"


def _member(type_: Type, path: Sequence[str | int]) -> str:
    """Return the member of a structure at a path."""
    text = ""
    for step in path:
        place = step
        if isinstance(place, str):
            assert isinstance(type_, Record)
            place = [name for name, _ in type_.fields].index(place)
        suffix, type_ = members(type_)[place]
        text += suffix
    return text


def _row(port: Port, places: Mapping[str, str], names: Mapping[str, str]) -> str:
    return ", ".join(
        (
            quoted(port.name),
            port.type.upper(),
            port.causality.upper(),
            port.variability.upper(),
            places[port.name],
            "0.0" if port.start is None else repr(float(port.start)),
            "-DBL_MAX" if port.minimum is None else repr(float(port.minimum)),
            "DBL_MAX" if port.maximum is None else repr(float(port.maximum)),
            names[port.name] if port.choices else "NULL",
            str(len(port.choices)),
        )
    )


def names_of_choices(ports: Sequence[Port]) -> dict[str, str]:
    """Return unique names of the tables of choices, by the names of ports."""
    names: dict[str, str] = {}
    for port in filter(lambda port: port.choices, ports):
        name = f"choices_of_{re.sub('[^A-Za-z0-9]', '_', port.name)}"
        while name in names.values():
            name += "_"
        names[port.name] = name
    return names


def _choices(name: str, choices: Mapping[str, Any]) -> str:
    rows = ", ".join(f"{{{quoted(text)}, {number:d}}}" for text, number in choices.items())
    return f"static const choice {name}[] = {{{rows}}};\n"


def _references(causality: str, values: Sequence[Port], ports: Sequence[Port]) -> str:
    """Write the value references of a causality in the order of values; C has no empty arrays."""
    places = {port.name: place for place, port in enumerate(ports)}
    chosen = [places[port.name] for port in values] or [0]
    numbers = ", ".join(f"FIRST_REFERENCE + {place}" for place in chosen)
    return f"static const uint32_t {causality}_references[] = {{{numbers}}};\n"


def _counts(values: Mapping[str, Sequence[Port]]) -> Iterator[str]:
    """Write the numbers of Reals, and whether a Real input has a range."""
    reals = {
        causality: [port for port in some if port.type == "Real"]
        for causality, some in values.items()
    }
    ranged = any((port.minimum, port.maximum) != (None, None) for port in reals["input"])
    yield (
        f"enum {{ REAL_INPUTS = {len(reals['input'])}, REAL_OUTPUTS = {len(reals['output'])}, "
        f"INPUTS_HAVE_RANGES = {int(ranged)} }};\n"
    )


def _continuous(places: Sequence[int]) -> str:
    """Write the places of the continuous states in the state; C has no empty arrays."""
    numbers = ", ".join(map(str, places or [0]))
    declared = f"static const size_t continuous[] = {{{numbers}}};"
    return f"\n/* Places of the continuous states. */\n{declared}\n"


def _state(scalars: Iterable[Any]) -> Iterator[str]:
    """Write the types of a state's numbers, in order."""
    runs = [(scalar, len([*same])) for scalar, same in groupby(scalars)]
    rows: list[str] = []
    enumerations: dict[Any, str] = {}
    for scalar, n in runs:
        if is_class(scalar, IntEnum):
            members = enumerations.setdefault(scalar, f"members_{len(enumerations)}")
            known = f"{quoted(scalar.__name__)}, {members}, {len(scalar)}"
            rows.append(f"{{INTEGER, {n}, {known}}}")
        else:
            rows.append(f"{{{_TYPES[scalar]}, {n}, NULL, NULL, 0}}")
    for scalar, members in enumerations.items():
        yield _choices(members, {member.name: member for member in scalar})
    # C has no empty arrays.
    rows = rows or ["{REAL, 0, NULL, NULL, 0}"]
    yield f"static const numbers state_numbers[] = {{{', '.join(rows)}}};\n"
    yield f"enum {{ N_STATE_NUMBERS = {len(rows)} }};\n"
