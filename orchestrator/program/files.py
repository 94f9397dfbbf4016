"""A whole system as C files for use in another program, such as the firmware of a controller.

`NAME.h` and `NAME.c` are the program. It has no input or output, no allocation and no global
variables; its public names begin with NAME. `NAME_main.c` runs the scenario and prints its table.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

from fmus.language.mathematics import FUNCTIONS
from fmus.language.types import FLOAT, count
from fmus.native.emit import closed, number_in_c, quoted
from fmus.native.pieces import array, function
from fmus.native.translator import deepest
from orchestrator.cosim import Plan, PortName
from orchestrator.machine.errors import InputError
from orchestrator.program.components import definitions_of
from orchestrator.program.writer import CALLS, Text, Unsupported, head_of

#: Descriptions of the calls that a component can refuse.
_REFUSED = ("its parameters", "its inputs", "its outputs", "its step", "a value")

#: Sizes and alignments of numbers.
_NUMBERS = {"double": (8, 8), "float": (4, 4), "int": (4, 4), "uint32_t": (4, 4), "char": (1, 1)}

#: Structures in C, their members, and constants.
_STRUCTURE = re.compile(r"^typedef struct \{\n(.*?)\n\} (\w+);", re.MULTILINE | re.DOTALL)
_MEMBERS = re.compile(r"^ +(\w+) ([\w\[\], ]+);", re.MULTILINE)
_COUNT = re.compile(r"\b([A-Z_]+) = (\d+)\b")

#: A static function or constant, with the comment before it.
_STATIC = re.compile(
    r"(?:^/\*(?:(?!\*/).)*\*/\n)?^static (?:"
    r"(?:inline )?[\w ]+[ *](?P<function>\w+)\([^(){}]*\) \{(?: [^\n]* \}|\n.*?^\})"
    r"|const \w+ (?P<constant>\w+)(?:\[\w*\])? = [^;]*;)\n\n?",
    re.MULTILINE | re.DOTALL,
)

#: Comments and texts.
_TEXTS = re.compile(r"/\*.*?\*/|\"(?:\\.|[^\"\\])*\"", re.DOTALL)

#: Functions of C in addition to Python's, and macros that take either precision.
_OTHERS, _GENERIC = ("fmin", "fmax", "round"), ("isfinite", "isinf", "isnan")

#: Comments and texts, which are kept, and the words of double precision.
_DOUBLES = re.compile(
    rf"(?P<kept>{_TEXTS.pattern})"
    r"|(?P<type>\bdouble\b)|(?P<limit>\bDBL_MAX\b)"
    r"|(?P<number>(?<![\w.])(?:\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)(?![\w.]))"
    rf"|\b(?P<called>{'|'.join([*FUNCTIONS, *_OTHERS])})(?=\()",
    re.DOTALL,
)

#: Smallest normal and largest numbers of single precision.
_LEAST, _MOST = 1.1754943508222875e-38, 3.4028234663852886e38

#: Largest numbers up to which single and double precision have all whole numbers.
_ALL_WHOLE, _ALL_OF_DOUBLE = 2**24, 2**53

#: Passages that assume double precision, and their replacement in single precision.
_PASSAGES = {
    # In single precision, INT_MAX is rounded to a number that is not an int.
    "x <= INT_MAX": "x < 2147483648.0",
    # Tolerance of a step that exceeds the largest internal one.
    "(1.0 + 1e-09)": "(1.0 + 1e-06)",
    # Tolerance of values at rest at the start.
    "1e-12 + 1e-12 * fabs(before)": "1e-06 + 1e-06 * fabs(before)",
    """\
    uint32_t upper = tempered(x[0]) >> 5, lower = tempered(x[1]) >> 6;
    return (upper * 67108864.0 + lower) * (1.0 / 9007199254740992.0);
""": """\
    /* In single precision, the first 24 of Python's 53 bits: all would be rounded to 1. */
    return (tempered(x[0]) >> 8) * (1.0 / 16777216.0);
""",
}

_HEADER = """\
/* {title}
 *
{components}
 *
 * A run, with the parameters of the scenario:
 *
 *     static {name}_simulation it;
 *     static {real} row[{NAME}_COLUMNS];
 *
 *     if ({name}_begin(&it, NULL, {NAME}_STEPS)) ...
 *     for (int k = 0; k <= {NAME}_STEPS; k++) {{
 *         if ({name}_step(&it, row)) ...
 *         ... row[{column}] ...
 *     }}
 *
 * A simulation holds a whole run; there can be several. Nothing is allocated or printed.
 * Up to {stack} bytes of structures are on the stack at once, or twice as many if the compiler
 * inlines functions; the C library takes more.
 */
