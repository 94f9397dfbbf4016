"""Print all modules with their first lines, and the sizes of subpackages.

`python tools/house.py --rooms` prints the sizes only.
"""

from __future__ import annotations

import argparse
import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import median
from typing import NamedTuple

ROOT = Path(__file__).parents[1]

#: The folders of the packages.
PACKAGES = ("src/auv_fmu", "fmus", "orchestrator")


class Module(NamedTuple):
    """A module: its path in the repository, its first line, and its length."""

    path: Path
    first_line: str
    lines: int

    @property
    def room(self) -> str:
        """Subpackage of the module."""
        package = next(folder for folder in PACKAGES if self.path.is_relative_to(folder))
        below = self.path.relative_to(package).parts[:-1]
        return "/".join((package, *below[:1]))


def modules(package: str) -> Iterator[Module]:
    """All modules of a package."""
    for path in sorted((ROOT / package).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        first_line = (ast.get_docstring(tree) or "").partition("\n")[0]
        yield Module(path.relative_to(ROOT), first_line, len(text.splitlines()))


def main() -> None:
    """Print the modules and subpackages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", action="store_true", help="leave the modules out")
    is_short: bool = parser.parse_args().rooms
    house = [module for package in PACKAGES for module in modules(package)]
    rooms: Mapping[str, list[Module]] = defaultdict(list)
    for module in house:
        rooms[module.room].append(module)
        if not is_short:
            print(f"{module.path.as_posix():50} {module.lines:4}  {module.first_line}")
    for room, listed in {**rooms, "all": house}.items():
        lines = [module.lines for module in listed]
        print(f"{room:32} {len(listed):4} modules {sum(lines):6} lines, median {median(lines):g}")


if __name__ == "__main__":
    main()
