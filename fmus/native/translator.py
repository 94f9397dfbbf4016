"""The equations of a component in C, and the functions by which the runtime calls them.

In the runtime, inputs, outputs and states are arrays of doubles. A structure whose numbers are all
floats has the same layout. Other structures are converted by generated functions, one number after
another; ints of 32 bits are exact in doubles.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from operator import itemgetter
from string import Formatter
from textwrap import wrap
from typing import NamedTuple

from fmus.language import tree
from fmus.language.build import Program, Untranslatable
from fmus.language.tree import Call, Expression, Function, Make
from fmus.language.types import (
    FLOAT,
    Scalar,
    Type,
    count,
    scalars_in,
    type_of,
)
from fmus.native.emit import LINE_WIDTH, Emitter, closed, lines_of, quoted
from fmus.native.names import in_c
from fmus.native.pieces import function, has_only_doubles, initializer, moves
from fmus.ports.behaviour import Behaviour
from fmus.ports.definition import Definition
from fmus.ports.groups import Nothing, count_values

_HEAD = """\
/* {title}
 *
 * Translated from the Python source of its equations, function by function; each function follows
 * those that it calls. A name begins with the name of the function's module.{citation}
 */
#include "arithmetic.h"
"""

#: Bytes on a thread's stack for the equations. The stack has 512 kB on macOS, and the host and the
#: runtime need some, too.
MOST_ON_STACK = 384 * 1024

#: Size of a number in a structure [bytes].
_NUMBER = 8

_P, _S, _I = (
    "const model_parameters *parameters",
    "const model_state *state",
    "const model_inputs *inputs",
)
_D, _O, _E = "const model_derived *derived", "model_outputs *outputs", "Error *error"
_NEXT, _SCRATCH = "model_state *state", "model_derived *derived"


#: Constants for the runtime that are true if a hook takes an argument.
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

#: All constants for the runtime: also the number of random numbers, whether outputs are sampled,
#: whether a state may be replaced, whether an update checks its own result, and for model exchange
#: the numbers of rates and of event indicators, and whether events change the state.
_ASKED = (
    "DRAWS", "SAMPLED", "HAS_GUARD", "CHECKS_STATES", "RATES", "SWITCHES", "HAS_EVENT", *_TAKES,
)  # fmt: skip

#: Functions for the runtime: result, arguments, and the body if a component has no such hook.
_CALLED = {
    "check": ("void", f"{_P}, {_E}", ()),
    "check_state": ("void", f"{_P}, {_S}, {_E}", ()),
    "seed": ("unsigned long", f"{_P}, {_E}", ("return (unsigned int)0;",)),
    "start": ("void", f"{_P}, {_I}, double t, {_NEXT}, {_E}", ()),
    "credible": ("int", f"{_P}, {_S}, {_I}, {_E}", ("return 1;",)),
    "restart": ("void", f"{_P}, {_NEXT}, {_I}, {_E}", ()),
    "derive": ("void", f"{_P}, {_S}, {_I}, double t, {_SCRATCH}, {_E}", ()),
    "evaluate": ("void", f"{_P}, {_S}, {_D}, {_I}, double t, {_O}, {_E}", ()),
    "update": ("void", f"{_P}, {_NEXT}, {_SCRATCH}, {_I}, double t, double h, {_E}", ()),
    "measure": ("void", f"{_P}, const double draws[], {_O}, {_E}", ()),
    "rates": ("void", f"{_P}, {_S}, {_D}, {_I}, double t, double rates[], {_E}", ()),
    "switches": ("void", f"{_P}, {_S}, {_D}, {_I}, double t, double switches[], {_E}", ()),
    "event": ("void", f"{_P}, {_NEXT}, {_D}, {_I}, double t, {_E}", ()),
}  # fmt: skip


class Translation(NamedTuple):
    """The equations of a component in C.

    Attributes:
        text: the file equations.c.
        program: trees of its hooks.
        emitter: emitter of the equations.
        passages: conversions of inputs, outputs and state.

    """

    text: str
    program: Program
    emitter: Emitter
    passages: Mapping[str, Passage]


def translated(definition: Definition) -> str:
    """Return the file equations.c of a component.

    Raises:
        Untranslatable: its text is outside the language of equations.

    """
    return translation(definition).text


@cache
def translation(definition: Definition) -> Translation:
    """Translate the equations of a component, and add the functions for the runtime.

    Raises:
        Untranslatable: its text is outside the language of equations.

    """
    behaviour = definition.behaviour
    program = Program(*filter(None, behaviour.hooks.values()))
    groups = (
        behaviour.parameters,
        behaviour.inputs,
        behaviour.outputs,
        behaviour.state,
        behaviour.derived or Nothing,
    )
    for group in groups:
        try:
            type_of(group)
        except TypeError as error:
            program.refuse("", str(error))
    program.check()
    bytes_on_stack, deep = deepest(program.functions.values())
    if deep and bytes_on_stack > MOST_ON_STACK:
        raise Untranslatable(
            f"{deep.name} and the functions that it calls hold "
            f"{bytes_on_stack // _NUMBER} numbers at once; C takes at most "
            f"{MOST_ON_STACK // _NUMBER}, since they are on a thread's stack"
        )
    emitter = Emitter(program.functions.values())
    passages = {
        what: _passage(emitter, what, type_of(hint))
        for what, hint in (
            ("inputs", behaviour.inputs),
            ("outputs", behaviour.outputs),
            ("state", behaviour.state),
        )
    }
    glue = _glue(emitter, program, behaviour, passages)
    citation = "".join(f"\n * {line}" for line in wrap(definition.origin.citation, LINE_WIDTH - 3))
    head = _HEAD.format(title=closed(definition.summary), citation=closed(citation))
    text = "\n\n".join([head, emitter.text(), glue]) + "\n"
    return Translation(text, program, emitter, passages)


def _glue(
    emitter: Emitter, program: Program, behaviour: Behaviour, passages: Mapping[str, Passage]
) -> str:
    """Write the functions `model_...`, which the runtime calls, also for missing hooks."""
    functions = {name: program.function(hook) for name, hook in behaviour.hooks.items() if hook}
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
        """Return the statement that stores the result of a hook."""
        return [passages[what].put(what, calls[hook])] if hook in calls else []

    bodies = {
        **{name: alone.get(name, []) for name in ("check", "check_state")},
        "start": put("state", "start"),
        "restart": put("state", "restarted"),
        "derive": [f"*derived = {calls['derive']};"] if behaviour.derived else [],
        "evaluate": put("outputs", "outputs"),
        "update": put("state", "update"),
        "event": put("state", "event"),
    }
    for what, made in (("rates", behaviour.rates), ("switches", behaviour.switches)):
        if made is not None:
            type_ = type_of(made)
            moved = moves(type_, "it", range(count(type_)), f"{what}[{{place}}] = {{member}};")
            bodies[what] = [f"{emitter.type(type_)} it = {calls[what]};", *moved]
    if "seed" in calls:
        # The cast adds 2^32 to a negative seed.
        bodies["seed"] = [f"return (unsigned int){calls['seed']};"]
    if "credible" in calls:
        bodies["credible"] = [f"return {calls['credible']};"]
    if behaviour.noisy:
        bodies["measure"] = _measured(
            emitter, behaviour, passages["outputs"], functions["measured"]
        )
    parts = [_constants(behaviour), *defined(bodies)]
    text = "\n\n".join(parts)
    # Compilers warn of static functions that are not called.
    moving = [
        function
        for form in passages.values()
        for name, function in zip((form.gather, form.scatter), form.functions)
        if re.search(rf"\b{name}\(", text)
    ]
    head = ["/* The functions for the runtime. */", _types(emitter, behaviour, passages), *moving]
    return "\n\n".join([*head, text])


def _constants(behaviour: Behaviour) -> str:
    """Write the constants that follow from the hooks."""
    numbers = {
        "DRAWS": behaviour.draws,
        "SAMPLED": behaviour.is_sampled,
        "HAS_GUARD": behaviour.hooks["credible"] is not None,
        "RATES": 0 if behaviour.rates is None else count_values(behaviour.rates),
        "SWITCHES": 0 if behaviour.switches is None else count_values(behaviour.switches),
        "HAS_EVENT": behaviour.hooks["event"] is not None,
        **{name: behaviour.takes(*question) for name, question in _TAKES.items()},
    }
    return constants(numbers, _directives(behaviour.restarted))


def constants(numbers: Mapping[str, int], restarted: str = "") -> str:
    """Write the constants for the runtime.

    Args:
        found: constants by name; missing ones are 0.
        restarted: message when a state is replaced, in the format of `compose`.

    """
    rows = "".join(f"    MODEL_{name} = {int(numbers.get(name, 0))},\n" for name in _ASKED)
    return f"enum {{\n{rows}}};\n#define MODEL_RESTARTED {quoted(restarted)}"


def _directives(text: str) -> str:
    """Convert a text with the time from `str.format` to `compose`."""
    return "".join(
        before.replace("%", "%%") + ("" if name is None else f"%{form or 'r'}")
        for before, name, form, _ in Formatter().parse(text)
    )


def _types(emitter: Emitter, behaviour: Behaviour, passages: Mapping[str, Passage]) -> str:
    defined = {
        "model_parameters": emitter.type(type_of(behaviour.parameters)),
        **{f"model_{what}": passage.declaration for what, passage in passages.items()},
        "model_derived": emitter.type(type_of(behaviour.derived or Nothing)),
    }
    hints = {"INPUTS": behaviour.inputs, "OUTPUTS": behaviour.outputs, "STATE": behaviour.state}
    counts = [f"MODEL_{what} = {count(type_of(hint))}" for what, hint in hints.items()]
    types = "".join(f"typedef {text} {name};\n" for name, text in defined.items())
    return f"{types}\nenum {{ {', '.join(counts)} }};"


def _measured(
    emitter: Emitter, behaviour: Behaviour, outputs: Passage, function: Function
) -> list[str]:
    """Return the statements that add noise to a group of outputs."""
    type_ = function.arguments["n"]
    n = initializer(type_, map("draws[{}]".format, range(behaviour.draws)))
    if not isinstance(type_, Scalar):
        n = f"({emitter.type(type_)}){n}"
    where = "groups." if outputs.gather else "outputs->"
    group = f"{where}{in_c(behaviour.noisy)}"
    given = {"parameters": "*parameters", "n": n, behaviour.noisy: group}
    change = f"{group} = {emitter.call(function, [given[name] for name in function.arguments])};"
    if not outputs.gather:
        return [change]
    return [
        f"{outputs.type} groups = {outputs.got('outputs')};",
        change,
        outputs.put("outputs", "groups"),
    ]


def defined(bodies: Mapping[str, Sequence[str]]) -> list[str]:
    """Write the functions for the runtime with their bodies."""
    return [
        runtime_function(returns, name, arguments, bodies.get(name) or idle)
        for name, (returns, arguments, idle) in _CALLED.items()
    ]


def runtime_function(returns: str, name: str, arguments: str, body: Sequence[str]) -> str:
    """Write a function for the runtime; unused arguments are cast to void."""
    names = re.findall(r"(\w+)(?:\[\])?(?=,|$)", arguments)
    head = lines_of(f"static {returns} model_{name}({arguments})", "")
    return function("\n".join(head), body, names)


@dataclass
class Passage:
    """Conversion of inputs, outputs or a state between the runtime and the equations.

    Attributes:
        type: type of the equations, in C.
        declaration: type of the runtime.
        gather, scatter: names of functions that convert; empty if both layouts are the same.
        functions: texts of these functions.

    """

    type: str
    declaration: str
    gather: str = ""
    scatter: str = ""
    functions: Sequence[str] = ()

    def got(self, pointer: str) -> str:
        """Return the expression of the equations' structure from a pointer of the runtime."""
        return f"{self.gather}({pointer}->v)" if self.gather else f"*{pointer}"

    def put(self, pointer: str, value: str) -> str:
        """Return the statement that stores a structure for the runtime."""
        if self.scatter:
            return f"{self.scatter}({value}, {pointer}->v);"
        return f"*{pointer} = {value};"


