"""Definitions of the components of a system, found by their FMUs.

An FMU of the bundle is recognised by its digest or its equations. A user's FMU contains the name of
the script that it was built from; this script must exist, unchanged.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from fmus.discovery import ORIGIN, Origin, components, digest_at, name_of, origin_of, source_of
from fmus.kinds import NATIVE, PYTHON
from fmus.language.build import Untranslatable
from fmus.native.translator import translated
from fmus.ports.definition import Definition, define
from fmus.ports.port import Misdeclared
from fmus.script import is_component, script_in
from orchestrator.cosim import Component, System
from orchestrator.machine.disk import sha256_of
from orchestrator.machine.errors import InputError, reason, shortened
from orchestrator.runs.bundle import current_fmus

#: Path of the equations in a native FMU.
_EQUATIONS = Path("sources", "equations.c")

#: Files and digests of users' modules that are loaded, by module.
_loaded: dict[str, tuple[Path, str | None]] = {}


def definitions_of(system: System) -> dict[str, Definition]:
    """Return the definitions of all components of a system, by component.

    Raises:
        InputError: a component is not in the language of equations, or the source of its FMU is
            missing; the message names the component and the reason.

    """
    definitions: dict[str, Definition] = {}
    known: dict[str, Definition] = {}
    for name, component in system.components.items():
        if component.digest not in known:
            try:
                known[component.digest] = _definition(component)
            except Untranslatable as error:
                first = str(error).splitlines()[0]
                raise InputError(f"{name}: is not in the language of equations: {first}") from None
            except (Misdeclared, InputError) as error:
                raise InputError(f"{name}: {error}") from None
        definitions[name] = known[component.digest]
    return definitions


def refusals(system: System) -> Iterator[str]:
    """Find parameters that components of known source will refuse, without running them."""
    for name, component in system.components.items():
        try:
            definition = _definition(component)
        except (InputError, Misdeclared, Untranslatable):
            continue
        if check := definition.behaviour.hooks["check"]:
            values: dict[str, Any] = {**component.starts, **system.parameters_of(name)}
            try:
                check(definition.parameters.of(values))
            except Exception as error:
                yield f"{name}: {error}"


def _definition(component: Component) -> Definition:
    """Return the definition that an FMU was made from.

    Raises:
        InputError: there is none, or it has changed.
        Misdeclared, Untranslatable: the changed source is not a valid definition.

    """
    model = str(component.description.modelName)
    if component.is_ours:
        record = component.folder / ORIGIN
        if record.is_file() and (origin := origin_of(record.read_bytes())):
            return _own(component, origin)
        if model in components():
            definition = source_of(model).definition
            if _is_made_from(component, definition):
                return definition
            raise InputError(
                f"{component.fmu.name} was built by another version of auv-fmu: build it again"
            )
    raise InputError(f"{component.fmu.name} is not a component in the language of equations")


def _is_made_from(component: Component, definition: Definition) -> bool:
    """Tell whether an FMU of the bundle has the equations of a definition."""
    equations = component.folder / _EQUATIONS
    kind = NATIVE if equations.is_file() else PYTHON
    if component.digest == sha256_of(current_fmus(kind) / f"{definition.name}.fmu"):
        return True
    # FMUs for other platforms, or another version of FMI, have the same equations.
    return kind == NATIVE and equations.read_text(encoding="utf-8") == translated(definition)


def _own(component: Component, origin: Origin) -> Definition:
    """Return the definition of a user's component.

    Raises:
        InputError: its script is missing, has changed, or is not a component in the language.

    """
    fmu = component.fmu
    script = origin.place(fmu) / origin.script
    if not script.is_file():
        raise InputError(
            f"{fmu.name} was built from {origin.script}, which is not there: a program is made "
            "from the script of a component"
        )
    if changed := origin.changed(fmu):
        names = shortened(", ".join(path.name for path in changed))
        raise InputError(f"{names} has changed since {fmu.name} was built: build it again")
    return definition_in(script)


def definition_in(path: Path) -> Definition:
    """Return the definition of a user's component from its script, or the folder of one.

    Raises:
        InputError: there is no such script, or it cannot be loaded, or is a slave of PythonFMU.
        Misdeclared: it is not a valid definition.

    """
    try:
        script = script_in(path)
    except ValueError as error:
        raise InputError(str(error)) from None
    if not is_component(script):
        raise InputError(
            f"{script.name} is a slave of PythonFMU, and not in the language of equations"
        )
    return define(name_of(script.stem), _load(script))


def _load(script: Path) -> ModuleType:
    """Load a user's module from its source, with the modules in its folder that it imports.

    Raises:
        InputError: it raises an exception, or a module of Python has the same name.

    """
    folder, name = script.resolve().parent, script.stem
    _forget_others(folder)
    known = sys.modules.get(name)
    if known is not None and name not in _loaded:
        if getattr(known, "__file__", None) == str(script.resolve()):
            return known
        raise InputError(f"{name} is already a module of Python; choose another name")
    importlib.invalidate_caches()
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    sys.path.insert(0, str(folder))
    try:
        module = importlib.import_module(name)
    except Exception as error:
        raise InputError(f"{script.name} cannot be loaded: {reason(error)}") from error
    finally:
        sys.path.remove(str(folder))
        sys.dont_write_bytecode = writes
        for other, loaded in [*sys.modules.items()]:
            file = getattr(loaded, "__file__", None)
            if file is not None and other not in _loaded and folder in Path(file).parents:
                _loaded[other] = Path(file), digest_at(Path(file))
    return module


def _forget_others(folder: Path) -> None:
    """Unload modules that have changed, or that modules of this folder would be mistaken for."""
    for name, (path, digest) in [*_loaded.items()]:
        top = folder / name.partition(".")[0]
        is_other = folder not in path.parents and (top.is_dir() or top.with_suffix(".py").is_file())
        if is_other or digest_at(path) != digest:
            del _loaded[name]
            sys.modules.pop(name, None)
