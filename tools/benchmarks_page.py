"""Measure again what docs/reference/benchmarks.md quotes.

`python tools/benchmarks_page.py [NAME...]` runs the command in the first line of each file
`benchmarks/results/NAME.txt`, and writes its output there, with date, machine and load. Without a
name it runs all commands, which takes an hour or two of an idle machine. A test then names the
numbers of the page that no file has any more. Where a command fails, the file stays as it is, and
the exit status is 1.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import shlex
import subprocess
import sys
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]

RESULTS = ROOT / "benchmarks" / "results"


def main() -> int:
    """Run commands, and keep what they print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    files = {file.stem: file for file in sorted(RESULTS.glob("*.txt"))}
    parser.add_argument("name", nargs="*", help=f"one of {', '.join(files)}; default: all")
    names = parser.parse_args().name or list(files)
    if unknown := set(names) - files.keys():
        parser.error(f"{', '.join(sorted(unknown))}: choose from {', '.join(files)}")
    failed = [name for name in names if not is_written(files[name])]
    return 1 if failed else 0


def is_written(file: Path) -> bool:
    """Whether the command of a file runs to its end; then the file has what it prints."""
    command = command_of(file)
    try:
        file.write_text(measured(command), encoding="utf-8")
    except subprocess.CalledProcessError as error:
        print(
            f"{file.stem} stays as it is: {command}: exit status {error.returncode}",
            file=sys.stderr,
        )
        return False
    return True


def command_of(file: Path) -> str:
    """The command in the first line of a file, without `$ python `."""
    return file.read_text(encoding="utf-8").partition("\n")[0].removeprefix("$ python ")


def measured(command: str) -> str:
    """A command that is run now, with its output."""
    where = machine()
    output = subprocess.run(
        [sys.executable, *shlex.split(command)],
        cwd=ROOT,
        check=True,
        stdout=subprocess.PIPE,
        encoding="utf-8",
    ).stdout
    return f"$ python {command}\n{date.today()}, {where}\n\n{output.rstrip()}\n"


def machine() -> str:
    """The processor that this runs on, how many cores of it, and how busy they are."""
    try:
        facts = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        facts = ""
    listed = re.search(r"^model name\s*: (.+)$", facts, re.MULTILINE)
    processor = listed[1] if listed else platform.machine()
    load = f", load {os.getloadavg()[0]:.0f}" if hasattr(os, "getloadavg") else ""
    return f"{processor}, {os.cpu_count()} cores{load}"


if __name__ == "__main__":
    sys.exit(main())
