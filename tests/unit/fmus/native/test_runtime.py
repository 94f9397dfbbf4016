"""The runtime of FMUs in C, compared with Python's functions, and compiled as hosts may do it."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
from binascii import crc32
from ctypes import CDLL, c_char_p, c_double, c_int, c_size_t, c_uint32, create_string_buffer
from math import inf, ldexp, nan
from pathlib import Path
from random import Random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fmus.discovery import source_of
from fmus.native.translator import _directives
from fmus.ports.behaviour import NUMBER_FORMAT
from fmus.ports.description import SOURCES
from fmus.python.component import LONGEST_MESSAGE
from support.all_types.build import sources
from support.language import HEAD, Twins, module_of
from support.settings import NAMES

COMPILERS = [command for command in ("gcc", "clang") if shutil.which(command)]

pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler")

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off")

#: Characters of a text in a message, and bytes that they have at most.
MOST_CHARACTERS = 500
ROOM = 4 * MOST_CHARACTERS + 1

#: From the smallest to the largest.
POWERS_OF_TWO = [ldexp(1.0, exponent) for exponent in range(-1074, 1024)]

every_double = st.integers(0, 2**64 - 1).map(
    lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0]
)

usual_double = st.floats(-1e7, 1e7) | st.floats(-1e-3, 1e-3) | st.integers(-(10**17), 10**17)


def written(folder: Path, name: str, version: str = "2") -> Path:
    """The sources of a component in a folder."""
    folder.mkdir(exist_ok=True)
    identity = f'#define MODEL_NAME "{name}"\n#define MODEL_GUID "{{{name}}}"\n'
    files = {**sources(source_of(name).definition, version), "identity.h": identity}
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")
    return folder


def compile_in(folder: Path, *options: str | Path, compiler: str = "") -> None:
    command = [compiler or COMPILERS[0], *FLAGS, *options]
    process = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr


class Runtime:
    """The functions of probe.c."""

    def __init__(self, library: Path) -> None:
        self.path, self._library = library, CDLL(str(library))

    def shown(self, number: float, exactly: bool) -> str:
        text = create_string_buffer(ROOM)
        self._library.show_number(c_double(number), c_int(exactly), text)
        return text.value.decode()

    def shown_in(self, form: str, number: float) -> str:
        """A text for `str.format` that names the time, as both kinds log it."""
        text = create_string_buffer(ROOM)
        directives = _directives(form).encode()
        self._library.show_in(c_char_p(directives), c_double(number), text)
        return text.value.decode()

    def text(self, content: bytes) -> bytes:
        text = create_string_buffer(ROOM)
        self._library.show_text(c_char_p(content), text)
        return text.value

    def is_utf8(self, content: bytes) -> bool:
        return bool(self._library.utf8(c_char_p(content)))

    def checksum(self, content: bytes) -> int:
        self._library.checksum.restype = c_uint32
        found: int = self._library.checksum(c_char_p(content), c_size_t(len(content)))
        return found

    def normal_numbers(self, seed: int, n: int) -> list[float]:
        numbers = (c_double * n)()
        self._library.normal_numbers(c_uint32(seed), c_size_t(n), numbers)
        return [*numbers]


def probe(folder: Path, *options: str) -> Runtime:
    source = Path(__file__).with_name("probe.c")
    written(folder, "DisturbanceGenerator")
    compile_in(folder, "-O2", "-shared", "-fPIC", *options, "-I.", "-o", "probe.so", source, "-lm")
    return Runtime(folder / "probe.so")


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> Runtime:
    return probe(tmp_path_factory.mktemp("runtime"))


@pytest.fixture(scope="module")
def comma(tmp_path_factory: pytest.TempPathFactory) -> Runtime:
    """As in a locale with a decimal comma."""
    return probe(tmp_path_factory.mktemp("comma"), "-DDECIMAL_COMMA")


# Texts


@given(number=every_double | usual_double.map(float))
@example(number=0.0)
@example(number=-0.0)
@example(number=nan)
@example(number=-inf)
@example(number=9.5e-05)
@example(number=999999.5)
@example(number=1e16)
@example(number=9007199254740993.0)
@example(number=2.2250738585072014e-308)
@example(number=1.7976931348623157e308)
def test_numbers_are_written_as_python_writes_them(runtime: Runtime, number: float):
    assert runtime.shown(number, exactly=True) == repr(number)
    assert runtime.shown(number, exactly=False) == f"{number:g}"


def test_powers_of_two_are_written_as_python_writes_them(runtime: Runtime):
    """Below a power of two, numbers are closer than above it, and the fewest digits differ."""
    for number in POWERS_OF_TWO:
        assert runtime.shown(number, exactly=True) == repr(number)


def test_decimal_comma_of_the_host_is_not_seen(comma: Runtime):
    for number in (0.1, -1234.5678, 5e-324, 1.7976931348623157e308, 1e23, 12.5):
        assert comma.shown(number, exactly=True) == repr(number)
        assert comma.shown(number, exactly=False) == f"{number:g}"


#: Texts for `str.format`, with the time at most once.
PIECE = st.sampled_from(["%", "{{", "}}", "d", "s", " ", "ü", "€", "𝜃", "t", "ü" * 498, "𝜃" * 600])
LITERAL = st.lists(PIECE, max_size=6).map("".join)
FIELD = st.sampled_from(["", "{t}", "{t:+.2f}", "{t: 12.3e}", "{t:200.150f}"]) | st.from_regex(
    NUMBER_FORMAT, fullmatch=True
).map(lambda form: f"{{t:{form}}}")
FORM = st.builds("{}{}{}".format, LITERAL, FIELD, LITERAL)


@given(form=FORM, number=every_double | usual_double.map(float))
@example(form="100 % at {t:g}", number=2.5)
@example(form="{t:10.3f}", number=inf)
@example(form="{t:+E}", number=-nan)
def test_messages_are_formatted_as_python_formats_them(
    runtime: Runtime, comma: Runtime, form: str, number: float
):
    """Whole, or cut between two characters; in any locale."""
    expected = form.format(t=number)[:MOST_CHARACTERS]
    assert runtime.shown_in(form, number) == expected
    assert comma.shown_in(form, number) == expected


#: Shows numbers in the locale of a process of its own.
_IN_GERMAN = """\
import locale, sys
from ctypes import CDLL, c_char_p, c_double, create_string_buffer
locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
assert locale.localeconv()["decimal_point"] == ","
library, text = CDLL(sys.argv[1]), create_string_buffer(2001)
library.show_in(c_char_p(b"%g, %%, "), c_double(2.5), text)
print(text.value.decode())
for form in sys.argv[2:]:
    library.show_in(c_char_p(form.encode()), c_double(-1234.5), text)
    print(text.value.decode())
