"""Indices in C: what takes a row after the other, and gives numbers at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from fmus.language.build import Program
from fmus.language.types import Array, Scalar, Type, is_whole, type_of
from fmus.native.emit import Emitter, lines_of, members
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer
from orchestrator.system.names import PortName



class Looking(NamedTuple):
    """An index of a system: what makes it, and where its signals are.

    Attributes:
        reducer: that makes it.
        sources: of the ports of its rows, in their order: ports or parameters, or constants.

    """

    reducer: Reducer
    sources: Sequence[PortName | float]


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
        return (
            f"typedef struct {{\n    int begun; /* -1: it has raised */\n    {state} state;\n"
            f"    {row} before; /* the last row */\n}} {self.name};"
        )

    def text(self) -> Iterator[str]:
        """What takes a row, and what gives its numbers."""
        row = self._type(self.reducer.inputs)
        start = self._call("start")
        update = self._call("update", state="it->state", before="it->before")
        lines = [
            f"{row} acting = acts_at_end ? inputs : it->before;",
            "Error noted = {0}, *error = &noted;",
            "(void)error;", "(void)acting;", "(void)t;", "(void)h;", "(void)begin;", "(void)end;",
            "if (it->begun < 0) return;",
            "if (it->begun) {",
            f"    it->state = {update};",
            "} else {",
            f"    it->state = {start};",
            "}",
            "it->begun = noted.raised ? -1 : 1;",
            "it->before = inputs;",
        ]  # fmt: skip
        head = (
            f"APART void {self.name}_look({self.name} *it, {row} inputs, int acts_at_end, double t,"
            "\n                 double h, double begin, double end) {"
        )
        yield "\n".join([head, *(part for line in lines for part in lines_of(line, "    ")), "}"])
        results = [port for ports in self.reducer.results.values() for port in ports]
        found = self._type(self.reducer.outputs)
        lines = [
            "Error noted = {0}, *error = &noted;",
            "(void)error;", "(void)t;", "(void)begin;", "(void)end;",
            f"for (int i = 0; i < {len(results)}; i++) found[i] = NAN;",
            "if (it->begun < 1) return;",
            f"{found} all = {self._call('outputs', state='it->state')};",
            "if (noted.raised) return;",
            *(f"found[{i}] = {text};" for i, text in enumerate(self._numbers())),
        ]  # fmt: skip
        head = (
            f"APART void {self.name}_give(const {self.name} *it, double t, double begin, double end,"
            "\n                 double found[]) {"
        )
        yield "\n".join([head, *(part for line in lines for part in lines_of(line, "    ")), "}"])

    def row(self, source: Source) -> str:
        """A row, whose numbers come from a source."""
        places = map(source, self.reducer.ports)
        type_ = type_of(self.reducer.inputs)
        return f"({self.emitter.type(type_)}){_initial(type_, places)}"

    def _type(self, hint: object) -> str:
        return self.emitter.type(type_of(hint))

    def _call(self, hook: str, **given: str) -> str:
        function = self.program.function(self.reducer.hooks[hook])
        return self.emitter.call(function, [given.get(one, one) for one in function.arguments])

    def _numbers(self) -> Iterator[str]:
        return _numbers(type_of(self.reducer.outputs), "all")


def _numbers(type_: Type, text: str) -> Iterator[str]:
    if isinstance(type_, Scalar):
        yield text
    for suffix, part in members(type_):
        yield from _numbers(part, text + suffix)


def _initial(type_: Type, places: Iterator[str]) -> str:
    """An initializer of a value from the texts of its numbers."""
    if isinstance(type_, Scalar):
        return f"(int){next(places)}" if is_whole(type_) else next(places)
    parts = ", ".join(_initial(part, places) for _, part in members(type_))
    return f"{{{{{parts}}}}}" if isinstance(type_, Array) else f"{{{parts or '0'}}}"
