"""A checker passes an FMU only by its words; each may exit with 0 without them."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"

#: Last words of fmuCheck, with the numbers of messages and of errors.
SUMMARY = r"""FMU reported:\n\t%d warning(s) and error(s)
Checker reported:\n\t1 Warning(s)\n\t%d Error(s)\n"""


@pytest.mark.parametrize(
    ("checker", "command", "output", "status", "verdict"),
    [
        ("VDMCheck", "VDMCheck2.sh", "No errors found.", 0, "valid"),
        ("VDMCheck", "VDMCheck2.sh", "Errors found.", 1, "exit status 1"),
        ("VDMCheck", "VDMCheck2.sh", "", 0, "not passed"),
        ("fmuCheck", "fmuCheck.linux64", SUMMARY % (0, 0), 0, "valid"),
        ("fmuCheck", "fmuCheck.linux64", SUMMARY % (0, 1), 0, "not passed"),
        ("fmuCheck", "fmuCheck.linux64", SUMMARY % (0, 10), 0, "not passed"),
        ("fmuCheck", "fmuCheck.linux64", SUMMARY % (1, 0), 0, "not passed"),
        ("fmuCheck", "fmuCheck.linux64", SUMMARY % (0, 0), 1, "exit status 1"),
    ],
)
def test_a_checker_passes_an_fmu_by_its_words(
    monkeypatch, tmp_path, checker, command, output, status, verdict
):
    program = tmp_path / command
    program.write_text(f"#!/bin/sh\nprintf '{output}' >&2\nexit {status}\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin")
    monkeypatch.syspath_prepend(BENCHMARKS)
    compatibility = importlib.import_module("compatibility")
    assert compatibility.CHECKERS[checker](Path("any.fmu"), "2") == verdict
