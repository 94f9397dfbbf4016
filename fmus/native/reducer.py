"""Indices in C: what takes a row after the other, and gives numbers at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from fmus.language.build import Program
from fmus.language.types import type_of
from fmus.native.emit import Emitter, number_in_c
from fmus.native.pieces import function, initializer, scalars, structure
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer

#: Where a row has the value of a port, as an expression in C.
Source = Callable[[Port], str]


@dataclass(frozen=True)
class ReducerText:
    """An index in C.

    Attributes:
        reducer: what it says.
        program: with its hooks as trees.
        emitter: of all equations.
        name: of its structure, and what its functions begin with.
        is_alone: whether rows are taken at one place only, where that may stand.

    """

    reducer: Reducer
    program: Program
    emitter: Emitter
    name: str
    is_alone: bool = False

    def structure(self) -> str:
        """Its structure."""
        state, row = map(self._type, (self.reducer.state, self.reducer.inputs))
        before = [f"{row} before; /* the last row */"] * self._looks_back
        rows = ["int begun; /* -1: it has raised */", f"{state} state;", *before]
        return structure(self.name, rows)

    def text(self) -> Iterator[str]:
        """What takes a row, and what gives its numbers."""
        row, found = self._type(self.reducer.inputs), self._type(self.reducer.outputs)
        start, update = self._call("start"), self._call("update", state="it->state")
        lines = [
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
            "it->begun = error->raised ? -1 : 1;",
            *(["it->before = inputs;"] if self._looks_back else []),
        ]
        how = "WITHIN" if self.is_alone else "APART"
        yield function(
            f"{how} void {self.name}_look({self.name} *it, {row} inputs, int acts_at_end,\n"
            "                 double t, double h, double begin, double end, Error *error)",
            lines,
            ("acts_at_end", "t", "h", "begin", "end"),
        )
        results = [port for ports in self.reducer.results.values() for port in ports]
        numbers = (place.text for place in scalars(type_of(self.reducer.outputs), "all"))
        lines = [
            f"for (int i = 0; i < {len(results)}; i++) found[i] = NAN;",
            "if (it->begun < 1) return;",
            f"const {found} all = {self._call('outputs', state='it->state')};",
            *(f"found[{i}] = {text};" for i, text in enumerate(numbers)),
        ]
        yield "/* Gives the numbers, which are none before the first row. */\n" + function(
            f"APART void {self.name}_give(const {self.name} *it, double t, double begin,\n"
            "                 double end, double found[], Error *error)",
            lines,
            ("t", "begin", "end", "error"),
        )

    def over_rows(self) -> str:
        """What takes rows of any run: which columns it takes, the caller says."""
        places = {port.name: k for k, port in enumerate(self.reducer.ports)}
        row = self.row(lambda port: _PLACE.format(places[port.name]))
        return _ROWS.format(name=self.name, row=row)

    def over_run(self) -> str:
        """What gives the numbers of a run whose rows are all there."""
        last = self.reducer.last
        since = "-INFINITY" if last is None else f"rows[(n - 1) * width] - {number_in_c(last)}"
        return f"{self.over_rows()}\n{_RUN.format(since=since)}"

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


_ROWS = """\
/* What is kept of rows that come in blocks, and when the last one was [s]. */
typedef struct {{
    {name} of;
    double time;
    Error error;
}} kept;

EXPORTED size_t size_of_rows(void) {{ return sizeof(kept); }}

/* Takes n rows of a width; how many were taken before one raised. */
EXPORTED int take_rows(kept *it, const double rows[], int n, int width, const int from[],
                       const double constants[], int acts_at_end, double begin, double end) {{
    for (int k = 0; k < n; k++, rows += width) {{
        const double t = rows[0], h = t - it->time;
        {name}_look(&it->of, {row},
            acts_at_end, t, h, begin, end, &it->error);
        if (it->error.raised) return k;
        it->time = t;
    }}
    return n;
}}

/* Gives the numbers; whether that raised. */
EXPORTED int give_numbers(kept *it, double begin, double end, double found[]) {{
    {name}_give(&it->of, it->time, begin, end, found, &it->error);
    return it->error.raised;
}}
"""

_RUN = """\
/* Gives the numbers of n rows; whether something has raised. */
EXPORTED int reduce(const double rows[], int n, int width, const int from[],
                    const double constants[], int acts_at_end, double begin, double end,
                    double found[]) {{
    kept it;
    const double since = n > 0 ? {since} : 0.0;
    memset(&it, 0, sizeof it);
    for (; n > 0 && rows[0] < since; n--) rows += width;
    take_rows(&it, rows, n, width, from, constants, acts_at_end, begin, end);
    return give_numbers(&it, begin, end, found);
}}
"""

#: A value of a row, or one that never changes.
_PLACE = "from[{0}] < 0 ? constants[{0}] : rows[from[{0}]]"

_WHY = "EXPORTED const char *why(const kept *it) { return it->error.why.text; }\n"


def text_over_rows(reducer: Reducer) -> str | None:
    """An index in C over rows of any run, as a source of its own.

    None: it is outside the language of equations.
    """
    program = Program(*reducer.hooks.values())
    if program.mistakes:
        return None
    emitter = Emitter(program.functions.values())
    one = ReducerText(reducer, program, emitter, emitter.unused(f"{reducer.name}_index"))
    functions, rows = [*one.text()], one.over_rows()
    head = '#include "arithmetic.h"\n\n#define APART static'
    return "\n\n".join([head, emitter.text(), one.structure(), *functions, rows, _WHY])