#ifndef {NAME}_H
#define {NAME}_H

#ifdef __cplusplus
extern "C" {{
#endif

/* Times of the scenario [s]. */
#define {NAME}_START_TIME {start_time}
#define {NAME}_STEP {step}
#define {NAME}_STOP_TIME {stop_time}

/* Number of steps, number of steps of full length, and bytes of a simulation. */
enum {{ {NAME}_STEPS = {steps}, {NAME}_FULL_STEPS = {full_steps}, {NAME}_BYTES = {bytes} }};

/* Components. */
{members}

/* Parameters and unconnected inputs, with their values in the scenario. */
{parameters}

/* Columns of a row: the time, and all inputs and outputs. */
{columns}

/* Memory of a run. */
typedef union {{
    {real} number;
    unsigned char bytes[{NAME}_BYTES];
}} {name}_simulation;

/* A refused call: its component, and the input, counted within the component. If the component is
 * -1, values do not come to rest at the start. */
typedef struct {{
    int component, call, input;
    int steps; /* made before */
}} {name}_refusal;

enum {{ {calls} }};

/* Give the parameters of the scenario, for example to change some. */
void {name}_defaults({real} parameters[]);

/* Begin a run: set parameters (NULL: the scenario's) and settle values. A run of INT_MAX steps has
 * no end. Returns 0, or 1 if a component refuses. */
int {name}_begin({name}_simulation *simulation, const {real} parameters[], int steps);

/* Write the current row, unless it is NULL, and make the next step, unless the run is at its end.
 * Returns 0, or 1 if a component refuses: then begin again. */
int {name}_step({name}_simulation *simulation, {real} row[]);

/* Return the refusal. */
{name}_refusal {name}_failure(const {name}_simulation *simulation);

#ifdef __cplusplus
}}
#endif

#endif
"""

_CALLS = """\
void {name}_defaults({real} parameters[]) {{
    memcpy(parameters, scenario, {parameters} * sizeof *parameters);
}}

int {name}_begin({name}_simulation *memory, const {real} parameters[], int steps) {{
    const int is_whole = steps == {NAME}_STEPS;
    simulation *it = (simulation *)memory;
    Error noted = {{0}};
    if (parameters == NULL) parameters = scenario;
    memset(it, 0, sizeof *it);
    it->start_time = {NAME}_START_TIME;
    it->step = {NAME}_STEP;
    it->steps = steps;
    it->full_steps = is_whole ? {NAME}_FULL_STEPS : steps;
    it->stop_time = is_whole ? {NAME}_STOP_TIME : it->start_time + ({real})steps * it->step;
    it->component = -1;
    set_parameters(it, parameters);
    return come_to_rest(it, &noted) != 0;
}}

int {name}_step({name}_simulation *memory, {real} row[]) {{
    simulation *it = (simulation *)memory;
    const int k = it->made;
    const {real} t = time_after(it, k);
    Error noted = {{0}};
{passing}    if (row != NULL) show(it, t, row);
    if (k == it->steps) return 0;
    if (make_step(it, k, t, &noted)) return 1;
    it->made = k + 1;
    return 0;
}}

{name}_refusal {name}_failure(const {name}_simulation *memory) {{
    const simulation *it = (const simulation *)memory;
    const {name}_refusal found = {{it->component, it->call, it->port, it->made}};
    return found;
}}
"""

_MAIN = """\
/* Run the scenario of {name}.h and print its table, with commas between the numbers.
 *
 * Compile it with -DSTEPS=500 for another number of steps.
 */
#include <stdio.h>

#include "{name}.h"

#ifndef STEPS
#define STEPS {NAME}_STEPS
#endif

{components}
{refused}
{columns}

static {name}_simulation it;
static {real} row[{NAME}_COLUMNS];

static int fail(void) {{
    const {name}_refusal why = {name}_failure(&it);
    if (why.component < 0) {{
        fprintf(stderr, "values do not come to rest at the start\\n");
    }} else {{
        fprintf(stderr, "%s refuses %s after %d steps\\n", components[why.component],
                refused[why.call], why.steps);
    }}
    return 1;
}}

