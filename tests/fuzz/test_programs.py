"""Random programs of the language: a few of those that `python -m fuzz programs` tries."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from fuzz.programs import Program, same, tried
from orchestrator.machine.compilers import machines_compiler
from support.hosts import GCC, sanitizers
from support.language import TOO_LARGE, Answer

FEW = range(15)

needs_compiler = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")


@needs_compiler
def test_programs_do_the_same_in_both_languages():
    assert list(tried(FEW, (str(machines_compiler()), "-O2"))) == []


@pytest.mark.slow
@pytest.mark.skipif(GCC is None, reason="gcc is not installed")
def test_sanitizers_find_nothing_in_them():
    script = f"""
from fuzz.programs import SANITIZED, tried
print([*tried(range(2000, 2025), ({GCC!r}, *SANITIZED))])
"""
    with sanitizers() as reports:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        command = [sys.executable, "-c", script]
        process = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False
        )
        assert process.stdout == "[]\n", f"{process.stderr}{reports}"


def test_a_seed_is_a_program_and_one_that_differs_would_be_seen():
    assert Program("it", 7).text() == Program("it", 7).text() != Program("it", 8).text()
    assert same(Answer((1.0, -0.0)), Answer((1.0, -0.0)))
    assert not same(Answer((0.0,)), Answer((-0.0,)))
    assert not same(Answer((1.0,)), Answer(error="ValueError: math domain error"))
    assert same(Answer((2.0**31,)), Answer(error=TOO_LARGE))