"""


@pytest.mark.skipif(
    not shutil.which("localedef") or not Path("/usr/share/i18n/locales/de_DE").is_file(),
    reason="there is no German locale",
)
def test_german_locale_of_the_host_is_not_seen(runtime: Runtime, tmp_path: Path):
    made = ["localedef", "-i", "de_DE", "-f", "UTF-8", tmp_path / "de_DE.UTF-8"]
    subprocess.run(made, check=True, capture_output=True)
    command = [sys.executable, "-c", _IN_GERMAN, runtime.path, "%g", "%r", "%.3f", "%+12.2e"]
    environment = {**os.environ, "LOCPATH": str(tmp_path)}
    process = subprocess.run(
        command, env=environment, capture_output=True, encoding="utf-8", check=True
    )
    assert process.stdout.splitlines() == [
        "2.5, %, ", "-1234.5", "-1234.5", "-1234.500", "   -1.23e+03",
    ]  # fmt: skip


#: Number of texts.
TEXTS = 60

#: Pieces between the numbers of a text.
PIECES = ("100 % ", "%%", "%d", "%n ", "ü" * 90, "𝜃" * 200, "{{", "}}", "\\\\", "\\'", " ist ", "€")
FIELDS = ("{x:g}", "{x:.3f}", "{x:+.2e}", "{y: 9.1f}", "{k}", "{k:d}", "{k:.1f}", "{on}", "{y:G}")

NUMBERS = (0.0, -0.0, 2.5, -1234.56789, 1e-5, 1e17, 1e308, 5e-324, inf, -inf, nan)


def texts(random: Random) -> list[str]:
    return [
        "".join(random.choice((random.choice(PIECES), random.choice(FIELDS))) for _ in range(8))
        for _ in range(TEXTS)
    ]


def test_refusals_say_the_same_in_both_languages(tmp_path: Path):
    random = Random(0)
    functions = "\n\n".join(
        f"def f{i}(x: float, y: float, k: int, on: bool) -> float:\n"
        f"    if k > -10:\n        raise Refusal(f'{text}')\n    return x\n"
        for i, text in enumerate(texts(random))
    )
    twins = Twins(module_of(HEAD + functions, tmp_path), tmp_path)
    for i in range(TEXTS):
        for _ in range(4):
            given = [
                random.choice(NUMBERS),
                random.choice(NUMBERS),
                random.randrange(-9, 99),
                i % 2,
            ]
            expected = twins.python(f"f{i}", given).error[:LONGEST_MESSAGE]
            assert twins.c(f"f{i}", given).error == expected


def test_long_text_is_cut_between_characters(runtime: Runtime):
    assert runtime.text("𝜃".encode() * 100_000) == "𝜃".encode() * MOST_CHARACTERS


def test_invalid_text_is_cut_where_the_room_ends(runtime: Runtime):
    assert runtime.text(b"\x80" * 100_000) == b"\x80" * (ROOM - 1)


def can_be_decoded(content: bytes) -> bool:
    try:
        content.decode()
    except UnicodeDecodeError:
        return False
    return True


#: Bytes at the borders of the ranges of UTF-8.
ODD_BYTES = st.lists(st.sampled_from(b"a\x80\x8f\x90\x9f\xa0\xbf\xc0\xc2\xe0\xed\xf0\xf4\xf5")).map(
    bytes
)


@given(content=st.binary() | st.text().map(str.encode) | ODD_BYTES)
def test_utf8_is_what_python_takes_for_it(runtime: Runtime, content: bytes):
    assert runtime.is_utf8(content) == can_be_decoded(content.split(b"\0")[0])


# Checksum and noise


@given(content=st.binary(max_size=5000))
def test_checksum_is_the_one_of_zip(runtime: Runtime, content: bytes):
    assert runtime.checksum(content) == crc32(content)


@given(seed=st.integers(0, 2**32 - 1))
@example(seed=0)
@example(seed=1)
@example(seed=2**31)
@example(seed=2**32 - 1)
def test_noise_is_pythons(runtime: Runtime, seed: int):
    """To the bit, over more numbers than the generator makes at once."""
    random = Random(seed)
    expected = [random.gauss(0.0, 1.0) for _ in range(1001)]
    assert bits(runtime.normal_numbers(seed, 1001)) == bits(expected)


def bits(numbers: list[float]) -> bytes:
    return struct.pack(f"{len(numbers)}d", *numbers)


# Compiling


@pytest.mark.parametrize(
    ("name", "version", "standard"),
    [*((name, "2", "c99") for name in NAMES), ("AuvPlant", "3", "c99"), ("AuvPlant", "2", "gnu17")],
)
def test_sources_have_no_warning(tmp_path: Path, name: str, version: str, standard: str):
    folder = written(tmp_path, name, version)
    for compiler in COMPILERS:
        options = f"-std={standard}", "-fsyntax-only"
        compile_in(folder, *options, SOURCES[version], compiler=compiler)
        if compiler == "gcc":
            strict = "-Wshadow=local", "-Wconversion", "-Wno-unused-function"
            compile_in(folder, *options, *strict, "equations.c")


LINKED = """
#include <stdio.h>

