"""A whole system as C files: warnings, numbers, precision, memory, and a microcontroller."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.cosim import Experiment, make_plan
from orchestrator.program.components import definitions_of
from orchestrator.program.files import _PASSAGES
from orchestrator.program.writer import Text, indices_of
from orchestrator.runs.preparation import load
from orchestrator.runs.result import Result
from orchestrator.runs.tables import read_columns, read_rows
from orchestrator.vehicle.indices import INDICES
from orchestrator.vehicle.signals import loops_of
from support.texts import mentions

#: Communication step of the scenarios [s].
H = 0.02

#: Scenarios, and their numbers of compared steps; in the first, the generator of the noise renews
#: all its words.
SCENARIOS = {"fig4": 1000, "path": 400, "sea": 100}

#: Scenarios with single precision.
SINGLE = ["fig4", "path"]

GCC, GPP, ARM_GCC, QEMU = map(shutil.which, ("gcc", "g++", "arm-none-eabi-gcc", "qemu-system-arm"))
needs_gcc = pytest.mark.skipif(GCC is None, reason="gcc is not installed")
needs_arm = pytest.mark.skipif(ARM_GCC is None, reason="arm-none-eabi-gcc is not installed")

#: Options for a processor with single precision only.
CORTEX_M = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
SUPPORT = Path(__file__).parents[1] / "support"

STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")
#: Options with which FMUs are compiled, too, so that all results are equal.
EXACT = ("-ffp-contract=off", "-fno-builtin")

#: Two programs in one.
BOTH = """\
#include <stdio.h>
#include "fig4.h"
#include "path.h"

static fig4_simulation one, other;
static path_simulation third;

int main(void) {
    double parameters[FIG4_PARAMETERS], row[FIG4_COLUMNS];
    float single[PATH_COLUMNS];
    int k;
    fig4_defaults(parameters);
    parameters[FIG4_PARAMETER_plant_noise_std] = 0.0;
    if (fig4_begin(&one, parameters, 100) || fig4_begin(&other, NULL, 2147483647)) return 1;
    if (path_begin(&third, NULL, PATH_STEPS)) return 1;
    for (k = 0; k <= 100; k++) {
        if (fig4_step(&one, row) || fig4_step(&other, NULL) || path_step(&third, single)) return 1;
    }
    printf("%.17g %.17g ", row[FIG4_COLUMN_time], row[FIG4_COLUMN_plant_eta_x]);
    if (fig4_step(&other, row)) return 1;
    printf("%.17g %.17g ", row[FIG4_COLUMN_time], row[FIG4_COLUMN_plant_eta_x]);
    printf("%.9g %.9g\\n", (double)single[PATH_COLUMN_time],
           (double)single[PATH_COLUMN_plant_eta_x]);
    return 0;
}
"""

#: Functions of the C library that a program may call: they compute or copy.
ALLOWED = re.compile(
    r"_GLOBAL_OFFSET_TABLE_|__stack_chk_fail|mem(cpy|cmp|set)"
    r"|(sin|cos|tan|asin|acos|atan|atan2|sincos|tanh|exp|expm1|log|log1p|sqrt|pow|fmod|fmin|fmax"
    r"|floor|ceil|trunc|round|fabs|copysign|isinf|__isinf)f?"
)


def compile_c(*command: object) -> None:
    subprocess.run([*map(str, command)], check=True)


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of all scenarios, and folders for single precision."""
    folder = tmp_path_factory.mktemp("programs")
    for name in SCENARIOS:
        export(name, folder / name)
    for name in SINGLE:
        export(name, folder / f"{name}-single", "--single")
    return folder


def export(name: str, folder: Path, *options: str) -> None:
    assert main(["export", name, "--format", "c", "--out", str(folder), *options]) == 0


def stem(name: str) -> str:
    return name.partition("-single")[0].replace("-", "_")


def sources(folder: Path) -> list[Path]:
    return [folder / f"{stem(folder.name)}{ending}" for ending in (".c", "_main.c")]


def printed(folder: Path, steps: int, *options: str) -> tuple[list[str], np.ndarray]:
    """Compile and run a program: its columns, without the time, and its rows."""
    program, table = folder / "program", folder / "table.csv"
    compile_c(GCC, *STRICT, "-O2", *EXACT, *options, f"-DSTEPS={steps}", *sources(folder),
              "-o", program, "-lm")  # fmt: skip
    with table.open("wb") as file:
        subprocess.run([program], check=True, stdout=file)
    return read_columns(table), np.vstack([*read_rows(table)])


@cache
def expected(name: str, steps: int) -> Result:
    return simulate(name, stop_time=steps * H, kind="native")


def rows_of(result: Result, columns: list[str]) -> np.ndarray:
    assert [name for name in result.columns if not name.endswith(".fault")] == [*columns]
    return np.column_stack([result[name] for name in ("time", *columns)])


