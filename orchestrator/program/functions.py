"""Components as functions of CasADi, for optimisers, estimators and derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import repeat
from pathlib import Path
from typing import Any

from auv_fmu.language.variable import Refusal
from fmus.discovery import components, source_of
from fmus.language.build import Program, Untranslatable
from fmus.language.symbols import Evaluator, Value, filled, numbers_in
from fmus.language.types import Array, Record, Type, type_of
from fmus.ports.definition import Definition
from fmus.ports.port import H_MAX, Misdeclared, Port
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.machine.lazy import casadi
from orchestrator.program.components import definition_in


@dataclass(frozen=True, eq=False)
class Model:
    """A component as functions of CasADi.

    The functions take and return column vectors; a Boolean is 0 or 1. A step is one internal step,
    however long. There is no noise. Values are taken to be valid: what the component would refuse
    gives numbers without a meaning.

    Attributes:
        name: name of the component.
        state: names of the numbers in the state.
        inputs: names of the inputs.
        parameters: names of the Real parameters; the others are fixed.
        outputs: names of the outputs.
        default_inputs: start values of the inputs.
        default_parameters: default values of the parameters.

    """

    name: str
    state: list[str]
    inputs: list[str]
    parameters: list[str]
    outputs: list[str]
    default_inputs: list[float]
    default_parameters: list[float]
    _equations: Any = field(repr=False)

    @cached_property
    def advance(self) -> Any:
        """Function of state, inputs, parameters, h, t: the state after a step, and its outputs.

        The inputs are held during the step of h seconds from time t on. The outputs are those that
        the FMU shows after the step: of a SAMPLED component those of its beginning.
        """
        return self._function("advance", ("state", "inputs", "parameters", "h", "t"))

    @cached_property
    def start(self) -> Any:
        """Function of inputs, parameters, t: the state at the start time t."""
        return self._function("start", ("inputs", "parameters", "t"))

    @cached_property
    def observe(self) -> Any:
        """Function of state, inputs, parameters, t: the outputs in a state at time t."""
        return self._function("observe", ("state", "inputs", "parameters", "t"))

    def _function(self, name: str, arguments: Sequence[str]) -> Any:
        ca = casadi()
        lengths = {
            "state": len(self.state), "inputs": len(self.inputs),
            "parameters": len(self.parameters), "h": 1, "t": 1,
        }  # fmt: skip
        given = {argument: ca.SX.sym(argument, lengths[argument]) for argument in arguments}
        values = {
            argument: symbol if argument in ("h", "t") else ca.vertsplit(symbol)
            for argument, symbol in given.items()
        }
        results = getattr(self._equations, name)(**values)
        columns = [_column(ca, numbers_in(result)) for result in results.values()]
        return ca.Function(f"{self.name}_{name}", [*given.values()], columns, [*given], [*results])


def _column(ca: Any, numbers: Iterable[Value]) -> Any:
    """Return a column vector of numbers and symbols."""
    column = [*map(ca.SX, numbers)]
    return ca.vertcat(*column) if column else ca.SX(0, 1)


class _Component:
    """One component as a model: its vectors, and its functions of them."""

    def __init__(self, definition: Definition, given: Mapping[str, object]) -> None:
        self._equations = Equations(definition)
        ports = {
            causality: [port for port in definition.ports if port.causality == causality]
            for causality in ("input", "output", "parameter")
        }
        values = settled(definition, given)
        self._values = values
        self._free = [port.name for port in definition.parameters.ports if port.type == "Real"]
        self.vectors: dict[str, list[Any]] = {
            "state": [*_names(self._equations.types["state"])],
            "inputs": [port.name for port in ports["input"]],
            "parameters": self._free,
            "outputs": [port.name for port in ports["output"]],
            "default_inputs": [_number(port.start) for port in ports["input"]],
            "default_parameters": [values[name] for name in self._free],
        }

    def advance(self, state: Any, inputs: Any, parameters: Any, h: Any, t: Any) -> dict[str, Any]:
        """Return the state after a step, and the outputs that are shown then."""
        equations, given = self._equations, self._given(inputs, parameters)
        before = filled(equations.types["state"], iter(state))
        after = equations.update(given, before, t, h)
        shown = (before, t) if equations.is_sampled else (after, t + h)
        return {"next": after, "outputs": equations.outputs(given, *shown)}

    def start(self, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Return the state at the start."""
        return {"state": self._equations.start(self._given(inputs, parameters), t)}

    def observe(self, state: Any, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Return the outputs in a state."""
        now = filled(self._equations.types["state"], iter(state))
        return {"outputs": self._equations.outputs(self._given(inputs, parameters), now, t)}

    def _given(self, inputs: Any, parameters: Any) -> dict[str, Value]:
        values = {**self._values, **dict(zip(self._free, parameters, strict=True))}
        return self._equations.given(values, inputs)


class Equations:
    """Hooks of a component with symbols.

    Attributes:
        types: types of the groups that hooks take.
        is_sampled: True if the outputs after a step are those of its beginning.

    """

    def __init__(self, definition: Definition) -> None:
        """Translate the hooks.

        Raises:
            Untranslatable: they are outside the language.

        """
        self._definition, self._behaviour = definition, definition.behaviour
        hooks = {name: hook for name, hook in self._behaviour.hooks.items() if hook}
        program = Program(*hooks.values())
        program.check()
        self._functions = {name: program.function(hook) for name, hook in hooks.items()}
        self._evaluator = Evaluator()
        self.types = {
            "parameters": type_of(self._behaviour.parameters),
            "inputs": type_of(self._behaviour.inputs),
            "state": type_of(self._behaviour.state),
        }
        self.is_sampled = self._behaviour.is_sampled

    def given(self, parameters: Mapping[str, Value], inputs: Iterable[Value]) -> dict[str, Value]:
        """Return the parameters, by name, and the inputs, in order, as groups."""
        numbers = (parameters[port.name] for port in self._definition.parameters.ports)
        return {
            "parameters": filled(self.types["parameters"], numbers),
            "inputs": filled(self.types["inputs"], iter(inputs)),
        }

    def start(self, given: Mapping[str, Value], t: Value) -> Value:
        """Return the state at the start."""
        return self._call("start", {**given, "t": t}) if "start" in self._functions else ()

    def update(self, given: Mapping[str, Value], state: Value, t: Value, h: Value) -> Value:
        """Return the state after a step."""
        if "update" not in self._functions:
            return ()
        known = {**given, "state": self._guarded(given, state), "t": t, "h": h}
        return self._call("update", self._derived("update", known))

    def outputs(self, given: Mapping[str, Value], state: Value, t: Value) -> Value:
        """Return the outputs in a state, without noise."""
        known = {**given, "state": self._guarded(given, state), "t": t}
        known = self._derived("outputs", known)
        shown = self._call("outputs", known)
        if not (noisy := self._behaviour.noisy):
            return shown
        measured = self._functions["measured"]
        drawn = filled(measured.arguments["n"], repeat(0.0))
        place = [*self._behaviour.outputs._fields].index(noisy)
        group = self._call("measured", {**known, "n": drawn, noisy: shown[place]})
        return (*shown[:place], group, *shown[place + 1 :])

    def _guarded(self, given: Mapping[str, Value], state: Value) -> Value:
        """Return the state with which a run continues: the guard may have replaced it."""
        if "credible" not in self._functions:
            return state
        known = {**given, "state": state}
        credible = self._call("credible", known)
        return self._evaluator.joined(credible, state, self._call("restarted", known))

    def _derived(self, hook: str, known: dict[str, Value]) -> dict[str, Value]:
        """Return the arguments with the derived values, if a hook takes them."""
        if "derived" not in self._functions[hook].arguments:
            return known
        return {**known, "derived": self._call("derive", known)}

    def _call(self, hook: str, known: Mapping[str, Value]) -> Value:
        function = self._functions[hook]
        return self._evaluator.call(function, *(known[name] for name in function.arguments))


def settled(definition: Definition, given: Mapping[str, object]) -> dict[str, Any]:
    """Return the values of all parameters of a component, by name.

    Args:
        definition: definition of the component.
        given: values that differ from the defaults; of an enumeration also the name of a choice.

    Raises:
        InputError: there is no such parameter, or it does not take the value.

    """
    ports = {port.name: port for port in definition.parameters.ports}
    values = {name: _typed(port, port.start) for name, port in ports.items()}
    for name, value in given.items():
        if name == H_MAX:
            raise InputError(f"{name}: a step of a function is one internal step, however long")
        if name not in ports:
            raise InputError(f"{name}: no such parameter{did_you_mean(name, ports)}")
        port = ports[name]
        if isinstance(value, str):
            if value not in port.choices:
                known = ", ".join(port.choices) or f"a number, it is of type {port.type}"
                raise InputError(f"{name} = {value!r:.20}: use one of {known}")
            value = port.choices[value]
        try:
            values[name] = _typed(port, port.checked(value))  # type: ignore[arg-type]
        except Refusal as error:
            raise InputError(str(error)) from None
    return values


def _typed(port: Port, value: Any) -> Any:
    """Return a value in the type of the equations."""
    return {"Real": float, "Boolean": bool}.get(port.type, int)(value)


def _number(value: Any) -> float:
    return float(value or 0.0)


def _names(type_: Type, name: str = "") -> Iterator[str]:
    """Yield the paths of the numbers in a type: `nu[1]`, `filter.x`."""
    if isinstance(type_, Record):
        for field_, part in type_.fields:
            yield from _names(part, f"{name}.{field_}" if name else field_)
    elif isinstance(type_, Array):
        inner: Type = type_
        indices = [""]
        while isinstance(inner, Array):
            indices = [f"{i},{k}" if i else f"{k}" for i in indices for k in range(1, inner.n + 1)]
            inner = inner.item
        for index in indices:
            yield from _names(inner, f"{name}[{index}]")
    else:
        yield name


def model(component: str | Path, parameters: Mapping[str, object] | None = None) -> Model:
    """Return a component as functions of CasADi.

    Args:
        component: name of a component of the bundle, or path of a component's file.
        parameters: values of parameters by name. A Real's value replaces its default; other
            parameters are fixed, since they may choose equations.

    Raises:
        InputError: there is no such component or parameter, casadi is missing, or the equations
            need a number where there is a symbol; the message names file and line.

    """
    definition = _definition(component)
    try:
        made = _Component(definition, parameters or {})
    except Untranslatable as error:
        raise InputError(f"{component}: is not in the language of equations: {error}") from None
    return Model(definition.name, _equations=made, **made.vectors)


def _definition(component: str | Path) -> Definition:
    """Return the definition of a component, from its name or the path of its file."""
    if str(component) in components():
        return source_of(str(component)).definition
    path = Path(component)
    if path.suffix == ".py" or path.is_dir():
        try:
            return definition_in(path)
        except Misdeclared as error:
            raise InputError(f"{path}: {error}") from None
    known = components()
    raise InputError(f"{component}: no such component{did_you_mean(str(component), known)}")


def function(component: str | Path, parameters: Mapping[str, object] | None = None) -> Any:
    """Return the step of a component as a function of CasADi: :attr:`Model.advance`.

    Args:
        component: name of a component of the bundle, or path of a component's file.
        parameters: as for :func:`model`.

    Raises:
        InputError: as :func:`model`.

    """
    return model(component, parameters).advance


def refusal(component: str | Path, parameters: Mapping[str, object] | None = None) -> str:
    """Return the reason why a component cannot be a function of CasADi; empty if it can."""
    try:
        function(component, parameters)
    except InputError as error:
        return str(error)
    return ""
