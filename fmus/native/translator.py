"""The equations of a component in C, with the glue by which the runtime calls them.

The runtime has inputs, outputs and states as arrays of doubles, whatever they are. Where all their
numbers are floats, a structure of the equations is such an array already. Where some are not,
functions that are written here go over it number by number: ints of 32 bits are exact in doubles.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from operator import itemgetter
from string import Formatter
from textwrap import wrap

from fmus.language import tree
from fmus.language.build import Program, Untranslatable
from fmus.language.tree import Call, Expression, Function, Make
from fmus.language.types import (
    FLOAT,
    Array,
    Scalar,
    Type,
    count,
    scalars_in,
    type_of,
)
from fmus.native.emit import LINE_WIDTH, Emitter, closed, lines_of, members, quoted
from fmus.native.names import in_c
from fmus.native.numbers import has_only_doubles, moves
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

#: Bytes that a number takes, alone in a structure.
_NUMBER = 8

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
    said = definition.behaviour
    program = Program(*filter(None, said.hooks.values()))
    groups = (said.parameters, said.inputs, said.outputs, said.state, said.derived or Nothing)
    for group in groups:
        try:
            type_of(group)
        except TypeError as error:
            program.refuse("", str(error))
    program.check()
    bytes_on_stack, deep = deepest(program.functions.values())
    if deep and bytes_on_stack > _MOST_ON_STACK:
        raise Untranslatable(
            f"{deep.name} and the functions that it calls hold "
            f"{bytes_on_stack // _NUMBER} numbers at once; C takes at most "
            f"{_MOST_ON_STACK // _NUMBER}, which lie on a thread's stack"
        )
    emitter = Emitter(program.functions.values())
    glue = _glue(emitter, program, said)
    citation = "".join(f"\n * {line}" for line in wrap(definition.origin.citation, LINE_WIDTH - 3))
    head = _HEAD.format(title=closed(definition.summary), citation=closed(citation))
    return "\n\n".join([head, emitter.text(), glue]) + "\n"


def _glue(emitter: Emitter, program: Program, said: Behaviour) -> str:
    """The functions `model_...`, in which the component finds all hooks, also those it has not."""
    functions = {name: program.function(hook) for name, hook in said.hooks.items() if hook}
    passages = {
        what: _passage(emitter, what, type_of(hint))
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
        name: emitter.call(function, [given.get(name, name) for name in function.arguments])
        for name, function in functions.items()
    }

    alone = {name: [f"{call};"] for name, call in calls.items()}

    def put(what: str, hook: str) -> list[str]:
        """What hands the result of a hook over."""
        return [passages[what].put(what, calls[hook])] if hook in calls else []

    # A negative seed is the number 2^32 above it.
    seed = [f"return (unsigned int){calls.get('seed', 0)};"]
    credible = [f"return {calls.get('credible', 1)};"]
    derive = [f"*derived = {calls['derive']};"] if said.derived else []
    measure = (
        _measured(emitter, said, passages["outputs"], functions["measured"]) if said.noisy else []
    )
    parts = [
        _constants(said),
        _defined("void check", f"{_P}, {_E}", alone.get("check", [])),
        _defined("void check_state", f"{_P}, {_S}, {_E}", alone.get("check_state", [])),
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
    head = ["/* What the component calls. */", _types(emitter, said, passages), *moving]
    return "\n\n".join([*head, text])


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


def _types(emitter: Emitter, said: Behaviour, passages: dict[str, _Passage]) -> str:
    defined = {
        "model_parameters": emitter.type(type_of(said.parameters)),
        **{f"model_{what}": passage.declaration for what, passage in passages.items()},
        "model_derived": emitter.type(type_of(said.derived or Nothing)),
    }
    hints = {"INPUTS": said.inputs, "OUTPUTS": said.outputs, "STATE": said.state}
    counts = [f"MODEL_{what} = {count(type_of(hint))}" for what, hint in hints.items()]
    types = "".join(f"typedef {text} {name};\n" for name, text in defined.items())
    return f"{types}\nenum {{ {', '.join(counts)} }};"


def _measured(
    emitter: Emitter, said: Behaviour, outputs: _Passage, function: Function
) -> list[str]:
    """What gives a group of outputs its noise."""
    type_ = function.arguments["n"]
    n = _drawn(type_, map("draws[{}]".format, range(said.draws)))
    if not isinstance(type_, Scalar):
        n = f"({emitter.type(type_)}){n}"
    where = "groups." if outputs.gather else "outputs->"
    group = f"{where}{in_c(said.noisy)}"
    given = {"parameters": "*parameters", "n": n, said.noisy: group}
    change = f"{group} = {emitter.call(function, [given[name] for name in function.arguments])};"
    if not outputs.gather:
        return [change]
    return [
        f"{outputs.type} groups = {outputs.got('outputs')};",
        change,
        outputs.put("outputs", "groups"),
    ]


def _drawn(type_: Type, draws: Iterator[str]) -> str:
    """The next numbers in a value of a type, as an initializer."""
    if isinstance(type_, Scalar):
        return next(draws)
    parts = ", ".join(_drawn(part, draws) for _, part in members(type_))
    return f"{{{{{parts}}}}}" if isinstance(type_, Array) else f"{{{parts or '0'}}}"


def _defined(name: str, arguments: str, body: list[str]) -> str:
    """A function with what it returns before its name; arguments it does not use are marked so."""
    returns, _, name = name.rpartition(" ")
    text = " ".join(body)
    names = [argument.rstrip("[]").split()[-1].lstrip("*") for argument in arguments.split(", ")]
    unused = [f"(void){n};" for n in names if not re.search(rf"\b{n}\b", text)]
    lines = [line for part in (*unused, *body) for line in lines_of(part, "    ")]
    return "\n".join([*lines_of(f"static {returns} model_{name}({arguments}) {{", ""), *lines, "}"])


@dataclass
class _Passage:
    """How one of them passes between the runtime and the equations.

    Attributes:
        type: of the equations, in C.
        declaration: of the type in the runtime.
        gather, scatter: names of the functions between the two forms; empty: both are the same.
        functions: their texts.

    """

    type: str
    declaration: str
    gather: str = ""
    scatter: str = ""
    functions: Sequence[str] = ()

    def got(self, pointer: str) -> str:
        """The structure of the equations, from where the runtime has it."""
        return f"{self.gather}({pointer}->v)" if self.gather else f"*{pointer}"

    def put(self, pointer: str, value: str) -> str:
        """The statement that hands a structure over to the runtime."""
        if self.scatter:
            return f"{self.scatter}({value}, {pointer}->v);"
        return f"*{pointer} = {value};"


def _passage(emitter: Emitter, what: str, type_: Type) -> _Passage:
    """How inputs, outputs or a state pass; ports have their Reals first, a state has none first."""
    name = emitter.type(type_)
    if has_only_doubles(type_) or not count(type_):
        return _Passage(name, name)
    scalars = [*scalars_in(type_)]
    n = len(scalars)
    places = [*range(n)]
    if what != "state":
        order = sorted(places, key=lambda i: scalars[i] != FLOAT)
        places = [order.index(number) for number in range(n)]
    gather, scatter = f"model_{what}_of", f"model_put_{what}"
    gathered = "\n".join(moves(type_, "it", places, "{member} = {cast}from[{place}];"))
    scattered = "\n".join(moves(type_, "it", places, "to[{place}] = {member};"))
    functions = (
        f"static {name} {gather}(const double from[]) {{\n"
        f"    {name} it;\n{gathered}\n    return it;\n}}",
        f"static void {scatter}({name} it, double to[]) {{\n{scattered}\n}}",
    )
    return _Passage(name, f"struct {{\n    double v[{n}];\n}}", gather, scatter, functions)


def deepest(functions: Iterable[Function]) -> tuple[int, Function | None]:
    """The most bytes that lie on a thread's stack in a call from outside, and the call of what.

    Structures are passed and returned by value, so a function that adds large vectors keeps each
    sum there. Nothing calls itself, and all sizes are fixed: what lies there at most can be added
    up. Compilers that optimise keep no more than this, but for a tenth.

    Args:
        functions: each after those that it calls.

    """
    depths: dict[Function, int] = {}
    for function in functions:
        found = [x for one in tree.statements_in(function.body) for x in tree.expressions_of(one)]
        calls = [x for one in found for x in tree.expressions_in(one) if isinstance(x, Call)]
        own = sum(map(_held, found))
        own += sum(map(_result, tree.variables_in(function.body).values()))
        deeper = max((depths[one.function] for one in calls), default=0)
        depths[function] = _passed(function) + own + deeper
    ends = ((depth + _result(one.returns), one) for one, depth in depths.items())
    return max(ends, key=itemgetter(0), default=(0, None))


def _result(type_: Type) -> int:
    """The bytes of a structure; a number lies in a register."""
    return 0 if isinstance(type_, Scalar) else _NUMBER * count(type_)


def _passed(function: Function) -> int:
    """The bytes of the arguments that a function takes by value."""
    given = function.arguments.items()
    return sum(_result(type_) for name, type_ in given if name != function.by_address)


def _held(one: Expression, within: bool = False) -> int:
    """The bytes of the structures that an expression makes, and that are returned to it."""
    is_made = isinstance(one, Make)
    own = _result(one.type) if isinstance(one, Call) or (is_made and not within) else 0
    return own + sum(_held(part, is_made) for part in one.parts)
