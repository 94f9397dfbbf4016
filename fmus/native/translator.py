"""The C sources of a component: its equations, translated, and its ports, as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from textwrap import wrap

from auv_fmu import euler
from fmus.native.functions import function_in_c
from fmus.native.layout import LINE_WIDTH, laid_out
from fmus.native.program import Function, Program
from fmus.native.shapes import Structure, count_numbers
from fmus.ports.behaviour import Behaviour
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

#: What stands for the arguments of a behaviour's functions in them.
_GIVEN = {
    "parameters": "*parameters",
    "inputs": "*inputs",
    "outputs": "*outputs",
    "state": "state->state",
    "derived": "state->derived",
}

_P, _S, _I = (
    "const model_parameters *parameters",
    "model_state *state",
    "const model_inputs *inputs",
)
_O, _E = "model_outputs *outputs", "Error *error"


@cache
def translated(definition: Definition) -> str:
    """The equations of a component, and the functions that the component calls.

    Raises:
        Untranslatable: its text is outside the language of equations.

    """
    program = Program(function_in_c)
    glue = _glue(program, definition.behaviour)
    citation = "".join(f"\n * {line}" for line in wrap(definition.origin.citation, LINE_WIDTH - 3))
    sections = [
        _HEAD.format(title=definition.summary, citation=citation),
        *program.structures.values(),
        *program.constants.values(),
        *(function.text for function in program.functions.values()),
        glue,
    ]
    return "\n\n".join(sections) + "\n"


def _glue(program: Program, said: Behaviour) -> str:
    """The functions `model_...`, in which the component finds all hooks, also those it has not."""
    functions = {name: program.function(hook) for name, hook in said.hooks.items() if hook}
    calls = {
        name: function.call([_GIVEN.get(argument, argument) for argument in function.arguments])
        for name, function in functions.items()
    }
    derive = [f"state->derived = {calls['derive']};"] if said.derived else []
    restart = [f"state->state = {calls['restarted']};", *derive] if said.restarted else []
    steps = f"{_P}, {_S}, {_I}, double t, double h, int n, {_O}, {_E}"
    expects = f"{_P}, const {_S}, const {_O}, model_outputs *expected, {_E}"
    expected = [f"*expected = {calls.get('expected', '*outputs')};"]
    # A negative seed is the number 2^32 above it.
    seed = [f"return (unsigned int){calls.get('seed', 0)};"]
    restarted = said.restarted.replace("{t:g}", "%g")
    parts = [
        "/* What the component calls. */",
        _types(program, said),
        f"enum {{ MODEL_EXPECTS = {int('expected' in calls)}, MODEL_DRAWS = {said.draws} }};\n"
        f'#define MODEL_RESTARTED "{restarted}"',
        _defined(
            "void begin",
            f"{_P}, {_I}, double t, {_S}, {_O}, {_E}",
            _moved(said, functions["begin"], calls["begin"]),
        ),
        _defined("void advance", steps, _moved(said, functions["advance"], calls["advance"])),
        _defined("void check", f"{_P}, {_E}", [f"{calls['check']};"] if "check" in calls else []),
        _defined("void derive", f"{_P}, {_S}, {_E}", derive),
        _defined("void expected", expects, expected),
        _defined(
            "int credible", f"{_P}, const {_S}, {_I}, {_E}", [f"return {calls.get('credible', 1)};"]
        ),
        _defined("void restart", f"{_P}, {_S}, {_I}, {_E}", restart),
        _defined("unsigned long seed", _P, seed),
        _defined(
            "void measure",
            f"{_P}, const double draws[], {_O}",
            _measured(said, functions["measured"]) if said.noisy else [],
        ),
    ]
    return "\n\n".join(parts)


def _types(program: Program, said: Behaviour) -> str:
    types = (said.parameters, said.inputs, said.outputs, said.state)
    parameters, inputs, outputs, state = map(program.shape, types)
    derived = f"    {program.shape(said.derived).name} derived;\n" if said.derived else ""
    return (
        f"typedef {parameters.name} model_parameters;\n"
        f"typedef {inputs.name} model_inputs;\n"
        f"typedef {outputs.name} model_outputs;\n"
        f"typedef struct {{\n    {state.name} state;\n{derived}}} model_state;\n\n"
        f"enum {{ MODEL_INPUTS = {count_numbers(inputs)}, "
        f"MODEL_OUTPUTS = {count_numbers(outputs)}, MODEL_STATE = {count_numbers(state)} }};"
    )


def _moved(said: Behaviour, function: Function, call: str) -> list[str]:
    """What takes over the state and the outputs that a function gives."""
    assert isinstance(function.returns, Structure)
    names = ["state->state", *(["state->derived"] if said.derived else []), "*outputs"]
    return [
        f"const {function.returns.name} result = {call};",
        *(f"{name} = result{part};" for name, (part, _) in zip(names, function.returns.parts)),
    ]


def _measured(said: Behaviour, function: Function) -> list[str]:
    """What gives a group of outputs its noise."""
    group = f"outputs->{said.noisy}"
    drawn = ", ".join(f"draws[{i}]" for i in range(said.draws))
    n = f"({function.arguments['n'].name}){{{{{drawn}}}}}"
    given = {**_GIVEN, "n": n, said.noisy: group}
    return [f"{group} = {function.call([given[name] for name in function.arguments])};"]


def _defined(name: str, arguments: str, body: list[str]) -> str:
    """A function with what it returns before its name; arguments it does not use are marked so."""
    returns, _, name = name.rpartition(" ")
    text = " ".join(body)
    names = [argument.rstrip("[]").split()[-1].lstrip("*") for argument in arguments.split(", ")]
    unused = [f"(void){n};" for n in names if n != "error" and not _uses(text, n)]
    if "Error" in arguments and "error" not in text:
        unused.append("(void)error;")
    lines = [line for part in (*unused, *body) for line in laid_out(part, "    ")]
    return "\n".join([*laid_out(f"static {returns} model_{name}({arguments}) {{", ""), *lines, "}"])


def _uses(text: str, name: str) -> bool:
    separated = "".join(c if c.isalnum() or c == "_" else " " for c in text)
    return name in separated.split()


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
        causality: [
            i for i, port in enumerate(ports) if (port.causality, port.type) == (causality, "Real")
        ]
        for causality in ("input", "output")
    }
    for found in references.values():
        places |= {ports[reference].name: str(place) for place, reference in enumerate(found)}
    rows = "".join(f"    {{{_row(port, places)}}},\n" for port in ports)
    return "\n".join(
        (
            _PORTS_HEAD,
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
    return f"choices_of_{port.name.replace('.', '_')}"


def _choices(port: Port) -> str:
    rows = ", ".join(f'{{"{text}", {number}}}' for text, number in port.choices.items())
    return f"static const choice {_choices_name(port)}[] = {{{rows}}};\n"


def _references(causality: str, places: Sequence[int]) -> str:
    """The value references of the Real ports of a causality; C has no empty arrays."""
    numbers = ", ".join(f"FIRST_REFERENCE + {place}" for place in places or [0])
    return f"static const uint32_t {causality}_references[] = {{{numbers}}};\n"