@needs_gcc
@pytest.mark.parametrize("name", SCENARIOS)
def test_table_equals_a_run_bit_for_bit(programs: Path, name: str):
    steps = SCENARIOS[name]
    columns, rows = printed(programs / name, steps)
    np.testing.assert_array_equal(rows, rows_of(expected(name, steps), columns))


@needs_gcc
@pytest.mark.parametrize("name", SINGLE)
def test_single_precision_has_no_double_and_the_same_motion(programs: Path, name: str):
    """Friction is not compared: it has the sign of velocities that are zero except for rounding."""
    steps = SCENARIOS[name]
    columns, rows = printed(programs / f"{name}-single", steps, "-Wdouble-promotion")
    text = sources(programs / f"{name}-single")[0].read_text(encoding="utf-8")
    assert "double" not in re.sub(r'/\*.*?\*/|"[^"]*"', "", text, flags=re.DOTALL)
    result = expected(name, steps)
    moved = [column for column in columns if re.search(r"\.(eta|y|y_d|e)\.", column)]
    assert len(moved) > 10
    for column in moved:
        found = rows[:, 1 + columns.index(column)]
        np.testing.assert_allclose(found, result[column], rtol=0.0, atol=2e-4, err_msg=column)


@pytest.mark.parametrize("passage", _PASSAGES)
def test_passages_for_double_precision_are_replaced(programs: Path, passage: str):
    double, single = (
        sources(programs / name)[0].read_text(encoding="utf-8") for name in ("fig4", "fig4-single")
    )
    assert passage in double
    assert passage not in re.sub(r"(?<=\d)f\b", "", single).replace("fabsf", "fabs")


@needs_gcc
def test_single_precision_over_the_whole_of_fig4(programs: Path):
    """The position differs by less than 1 mm after 100 s, the tracking error by a 20th of that."""
    columns, rows = printed(programs / "fig4-single", 5000)
    result = expected("fig4", 5000)
    for name, bound in (("plant.eta.x", 1e-3), ("plant.eta.y", 1e-3), ("controller.e.x", 5e-5)):
        off = np.abs(rows[:, 1 + columns.index(name)] - result[name]).max()
        assert bound / 100 < off < bound, name


@needs_gcc
def test_two_programs_are_linked_into_one(programs: Path, tmp_path: Path):
    (tmp_path / "both.c").write_text(BOTH, encoding="utf-8")
    folders = [programs / "fig4", programs / "path-single"]
    compile_c(GCC, *STRICT, *EXACT, *(f"-I{path}" for path in folders), tmp_path / "both.c",
              *(sources(path)[0] for path in folders), "-o", tmp_path / "both", "-lm")  # fmt: skip
    output = subprocess.run([tmp_path / "both"], check=True, capture_output=True, text=True).stdout
    times_and_places = [float(word) for word in output.split()]
    quiet = simulate("fig4", {"plant.noise.std": 0.0}, stop_time=2.0, kind="native")
    noisy, path = expected("fig4", 1000), expected("path", 400)
    assert times_and_places[:4] == [2.0, quiet["plant.eta.x"][-1], 2.02, noisy["plant.eta.x"][101]]
    assert times_and_places[4:] == pytest.approx([2.0, path["plant.eta.x"][100]], abs=1e-5)


def symbols(path: Path, folder: Path) -> dict[str, str]:
    """The kinds of all symbols of a source's object file."""
    compile_c(GCC, "-std=c99", "-c", path, "-o", folder / "one.o")
    output = subprocess.run(["nm", folder / "one.o"], check=True, capture_output=True, text=True)
    return {words[-1]: words[-2] for words in map(str.split, output.stdout.splitlines())}


@needs_gcc
@pytest.mark.parametrize("name", ["sea", "path-single"])
def test_program_has_no_variables_and_calls_only_mathematics(
    programs: Path, tmp_path: Path, name: str
):
    found = symbols(sources(programs / name)[0], tmp_path)
    public = {f"{stem(name)}_{call}" for call in ("begin", "defaults", "failure", "step")}
    assert {symbol for symbol, kind in found.items() if kind == "T"} == public
    assert {*found.values()} <= {*"TtrU"}, "neither data nor bss"
    assert all(ALLOWED.fullmatch(symbol) for symbol, kind in found.items() if kind == "U"), found


def deepest_call(graph: Path, root: str) -> int:
    """Bytes of the stack below a function, in a program without recursion."""
    text = graph.read_text(encoding="utf-8")
    own = {
        title: int(size[1]) if (size := re.search(r"(\d+) bytes", label)) else 0
        for title, label in re.findall(r'title: "([^"]+)" label: "([^"]+)"', text)
    }
    calls: dict[str, set[str]] = {}
    for caller, called in re.findall(r'sourcename: "([^"]+)" targetname: "([^"]+)"', text):
        calls.setdefault(caller, set()).add(called)

    @cache
    def below(function: str) -> int:
        return own.get(function, 0) + max(map(below, calls.get(function, ())), default=0)

    return below(root)


