"""The laws of the house: imports run one way, and the general half names no vehicle."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

from fmus.discovery import components
from support.settings import ports_of

ROOT = Path(__file__).parents[2]

#: Rooms, each of which may import those before it.
FLOORS = {
    "auv_fmu": (
        "language", "paper", "proof", "remus", "bluerov2", "water", "guidance", "navigation",
        "loop", "casadi",
    ),
    "orchestrator": (
        "machine", "cosim", "vehicle", "figures", "runs", "program", "simulation", "bridges",
        "live", "exchange", "studies", "benchmark", "paper", "commands",
    ),
    "fmus": (
        "ports", "language", "components", "kinds", "discovery", "documentation", "script",
        "python", "trial", "native", "check", "build",
    ),
}  # fmt: skip

#: Packages that each package may import besides itself and the standard library.
ALLOWED = {
    "auv_fmu": set(),
    "fmus": {"auv_fmu", "markdown_it", "orchestrator", "pythonfmu"},
    "orchestrator": {
        "auv_fmu", "builtin_interfaces", "dask", "distributed", "filelock", "fmpy", "fmus",
        "geometry_msgs", "gymnasium", "libcosimpy", "lxml", "markdown_it", "math_core",
        "matplotlib", "mpl_toolkits", "nav_msgs", "numpy", "onnx", "pandas", "pettingzoo", "PIL",
        "platformdirs", "pyarrow", "pydantic", "pydantic_core", "rclpy", "rosgraph_msgs", "scipy",
        "tqdm",
    },
}  # fmt: skip

#: Modules that run in environments of other tools, and import no package of the project.
FOREIGN = ("exchange", "drivers")

#: Modules of `fmus` that the orchestrator may import; others would load PythonFMU.
DECLARED = re.compile(r"fmus\.(kinds|discovery|ports|language\.build\.Untranslatable)(\.|$)")

#: Further modules for rooms that translate components or indices.
TRANSLATED = re.compile(r"fmus\.(documentation|language|native|script)(\.|$)")
TRANSLATING = (("program",), ("vehicle", "reduction"))

#: Rooms that run any system. Components are built with the lower one.
GENERAL = ("machine", "cosim")


def folder_of(package: str) -> Path:
    [folder] = import_module(package).__path__
    return Path(folder)


def modules(package: str) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """Every module of a package, and its name from the package on."""
    folder = folder_of(package)
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).with_suffix("").parts
        yield path, tuple(part for part in parts if part != "__init__")


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path: Path) -> set[tuple[str, ...]]:
    found = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found |= {tuple(alias.name.split(".")) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found |= {(*str(node.module).split("."), alias.name) for alias in node.names}
    return found


@cache
def component_folders() -> set[str]:
    return {module.split(".")[1] for module in components().values()}


def room(package: str, name: tuple[str, ...]) -> str:
    """The room of a module; a component of `fmus` is in the room of components."""
    first = name[0] if name else ""
    return "components" if package == "fmus" and first in component_folders() else first


@pytest.mark.parametrize("package", ALLOWED)
def test_packages_import_what_they_may(package):
    for path, name in modules(package):
        allowed = ALLOWED[package] | {package} | sys.stdlib_module_names
        # The proof never runs inside an FMU.
        if package == "auv_fmu" and name[:1] == ("proof",):
            allowed = allowed | {"numpy"}
        # The package exports functions of the orchestrator on first use.
        if package == "auv_fmu" and name in ((), ("casadi",)):
            allowed = allowed | {"orchestrator"}
        for imported in imports(path):
            if name == FOREIGN:
                assert imported[0] not in ALLOWED, f"{path} imports {imported[0]}"
            else:
                assert imported[0] in allowed, f"{path} imports {imported[0]}"


@pytest.mark.parametrize("package", FLOORS)
def test_imports_run_downwards(package):
    floors = FLOORS[package]
    for path, name in modules(package):
        # The package itself exports names of every room.
        if not name or name == ("__main__",):
            continue
        own = floors.index(room(package, name))
        for imported in imports(path):
            # Names that are not rooms belong to the package itself.
            if imported[0] == package and room(package, imported[1:]) in floors:
                other = floors.index(room(package, imported[1:]))
                assert other <= own, f"{path} imports {'.'.join(imported)}, which is above it"


@pytest.mark.parametrize("package", ["auv_fmu", "orchestrator"])
def test_package_names_its_rooms_from_the_lowest_on(package):
    assert tuple(named_in(package)) == FLOORS[package]


@pytest.mark.parametrize("room", FLOORS["auv_fmu"])
def test_room_names_its_modules(room):
    listed = {name[1] for _, name in modules("auv_fmu") if name[:1] == (room,) and name[1:]}
    assert sorted(named_in(f"auv_fmu.{room}")) == sorted(listed)


def named_in(package: str) -> list[str]:
    """The modules in the table of a package's docstring."""
    return re.findall(r"^:mod:`\.(\w+)`", str(import_module(package).__doc__), re.MULTILINE)


