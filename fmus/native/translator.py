"""The equations of a component in C, with the glue by which the runtime calls them.

The runtime has inputs, outputs and states as arrays of doubles, whatever they are. Where all their
numbers are floats, a structure of the equations is such an array already. Where some are not,
functions that are written here go over it number by number: ints of 32 bits are exact in doubles.
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
from fmus.native.numbers import has_only_doubles, moves
from fmus.native.pieces import function, initializer
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
_NEXT, _SCRATCH = "model_state *state", "model_derived *derived"


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

#: All that the runtime asks: besides, how many numbers noise takes, whether outputs are held,
#: whether a state may be given up, and whether an update finds out itself what cannot be a state.
_ASKED = ("DRAWS", "SAMPLED", "HAS_GUARD", "CHECKS_STATES", *_TAKES)

#: What the runtime calls: what each returns and takes, and what it does where nothing is to do.
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
}  # fmt: skip


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

    bodies = {
        **{name: alone.get(name, []) for name in ("check", "check_state")},
        "start": put("state", "start"),
        "restart": put("state", "restarted"),
        "derive": [f"*derived = {calls['derive']};"] if said.derived else [],
        "evaluate": put("outputs", "outputs"),
        "update": put("state", "update"),
    }
    if "seed" in calls:
        # A negative seed is the number 2^32 above it.
        bodies["seed"] = [f"return (unsigned int){calls['seed']};"]
    if "credible" in calls:
        bodies["credible"] = [f"return {calls['credible']};"]
    if said.noisy:
        bodies["measure"] = _measured(emitter, said, passages["outputs"], functions["measured"])
    parts = [_constants(said), *defined(bodies)]
    text = "\n\n".join(parts)
    # One that nothing calls would be a warning.
    moving = [
        one
        for form in passages.values()
        for name, one in zip((form.gather, form.scatter), form.functions)
        if re.search(rf"\b{name}\(", text)
    ]
    head = ["/* What the component calls. */", _types(emitter, said, passages), *moving]
    return "\n\n".join([*head, text])


def _constants(said: Behaviour) -> str:
    """What follows from the hooks before any of them is called."""
    found = {
        "DRAWS": said.draws,
        "SAMPLED": said.is_sampled,
        "HAS_GUARD": said.hooks["credible"] is not None,
        **{name: said.takes(*question) for name, question in _TAKES.items()},
    }
    return constants(found, _directives(said.restarted))


def constants(found: Mapping[str, int], restarted: str = "") -> str:
    """What the runtime asks before it calls anything.

    Args:
        found: the answers, by their names; those that are missing are 0.
        restarted: what is logged when a state is given up, as `compose` takes it.

    """
    rows = "".join(f"    MODEL_{name} = {int(found.get(name, 0))},\n" for name in _ASKED)
    return f"enum {{\n{rows}}};\n#define MODEL_RESTARTED {quoted(restarted)}"


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
    n = initializer(type_, map("draws[{}]".format, range(said.draws)))
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


def defined(bodies: Mapping[str, Sequence[str]]) -> list[str]:
    """The functions that the runtime calls, with what they do."""
    return [
        _defined(returns, name, arguments, bodies.get(name) or idle)
        for name, (returns, arguments, idle) in _CALLED.items()
    ]


def _defined(returns: str, name: str, arguments: str, body: Sequence[str]) -> str:
    names = re.findall(r"(\w+)(?:\[\])?(?=,|$)", arguments)
    head = lines_of(f"static {returns} model_{name}({arguments})", "")
    return function("\n".join(head), body, names)


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
    gathered = moves(type_, "it", places, "{member} = {cast}from[{place}];")
    scattered = moves(type_, "it", places, "to[{place}] = {member};")
    taken = [f"{name} it;", *gathered, "return it;"]
    functions = (
        function(f"static {name} {gather}(const double from[])", taken, ()),
        function(f"static void {scatter}({name} it, double to[])", [*scattered], ()),
    )
    return _Passage(name, f"struct {{\n    double v[{n}];\n}}", gather, scatter, functions)


def deepest(
    functions: Iterable[Function],
    shared: Callable[[Function], Collection[str]] = lambda function: {function.by_address},
) -> tuple[int, Function | None]:
    """The most bytes that lie on a thread's stack in a call from outside, and the call of what.

    Structures are passed and returned by value, so a function that adds large vectors keeps each
    sum there. Nothing calls itself, and all sizes are fixed: what lies there at most can be added
    up. Compilers that optimise keep no more than this, but for a tenth.

    Args:
        functions: each after those that it calls.
        shared: the arguments and variables of one that are not copied.

    """
    depths: dict[Function, int] = {}
    for called in functions:
        found = [x for one in tree.statements_in(called.body) for x in tree.expressions_of(one)]
        own = sum(map(_held, found))
        named = chain(called.arguments.items(), tree.variables_in(called.body).items())
        own += sum(_result(type_) for name, type_ in named if name not in shared(called))
        deeper = max((depths[one.function] for one in tree.calls_in(called.body)), default=0)
        depths[called] = own + deeper
    ends = ((depth + _result(one.returns), one) for one, depth in depths.items())
    return max(ends, key=itemgetter(0), default=(0, None))


def _result(type_: Type) -> int:
    """The bytes of a structure; a number lies in a register."""
    return 0 if isinstance(type_, Scalar) else _NUMBER * count(type_)


def _held(one: Expression, within: bool = False) -> int:
    """The bytes of the structures that an expression makes, and that are returned to it."""
    is_made = isinstance(one, Make)
    own = _result(one.type) if isinstance(one, Call) or (is_made and not within) else 0
    return own + sum(_held(part, is_made) for part in one.parts)
