"""The functions `model_...` in C, in which the component finds all hooks, also those it has not.

Inputs, outputs and state lie in the component as doubles. Where the equations have integers or
truth values among them, they are converted here.
"""

from __future__ import annotations

from typing import NamedTuple

from fmus.native.layout import laid_out
from fmus.native.program import Function, Program
from fmus.native.shapes import BOOLEAN, DOUBLE, Shape, Structure, count_numbers, in_c, leaves_of
from fmus.ports.behaviour import Behaviour

_P, _S, _I = (
    "const model_parameters *parameters",
    "model_state *state",
    "const model_inputs *inputs",
)
_O, _E = "model_outputs *outputs", "Error *error"


class _Numbers(NamedTuple):
    """Inputs, outputs or state, as the component holds them.

    Attributes:
        name: which of them.
        shape: of the equations' type.
        place: what points to them in the functions `model_...`.

    """

    name: str
    shape: Shape
    place: str

    @property
    def are_doubles(self) -> bool:
        """Whether the equations have nothing but floats in them."""
        return all(part == DOUBLE for _, part in leaves_of(self.shape))

    @property
    def typed(self) -> str:
        """The equations' value of them."""
        return self.place if self.are_doubles else f"typed_{self.name}(&{self.place})"

    def kept(self, code: str) -> str:
        """What the component holds of a value of the equations."""
        return code if self.are_doubles else f"{self.name}_numbers({code})"

    def texts(self) -> list[str]:
        """Their type in the component, and the conversions to it and from it."""
        kept = f"model_{self.name}" if self.name != "state" else "state_numbers"
        if self.are_doubles:
            return [f"typedef {self.shape.name} {kept};"] if self.name != "state" else []
        leaves, n = leaves_of(self.shape), count_numbers(self.shape)
        typed = [f"to{leaf} = {_converted(i, part)};" for i, (leaf, part) in enumerate(leaves)]
        flat = [f"to.numbers[{i}] = from{leaf};" for i, (leaf, _) in enumerate(leaves)]
        kind = kept if self.name != "state" else "state_as_numbers"
        return [
            f"/* Integers and truth values among them are doubles, too. */\n"
            f"typedef struct {{\n    double numbers[{n}];\n}} {kind};",
            _function(
                f"static {self.shape.name} typed_{self.name}(const {kind} *from)",
                [f"{self.shape.name} to;", *typed, "return to;"],
            ),
            _function(
                f"static {kind} {self.name}_numbers({self.shape.name} from)",
                [f"{kind} to;", *flat, "return to;"],
            ),
        ]


def _converted(i: int, shape: Shape) -> str:
    number = f"from->numbers[{i}]"
    if shape == DOUBLE:
        return number
    return f"{number} != 0.0" if shape == BOOLEAN else f"(int){number}"


def _function(head: str, body: list[str]) -> str:
    lines = [line for part in body for line in laid_out(part, "    ")]
    return "\n".join([*laid_out(f"{head} {{", ""), *lines, "}"])


def glue(program: Program, said: Behaviour) -> str:
    """The functions that a component calls, from what its behaviour says."""
    functions = {name: program.function(hook) for name, hook in said.hooks.items() if hook}
    inputs = _Numbers("inputs", program.shape(said.inputs), "*inputs")
    outputs = _Numbers("outputs", program.shape(said.outputs), "*outputs")
    state = _Numbers("state", program.shape(said.state), "state->state")
    given = {
        "parameters": "*parameters",
        "inputs": _pointed(inputs),
        "outputs": _pointed(outputs),
        "state": state.typed,
        "derived": "state->derived",
    }
    calls = {
        name: function.call([given.get(argument, argument) for argument in function.arguments])
        for name, function in functions.items()
    }

    def moved(hook: str) -> list[str]:
        return _moved(said, functions[hook], calls[hook], state, outputs)

    derive = [f"state->derived = {calls['derive']};"] if said.derived else []
    restart = []
    if said.restarted:
        restart = [f"state->state = {state.kept(calls['restarted'])};", *derive]
    expected = outputs.kept(calls["expected"]) if "expected" in calls else "*outputs"
    steps = f"{_P}, {_S}, {_I}, double t, double h, int n, {_O}, {_E}"
    expects = f"{_P}, const {_S}, const {_O}, model_outputs *expected, {_E}"
    # A negative seed is the number 2^32 above it.
    seed = [f"return (unsigned int){calls.get('seed', 0)};"]
    restarted = said.restarted.replace("{t:g}", "%g")
    parts = [
        "/* What the component calls. */",
        *_types(program, said, inputs, outputs, state),
        f"enum {{ MODEL_EXPECTS = {int('expected' in calls)}, MODEL_DRAWS = {said.draws} }};\n"
        f'#define MODEL_RESTARTED "{restarted}"',
        _defined("void begin", f"{_P}, {_I}, double t, {_S}, {_O}, {_E}", moved("begin")),
        _defined("void advance", steps, moved("advance")),
        _defined("void check", f"{_P}, {_E}", [f"{calls['check']};"] if "check" in calls else []),
        _defined("void derive", f"{_P}, {_S}, {_E}", derive),
        _defined("void expected", expects, [f"*expected = {expected};"]),
        _defined(
            "int credible", f"{_P}, const {_S}, {_I}, {_E}", [f"return {calls.get('credible', 1)};"]
        ),
        _defined("void restart", f"{_P}, {_S}, {_I}, {_E}", restart),
        _defined("unsigned long seed", f"{_P}, {_E}", seed),
        _defined(
            "void measure",
            f"{_P}, const double draws[], {_O}, {_E}",
            _measured(said, functions["measured"], given, outputs) if said.noisy else [],
        ),
        _defined("int is_sound", "const double state[]", _soundness(state)),
    ]
    return "\n\n".join(parts)


