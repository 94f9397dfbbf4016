"""The equations of a component in C, translated, with the glue by which the runtime calls them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from string import Formatter
from textwrap import wrap

from fmus.native.flat import Passage, count, passage
from fmus.native.functions import function_in_c
from fmus.native.layout import LINE_WIDTH, laid_out, quoted
from fmus.native.program import Function, Program, Untranslatable
from fmus.native.shapes import Shape, Structure, closed, in_c
from fmus.native.stack import NUMBER, deepest
from fmus.ports.behaviour import Behaviour
from fmus.ports.definition import Definition

_HEAD = """\
/* {title}
 *
 * Translated from the Python text of its equations, function by function, in the order in which
 * they need each other. A name begins with the module that the function stands in.{citation}
 */
#include "arithmetic.h"
"""

#: Bytes that the equations may take of a thread's stack, of which macOS gives 512 kB: the host and
#: the runtime take some, too.
_MOST_ON_STACK = 384 * 1024

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
        _HEAD.format(title=closed(definition.summary), citation=closed(citation)),
        *program.structures.values(),
        *program.constants.values(),
        *(function.text for function in program.functions.values()),
        glue,
    ]
    text = "\n\n".join(sections) + "\n"
    bytes_on_stack, name = deepest(text)
    if bytes_on_stack > _MOST_ON_STACK:
        raise Untranslatable(
            f"{name.removeprefix('model_')} and the functions that it calls hold "
            f"{bytes_on_stack // NUMBER} numbers at once; C takes at most "
            f"{_MOST_ON_STACK // NUMBER}, which lie on a thread's stack"
        )
    return text


def _glue(program: Program, said: Behaviour) -> str:
    """The functions `model_...`, in which the component finds all hooks, also those it has not."""
    functions = {name: program.function(hook) for name, hook in said.hooks.items() if hook}
    passages = {
        what: passage(program, what, program.shape(hint), what == "state")
        for what, hint in (
            ("inputs", said.inputs), ("outputs", said.outputs), ("state", said.state),
        )
    }  # fmt: skip
    state, outputs = passages["state"], passages["outputs"]
    given = {
        "parameters": "*parameters",
        "inputs": passages["inputs"].got("*inputs", "inputs"),
        "outputs": outputs.got("*outputs", "outputs"),
        "state": state.got("state->state", "state->state"),
        "derived": "state->derived",
    }
    calls = {
        name: function.call([given.get(argument, argument) for argument in function.arguments])
        for name, function in functions.items()
    }
    derive = [f"state->derived = {calls['derive']};"] if said.derived else []
    restart: list[str] = []
    if said.restarted:
        restart = [state.put("state->state", "state->state", calls["restarted"]), *derive]
    steps = f"{_P}, {_S}, {_I}, double t, double h, int n, {_O}, {_E}"
    expects = f"{_P}, const {_S}, const {_O}, model_outputs *expected, {_E}"
    expected = ["*expected = *outputs;"]
    if "expected" in calls:
        expected = [outputs.put("*expected", "expected", calls["expected"])]
    # A negative seed is the number 2^32 above it.
    seed = [f"return (unsigned int){calls.get('seed', 0)};"]
    parts = [
        f"enum {{ MODEL_EXPECTS = {int('expected' in calls)}, MODEL_DRAWS = {said.draws} }};\n"
        f"#define MODEL_RESTARTED {quoted(_directives(said.restarted))}",
        _defined(
            "void begin",
            f"{_P}, {_I}, double t, {_S}, {_O}, {_E}",
            _moved(said, passages, functions["begin"], calls["begin"]),
        ),
        _defined(
            "void advance",
            steps,
            _moved(said, passages, functions["advance"], calls["advance"]),
        ),
        _defined("void check", f"{_P}, {_E}", [f"{calls['check']};"] if "check" in calls else []),
        _defined("void derive", f"{_P}, {_S}, {_E}", derive),
        _defined("void expected", expects, expected),
        _defined(
            "int credible", f"{_P}, const {_S}, {_I}, {_E}", [f"return {calls.get('credible', 1)};"]
        ),
        _defined("void restart", f"{_P}, {_S}, {_I}, {_E}", restart),
        _defined("unsigned long seed", f"{_P}, {_E}", seed),
        _defined(
            "void measure",
            f"{_P}, const double draws[], {_O}, {_E}",
            _measured(said, outputs, functions["measured"]) if said.noisy else [],
        ),
    ]
    text = "\n\n".join(parts)
    # One that nothing calls would be a warning.
    moving = [
        function
        for form in passages.values()
        for name, function in zip((form.gather, form.scatter), form.functions)
        if re.search(rf"\b{name}\(", text)
    ]
    head = ["/* What the component calls. */", _types(program, said, passages), *moving]
    return "\n\n".join([*head, text])


def _directives(text: str) -> str:
    """A text for `str.format` that names the time, as one for `compose`."""
    return "".join(
        before.replace("%", "%%") + ("" if name is None else f"%{form or 'r'}")
        for before, name, form, _ in Formatter().parse(text)
    )


def _types(program: Program, said: Behaviour, passages: dict[str, Passage]) -> str:
    inputs, outputs, state = (
        "".join((before, " ", name, after))
        for name, (before, after) in (
            ("model_inputs", passages["inputs"].declaration),
            ("model_outputs", passages["outputs"].declaration),
            ("state", passages["state"].declaration),
        )
    )
    numbers = [count(program.shape(hint)) for hint in (said.inputs, said.outputs, said.state)]
    derived = f"    {program.shape(said.derived).name} derived;\n" if said.derived else ""
    return (
        f"typedef {program.shape(said.parameters).name} model_parameters;\n"
        f"typedef {inputs};\n"
        f"typedef {outputs};\n"
        f"typedef struct {{\n    {state};\n{derived}}} model_state;\n\n"
        f"enum {{ MODEL_INPUTS = {numbers[0]}, "
        f"MODEL_OUTPUTS = {numbers[1]}, MODEL_STATE = {numbers[2]} }};"
    )


def _moved(
    said: Behaviour, passages: dict[str, Passage], function: Function, call: str
) -> list[str]:
    """What takes over the state and the outputs that a function gives."""
    assert isinstance(function.returns, Structure)
    if said.is_stateless:
        nothing = "memset(state, 0, sizeof *state);"
        return [passages["outputs"].put("*outputs", "outputs", call), nothing]
    (state, _), *derived, (outputs, _) = function.returns.parts
    return [
        f"const {function.returns.name} result = {call};",
        passages["state"].put("state->state", "state->state", f"result{state}"),
        *(f"state->derived = result{part};" for part, _ in derived),
        passages["outputs"].put("*outputs", "outputs", f"result{outputs}"),
    ]


def _measured(said: Behaviour, outputs: Passage, function: Function) -> list[str]:
    """What gives a group of outputs its noise."""
    shape = function.arguments["n"]
    n = _drawn(shape, map("draws[{}]".format, range(said.draws)))
    if isinstance(shape, Structure):
        n = f"({shape.name}){n}"
    where = "groups." if outputs.gather else "outputs->"
    group = f"{where}{in_c(said.noisy)}"
    given = {"parameters": "*parameters", "n": n, said.noisy: group}
    change = f"{group} = {function.call([given[name] for name in function.arguments])};"
    if not outputs.gather:
        return [change]
    return [
        f"{outputs.type} groups = {outputs.got('', 'outputs')};",
        change,
        outputs.put("", "outputs", "groups"),
    ]


def _drawn(shape: Shape, draws: Iterator[str]) -> str:
    """The next numbers in a shape, as an initializer."""
    if not isinstance(shape, Structure):
        return next(draws)
    parts = ", ".join(_drawn(part, draws) for _, part in shape.parts)
    return f"{{{{{parts}}}}}" if shape.is_array else f"{{{parts}}}"


def _defined(name: str, arguments: str, body: list[str]) -> str:
    """A function with what it returns before its name; arguments it does not use are marked so."""
    returns, _, name = name.rpartition(" ")
    text = " ".join(body)
    names = [argument.rstrip("[]").split()[-1].lstrip("*") for argument in arguments.split(", ")]
    unused = [f"(void){n};" for n in names if not re.search(rf"\b{n}\b", text)]
    lines = [line for part in (*unused, *body) for line in laid_out(part, "    ")]
    return "\n".join([*laid_out(f"static {returns} model_{name}({arguments}) {{", ""), *lines, "}"])
