"""The equations of a component in C, from the text that its Python kind runs."""

from __future__ import annotations

from functools import cache
from importlib import import_module

from fmus.native.functions import function_in_c
from fmus.native.layout import laid_out
from fmus.native.program import Function, Program
from fmus.native.shapes import Structure, numbers
from fmus.ports.behaviour import Behaviour, read_behaviour

_HEAD = """\
/* {title}
 *
 * Translated from the Python text of its equations, function by function, in the order in which
 * they need each other. A name begins with the module that the function stands in. The numbers in
 * brackets are those of the equations in "Three-dimensional tracking control of autonomous
 * underwater vehicles with limited torque and without velocity sensors".
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
def translated(package: str) -> str:
    """The equations of a component, and the functions that the component calls.

    Args:
        package: of the component, for example `fmus.auv_plant`.

    Raises:
        Untranslatable: its text is outside the language of equations.

    """
    behaviour = read_behaviour(import_module(f"{package}.behaviour"))
    program = Program(function_in_c)
    glue = _Glue(program, behaviour).text()
    title = import_module(f"{package}.ports").DESCRIPTION
    sections = [
        _HEAD.format(title=title),
        *program.structures.values(),
        *program.constants.values(),
        *(function.text for function in program.functions.values()),
        glue,
    ]
    return "\n\n".join(sections) + "\n"


class _Glue:
    """The functions `model_...`, in which the component finds a behaviour's functions."""

    def __init__(self, program: Program, behaviour: Behaviour) -> None:
        self._program, self._behaviour = program, behaviour

    def text(self) -> str:
        """All of them, also those for what this component has not."""
        parts = [self._begin(), self._advance(), *self._others()]
        return "\n\n".join(["/* What the component calls. */", self._types(), *parts])

    def _function(self, name: str) -> Function | None:
        hook = self._behaviour.hooks[name]
        return None if hook is None else self._program.function(hook)

    def _called(self, function: Function) -> str:
        return function.call([_GIVEN.get(name, name) for name in function.arguments])

    def _types(self) -> str:
        shape, said = self._program.shape, self._behaviour
        state, inputs = shape(said.state), shape(said.inputs)
        parameters, outputs = shape(said.parameters), shape(said.outputs)
        derived = f"    {shape(said.derived).name} derived;\n" if self._derives else ""
        return (
            f"typedef {parameters.name} model_parameters;\n"
            f"typedef {inputs.name} model_inputs;\n"
            f"typedef {outputs.name} model_outputs;\n"
            f"typedef struct {{\n    {state.name} state;\n{derived}}} model_state;\n\n"
            f"enum {{ MODEL_INPUTS = {numbers(inputs)}, MODEL_OUTPUTS = {numbers(outputs)}, "
            f"MODEL_STATE = {numbers(state)} }};"
        )

    @property
    def _derives(self) -> bool:
        return self._behaviour.derived is not None

    def _begin(self) -> str:
        return self._moved("begin", f"{_P}, {_I}, double t, {_S}, {_O}, {_E}")

    def _advance(self) -> str:
        arguments = f"{_P}, {_S}, {_I}, double t, double h, int n, {_O}, {_E}"
        return self._moved("advance", arguments)

    def _moved(self, name: str, arguments: str) -> str:
        """A function that gives state and outputs."""
        function = self._function(name)
        assert function is not None and isinstance(function.returns, Structure)
        names = ["state->state", *(["state->derived"] if self._derives else []), "*outputs"]
        parts = [suffix for suffix, _ in function.returns.parts]
        stores = [f"{name} = result{part};" for name, part in zip(names, parts)]
        result = f"const {function.returns.name} result = {self._called(function)};"
        return _defined("void", f"model_{name}", arguments, [result, *stores])

    def _others(self) -> list[str]:
        derive, expected = self._function("derive"), self._function("expected")
        credible, restarted = self._function("credible"), self._function("restarted")
        check, seed, measured = map(self._function, ("check", "seed", "measured"))
        draws = self._behaviour.draws
        said = self._behaviour.restarted.replace("{t:g}", "%g")
        restart = [f"state->state = {self._called(restarted)};"] if restarted else []
        if restart and derive:
            restart.append(f"state->derived = {self._called(derive)};")
        check_call = [f"{self._called(check)};"] if check else []
        derived = [f"state->derived = {self._called(derive)};"] if derive else []
        return [
            f"enum {{ MODEL_EXPECTS = {int(bool(expected))}, MODEL_DRAWS = {draws} }};\n"
            f'#define MODEL_RESTARTED "{said}"',
            _defined("void", "model_check", f"{_P}, {_E}", check_call),
            _defined("void", "model_derive", f"{_P}, {_S}, {_E}", derived),
            _defined(
                "void",
                "model_expected",
                f"{_P}, const {_S}, const {_O}, model_outputs *expected, {_E}",
                [f"*expected = {self._called(expected) if expected else '*outputs'};"],
            ),
            _defined(
                "int",
                "model_credible",
                f"{_P}, const {_S}, {_I}, {_E}",
                [f"return {self._called(credible) if credible else 1};"],
            ),
            _defined("void", "model_restart", f"{_P}, {_S}, {_I}, {_E}", restart),
            _defined(
                "unsigned long",
                "model_seed",
                _P,
                # A negative seed is the number 2^32 above it.
                [f"return (unsigned int){self._called(seed) if seed else 0};"],
            ),
            self._measure(measured, draws),
        ]

    def _measure(self, measured: Function | None, draws: int) -> str:
        arguments = f"{_P}, const double draws[], {_O}"
        if measured is None:
            return _defined("void", "model_measure", arguments, [])
        group = f"outputs->{self._behaviour.noisy}"
        drawn = ", ".join(f"draws[{i}]" for i in range(draws))
        n = f"({measured.arguments['n'].name}){{{{{drawn}}}}}"
        given = {**_GIVEN, "n": n, self._behaviour.noisy: group}
        call = measured.call([given[name] for name in measured.arguments])
        return _defined("void", "model_measure", arguments, [f"{group} = {call};"])


def _defined(returns: str, name: str, arguments: str, body: list[str]) -> str:
    """A function; arguments that it does not use are marked so."""
    text = " ".join(body)
    names = [argument.rstrip("[]").split()[-1].lstrip("*") for argument in arguments.split(", ")]
    unused = [f"(void){n};" for n in names if n != "error" and not _uses(text, n)]
    if "Error" in arguments and "error" not in text:
        unused.append("(void)error;")
    lines = [line for part in (*unused, *body) for line in laid_out(part, "    ")]
    return "\n".join([*laid_out(f"static {returns} {name}({arguments}) {{", ""), *lines, "}"])


def _uses(text: str, name: str) -> bool:
    separated = "".join(c if c.isalnum() or c == "_" else " " for c in text)
    return name in separated.split()
