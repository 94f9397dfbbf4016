"""The derivatives of a component in C: its equations for dual numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache

from fmus.language import tree
from fmus.language.build import Program
from fmus.language.tree import Function
from fmus.language.types import Scalar, Type, count, type_of
from fmus.native.dual import DualEmitter
from fmus.native.emit import Emitter
from fmus.native.names import in_c
from fmus.native.pieces import function, initializer, moves
from fmus.native.translator import MOST_ON_STACK, deepest, runtime_function, translation
from fmus.ports.behaviour import Behaviour
from fmus.ports.definition import Definition

#: Arguments of the function for the runtime.
_ARGUMENTS = (
    "int starts, const model_parameters *parameters, const model_parameters *dparameters, "
    "const model_state *state, model_state *dstate, const model_inputs *inputs, "
    "const model_inputs *dinputs, double t, double dt, const double draws[], "
    "model_outputs *doutputs, double drates[], Error *error"
)

_HEAD = """\
/* Derivatives of outputs and rates: the functions of equations.c for dual numbers. */
#include "dual.h"

enum {{ MODEL_DIFFERENTIABLE = {} }};"""


def derivatives_of_nothing() -> str:
    """Return the file derivatives.c of a model without derivatives."""
    return "\n\n".join([_HEAD.format(0), _differentiate([])]) + "\n"


def _differentiate(body: Sequence[str]) -> str:
    return runtime_function("void", "differentiate", _ARGUMENTS, body)


@cache
def derivatives(definition: Definition) -> str | None:
    """Return the file derivatives.c of a component; None if they need too much of the stack.

    Raises:
        Untranslatable: its text is outside the language of equations.

    """
    _, program, emitter, passages = translation(definition)
    behaviour = definition.behaviour
    hooks = _hooks(behaviour, program)
    functions = [*_needed(program.functions.values(), hooks.values())]
    if 2 * deepest(functions)[0] > MOST_ON_STACK:
        return None
    dual = DualEmitter(functions, emitter)
    groups = {
        "parameters": type_of(behaviour.parameters),
        "inputs": type_of(behaviour.inputs),
        "state": type_of(behaviour.state),
    }
    given = {"parameters": "p", "inputs": "u", "state": "x", "derived": "seen", "t": "now"}
    if behaviour.noisy:
        type_ = hooks["measured"].arguments["n"]
        draws = initializer(type_, map("dual_fixed(draws[{}])".format, range(behaviour.draws)))
        given["n"] = draws if isinstance(type_, Scalar) else f"({dual.type(type_)}){draws}"
        given[behaviour.noisy] = f"y.{in_c(behaviour.noisy)}"
    calls = {
        name: dual.call(hook, [given[argument] for argument in hook.arguments])
        for name, hook in hooks.items()
    }
    joined = {
        name: f"model_dual_{name}({passages[name].got(name)}, {passages[name].got(f'd{name}')})"
        for name in ("inputs", "state")
    }
    joined["parameters"] = "model_dual_parameters(*parameters, *dparameters)"
    taken = {name for hook in hooks.values() for name in hook.arguments}
    lines = [
        f"const {dual.type(groups[name])} {given[name]} = {joined[name]};"
        for name in ("parameters", "inputs")
        if name in taken
    ]
    if "t" in taken:
        lines.append("const Dual now = {t, dt};")
    if "start" in hooks:
        lines += [
            f"{dual.type(groups['state'])} x;",
            "if (starts) {",
            f"    x = {calls['start']};",
            f"    {passages['state'].put('dstate', 'model_slopes_of_state(x)')}",
            "} else {",
            f"    x = {joined['state']};",
            "}",
        ]
    if "restarted" in hooks:
        lines.append(
            f"if (!model_credible(parameters, state, inputs, error)) x = {calls['restarted']};"
        )
    if "derive" in hooks:
        lines.append(f"const {dual.type(hooks['derive'].returns)} seen = {calls['derive']};")
    lines.append(f"{dual.type(hooks['outputs'].returns)} y = {calls['outputs']};")
    if behaviour.noisy:
        lines.append(f"{given[behaviour.noisy]} = {calls['measured']};")
    lines.append(passages["outputs"].put("doutputs", "model_slopes_of_outputs(y)"))
    if "rates" in hooks:
        type_ = hooks["rates"].returns
        moved = moves(type_, "dx", range(count(type_)), "drates[{place}] = {member}.d;")
        lines += [
            "if (drates != NULL) {",
            f"    const {dual.type(type_)} dx = {calls['rates']};",
            *(f"    {line}" for line in moved),
            "}",
        ]
    given_back = {"outputs": hooks["outputs"].returns}
    if "start" in hooks:
        given_back["state"] = groups["state"]
    parts = [
        *(_joined(emitter, dual, name, groups[name]) for name in groups if name in taken),
        *(_slopes(emitter, dual, name, type_) for name, type_ in given_back.items()),
        _differentiate(lines),
    ]
    return "\n\n".join([_HEAD.format(1), dual.text(), *parts]) + "\n"


def _hooks(behaviour: Behaviour, program: Program) -> dict[str, Function]:
    """Return the hooks that outputs and rates follow from."""
    hooks: dict[str, Function] = {}
    for name, given in {
        "measured": "",
        "outputs": "",
        "rates": "",
        "derive": "derived",
        "restarted": "state",
        "start": "state",
    }.items():
        is_needed = not given or any(given in hook.arguments for hook in hooks.values())
        if is_needed and (hook := behaviour.hooks[name]):
            hooks[name] = program.function(hook)
    return hooks


def _needed(functions: Iterable[Function], hooks: Iterable[Function]) -> Iterator[Function]:
    """Yield hooks and the functions that they call, each after those that it calls."""
    needed, rest = set(), [*hooks]
    while rest:
        called = rest.pop()
        if called not in needed:
            needed.add(called)
            rest += [call.function for call in tree.calls_in(called.body)]
    yield from (called for called in functions if called in needed)


def _joined(emitter: Emitter, dual: DualEmitter, name: str, type_: Type) -> str:
    """Write the function that joins values and their derivatives."""
    given, made = emitter.type(type_), dual.type(type_)
    places = range(count(type_))
    text, whole = "it{member} = (Dual){{v{member}, d{member}}};", "it{member} = v{member};"
    body = moves(type_, "", places, text, whole=whole)
    head = f"static {made} model_dual_{name}({given} v, {given} d)"
    return function(head, [f"{made} it = {{0}};", *body, "return it;"], ("v", "d"))


def _slopes(emitter: Emitter, dual: DualEmitter, name: str, type_: Type) -> str:
    """Write the function that takes derivatives out of their pairs with values."""
    given, made = dual.type(type_), emitter.type(type_)
    places = range(count(type_))
    body = moves(type_, "", places, "it{member} = y{member}.d;", whole="it{member} = 0;")
    head = f"static {made} model_slopes_of_{name}({given} y)"
    return function(head, [f"{made} it = {{0}};", *body, "return it;"], ("y",))
