"""Print the house: modules with their first lines, rooms, odd sizes, and names that occur twice.

`python tools/house.py --rooms` leaves the modules out.
"""

from __future__ import annotations

import argparse
import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

ROOT = Path(__file__).parents[1]

#: The folders of the packages.
PACKAGES = ("src/auv_fmu", "fmus", "orchestrator")

#: The pages of the components.
COMPONENTS = [page.relative_to(ROOT) for page in ROOT.glob("fmus/*/page.md")]

#: How many lines a module has, unless there is a reason.
SIZES = range(100, 401)

#: Where a module is as long as its subject: one thing of the paper, or one component.
BY_SUBJECT = ("src/auv_fmu", *(page.parent.as_posix() for page in COMPONENTS))

#: Why others have another size.
REASONS = {
    "fmus/ports/controllers.py": "in the FMUs of controllers only",
    "fmus/ports/quantities.py": "ports and groups need it, and it needs nothing",
    "fmus/ports/tail.py": "in the FMUs of Remus100 and Allocation only",
    "fmus/ports/vehicle.py": "in the FMUs of plant and planners only",
    "fmus/python/own.py": "slaves of PythonFMU only, which no component needs",
    "orchestrator/commands/listing.py": "imports nothing that takes longer than the command",
    "orchestrator/commands/streams.py": "all commands need it before they import anything large",
    "orchestrator/exchange/hosts/drivers.py": "a function for each tool, and nothing of ours",
    "orchestrator/figures/body.py": "pages need it without matplotlib, and films without a page",
    "orchestrator/figures/view.py": "puts a page together, of parts that are modules",
    "orchestrator/paper/claims.py": "a function for each claim of the paper",
}


class Module(NamedTuple):
    """A module: its path in the repository, its first line, how long it is, and its classes."""

    path: Path
    first_line: str
    lines: int
    classes: Sequence[str]

    @property
    def room(self) -> str:
        """The folder below its package that it is in."""
        package = next(folder for folder in PACKAGES if self.path.is_relative_to(folder))
        below = self.path.relative_to(package).parts[:-1]
        return "/".join((package, *below[:1]))


def modules(package: str) -> Iterator[Module]:
    """All modules of a package."""
    for path in sorted((ROOT / package).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        first_line = (ast.get_docstring(tree) or "").partition("\n")[0]
        classes = [node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
        yield Module(path.relative_to(ROOT), first_line, len(text.splitlines()), classes)


def names_that_occur_twice() -> dict[str, list[str]]:
    """Names that several modules or classes of the orchestrator have, and where."""
    places: Mapping[str, list[str]] = defaultdict(list)
    for module in modules("orchestrator"):
        own = [] if module.path.stem.startswith("__") else [module.path.stem]
        for name in (*own, *module.classes):
            places[name].append(module.path.as_posix())
    return {name: found for name, found in places.items() if len(found) > 1}


def odd_sizes() -> dict[str, int]:
    """The modules that are shorter or longer than most, and how long they are."""
    return {
        module.path.as_posix(): module.lines
        for package in PACKAGES
        for module in modules(package)
        if module.lines not in SIZES
        and not module.path.name.startswith("__")
        and not any(module.path.is_relative_to(folder) for folder in BY_SUBJECT)
    }


def main() -> None:
    """Print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", action="store_true", help="leave the modules out")
    is_short: bool = parser.parse_args().rooms
    house = [module for package in PACKAGES for module in modules(package)]
    rooms: Mapping[str, list[Module]] = defaultdict(list)
    for module in house:
        rooms[module.room].append(module)
        if not is_short:
            print(f"{module.path.as_posix():50} {module.lines:4}  {module.first_line}")
    for room, found in {**rooms, "all": house}.items():
        lines = [module.lines for module in found]
        print(f"{room:32} {len(found):4} modules {sum(lines):6} lines, median {median(lines):g}")
    for name, size in odd_sizes().items():
        print(f"{name:40} {size:4}  {REASONS.get(name, 'no reason')}")
    twice = names_that_occur_twice()
    for name, places in twice.items():
        print(f"{name}: {', '.join(places)}")
    print(f"names that occur twice in the orchestrator: {len(twice)}")


if __name__ == "__main__":
    main()