def _passage(emitter: Emitter, what: str, type_: Type) -> Passage:
    """Return the conversion of inputs, outputs or a state; values of ports have Reals first."""
    name = emitter.type(type_)
    if has_only_doubles(type_) or not count(type_):
        return Passage(name, name)
    scalars = [*scalars_in(type_)]
    n = len(scalars)
    places = [*range(n)]
    if what != "state":
        order = sorted(places, key=lambda i: scalars[i] != FLOAT)
        places = [order.index(number) for number in range(n)]
    gather, scatter = f"model_{what}_of", f"model_put_{what}"
    gathered = moves(type_, "it", places, "{member} = {cast}from[{place}];")
    scattered = moves(type_, "it", places, "to[{place}] = {member};")
    taken = [f"{name} it;", *gathered, "return it;"]
    functions = (
        function(f"static {name} {gather}(const double from[])", taken, ()),
        function(f"static void {scatter}({name} it, double to[])", [*scattered], ()),
    )
    return Passage(name, f"struct {{\n    double v[{n}];\n}}", gather, scatter, functions)


def deepest(
    functions: Iterable[Function],
    shared: Callable[[Function], Collection[str]] = lambda function: {function.by_address},
) -> tuple[int, Function | None]:
    """Return the most bytes on a thread's stack in a call from outside, and the called function.

    Structures are passed and returned by value, so a function that adds large vectors keeps each
    sum on the stack. There is no recursion, and all sizes are fixed, so the sizes can be added.
    Optimising compilers need at most a tenth more.

    Args:
        functions: functions, each after those that it calls.
        shared: returns the arguments and variables of a function that are not copied.

    """
    depths: dict[Function, int] = {}
    for called in functions:
        expressions = [
            expression
            for statement in tree.statements_in(called.body)
            for expression in tree.expressions_of(statement)
        ]
        own = sum(map(_held, expressions))
        named = chain(called.arguments.items(), tree.variables_in(called.body).items())
        own += sum(_result(type_) for name, type_ in named if name not in shared(called))
        deeper = max((depths[call.function] for call in tree.calls_in(called.body)), default=0)
        depths[called] = own + deeper
    ends = ((depth + _result(function.returns), function) for function, depth in depths.items())
    return max(ends, key=itemgetter(0), default=(0, None))


def _result(type_: Type) -> int:
    """Return the bytes of a structure; numbers are in registers."""
    return 0 if isinstance(type_, Scalar) else _NUMBER * count(type_)


def _held(expression: Expression, within: bool = False) -> int:
    """Return the bytes of the structures that an expression makes or receives from calls."""
    is_made = isinstance(expression, Make)
    own = (
        _result(expression.type) if isinstance(expression, Call) or (is_made and not within) else 0
    )
    return own + sum(_held(part, is_made) for part in expression.parts)
