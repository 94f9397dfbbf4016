"""Indices in C: what takes a row after the other, and gives numbers at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from fmus.language.build import Program
from fmus.language.types import type_of
from fmus.native.emit import Emitter
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer
from orchestrator.program.kind import function, initializer, scalars
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System
from orchestrator.vehicle.reduction import sources_of
from orchestrator.vehicle.signals import Loop


class Looking(NamedTuple):
    """An index of a system: what makes it, and where its signals are.

    Attributes:
        reducer: that makes it.
        sources: of the ports of its rows, in their order: ports or parameters, or constants.

    """

    reducer: Reducer
    sources: Sequence[PortName | float]


def looking_at(system: System, loop: Loop, reducers: Iterable[Reducer]) -> Iterator[Looking]:
    """Those of some indices of a loop for which a system has all signals and parameters."""
    names = [
        f"{name}.{variable.name}"
        for name, component in system.components.items()
        for causality in ("input", "output", "parameter")
        for variable in component.having(causality)
    ]
    places = {name: i for i, name in enumerate(names)}
    for reducer in reducers:
        found = sources_of(reducer, loop, places, {})
        if not found.missing:
            sources: dict[str, PortName | float] = {**found.constants}
            sources |= {
                port: system.named(port_name(names[i])) for port, i in found.places.items()
            }
            yield Looking(reducer, [sources[port.name] for port in reducer.ports])


#: Where a row has the value of a port, as an expression in C.
Source: TypeAlias = Callable[[Port], str]


@dataclass(frozen=True)
class ReducerText:
    """An index in C.

    Attributes:
        reducer: what it says.
        program: with its hooks as trees.
        emitter: of all equations.
        name: of its structure, and what its functions begin with.

    """

    reducer: Reducer
    program: Program
    emitter: Emitter
    name: str

    def structure(self) -> str:
        """Its structure."""
        state, row = map(self._type, (self.reducer.state, self.reducer.inputs))
        before = f"    {row} before; /* the last row */\n" if self._looks_back else ""
        return (
            f"typedef struct {{\n    int begun; /* -1: it has raised */\n    {state} state;\n"
            f"{before}}} {self.name};"
        )

    def text(self) -> Iterator[str]:
        """What takes a row, and what gives its numbers."""
        row, found = self._type(self.reducer.inputs), self._type(self.reducer.outputs)
        start, update = self._call("start"), self._call("update", state="it->state", before="before")
        lines = [
            "Error noted = {0}, *error = &noted;",
            "if (it->begun < 0) return;",
            "if (it->begun > 0) {",
        ]
        if self._looks_back:
            lines.append(f"    const {row} before = it->before;")
        if "acting" in self.reducer.arguments("update"):
            lines.append(f"    const {row} acting = acts_at_end ? inputs : before;")
        lines += [
            f"    it->state = {update};",
            "} else {",
            f"    it->state = {start};",
            "}",
            "it->begun = noted.raised ? -1 : 1;",
            *(["it->before = inputs;"] if self._looks_back else []),
            "(void)error;",
        ]
        yield function(
            f"APART void {self.name}_look({self.name} *it, {row} inputs, int acts_at_end, double t,\n"
            "                 double h, double begin, double end)",
            lines,
            ("acts_at_end", "t", "h", "begin", "end"),
        )
        results = [port for ports in self.reducer.results.values() for port in ports]
        numbers = (place.text for place in scalars(type_of(self.reducer.outputs), "all"))
        yield "/* Gives the numbers, which are none before the first row; whether it has raised. */\n" + function(
            f"APART int {self.name}_give(const {self.name} *it, double t, double begin, double end,\n"
            "                 double found[])",
            [
                "Error noted = {0}, *error = &noted;",
                "(void)error;",
                f"for (int i = 0; i < {len(results)}; i++) found[i] = NAN;",
                "if (it->begun < 1) return it->begun < 0;",
                f"const {found} all = {self._call('outputs', state='it->state')};",
                "if (noted.raised) return 1;",
                *(f"found[{i}] = {text};" for i, text in enumerate(numbers)),
                "return 0;",
            ],
            ("t", "begin", "end"),
        )

    @property
    def _looks_back(self) -> bool:
        """Whether it takes the row before."""
        return not {"before", "acting"}.isdisjoint(self.reducer.arguments("update"))

    def row(self, source: Source) -> str:
        """A row, whose numbers come from a source."""
        places = map(source, self.reducer.ports)
        type_ = type_of(self.reducer.inputs)
        return f"({self.emitter.type(type_)}){initializer(type_, places)}"

    def _type(self, hint: object) -> str:
        return self.emitter.type(type_of(hint))

    def _call(self, hook: str, **given: str) -> str:
        function = self.program.function(self.reducer.hooks[hook])
        return self.emitter.call(function, [given.get(one, one) for one in function.arguments])