def _pointed(numbers: _Numbers) -> str:
    """Inputs or outputs, which the functions get a pointer to."""
    return numbers.place if numbers.are_doubles else f"typed_{numbers.name}({numbers.name})"


def _types(
    program: Program, said: Behaviour, inputs: _Numbers, outputs: _Numbers, state: _Numbers
) -> list[str]:
    derived = f"    {program.shape(said.derived).name} derived;\n" if said.derived else ""
    held = state.shape.name if state.are_doubles else "state_as_numbers"
    typedefs = [f"typedef {program.shape(said.parameters).name} model_parameters;"]
    conversions: list[str] = []
    for numbers in (inputs, outputs, state):
        target = typedefs if numbers.are_doubles else conversions
        target += numbers.texts()
    model_state = f"typedef struct {{\n    {held} state;\n{derived}}} model_state;"
    counts = (
        f"enum {{ MODEL_INPUTS = {count_numbers(inputs.shape)}, "
        f"MODEL_OUTPUTS = {count_numbers(outputs.shape)}, "
        f"MODEL_STATE = {count_numbers(state.shape)} }};"
    )
    if not conversions:
        return ["\n".join([*typedefs, model_state]), counts]
    return ["\n".join(typedefs), *conversions, model_state, counts]


def _moved(
    said: Behaviour, function: Function, call: str, state: _Numbers, outputs: _Numbers
) -> list[str]:
    """What takes over the state and the outputs that a function gives."""
    assert isinstance(function.returns, Structure)
    if said.is_stateless:
        return [f"*outputs = {outputs.kept(call)};", "memset(state, 0, sizeof *state);"]
    parts = [f"result{part}" for part, _ in function.returns.parts]
    values = [state.kept(parts[0]), *parts[1:-1], outputs.kept(parts[-1])]
    names = ["state->state", *(["state->derived"] if said.derived else []), "*outputs"]
    return [
        f"const {function.returns.name} result = {call};",
        *(f"{name} = {value};" for name, value in zip(names, values)),
    ]


def _measured(
    said: Behaviour, function: Function, given: dict[str, str], outputs: _Numbers
) -> list[str]:
    """What gives a group of outputs its noise."""
    owner = "outputs->" if outputs.are_doubles else "typed."
    group = f"{owner}{in_c(said.noisy)}"
    shape = function.arguments["n"]
    drawn = ", ".join(f"draws[{i}]" for i in range(said.draws))
    n = f"({shape.name}){{{{{drawn}}}}}" if isinstance(shape, Structure) else drawn
    given = {**given, "n": n, said.noisy: group}
    call = function.call([given[name] for name in function.arguments])
    if outputs.are_doubles:
        return [f"{group} = {call};"]
    return [
        f"{outputs.shape.name} typed = {_pointed(outputs)};",
        f"{group} = {call};",
        f"*outputs = {outputs.kept('typed')};",
    ]


def _soundness(state: _Numbers) -> list[str]:
    """Whether numbers can be a state: integers and truth values are such."""
    checks = []
    for i, (_, part) in enumerate(leaves_of(state.shape)):
        if part == BOOLEAN:
            checks.append(f"(state[{i}] == 0.0 || state[{i}] == 1.0)")
        elif part != DOUBLE:
            checks.append(f"is_integer(state[{i}])")
    return [f"return {' && '.join(checks) or '1'};"]


def _defined(name: str, arguments: str, body: list[str]) -> str:
    """A function with what it returns before its name; arguments it does not use are marked so."""
    returns, _, name = name.rpartition(" ")
    text = " ".join(body)
    names = [argument.rstrip("[]").split()[-1].lstrip("*") for argument in arguments.split(", ")]
    unused = [f"(void){n};" for n in names if n != "error" and not _uses(text, n)]
    if "Error" in arguments and "error" not in text:
        unused.append("(void)error;")
    declarations = body[:1] if body and " result = " in body[0] else []
    rest = body[len(declarations) :]
    return _function(f"static {returns} model_{name}({arguments})", [*unused, *declarations, *rest])


def _uses(text: str, name: str) -> bool:
    separated = "".join(c if c.isalnum() or c == "_" else " " for c in text)
    return name in separated.split()