#define DECLARE(prefix)                                                                \\
    void *prefix##fmi2Instantiate(const char *, int, const char *, const char *,       \\
                                  const void *, int, int);                             \\
    int prefix##fmi2EnterInitializationMode(void *);                                   \\
    int prefix##fmi2ExitInitializationMode(void *);                                    \\
    int prefix##fmi2DoStep(void *, double, double, int);                               \\
    void prefix##fmi2FreeInstance(void *);

#define RUN(prefix)                                                                    \\
    do {                                                                               \\
        void *c = prefix##fmi2Instantiate("linked", 1, NULL, NULL, NULL, 0, 1);        \\
        if (prefix##fmi2EnterInitializationMode(c)) return 1;                          \\
        if (prefix##fmi2ExitInitializationMode(c)) return 2;                           \\
        if (prefix##fmi2DoStep(c, 0.0, 0.02, 1)) return 3;                             \\
        prefix##fmi2FreeInstance(c);                                                   \\
    } while (0)

DECLARE(AuvPlant_)
DECLARE(MotionPlanner_)

int main(void) {
    RUN(AuvPlant_);
    RUN(MotionPlanner_);
    return 0;
}
"""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_options_that_change_numbers_are_refused(tmp_path: Path, compiler: str):
    command = [compiler, "-ffast-math", "-fsyntax-only", "fmi2.c"]
    folder = written(tmp_path / "fast", "PdController")
    process = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert process.returncode != 0
    assert "-ffast-math" in process.stderr


def test_several_components_can_be_linked_into_one_program(tmp_path: Path):
    objects = []
    for name in ("AuvPlant", "MotionPlanner"):
        folder = written(tmp_path / name, name)
        objects.append(folder / "fmi2.o")
        compile_in(folder, f"-DFMI2_FUNCTION_PREFIX={name}_", "-c", "fmi2.c")
    (tmp_path / "linked.c").write_text(LINKED)
    compile_in(tmp_path, "-o", "linked", "linked.c", *objects, "-lm")
    subprocess.run([tmp_path / "linked"], check=True)


def test_memory_that_there_is_not_is_an_error_and_nothing_worse(tmp_path: Path):
    """Each allocation in turn fails, and with it every later one."""
    folder = written(tmp_path / "sources", "AuvPlant")
    source = Path(__file__).with_name("no_memory.c")
    sanitizers = ("-fsanitize=address,undefined", "-fno-sanitize-recover")
    compile_in(folder, *sanitizers, "-I.", "-o", "no_memory", source, "-lm")
    process = subprocess.run(
        [folder / "no_memory"], capture_output=True, text=True, check=False, timeout=60
    )
    assert process.returncode == 0, process.stderr
    assert int(process.stdout) > 8, "each kind of call that allocates has failed once"
