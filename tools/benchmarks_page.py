"""Measure again what docs/reference/benchmarks.md says.

`python tools/benchmarks_page.py [NAME...]` runs the command that the page has between
`<!-- filled: NAME -->` and `<!-- / -->`, and writes its output there, with the date, the machine
and its load. Without a name it runs all commands, which takes an hour or two of an idle machine.
Where a command fails, the page keeps what it has, and the exit status is 1.
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

PAGE = ROOT / "docs" / "reference" / "benchmarks.md"

_PLACE = re.compile(r"<!-- filled: (\w+) -->\n`python (.+?)`.*?<!-- / -->", re.DOTALL)


def main() -> int:
    """Run commands of the page, and write what they print into it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    places = dict(_PLACE.findall(PAGE.read_text(encoding="utf-8")))
    parser.add_argument("name", nargs="*", help=f"one of {', '.join(places)}; default: all")
    names = parser.parse_args().name or list(places)
    if unknown := set(names) - places.keys():
        parser.error(f"{', '.join(sorted(unknown))}: choose from {', '.join(places)}")
    failed = [name for name in names if not is_written(name, places[name])]
    return 1 if failed else 0


def is_written(name: str, command: str) -> bool:
    """Whether a command runs to its end, and the page has what it prints."""
    try:
        write_part(name, measured(name, command))
    except subprocess.CalledProcessError as error:
        print(f"{name} stays as it is: {command}: exit status {error.returncode}", file=sys.stderr)
        return False
    return True


def measured(name: str, command: str) -> str:
    """The part of the page about a command that is run now."""
    where = machine()
    output = subprocess.run(
        [sys.executable, *shlex.split(command)],
        cwd=ROOT,
        check=True,
        stdout=subprocess.PIPE,
        encoding="utf-8",
    ).stdout
    return (
        f"<!-- filled: {name} -->\n`python {command}`, {date.today()}, {where}:\n\n"
        f"```text\n{output.rstrip()}\n```\n<!-- / -->"
    )


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


def write_part(name: str, part: str) -> None:
    """Put a part in the place of the page's own."""

    def chosen(place: re.Match[str]) -> str:
        return part if place[1] == name else place[0]

    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(_PLACE.sub(chosen, text), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
