"""Standard streams that are closed, full or without a reader, and an early Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from orchestrator.commands import streams
from support.tiers import slow

COMMAND = [sys.executable, "-m", "orchestrator"]
RUN = ["run", "fig4", "--stop-time", "0.1", "--no-figures", "--out", "o"]


def shell(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a line of a shell, in which `$A` is auv-fmu."""
    return subprocess.run(
        ["bash", "-c", text], env={**os.environ, "A": " ".join(COMMAND)},
        cwd=folder, check=False, capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.slow
def test_output_that_cannot_be_written_is_one_line(tmp_path: Path):
    process = shell("PYTHONUNBUFFERED=1 $A list > /dev/full", tmp_path)
    assert process.returncode == 1
    assert process.stderr == "auv-fmu: cannot write the output: No space left on device\n"
    process = shell("$A list > /dev/full", tmp_path)
    assert (process.returncode, process.stderr.count("\n")) == (1, 1)


def test_reader_who_has_gone_is_not_told(tmp_path: Path):
    process = shell("set -o pipefail; $A list | true", tmp_path)
    assert (process.returncode, process.stderr) == (1, "")


def test_complaint_that_cannot_be_written_leaves_the_status(tmp_path: Path):
    assert shell("$A run nosuch 2> /dev/full", tmp_path).returncode == 2
    assert shell("$A run nosuch 2>&-", tmp_path).returncode == 2


@pytest.mark.slow
@pytest.mark.parametrize("streams", ["> /dev/full", ">&- 2>&- <&-"])
def test_run_keeps_its_files_whatever_the_streams(tmp_path: Path, streams: str):
    """The next opened file must not get a closed stream's number, and with it the output."""
    shell(f"$A {' '.join(RUN)}", tmp_path)
    whole = (tmp_path / "o/result.csv").read_bytes()
    shell(f"rm -r o; $A {' '.join(RUN)} {streams}", tmp_path)
    assert (tmp_path / "o/result.csv").read_bytes() == whole
    assert (tmp_path / "o/run.json").is_file()


_INTERRUPTED = """
import builtins, os, signal, sys
imported = builtins.__import__
def interrupt(name, *arguments, **how):
    if name == sys.argv[1]:
        os.kill(os.getpid(), signal.SIGINT)
    return imported(name, *arguments, **how)
from orchestrator.commands.main import main
builtins.__import__ = interrupt
sys.exit(main(["list"]))
"""


def test_ctrl_c_during_imports_is_one_line():
    process = subprocess.run(
        [sys.executable, "-c", _INTERRUPTED, "argparse"],
        check=False, capture_output=True, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert (process.returncode, process.stdout) == (130, "")
    assert process.stderr == "auv-fmu: interrupted\n"


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        (["run", b"a\nb\x1b[31m.toml"], r"a\nb\x1b[31m.toml"),
        *slow(
            (["run", "fig4", "--set", b"controller.saturation=\xff"], r"= \udcff"),
            (["run", "fig4", "--set", b"pl\nant.m11=1"], r"'pl\nant'"),
            (["verify", b"\xff.csv"], r"\udcff.csv"),
        ),
    ],
)
def test_names_of_any_bytes_are_shown_in_one_line(tmp_path: Path, arguments, shown):
    process = subprocess.run(
        [*COMMAND, *arguments], cwd=tmp_path, check=False, capture_output=True, text=True
    )
    assert process.returncode == 2
    assert shown in process.stderr
    assert process.stderr.count("\n") == 1


@pytest.mark.slow
def test_folder_of_any_name_takes_a_result(tmp_path: Path):
    name = b"o\xff\n\x1b"
    process = subprocess.run(
        [*COMMAND, *RUN[:-1], name], cwd=tmp_path, check=False, capture_output=True, text=True
    )
    assert (process.returncode, process.stderr) == (0, "")
    assert process.stdout.endswith("written to o\\udcff\\n\\x1b/\n")
    assert os.path.exists(os.path.join(os.fsencode(tmp_path), name, b"run.json"))  # noqa: PTH110, PTH118


def test_letters_that_a_code_page_has_not_are_escaped(monkeypatch):
    """Windows writes what is not a console in a code page; 1252 has an u umlaut, and no pi."""
    written = BytesIO()
    monkeypatch.setattr(sys, "stdout", TextIOWrapper(written, "cp1252"))
    streams.show("\u03c0 = 3.14", "f\u00fcr")
    sys.stdout.flush()
    assert written.getvalue().split() == [b"\\u03c0", b"=", b"3.14", b"f\xfcr"]
