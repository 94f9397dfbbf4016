"""The slave of a component, made from its ports and its behaviour.

Its methods are written out and compiled, because they run once a step: `advance` of a component
that derives something of its state and may restart becomes

    def advance(self, state, inputs, t, h, n):
        derived = self._derived
        if not credible(self.parameters, state, inputs):
            self.say(RESTARTED.format(t=t), warning, RESTARTED)
            state = restarted(self.parameters, state, inputs)
            derived = None
        if derived is None:
            derived = derive(self.parameters, state)
        state, self._next, outputs = advance(self.parameters, state, derived, inputs, h)
        return state, outputs

and the method of a simpler one is shorter by what it lacks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from math import isfinite
from random import Random
from types import ModuleType, new_class
from typing import Any

from pythonfmu.enums import Fmi2Status

from fmus.ports.behaviour import HOOKS, Behaviour
from fmus.ports.definition import define
from fmus.ports.groups import SCOPE, Nothing, gathered, hints_of, reals_first, scattered
from fmus.ports.port import Port, Refusal
from auv_fmu.quantities import group_name
from fmus.python.component import Component, Inputs, Outputs, Parameters, State

#: Numbers that are drawn between two notes of a generator's state.
_MOST_DRAWN = 1_000


class Noisy(Component[State, Inputs, Outputs, Parameters]):
    """A component one of whose outputs has noise, which Python's generator makes.

    To note the generator's state takes as long as a step. So it is noted once in many steps, and
    what was drawn since then is counted, to be drawn again where a step is refused.
    """

    _draws: int  #: in each sample
    _random: Random
    _noted: Any  #: of its state
    _drawn: int  #: since then

    def _use(self, generator: Random) -> None:
        self._random, self._noted, self._drawn = generator, generator.getstate(), 0

    def unsample(self) -> None:
        self._drawn -= self._draws
        self._random.setstate(self._noted)
        for _ in range(self._drawn):
            self._random.gauss(0.0, 1.0)

    def hidden_state(self) -> Any:
        return self._random.getstate() if self._state is not None else None

    def restore_hidden_state(self, hidden: Any) -> None:
        generator = Random()
        generator.setstate(hidden)
        # Some of what setstate takes it changes in silence, or only gauss finds out about.
        *_, following = hidden
        if generator.getstate() != hidden or type(following) not in (float, type(None)):
            raise Refusal("its noise generator has an invalid state")
        if not isfinite(following or 0.0):
            raise Refusal("its noise is not finite")
        self._use(generator)


@cache
def slave_of(name: str, *modules: ModuleType) -> type[Component[Any, Any, Any, Any]]:
    """The class of a component, the same each time: an FMU's script asks once an instance.

    Args:
        name: of the component.
        modules: that define it.

    Raises:
        TypeError: they do not go together.

    """
    definition = define(name, *modules)
    said = definition.behaviour
    outputs = [port for port in definition.ports if port.causality == "output"]
    members: dict[str, Any] = {
        "__module__": modules[0].__package__ or modules[0].__name__,
        "__doc__": definition.summary,
        **definition.about,
        "description": definition.description,
        "ports": definition.ports,
        "parameter_set": definition.parameters,
        "group_of": definition.group_of,
        "_draws": said.draws,
    }
    scope: dict[str, Any] = {
        **SCOPE,
        **said.hooks,
        "Random": Random,
        "nothing": Nothing(),
        "RESTARTED": said.restarted,
        "warning": Fmi2Status.warning,
    }
    for method in (*_steps(said), *_checks(said), *_noise(said, outputs, scope)):
        exec(method, scope, members)
    base: Any = Noisy if said.noisy else Component
    types = (said.state, said.inputs, said.outputs, said.parameters)
    made: type[Component[Any, Any, Any, Any]]
    made = new_class(name, (base[types],), {}, lambda namespace: namespace.update(members))
    return made


def _call(said: Behaviour, hook: str, **given: str) -> str:
    """A call of a hook in a method that has its arguments, and the parameters."""
    given = {"parameters": "self.parameters", **given}
    return f"{hook}({', '.join(given.get(name, name) for name in said.arguments(hook))})"


def _steps(said: Behaviour) -> Iterator[str]:
    """How a run begins and goes on."""
    begin, advance = ["def begin(self, inputs, t):"], ["def advance(self, state, inputs, t, h, n):"]
    if said.noisy:
        # Random takes the magnitude of its seed: a negative one is the number 2^32 above it.
        begin += [f"    self._use(Random({_call(said, 'seed')} % 2**32))"]
    derives = said.hooks["derive"] is not None
    if derives:
        advance += ["    derived = self._derived"]
    if said.hooks["credible"]:
        advance += [
            f"    if not {_call(said, 'credible')}:",
            "        self.say(RESTARTED.format(t=t), warning, RESTARTED)",
            f"        state = {_call(said, 'restarted')}",
            *(["        derived = None"] if derives else []),
        ]
    if derives:
        advance += ["    if derived is None:", f"        derived = {_call(said, 'derive')}"]
    for lines, hook in ((begin, "begin"), (advance, "advance")):
        if derives:
            lines += [
                f"    state, self._next, outputs = {_call(said, hook)}",
                "    return state, outputs",
            ]
        else:
            state = "nothing, " if said.is_stateless else ""
            lines += [f"    return {state}{_call(said, hook)}"]
        yield "\n".join(lines)


def _checks(said: Behaviour) -> Iterator[str]:
    """What is asked of parameters, and of a state that is restored."""
    for hook in ("check", "expected"):
        if said.hooks[hook]:
            arguments = ", ".join(HOOKS[hook])
            call = _call(said, hook, parameters="parameters")
            yield f"def {hook}(self, {arguments}):\n    return {call}"


def _noise(said: Behaviour, outputs: Sequence[Port], scope: dict[str, Any]) -> Iterator[str]:
    """How an output gets its noise; the names that it needs are put into the scope."""
    if said.hooks["measured"] is None:
        return
    order = reals_first(outputs)
    noisy = [port for port in outputs if group_name(port.name) == said.noisy]
    values = [f"values[{order.index(port)}]" for port in noisy]
    hint = hints_of(said.outputs)[said.noisy]
    drawn = iter(["gauss(0.0, 1.0)"] * said.draws)
    n = gathered(hints_of(said.hooks["measured"])["n"], drawn, scope)
    before = gathered(hint, iter(values), scope)
    flat = ", ".join(text for text, _ in scattered(hint, "noisy"))
    after = "noisy" if flat == "*noisy" else f"({flat},)"
    yield (
        "def sample(self, values):\n"
        f"    if self._drawn >= {_MOST_DRAWN}:\n        self._use(self._random)\n"
        f"    self._drawn += {said.draws}\n    gauss = self._random.gauss\n"
        f"    noisy = {_call(said, 'measured', **{'n': n, said.noisy: before})}\n"
        f"    {', '.join(values)}, = noisy = {after}\n    return noisy"
    )