int main(void) {{
    printf("%s", columns[0]);
    for (int i = 1; i < {NAME}_COLUMNS; i++) printf(",%s", columns[i]);
    if ({name}_begin(&it, NULL, STEPS)) return fail();
    for (int k = 0; k <= STEPS; k++) {{
        if ({name}_step(&it, row)) return fail();
        printf("\\n%.{digits}g", {cast}row[0]);
        for (int i = 1; i < {NAME}_COLUMNS; i++) printf(",%.{digits}g", {cast}row[i]);
    }}
    printf("\\n");
    return 0;
}}
"""


_CHECKS = """\
/* An int needs 32 bits, and structures must not be larger than assumed. */
typedef char int_has_32_bits[INT_MAX >= 2147483647 ? 1 : -1];
typedef char simulation_fits[sizeof(simulation) <= {NAME}_BYTES ? 1 : -1];"""


@dataclass
class ProgramFiles:
    """C files of a system.

    Attributes:
        plan: plan of the run.
        name: name of the files, and prefix of all public names.
        title: one line about the system.
        is_single: if set, numbers have single precision.

    """

    plan: Plan
    name: str
    title: str
    is_single: bool = False

    def __post_init__(self) -> None:
        """Translate the equations.

        Raises:
            InputError: the system cannot be one program, with the reason.

        """
        self.text = Text(self.plan, definitions_of(self.plan.system))
        self.name = re.sub(r"\W", "_", self.name, flags=re.ASCII)
        self.name = self.name if self.name[0].isalpha() else f"of_{self.name}"
        self._upper = self.name.upper()
        self.parameters = self._constants("PARAMETER", self.text.parameters)
        self._columns = self._constants("COLUMN", ["time", *self.text.columns])

    def _constants(self, what: str, names: Iterable[object]) -> dict[str, str]:
        """Return names of constants in C, distinct, by the given names."""
        constants: dict[str, str] = {}
        for name in map(str, names):
            constant = f"{self._upper}_{what}_{re.sub(r'[^A-Za-z0-9]+', '_', name).strip('_')}"
            while constant in constants.values():
                constant += "_"
            constants[name] = constant
        return constants

    def files(self) -> dict[str, str]:
        """Return the texts of the files by name."""
        main = self._filled(
            _MAIN,
            components=array("char *const components", map(quoted, self.text.components)),
            refused=array("char *const refused", map(quoted, _REFUSED)),
            columns=array("char *const columns", map(quoted, self._columns)),
            digits="9" if self.is_single else "17",
            cast="(double)" * self.is_single,
        )
        return {
            f"{self.name}.h": self._header(),
            f"{self.name}.c": self.program,
            f"{self.name}_main.c": main,
        }

    def _filled(self, form: str, **given: object) -> str:
        real = "float" if self.is_single else "double"
        return form.format(name=self.name, NAME=self._upper, real=real, **given)

    def _precise(self, text: str) -> str:
        """Return a text in the wanted precision."""
        return in_single(text) if self.is_single else text

    # The header

    def _header(self) -> str:
        experiment, text = self.plan.experiment, self.text
        summaries = (f"{name}: {text.definitions[name].summary}" for name in text.components)
        members = self._constants("COMPONENT", text.components)
        columns = dict(
            zip(self._columns.values(), ["", *map(self._about, text.columns)], strict=True)
        )
        values = dict(zip(self.parameters.values(), map(self._value, text.parameters), strict=True))
        header = self._filled(
            _HEADER,
            title=closed(self.title),
            components="\n".join(f" * {closed(summary)}" for summary in summaries),
            column=[*columns][-1],
            stack=self.stack,
            start_time=number_in_c(experiment.start_time),
            step=number_in_c(experiment.step),
            stop_time=number_in_c(experiment.stop_time),
            steps=experiment.rows - 1,
            full_steps=experiment.full_steps,
            bytes=self.sizes["simulation"],
            members=self._enum("COMPONENTS", dict.fromkeys(members.values(), "")),
            parameters=self._enum("PARAMETERS", values),
            columns=self._enum("COLUMNS", columns),
            calls=", ".join(f"{self._upper}_{call}" for call in CALLS),
        )
        return self._precise(header)

    def _enum(self, total: str, constants: Mapping[str, str]) -> str:
        """Return an enumeration of constants with comments, ended by their number."""
        rows = [
            f"    {name},{f' /* {text} */' if text else ''}" for name, text in constants.items()
        ]
        return "\n".join(["enum {", *rows, f"    {self._upper}_{total}", "};"])

    def _about(self, name: PortName) -> str:
        port = self.text.ports[name]
        return closed(f"{port.description} [{port.unit}]" if port.unit else port.description)

    def _value(self, name: PortName) -> str:
        """Return the description of a parameter with its value."""
        value = self.text.start(name)
        words = [word for word, item in self.text.ports[name].choices.items() if item == value]
        return closed(f"{self._about(name)}: {' '.join([number_in_c(value), *words])}")

    # The program

    @cached_property
    def program(self) -> str:
        """Text of NAME.c."""
        text = self.text
        _, *core = text.core()
        values = [
            f"    [{self.parameters[str(name)]}] = {number_in_c(self._number(name))},"
            for name in text.parameters
        ]
        setting = [*text.set_parameters(), *text.unsplit()]
        parts = [
            f"/* {closed(self.title)}: see {self.name}.h. */",
            f'#include "{self.name}.h"',
            head_of(text.equations),
            *core,
            self._filled(_CHECKS),
            "\n".join(
                [
                    "/* The parameters of the scenario. */",
                    f"static const double scenario[{len(values) or 1}] = {{",
                    *(values or ["    0.0"]),
                    "};",
                ]
            ),
            function(
                "static void set_parameters(simulation *it, const double parameters[])",
                setting,
                ("it", "parameters"),
            ),
            text.show(),
            self._filled(
                _CALLS,
                parameters=len(text.parameters),
                passing="    if (pass(it, k, t, &noted)) return 1;\n" * text.passes,
            ),
        ]
        program = re.sub(r"^APART ", "static ", "\n\n".join(parts), flags=re.MULTILINE)
        return self._precise(_without_unused(program))

    def _number(self, name: PortName) -> float:
        value = self.text.start(name)
        is_float = self.text.parameters[name].type == FLOAT
        if self.is_single and not is_float and abs(value) > _ALL_WHOLE:
            raise InputError(
                f"{name} = {value}: single precision has all whole numbers up to {_ALL_WHOLE} only"
            )
        return float(value)

    # Memory

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Bytes of each structure, if each number is at a multiple of its own size."""
        code = _TEXTS.sub("", self.program)
        counts = {name: int(n) for name, n in _COUNT.findall(code)}
        known = dict(_NUMBERS)
        for body, name in _STRUCTURE.findall(code):
            at, widest = 0, 1
            for type_, names in _MEMBERS.findall(body):
                size, alignment = known[type_]
                widest = max(widest, alignment)
                for member in names.split(", "):
                    n = re.search(r"\[(\w+)\]", member)
                    at += -at % alignment + size * (int(counts.get(n[1], n[1])) if n else 1)
            known[name] = at + -at % widest, widest
        return {name: size for name, (size, _) in known.items()}

    @cached_property
    def stack(self) -> int:
        """Most bytes of the stack that a call takes."""
        number = 4 if self.is_single else 8
        emitter = self.text.emitter
        equations = deepest(emitter.names, emitter.shared)[0] * number // 8
        held = (
            2 * number * (count(kind.types["state"]) + count(kind.types["outputs"]))
            for kind in self.text.kinds.values()
        )
        return equations + max(held, default=0)


