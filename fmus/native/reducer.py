"""Indices in C: functions that process rows one by one, and return numbers at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from fmus.language.build import Program
from fmus.language.types import type_of
from fmus.native.emit import Emitter, number_in_c
from fmus.native.pieces import function, initializer, scalars, structure
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer

#: Returns the expression in C of a port's value in a row.
Source = Callable[[Port], str]


@dataclass(frozen=True)
class ReducerText:
    """An index in C.

    Attributes:
        reducer: its hooks and results.
        program: trees of its hooks.
        emitter: emitter of all equations.
        name: name of its structure, and prefix of its functions.
        is_alone: True if rows are processed at one place only, so that the function may be inlined.

    """

    reducer: Reducer
    program: Program
    emitter: Emitter
    name: str
    is_alone: bool = False

    def structure(self) -> str:
        """Write its structure."""
        state, row = map(self._type, (self.reducer.state, self.reducer.inputs))
        before = [f"{row} before; /* the last row */"] * self._looks_back
        rows = ["int begun; /* -1: a hook has failed */", f"{state} state;", *before]
        return structure(self.name, rows)

    def text(self) -> Iterator[str]:
        """Yield the functions that process a row and return the numbers."""
        row, outputs = self._type(self.reducer.inputs), self._type(self.reducer.outputs)
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
            f"const {outputs} all = {self._call('outputs', state='it->state')};",
            *(f"found[{i}] = {text};" for i, text in enumerate(numbers)),
        ]
        yield "/* Returns the numbers, which are NaN before the first row. */\n" + function(
            f"APART void {self.name}_give(const {self.name} *it, double t, double begin,\n"
            "                 double end, double found[], Error *error)",
            lines,
            ("t", "begin", "end", "error"),
        )

    def over_rows(self) -> str:
        """Write functions that process rows of any run; callers pass the numbers of columns."""
        places = {port.name: k for k, port in enumerate(self.reducer.ports)}
        row = self.row(lambda port: _PLACE.format(places[port.name]))
        return _ROWS.format(name=self.name, row=row)

    def over_run(self) -> str:
        """Write functions that also reduce a finished run."""
        last = self.reducer.last
        since = "-INFINITY" if last is None else f"rows[(n - 1) * width] - {number_in_c(last)}"
        return f"{self.over_rows()}\n{_RUN.format(since=since)}"

    @property
    def _looks_back(self) -> bool:
        """True if it needs the row before."""
        return not {"before", "acting"}.isdisjoint(self.reducer.arguments("update"))

    def row(self, source: Source) -> str:
        """Return the expression of a row from the expressions of its numbers."""
        places = map(source, self.reducer.ports)
        type_ = type_of(self.reducer.inputs)
        return f"({self.emitter.type(type_)}){initializer(type_, places)}"

    def _type(self, hint: object) -> str:
        return self.emitter.type(type_of(hint))

    def _call(self, hook: str, **given: str) -> str:
        function = self.program.function(self.reducer.hooks[hook])
        return self.emitter.call(function, [given.get(name, name) for name in function.arguments])


_ROWS = """\
/* The state between blocks of rows, and the time of the last row [s]. */
typedef struct {{
    {name} of;
    double time;
    Error failure;
}} kept;

EXPORTED size_t size_of_rows(void) {{ return sizeof(kept); }}

/* Processes n rows of a width; returns the number of rows before a failure. */
EXPORTED int take_rows(kept *it, const double rows[], int n, int width, const int from[],
                       const double constants[], int acts_at_end, double begin, double end) {{
    for (int k = 0; k < n; k++, rows += width) {{
        const double t = rows[0], h = t - it->time;
        {name}_look(&it->of, {row},
            acts_at_end, t, h, begin, end, &it->failure);
        if (it->failure.raised) return k;
        it->time = t;
    }}
    return n;
}}

/* Returns true if a hook has failed. */
EXPORTED int give_numbers(kept *it, double begin, double end, double found[]) {{
    {name}_give(&it->of, it->time, begin, end, found, &it->failure);
    return it->failure.raised;
}}
"""

_RUN = """\
/* Reduces n rows; returns true if a hook has failed. */
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

#: The expression of a value in a row, or of a constant.
_PLACE = "from[{0}] < 0 ? constants[{0}] : rows[from[{0}]]"

_WHY = "EXPORTED const char *why(const kept *it) { return it->failure.why.text; }\n"


def text_over_rows(reducer: Reducer) -> str | None:
    """Translate an index to a C source that processes rows of any run.

    Returns:
        The source; None if the index is outside the language of equations.

    """
    program = Program(*reducer.hooks.values())
    if program.mistakes:
        return None
    emitter = Emitter(program.functions.values())
    text = ReducerText(reducer, program, emitter, emitter.unused(f"{reducer.name}_index"))
    functions, rows = [*text.text()], text.over_rows()
    head = '#include "arithmetic.h"\n\n#define APART static'
    return "\n\n".join([head, emitter.text(), text.structure(), *functions, rows, _WHY])