def test_the_general_half_imports_neither_the_mathematics_nor_the_components():
    for path, name in modules("orchestrator"):
        if name and name[0] in GENERAL:
            assert {module[0] for module in imports(path)}.isdisjoint(("auv_fmu", "fmus")), path


#: Most names that may be imported from `orchestrator.cosim`; fewer are better.
MOST_NAMES = 46


def test_the_master_is_used_through_its_door_only():
    """Only tests, measurements and tools may look inside."""
    folders = [folder_of("orchestrator"), folder_of("fmus"), ROOT / "examples"]
    taken = set()
    for path in (path for folder in folders for path in folder.rglob("*.py")):
        if folder_of("orchestrator.cosim") not in path.parents:
            inside = [module for module in imports(path) if module[:2] == ("orchestrator", "cosim")]
            taken |= {module[2] for module in inside}
            assert all(len(module) == 3 for module in inside), path
    assert taken == set(import_module("orchestrator.cosim").__all__)
    assert len(taken) <= MOST_NAMES


def test_components_are_built_with_the_lowest_room_of_the_orchestrator_only():
    for path, _ in modules("fmus"):
        rooms = {module[1] for module in imports(path) if module[0] == "orchestrator"}
        assert rooms <= {"machine"}, path


def is_translating(name: tuple[str, ...]) -> bool:
    return any(name[: len(prefix)] == prefix for prefix in TRANSLATING)


def test_the_orchestrator_imports_only_declarations_of_components():
    for path, name in modules("orchestrator"):
        for imported in imports(path):
            if imported[0] == "fmus":
                module = ".".join(imported)
                translates = is_translating(name) and TRANSLATED.match(module)
                assert translates or DECLARED.match(module), f"{path} imports {module}"


def test_what_components_declare_brings_no_pythonfmu_into_the_process():
    rooms = [
        ".".join(("orchestrator", *name))
        for _, name in modules("orchestrator")
        if is_translating(name)
    ]
    declared = ", ".join([*components().values(), *rooms])
    code = f"import sys, fmus.kinds, fmus.discovery, {declared}; "
    code += "from fmus.discovery import fingerprint; fingerprint('python'); "
    code += "sys.exit('pythonfmu' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def ports() -> set[str]:
    """Names of all ports and of their groups."""
    found = {port.name for component in components() for port in ports_of(component)}
    return found | {re.split(r"[.\[]", name)[0] for name in found}


def test_the_general_half_names_no_component_and_no_port_of_this_vehicle():
    wiring = (folder_of("orchestrator") / "runs/closed_loop.toml").read_text()
    instances = set(re.findall(r"^(\w+) = \"\w+\"$", wiring.split("[wires]")[0], re.MULTILINE))
    assert "plant" in instances
    words = instances - {"name"} | set(components())
    word = re.compile(rf"\b({'|'.join(words)})\b")
    dotted = "|".join(re.escape(name) for name in ports() if "." in name or "[" in name)
    port = re.compile(rf"(?<![\w.])({dotted})(?!\w)")
    # Short names such as e, y or bias are words of any program; in quotes they would be ports.
    plain = {"bias", "delay", "number", "stage", "stages", "step"}
    quoted = {name for name in ports() if len(name) > 1} - plain
    for path, name in modules("orchestrator"):
        if not name or name[0] not in GENERAL:
            continue
        text = path.read_text(encoding="utf-8")
        assert (word.findall(text), port.findall(text)) == ([], []), path
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert node.value not in quoted, f"{path} names {node.value}"


def test_no_modules_import_each_other():
    """Also where an import waits within a function."""
    for package in ("auv_fmu", "fmus", "orchestrator"):
        names = {".".join((package, *name)): path for path, name in modules(package)}
        needs = {}
        for name, path in names.items():
            found = {".".join(part) for module in imports(path) for part in (module, module[:-1])}
            needs[name] = found & (names.keys() - {name})
        list(TopologicalSorter(needs).static_order())


#: Names that distinguish operating systems, and modules of the orchestrator that may use them.
ASKS = {("os", "name"), ("sys", "platform"), ("platform", "system"), ("sys", "getwindowsversion")}
ASKING = {("machine", name) for name in ("compilers", "operating_system")}


def test_the_lowest_room_asks_which_operating_system_there_is():
    asking = {
        name
        for path, name in modules("orchestrator")
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
        and (node.value.id, node.attr) in ASKS
    }  # fmt: skip
    assert asking == ASKING
    for path, name in modules("orchestrator"):
        assert not imports(path) & ASKS, f"{path} imports what the lowest room may ask"
        if name != ("machine", "operating_system"):
            alone = {("fcntl",), ("msvcrt",), ("_winapi",), ("termios",)}
            assert not imports(path) & alone, f"{path} imports what one system has"
