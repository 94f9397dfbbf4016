"""Components and systems as functions of CasADi, for optimisers, estimators and derivatives."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, repeat
from pathlib import Path
from typing import Any

from auv_fmu.language.variable import Refusal
from auv_fmu.paper import euler
from fmus.discovery import components, source_of
from fmus.language.build import Program, Untranslatable
from fmus.language.symbols import Evaluator, Value, filled, numbers_in
from fmus.language.types import Array, Record, Type, count, type_of
from fmus.ports.definition import Definition
from fmus.ports.fields import declared
from fmus.ports.port import H_MAX, Misdeclared
from fmus.script import message_of, script_in
from orchestrator.cosim import Connection, Linear, PortName, Stage, System, Visit
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.machine.lazy import casadi
from orchestrator.program.components import definition_in, definitions_of, refusals
from orchestrator.program.writer import start_of, straight, typed
from orchestrator.runs.preparation import Prepared, is_path, prepare_options
from orchestrator.runs.request import SystemOptions
from orchestrator.runs.scenario import names as scenario_names

#: Most rounds in which values are passed along all connections at the start.
_MOST_ROUNDS = 20

#: Difference of values that have come to rest, absolute and relative.
_SAME = 1e-12


#: A component or a system: a name, a path, the entries of a scenario file, or a loaded system.
Source = str | Path | Mapping[str, Any] | System

#: Names of parameters, or of groups of them, that are symbols; None: all Reals.
Free = Collection[str] | None


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A component or a system as functions of CasADi.

    The functions take and return column vectors; a Boolean is 0 or 1. A component's step is one
    internal step, however long. There is no noise. Values are taken to be valid: what a component
    would refuse gives numbers without a meaning.

    Attributes:
        name: name of the component or the system.
        state: names of the numbers in the state, as variables of model exchange have them.
        inputs: names of the inputs.
        parameters: names of the parameters that are arguments; the others are fixed.
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
    _equations: Any

    def __repr__(self) -> str:
        """Return the name and the numbers of values."""
        sizes = (
            f"{len(getattr(self, name))} in {name}"
            for name in ("state", "inputs", "parameters", "outputs")
        )
        return f"<Model of {self.name}: {', '.join(sizes)}>"

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

    @cached_property
    def rates(self) -> Any:
        """Function of state, inputs, parameters, t: the time derivative of the state.

        It is zero for numbers that only steps change. A component has it if it has a hook `rates`.
        """
        return self._function("rates", ("state", "inputs", "parameters", "t"))

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
        title, options = f"{re.sub(r'[^A-Za-z0-9]+', '_', self.name)}_{name}", {"cse": True}
        names = [*given], [*results]
        return ca.Function(title, [*given.values()], columns, *names, options)


def _column(ca: Any, numbers: Iterable[Value]) -> Any:
    """Return a column vector of numbers and symbols."""
    column = [*map(ca.SX, numbers)]
    return ca.vertcat(*column) if column else ca.SX(0, 1)


class _Component:
    """One component as a model: its vectors, and its functions of them."""

    def __init__(
        self, definition: Definition, given: Mapping[str, object], free: Free = None
    ) -> None:
        self._equations = Equations(definition)
        ports = {
            causality: [port for port in definition.ports if port.causality == causality]
            for causality in ("input", "output", "parameter")
        }
        values = self._values = settled(definition, given)
        self._free = chosen(
            [port.name for port in definition.parameters.ports if port.type == "Real"], free
        )
        self.vectors: dict[str, list[Any]] = {
            "state": self._equations.names,
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
        after = equations.step(given, equations.restored(given, before), t, h)
        shown = (before, t) if equations.is_sampled else (after, t + h)
        return {"next": after, "outputs": equations.outputs(given, *shown)}

    def start(self, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Return the state at the start."""
        return {"state": self._equations.start(self._given(inputs, parameters), t)}

    def observe(self, state: Any, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Return the outputs in a state."""
        now = filled(self._equations.types["state"], iter(state))
        return {"outputs": self._equations.outputs(self._given(inputs, parameters), now, t)}

    def rates(self, state: Any, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Return the time derivative of a state."""
        now = filled(self._equations.types["state"], iter(state))
        return {"rates": self._equations.rates(self._given(inputs, parameters), now, t)}

    def _given(self, inputs: Any, parameters: Any) -> dict[str, Value]:
        values = {**self._values, **dict(zip(self._free, parameters, strict=True))}
        return self._equations.given(values, inputs)


@dataclass
class _Moment:
    """The numbers of a system between two actions.

    Attributes:
        states: states of the components.
        values: inputs and outputs of the components.

    """

    states: dict[str, Value]
    values: dict[PortName, Value]


class _System:
    """A system as a model: one communication step of all components."""

    def __init__(self, prepared: Prepared, free: Free = None) -> None:
        if prepared.events or prepared.input_tables:
            raise InputError(
                "a function has no events and no tables of inputs: take the system from load, "
                "which leaves them out"
            )
        for refused in refusals(prepared.system):
            raise InputError(refused)
        self._plan = straight(prepared.plan)
        slow = [name for name, n in self._plan.decimations.items() if n > 1]
        if slow:
            raise InputError(f"{slow[0]}: takes longer steps, which a function cannot have")
        self._stages = self._plan.stages()
        self._definitions = definitions_of(self._system)
        made = {definition: Equations(definition) for definition in self._definitions.values()}
        self._equations = {name: made[of] for name, of in self._definitions.items()}
        self._ports = {
            PortName(name, port.name): port
            for name, definition in self._definitions.items()
            for port in definition.ports
        }
        fed = {connection.target for connection in self._system.connections}
        inputs = self._named("input")
        self._open = [port for port in inputs if port not in fed]
        self._outputs = self._named("output")
        self._values = {
            port: start_of(self._system, port, self._ports[port])
            for port in (*self._named("parameter"), *self._open)
        }
        reals = {
            str(port): port
            for port in self._named("parameter")
            if self._ports[port].type == "Real" and port.port != H_MAX
        }
        self._free = [reals[name] for name in chosen([*reals], free)]
        self._turns = {name: self._internal_steps(name) for name in self._definitions}
        #: Inputs and outputs that a step takes from the step before.
        self._held = [port for port in (*inputs, *self._outputs) if port not in self._open]
        self._held = self._needed()
        states = [
            f"{name}.{path}"
            for name, equations in self._equations.items()
            for path in equations.names
        ]
        self.vectors: dict[str, list[Any]] = {
            "state": [*states, *map(str, self._held)],
            "inputs": [*map(str, self._open)],
            "parameters": [*map(str, self._free)],
            "outputs": [*map(str, self._outputs)],
            "default_inputs": [_number(self._values[port]) for port in self._open],
            "default_parameters": [self._values[port] for port in self._free],
        }

    @property
    def _system(self) -> System:
        return self._plan.system

    def _named(self, causality: str) -> list[PortName]:
        return [name for name, port in self._ports.items() if port.causality == causality]

    def _internal_steps(self, name: str) -> int:
        """Return the number of internal steps of a component in a step."""
        port = PortName(name, H_MAX)
        if self._definitions[name].behaviour.h_max is None:
            return 1
        longest = float(self._values[port]) * (1.0 + euler.ROUNDING)
        return euler.internal_steps(self._plan.experiment.step, longest)

    def _needed(self) -> list[PortName]:
        """Return the held values that states and outputs after a step depend on."""
        ca = casadi()
        numbers = {port: ca.SX.sym(f"held_{i}") for i, port in enumerate(self._held)}
        ports = {symbol.name(): port for port, symbol in numbers.items()}
        moment = self._moment(repeat(1.0), repeat(1.0))
        moment.values |= numbers
        for name, equations in self._equations.items():
            symbols = ca.vertsplit(ca.SX.sym(name, count(equations.types["state"])))
            moment.states[name] = filled(equations.types["state"], iter(symbols))
        values = self._parameters([ca.SX.sym(str(port)) for port in self._free])
        self._step(moment, values, ca.SX.sym("h"), ca.SX.sym("t"))
        asked = [*numbers_in(tuple(moment.states.values()))]
        asked += [moment.values[port] for port in self._outputs]
        needed: set[PortName] = set()
        while asked:
            symbols = ca.symvar(ca.vertcat(*map(ca.SX, asked)))
            new = {ports[s.name()] for s in symbols if s.name() in ports} - needed
            needed |= new
            asked = [moment.values[port] for port in new]
        return [port for port in self._held if port in needed]

    # The functions

    def advance(self, state: Any, inputs: Any, parameters: Any, h: Any, t: Any) -> dict[str, Any]:
        """Return the state after a step, and the outputs that are shown then."""
        moment = self._moment(iter(state), iter(inputs))
        self._step(moment, self._parameters(parameters), h, t)
        return {"next": self._state(moment), "outputs": self._shown(moment)}

    def start(self, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Return the state at the start."""
        moment = self._settled(inputs, self._parameters(parameters), t, self._rounds)
        return {"state": self._state(moment)}

    def observe(self, state: Any, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Return the outputs in a state."""
        if self._stages.passing is None:
            raise InputError(
                f"observe: outputs in the order {self._plan.experiment.order} belong to different "
                "times; take the outputs of advance"
            )
        moment, values = self._moment(iter(state), iter(inputs)), self._parameters(parameters)
        self._refresh(moment, values, t)
        self._pass(moment, values, t)
        return {"outputs": self._shown(moment)}

    def rates(self, state: Any, inputs: Any, parameters: Any, t: Any) -> dict[str, Any]:
        """Refuse: components change at different times."""
        raise InputError("rates: a system makes steps; take the rates of its components")

    def _parameters(self, free: Iterable[Value]) -> dict[PortName, Value]:
        return {**self._values, **dict(zip(self._free, free, strict=True))}

    def _moment(self, state: Iterator[Value], inputs: Iterator[Value]) -> _Moment:
        states = {
            name: filled(equations.types["state"], state)
            for name, equations in self._equations.items()
        }
        values: dict[PortName, Value] = dict.fromkeys(self._ports, 0.0)
        values |= {port: next(state) for port in self._held}
        values |= {port: next(inputs) for port in self._open}
        return _Moment(states, values)

    def _state(self, moment: _Moment) -> Value:
        return (*moment.states.values(), *(moment.values[port] for port in self._held))

    def _shown(self, moment: _Moment) -> Value:
        return tuple([moment.values[port] for port in self._outputs])

    # One step

    def _step(self, moment: _Moment, values: Mapping[PortName, Value], h: Value, t: Value) -> None:
        """Make the step from a time on; its inputs count from its beginning."""
        self._refresh(moment, values, t)
        if not self._plan.arrangement.late:
            self._pass(moment, values, t)
        for stage in self._stages.stepping:
            self._act(stage, moment, values, t, h)
        self._pass(moment, values, t + h)

    def _refresh(self, moment: _Moment, values: Mapping[PortName, Value], t: Value) -> None:
        """Compute the outputs that follow from the states, so that no state has to hold them."""
        for name, equations in self._equations.items():
            component = self._system.components[name]
            if not equations.is_sampled:
                before = {**moment.values}
                self._evaluate(name, moment, values, t)
                moment.values |= {
                    port: before[port]
                    for port in self._outputs
                    if port.component == name and component.has_feedthrough(port.port)
                }

    def _pass(self, moment: _Moment, values: Mapping[PortName, Value], t: Value) -> None:
        """Pass values of a time on, if the order does."""
        for stage in self._stages.passing or ():
            self._act(stage, moment, values, t, 0.0)

    def _act(
        self, stage: Stage, moment: _Moment, values: Mapping[PortName, Value], t: Value, h: Value
    ) -> None:
        self._feed(stage.connections, moment)
        for visit in stage.visits:
            if visit.steps:
                self._advance(visit, moment, values, t, h)
        for visit in stage.visits:
            behaviour = self._definitions[visit.component].behaviour
            is_done = behaviour.is_sampled and visit.steps
            if behaviour.takes("outputs", "inputs") and not is_done and self._reads(visit):
                end = t + h if visit.steps else t
                self._evaluate(visit.component, moment, values, end)

    def _feed(self, connections: Iterable[Connection], moment: _Moment) -> None:
        """Pass values along connections at the same time."""
        moment.values |= {wire.target: self._passed(wire, moment) for wire in connections}

    def _passed(self, wire: Connection, moment: _Moment) -> Value:
        value, change = moment.values[wire.source], wire.transformation
        if change is None:
            return value
        if isinstance(change, Linear):
            return change.factor * value + change.offset
        joined = self._equations[wire.target.component].joined
        for source, target in change.pairs:
            value = joined(moment.values[wire.source] == source, target, value)
        return value

    def _reads(self, visit: Visit) -> bool:
        names = [port.port for port in self._outputs if port.component == visit.component]
        return bool(visit.types_read(self._system.components[visit.component], names))

    def _advance(
        self,
        visit: Visit,
        moment: _Moment,
        values: Mapping[PortName, Value],
        t: Value,
        h: Value,
    ) -> None:
        name, equations = visit.component, self._equations[visit.component]
        if equations.is_sampled and visit.takes:
            self._evaluate(name, moment, values, t)
        given, n = self._given(name, moment, values), self._turns[name]
        state = equations.restored(given, moment.states[name])
        for i in range(n):
            state = equations.step(given, state, t + i * (h / n), h / n)
        moment.states[name] = state
        follows = self._definitions[name].behaviour.takes("outputs", "inputs")
        if not equations.is_sampled and not follows:
            self._evaluate(name, moment, values, t + h)

    def _evaluate(
        self, name: str, moment: _Moment, values: Mapping[PortName, Value], t: Value
    ) -> None:
        """Compute the outputs of a component."""
        given = self._given(name, moment, values)
        shown = self._equations[name].outputs(given, moment.states[name], t)
        ports = (port for port in self._outputs if port.component == name)
        moment.values |= zip(ports, numbers_in(shown), strict=True)

    def _given(
        self, name: str, moment: _Moment, values: Mapping[PortName, Value]
    ) -> dict[str, Value]:
        definition = self._definitions[name]
        parameters = {
            port.name: values[PortName(name, port.name)] for port in definition.parameters.ports
        }
        inputs = [
            moment.values[PortName(name, port.name)]
            for port in definition.ports
            if port.causality == "input"
        ]
        return self._equations[name].given(parameters, inputs)

    # The start

    @cached_property
    def _rounds(self) -> int:
        """Number of rounds after which values at the start rest, with the default values."""
        inputs = self.vectors["default_inputs"]
        moments = [self._settled(inputs, self._values, 0.0, n) for n in (1, 2)]
        while any(
            abs(moments[-1].values[port] - moments[-2].values[port])
            > _SAME + _SAME * abs(moments[-2].values[port])
            for port in self._outputs
        ):
            if len(moments) > _MOST_ROUNDS:
                raise InputError("values at the start do not come to rest")
            moments.append(self._settled(inputs, self._values, 0.0, len(moments) + 1))
        return len(moments) - 1

    def _settled(
        self, inputs: Iterable[Value], values: Mapping[PortName, Value], t: Value, rounds: int
    ) -> _Moment:
        """Pass values at the start along all connections some times."""
        moment = self._moment(repeat(0.0), iter(inputs))
        for wire in self._system.connections:
            moment.values[wire.target] = _number(self._ports[wire.target].start)
        order = [name for names in self._plan.arrangement.settling for name in names]
        turn = {name: i for i, name in enumerate(order)}
        early = {
            wire.source.component
            for wire in self._system.connections
            if turn[wire.source.component] >= turn[wire.target.component]
        }
        for name in (name for name in self._equations if name in early):
            self._begin(name, moment, values, t)
        for _ in range(rounds):
            for name in order:
                self._feed(self._system.feeding[name], moment)
                self._begin(name, moment, values, t)
        self._pass(moment, values, t)
        return moment

    def _begin(
        self, name: str, moment: _Moment, values: Mapping[PortName, Value], t: Value
    ) -> None:
        """Compute the state and the outputs of a component at the start."""
        given = self._given(name, moment, values)
        moment.states[name] = self._equations[name].start(given, t)
        self._evaluate(name, moment, values, t)


class Equations:
    """Hooks of a component with symbols.

    Attributes:
        types: types of the groups that hooks take.
        names: names of the numbers in the state.
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
        self.names = _names_in(self._behaviour.state)
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

    def step(self, given: Mapping[str, Value], state: Value, t: Value, h: Value) -> Value:
        """Return the state after an internal step."""
        if "update" not in self._functions:
            return ()
        known = {**given, "state": state, "t": t, "h": h}
        return self._call("update", self._derived("update", known))

    def rates(self, given: Mapping[str, Value], state: Value, t: Value) -> Value:
        """Return the time derivative of a state; zero for fields without one.

        Raises:
            InputError: there is no hook `rates`.

        """
        if "rates" not in self._functions:
            raise InputError(f"{self._definition.name}: has no hook rates, only steps")
        known = self._derived("rates", {**given, "state": state, "t": t})
        returns, whole = self._functions["rates"].returns, self.types["state"]
        assert isinstance(returns, Record) and isinstance(whole, Record)
        found = dict(
            zip([name for name, _ in returns.fields], self._call("rates", known), strict=True)
        )
        return tuple([found.get(name, (0.0,) * count(part)) for name, part in whole.fields])

    def outputs(self, given: Mapping[str, Value], state: Value, t: Value) -> Value:
        """Return the outputs in a state, without noise."""
        known = {**given, "state": self.restored(given, state), "t": t}
        known = self._derived("outputs", known)
        shown = self._call("outputs", known)
        if not (noisy := self._behaviour.noisy):
            return shown
        measured = self._functions["measured"]
        drawn = filled(measured.arguments["n"], repeat(0.0))
        place = [*self._behaviour.outputs._fields].index(noisy)
        group = self._call("measured", {**known, "n": drawn, noisy: shown[place]})
        return (*shown[:place], group, *shown[place + 1 :])

    def restored(self, given: Mapping[str, Value], state: Value) -> Value:
        """Return the state with which a run continues: the guard may have replaced it."""
        if "credible" not in self._functions:
            return state
        known = {**given, "state": state}
        credible = self._call("credible", known)
        if credible is True:
            return state
        return self.joined(credible, state, self._call("restarted", known, unless=credible))

    def joined(self, test: Any, this: Value, other: Value) -> Value:
        """Return one of two values, chosen by a condition."""
        return self._evaluator.joined(test, this, other)

    def _derived(self, hook: str, known: dict[str, Value]) -> dict[str, Value]:
        """Return the arguments with the derived values, if a hook takes them."""
        if "derived" not in self._functions[hook].arguments:
            return known
        return {**known, "derived": self._call("derive", known)}

    def _call(self, hook: str, known: Mapping[str, Value], unless: Any = False) -> Value:
        function = self._functions[hook]
        given = (known[name] for name in function.arguments)
        return self._evaluator.call(function, *given, unless=unless)


def settled(definition: Definition, given: Mapping[str, object]) -> dict[str, Any]:
    """Return the values of all parameters of a component, by name.

    Args:
        definition: definition of the component.
        given: values that differ from the defaults; of an enumeration also the name of a choice.

    Raises:
        InputError: there is no such parameter, or it does not take the value.

    """
    ports = {port.name: port for port in definition.parameters.ports}
    values = {name: typed(port, port.start or 0) for name, port in ports.items()}
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
            value = int(port.choices[value])
        try:
            values[name] = typed(port, port.checked(value))  # type: ignore[arg-type]
        except Refusal as error:
            raise InputError(str(error)) from None
    if check := definition.behaviour.hooks["check"]:
        try:
            check(definition.parameters.of(values))
        except (ArithmeticError, Refusal, ValueError) as error:
            raise InputError(str(error)) from None
    return values


def chosen(names: Sequence[str], free: Free) -> list[str]:
    """Return the names of parameters that are symbols.

    Args:
        names: of all Real parameters.
        free: names of some, or of groups such as `plant` and `plant.eta0`; None: all.

    Raises:
        InputError: there is no such Real parameter.

    """
    if free is None:
        return [*names]
    groups = {name: tuple(name + end for end in (".", "[")) for name in free}
    for group, starts in groups.items():
        if not any(name == group or name.startswith(starts) for name in names):
            raise InputError(f"{group}: no such Real parameter{did_you_mean(group, names)}")
    return [
        name
        for name in names
        if any(name == group or name.startswith(starts) for group, starts in groups.items())
    ]


def _number(value: Any) -> float:
    return float(value or 0.0)


def _names_in(state: Any) -> list[str]:
    """Return the names of the numbers in a state: `state.nu_r.u`, `state.P[1,2]`."""
    try:
        ports = [*chain(*declared(state, "local", prefix="state.").values())]
    except Misdeclared:
        # A tuple of several types, which ports cannot be.
        return [*_paths(type_of(state), "state")]
    return [port.name for port in ports]


def _paths(type_: Type, name: str) -> Iterator[str]:
    """Yield the paths of the numbers in a type."""
    if isinstance(type_, Record):
        for field_, part in type_.fields:
            yield from _paths(part, f"{name}.{field_}")
    elif isinstance(type_, Array):
        inner: Type = type_
        indices = [""]
        while isinstance(inner, Array):
            indices = [f"{i},{k}" if i else f"{k}" for i in indices for k in range(1, inner.n + 1)]
            inner = inner.item
        for index in indices:
            yield from _paths(inner, f"{name}[{index}]")
    else:
        yield name


def model(
    source: Source, parameters: Mapping[str, object] | None = None, free: Free = None
) -> Model:
    """Return a component or a system as functions of CasADi.

    Args:
        source: name of a component of the bundle, path of a component's file, or a system: name of
            a scenario, path of a file such as .toml or .ssp, a dictionary with the entries of a
            scenario file, or a system from `load`.
        parameters: values of parameters by name, in a system by `component.parameter`. A Real's
            value replaces its default; other parameters are fixed, since they may choose equations.
        free: names of the Real parameters that the functions take, or of groups such as `plant`
            and `plant.eta0`; the others are fixed, too, which makes the functions smaller. None:
            all.

    Raises:
        InputError: there is no such component, system or parameter, casadi is missing, or the
            equations need a number where there is a symbol; the message names file and line.

    """
    casadi()
    definition = None if isinstance(source, (Mapping, System)) else _definition(source)
    if definition is None:
        options = SystemOptions(source, parameters)
        prepared = prepare_options(options, is_open=True)
        system = _System(prepared, free)
        return Model(prepared.scenario.name, _equations=system, **system.vectors)
    try:
        made = _Component(definition, parameters or {}, free)
    except Untranslatable as error:
        raise InputError(str(error)) from None
    return Model(definition.name, _equations=made, **made.vectors)


def _definition(source: str | Path) -> Definition | None:
    """Return the definition of a component, from its name or the path of its file; else None."""
    name, path = str(source), Path(source)
    if name in components():
        return source_of(name).definition
    if path.suffix == ".py" or (path / f"{path.resolve().name}.py").is_file():
        try:
            return definition_in(path)
        except Misdeclared as error:
            raise InputError(message_of(error, script_in(path))) from None
    known = [*components(), *scenario_names()]
    if name not in known and not is_path(name) and not path.exists():
        raise InputError(f"{name}: no such component or scenario{did_you_mean(name, known)}")
    return None


def function(
    source: Source, parameters: Mapping[str, object] | None = None, free: Free = None
) -> Any:
    """Return the step of a component or a system: `advance` of its :func:`model`."""
    return model(source, parameters, free).advance


def refusal(
    source: Source, parameters: Mapping[str, object] | None = None, free: Free = None
) -> str:
    """Return the reason why something cannot be a function of CasADi; empty if it can."""
    try:
        function(source, parameters, free)
    except InputError as error:
        return str(error)
    return ""
