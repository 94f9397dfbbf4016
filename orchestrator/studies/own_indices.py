"""The user's own indices, in files next to a study whose names its figures show."""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.util import module_from_spec, spec_from_file_location
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any

from fmus.ports.reducer import Reducer, read_reducer
from orchestrator.cosim import System, Variable
from orchestrator.figures.study_values import is_known, names_of
from orchestrator.machine.children import run_module
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import Findings, InputError, did_you_mean, last_line, reason
from orchestrator.studies.study import LABELS, Study, listed
from orchestrator.vehicle.indices import INDICES, Index, index_columns
from orchestrator.vehicle.reduction import sources_of
from orchestrator.vehicle.signals import Loop, loops_of

#: A name of a file at the beginning of a value.
_STEM = re.compile(r"[A-Za-z_]\w*", re.ASCII)

#: Reason why a file cannot import another one.
_ALONE = "an index is one file, which imports what is installed"


@dataclass(frozen=True)
class OwnIndex:
    """A file with one or several indices of the user's own; it is pickled as text.

    Attributes:
        name: stem of the file.
        text: content of the file.

    """

    name: str
    text: bytes

    @property
    def digest(self) -> str:
        """Hash of the text."""
        return hashlib.sha256(self.text).hexdigest()

    @cached_property
    def reducer(self) -> Reducer:
        """The functions of the file."""
        return read_reducer(_module(self))

    @property
    def indices(self) -> tuple[Index, ...]:
        """The indices in the file."""
        return tuple(
            Index(name, name.replace("_", " "), self.reducer) for name in self.reducer.results
        )

    def __getstate__(self) -> Mapping[str, object]:
        """Return the text, without the reducer made of it."""
        return {"name": self.name, "text": self.text}


@cache
def _module(own: OwnIndex) -> ModuleType:
    """Import the text of a file as a module of this process."""
    file = process_folder() / own.digest[:16] / f"{own.name}.py"
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(own.text)
    # Another study of this process may have another file of this name.
    name = f"index_{own.digest[:16]}.{own.name}"
    specification = spec_from_file_location(name, file)
    assert specification is not None and specification.loader is not None
    module = module_from_spec(specification)
    sys.modules[name] = module
    specification.loader.exec_module(module)
    return module


def read_own_index(path: Path) -> OwnIndex:
    """Read a file with the user's own indices.

    Raises:
        Refused: there are problems in it.

    """
    # A separate process imports it first, because it may contain any Python.
    process = run_module("fmus.check", "--index", str(path))
    findings = Findings()
    for text in process.stdout.splitlines():
        findings.problem(text)
    if process.returncode != 0:
        findings.problem(last_line(process.stderr))
    findings.refuse()
    try:
        own = OwnIndex(path.stem, path.read_bytes())
        own.reducer  # noqa: B018
    except Exception as error:
        raise InputError(f"{path}: {type(error).__name__}: {reason(error)}; {_ALONE}") from None
    return own


def own_indices(study: Study, systems: Mapping[str, System]) -> tuple[OwnIndex, ...]:
    """Return the user's own indices that a study names, or that its figures show.

    Args:
        study: in the folder of the files.
        systems: that it runs, by their names in the study.

    Raises:
        Refused: a file has no index, an index has the name of another, or an input that no system
            has.

    """
    loops = {name: loops_of(system) for name, system in systems.items()}
    known = [*study.varied, *chain(*map(index_columns, loops.values()))]
    unknown = (value for value in _shown(study) if not is_known(value, known))
    names = [name for value in unknown for name in names_of(value) if not is_known(name, known)]
    prefixes = {"": None} | {f"{loop.name}.": None for loop in chain(*loops.values())}
    components = {
        name.partition(".")[0] for system in systems.values() for name in system.components
    }
    stems = {
        match[0]: None
        for name in names
        for prefix in prefixes
        if name.startswith(prefix) and (match := _STEM.match(name, len(prefix)))
    }
    findings, every = Findings(), list[OwnIndex]()
    # A file may also belong to a component.
    beside = [stem for stem in stems if study.folder and stem not in components]
    for path in (*study.indices, *(Path(study.folder or "", f"{stem}.py") for stem in beside)):
        if path.is_file():
            with findings.collecting():
                own = read_own_index(path)
                _check_names(path, own, every)
                _check_inputs(path, own, systems, loops)
                every.append(own)
    findings.refuse()
    return tuple(every)


def _check_names(path: Path, own: OwnIndex, others: Sequence[OwnIndex]) -> None:
    """Raise an InputError if another index has the name of one."""
    taken = {index.name: "auv-fmu" for index in INDICES}
    taken |= {index.name: f"{other.name}.py" for other in others for index in other.indices}
    for index in own.indices:
        if index.name in taken:
            raise InputError(f"{path}: {taken[index.name]} has an index {index.name}; rename it")


def _check_inputs(
    path: Path,
    own: OwnIndex,
    systems: Mapping[str, System],
    loops: Mapping[str, Sequence[Loop]],
) -> None:
    """Raise an InputError if no system of the study has the inputs of an index."""
    without = ""
    for name, system in systems.items():
        variables = dict(_variables(system))
        for loop in loops[name]:
            places = dict.fromkeys(variables, 0)
            sources = sources_of(own.reducer, loop, places, {})
            for port in own.reducer.ports:
                variable = variables.get(loop.port(port.name))
                if variable is not None and variable.family != port.type:
                    why = f"{port.name} is of the type {variable.family}, not {port.type}"
                    raise InputError(f"{path}: {why}")
            if not sources.missing:
                return
            lacking = sources.missing[0]
            without = f"{name} has no {lacking}{did_you_mean(lacking, variables)}"
    raise InputError(f"{path}: {without}")


def _variables(system: System) -> Iterator[tuple[str, Variable]]:
    """Yield the variables of rows and parameters of a run with their names."""
    for component in system.components.values():
        for causality in ("output", "input", "parameter"):
            for variable in component.having(causality):
                yield f"{component.name}.{variable.name}", variable


def _shown(study: Study) -> Iterator[str]:
    """Yield the values that the figures of a study show."""
    for name, table in study.figures.items():
        if name != LABELS:
            for key in ("x", "y", "show", "limits"):
                yield from listed(table.get(key, ()))


def with_fields(
    figures: Mapping[str, Any], own: Sequence[OwnIndex], columns: Sequence[str]
) -> dict[str, Any]:
    """Return the figures of a study with the indices of all vehicles instead of names of files.

    Args:
        figures: of the study file.
        own: the user's own indices.
        columns: of indices.

    """
    indices = {
        file.name: [
            name
            for index in file.indices
            for name in dict.fromkeys(_group(column, index.name) for column in columns)
            if name
        ]
        for file in own
    }
    return {
        name: {
            **table,
            "show": [*chain(*(indices.get(value, [value]) for value in listed(table["show"])))],
        }
        if name != LABELS and "show" in table
        else table
        for name, table in figures.items()
    }


def _group(column: str, index: str) -> str:
    """Return the index of a column with its vehicle; empty for a column of another index."""
    match = re.fullmatch(rf"((?:.+\.)?{index})(?:\.\w+|\[[\d,]+\])?", column)
    return match[1] if match else ""
