"""The benchmarks: their commands, new measurements, and numbers on the page; moved functions."""

from __future__ import annotations

import math
import re
import shlex
from ctypes import CDLL, c_double

import pytest

import page_numbers
from orchestrator.machine.compilers import MATHEMATICS, SAME_NUMBERS, compile_text, find_compiler
from page_numbers import RESULTS, ROOT, MovedFunctions, benchmarks, command_of, is_written
from support.markdown import DOCS

PAGE = (DOCS / "reference" / "benchmarks.md").read_text(encoding="utf-8")
SECTIONS = [section for section in PAGE.split("\n## ") if "/results/" in section]


def test_every_file_has_a_command_that_is_there_and_a_place_on_the_page():
    files = sorted(RESULTS.glob("*.txt"))
    assert len(files) > 10
    for file in files:
        assert (ROOT / shlex.split(command_of(file))[0]).is_file(), file.stem
    assert sorted(re.findall(r"/results/(\w+)\.txt", PAGE)) == [file.stem for file in files]


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.partition("\n")[0])
def test_every_number_of_a_table_is_in_the_files_of_its_section(section: str):
    names = re.findall(r"/results/(\w+)\.txt", section)
    text = "".join((RESULTS / f"{name}.txt").read_text(encoding="utf-8") for name in names)
    rows = [line for line in section.splitlines() if re.match(r"\|(?! `python|-)", line)]
    measured = " ".join(cell for row in rows for cell in row.split("|")[2:])
    assert rows
    for number in re.findall(r"-?\d[\d,.]*", measured):
        assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.])", text), number


def test_a_measurement_takes_its_place(tmp_path):
    file, script = tmp_path / "first.txt", tmp_path / "script.py"
    script.write_text("import sys; print('1.5 us', sys.argv[1:])\n")
    file.write_text(f"$ python {script} --n 3\nonce\n\n0\n")
    assert is_written(file)
    command, where, _, *output = file.read_text().splitlines()
    assert command == f"$ python {script} --n 3"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d, .+", where)
    assert output == ["1.5 us ['--n', '3']"]


def test_a_script_that_fails_changes_nothing_and_others_run(tmp_path, monkeypatch, capsys):
    bad, good = (tmp_path / name for name in ("bad.py", "good.py"))
    bad.write_text("print('1.5 us'); raise SystemExit(3)\n")
    good.write_text("print('2.5 us')\n")
    for script in (bad, good):
        script.with_suffix(".txt").write_text(f"$ python {script}\nonce\n\n0\n")
    monkeypatch.setattr(page_numbers, "RESULTS", tmp_path)
    assert benchmarks() == 1
    assert bad.with_suffix(".txt").read_text().endswith("once\n\n0\n")
    assert "2.5 us" in good.with_suffix(".txt").read_text()
    assert capsys.readouterr().err == f"bad stays as it is: {bad}: exit status 3\n"


def test_functions_are_moved_by_one_unit_in_the_last_place_and_roots_are_not(tmp_path):
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    text = """
    double math_tanh(double x) { return tanh(x); }
    double angle(double y, double x) { return atan2(y, x); }
    double root(double x) { return sqrt(x); }
    """
    options = ("-shared", "-fPIC", *SAME_NUMBERS, *MATHEMATICS)
    file = tmp_path / "moved"
    file.write_bytes(compile_text(compiler, MovedFunctions(1).head + text, *options))
    library = CDLL(str(file))
    for name in ("math_tanh", "angle", "root"):
        getattr(library, name).restype = c_double
    found: dict[str, set[float]] = {"tanh": set(), "atan2": set()}
    for i in range(1, 100):
        x = i / 50
        for name, value, exact in (
            ("tanh", library.math_tanh(c_double(x)), math.tanh(x)),
            ("atan2", library.angle(c_double(x), c_double(-0.3)), math.atan2(x, -0.3)),
        ):
            found[name].add((value - exact) / math.ulp(exact))
        assert library.root(c_double(x)) == math.sqrt(x)
    assert found == {name: {-1.0, 0.0, 1.0} for name in found}
    assert library.math_tanh(c_double(0.0)) == 0.0
    assert library.math_tanh(c_double(30.0)) == 1.0