@pytest.mark.parametrize(
    ("name", "command"),
    [
        pytest.param("sea", (GCC, "-O2"), marks=needs_gcc),
        pytest.param("path-single", (ARM_GCC, *CORTEX_M, "-Os"), marks=needs_arm),
    ],
)
def test_header_tells_the_bytes_that_a_program_takes(
    programs: Path, tmp_path: Path, name: str, command: tuple[str, ...]
):
    """The size of a simulation, and of the stack, as compilers report them."""
    folder, upper = programs / name, stem(name).upper()
    header = (folder / f"{stem(name)}.h").read_text(encoding="utf-8")
    size = int(str(re.search(rf"{upper}_BYTES = (\d+)", header)[1]))  # type: ignore[index]
    stack = int(str(re.search(r"Up to (\d+) bytes of structures", header)[1]))  # type: ignore[index]
    exact = f"typedef char exactly[sizeof(simulation) == {size} ? 1 : -1];\n"
    source = tmp_path / "one.c"
    source.write_text(sources(folder)[0].read_text(encoding="utf-8") + exact, encoding="utf-8")
    compile_c(*command, "-std=c99", f"-I{folder}", "-fcallgraph-info=su", "-c", source,
              "-o", tmp_path / "one.o")  # fmt: skip
    for call in ("begin", "step"):
        found = deepest_call(tmp_path / "one.ci", f"{stem(name)}_{call}")
        assert stack / 4 < found < 2 * stack


@needs_arm
@pytest.mark.skipif(QEMU is None, reason="qemu-system-arm is not installed")
@pytest.mark.parametrize(("kind", "tolerance"), [("fig4", 1e-9), ("fig4-single", 2e-4)])
def test_microcontroller_gives_the_same_except_for_rounding(
    programs: Path, tmp_path: Path, kind: str, tolerance: float
):
    """Two seconds on a Cortex-M4; newlib has another sine."""
    steps, table = 100, tmp_path / "table.csv"
    compile_c(ARM_GCC, *CORTEX_M, "-std=c99", "-O2", "-ffp-contract=off", f"-DSTEPS={steps}",
              "--specs=rdimon.specs", f"-T{SUPPORT / 'cortex_m.ld'}", SUPPORT / "cortex_m.c",
              *sources(programs / kind), "-o", tmp_path / "one.elf", "-lm")  # fmt: skip
    command = [
        QEMU,
        "-M",
        "mps2-an386",
        "-nographic",
        "-semihosting",
        "-kernel",
        tmp_path / "one.elf",
    ]
    with table.open("wb") as file:
        subprocess.run([*map(str, command)], check=True, stdout=file, timeout=60)
    columns, rows = read_columns(table), np.vstack([*read_rows(table)])
    result = expected("fig4", 1000)
    assert len(rows) == steps + 1
    compared = [
        column for column in columns if kind == "fig4" or re.search(r"\.(eta|y|e)\.", column)
    ]
    for column in compared:
        found = rows[:, 1 + columns.index(column)]
        np.testing.assert_allclose(
            found, result[column][: steps + 1], rtol=0.0, atol=tolerance, err_msg=column
        )


@needs_gcc
def test_refusal_is_told(tmp_path: Path):
    export("fig4", tmp_path / "fig4", "--set", "plant.h_max=1e-9")
    program = tmp_path / "program"
    compile_c(GCC, *STRICT, *sources(tmp_path / "fig4"), "-o", program, "-lm")
    ran = subprocess.run([program], check=False, capture_output=True, text=True)
    assert ran.returncode == 1
    assert ran.stderr == "plant refuses its step after 0 steps\n"


def test_scenarios_beyond_single_precision_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    options = ["--format", "c", "--single", "--out", str(tmp_path / "one")]
    assert main(["export", "sea", *options]) != 0
    assert mentions(capsys.readouterr().err, "2147483647 random --single")
    assert main(["export", "fig4", *options, "--set", "plant.noise.seed=16777217"]) != 0
    assert mentions(capsys.readouterr().err, "plant.noise.seed 16777217 16777216")
    assert main(["export", "fig4", "--single"]) != 0
    assert mentions(capsys.readouterr().err, "--single --format c")
    assert not (tmp_path / "one").exists()


@pytest.mark.skipif(GPP is None, reason="g++ is not installed")
def test_quick_programs_are_cpp_too():
    """With the indices of a fleet, and for single steps."""
    system, stepped = load("formation-v", "native"), load("remus", "native")
    reducers = dict.fromkeys(index.reducer for index in INDICES)
    loops = loops_of(system)
    indices = [index for loop in loops for index in indices_of(system, loop, reducers)]
    of_fleet = {"indices": indices, "loops": loops}
    for part, options in ((system, of_fleet), (stepped, {"is_stepped": True})):
        plan = make_plan(part, Experiment(1.0, H))
        text = Text(plan, definitions_of(part), is_quick=True, **options).text()
        command = [GPP, "-x", "c++", "-std=c++20", "-w", "-fsyntax-only", "-"]
        subprocess.run(command, input=text, text=True, check=True)
