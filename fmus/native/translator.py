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
from fmus.ports.groups import Nothing

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
    "const model_state *state",
    "const model_inputs *inputs",
)
_D, _O, _E = "const model_derived *derived", "model_outputs *outputs", "Error *error"
_NEXT = "model_state *state"


#: What the runtime asks of hooks: whether they take an argument.
_TAKES = {
    "OUTPUTS_TAKE_PARAMETERS": ("outputs", "parameters"),
    "OUTPUTS_TAKE_DERIVED": ("outputs", "derived"),
    "OUTPUTS_TAKE_INPUTS": ("outputs", "inputs"),
    "OUTPUTS_TAKE_TIME": ("outputs", "t"),
    "UPDATE_TAKES_DERIVED": ("update", "derived"),
    "DERIVE_TAKES_STATE": ("derive", "state"),
    "DERIVE_TAKES_INPUTS": ("derive", "inputs"),
    "DERIVE_TAKES_TIME": ("derive", "t"),
}


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
    given = {
        "parameters": "*parameters",
        "inputs": passages["inputs"].got("inputs"),
        "state": passages["state"].got("state"),
        "derived": "*derived",
    }
    calls = {
        name: function.call([given.get(argument, argument) for argument in function.arguments])
        for name, function in functions.items()
    }

    def put(what: str, hook: str) -> list[str]:
        """What hands the result of a hook over."""
        return [passages[what].put(what, calls[hook])] if hook in calls else []

    # A negative seed is the number 2^32 above it.
    seed = [f"return (unsigned int){calls.get('seed', 0)};"]
    credible = [f"return {calls.get('credible', 1)};"]
    derive = [f"*derived = {calls['derive']};"] if said.derived else []
    measure = _measured(said, passages["outputs"], functions["measured"]) if said.noisy else []
    parts = [
        _constants(said),
        _defined("void check", f"{_P}, {_E}", _statement(calls, "check")),
        _defined("void check_state", f"{_P}, {_S}, {_E}", _statement(calls, "check_state")),
        _defined("unsigned long seed", f"{_P}, {_E}", seed),
        _defined("void start", f"{_P}, {_I}, double t, {_NEXT}, {_E}", put("state", "start")),
        _defined("int credible", f"{_P}, {_S}, {_I}, {_E}", credible),
        _defined("void restart", f"{_P}, {_NEXT}, {_I}, {_E}", put("state", "restarted")),
        _defined(
            "void derive", f"{_P}, {_S}, {_I}, double t, model_derived *derived, {_E}", derive
        ),
        _defined(
            "void evaluate", f"{_P}, {_S}, {_D}, {_I}, double t, {_O}, {_E}",
            put("outputs", "outputs"),
        ),
        _defined(
            "void update", f"{_P}, {_NEXT}, {_D}, {_I}, double t, double h, {_E}",
            put("state", "update"),
        ),
        _defined("void measure", f"{_P}, const double draws[], {_O}, {_E}", measure),
    ]  # fmt: skip
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


def _statement(calls: dict[str, str], hook: str) -> list[str]:
    """The call of a hook that returns nothing."""
    return [f"{calls[hook]};"] if hook in calls else []


def _constants(said: Behaviour) -> str:
    """What follows from the hooks before any of them is called."""
    constants = {
        "DRAWS": said.draws,
        "SAMPLED": said.is_sampled,
        "HAS_GUARD": said.hooks["credible"] is not None,
        **{name: said.takes(*question) for name, question in _TAKES.items()},
    }
    rows = "".join(f"    MODEL_{name} = {int(value)},\n" for name, value in constants.items())
    return f"enum {{\n{rows}}};\n#define MODEL_RESTARTED {quoted(_directives(said.restarted))}"


def _directives(text: str) -> str:
    """A text for `str.format` that names the time, as one for `compose`."""
    return "".join(
        before.replace("%", "%%") + ("" if name is None else f"%{form or 'r'}")
        for before, name, form, _ in Formatter().parse(text)
    )


def _types(program: Program, said: Behaviour, passages: dict[str, Passage]) -> str:
    defined = {
        "model_parameters": program.shape(said.parameters).name,
        **{f"model_{what}": passage.declaration for what, passage in passages.items()},
        "model_derived": program.shape(said.derived or Nothing).name,
    }
    hints = {"INPUTS": said.inputs, "OUTPUTS": said.outputs, "STATE": said.state}
    counts = [f"MODEL_{what} = {count(program.shape(hint))}" for what, hint in hints.items()]
    types = "".join(f"typedef {text} {name};\n" for name, text in defined.items())
    return f"{types}\nenum {{ {', '.join(counts)} }};"


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
        f"{outputs.type} groups = {outputs.got('outputs')};",
        change,
        outputs.put("outputs", "groups"),
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