def write_files(program: ProgramFiles, folder: Path) -> list[Path]:
    """Write the files of a program into a folder, and return their paths."""
    written = []
    for name, text in program.files().items():
        path = folder / name
        path.write_text(text, encoding="utf-8")
        written.append(path)
    return written


def in_single(text: str) -> str:
    """Convert the types, numbers and functions of a program to single precision.

    Numbers beyond its range become its largest, or its smallest normal number.

    Raises:
        Unsupported: the program counts with whole numbers that single precision does not have.

    """
    for double, single in _PASSAGES.items():
        text = text.replace(double, single)
    return _DOUBLES.sub(_single, text)


def _single(match: re.Match[str]) -> str:
    kind, text = str(match.lastgroup), match[0]
    if kind == "number":
        value = float(text)
        if value.is_integer() and _ALL_WHOLE < value < _ALL_OF_DOUBLE and _rounded(value) != value:
            raise Unsupported(
                f"equations count with {value:.0f}, as random numbers do, and single precision "
                "does not have it: leave --single out"
            )
        held = min(max(value, _LEAST), _MOST) if value else value
        return f"{text if held == value else repr(held)}f"
    if kind == "called":
        return text if text in _GENERIC else f"{text}f"
    return {"type": "float", "limit": "FLT_MAX"}.get(kind, text)


def _rounded(value: float) -> float:
    """Round to the nearest number of single precision."""
    return float(struct.unpack("f", struct.pack("f", value))[0])


def _without_unused(text: str) -> str:
    """Remove static functions and constants that a program does not use."""
    before = ""
    while text != before:
        before, words = text, Counter(re.findall(r"\w+", _TEXTS.sub("", text)))
        text = _STATIC.sub(partial(_used, words), text)
    return text


def _used(words: Mapping[str, int], match: re.Match[str]) -> str:
    return match[0] if words[match["function"] or match["constant"]] > 1 else ""
