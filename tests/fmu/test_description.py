"""The native kind's modelDescription.xml beside the Python kind's, as a host reads them."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import attrs
import pytest
from fmpy import read_model_description
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu

from fmus.packaging.discovery import components
from fmus.ports.description_fmi2 import fmi2_description
from fmus.ports.port import Port

GUID = "{00000000-0000-0000-0000-000000000000}"

#: In what the kinds differ.
ITS_OWN = {"instantiationToken", "generationTool", "buildConfigurations"}


def ports_of(name: str) -> tuple[Port, ...]:
    return import_module(components()[name].replace(".slave", ".ports")).PORTS


def everything(description: ModelDescription) -> dict[str, Any]:
    """All that a host reads, without what depends on the layout of the file."""
    return attrs.asdict(description, filter=lambda field, _: field.name != "sourceline")


@pytest.fixture(scope="module", params=components())
def folder(request, tmp_path_factory) -> Path:
    """A folder named like a component, with the description that the native kind has."""
    path = tmp_path_factory.mktemp("native") / request.param
    path.mkdir()
    summary = import_module(components()[path.name])
    content = fmi2_description(
        path.name, getattr(summary, path.name).description, GUID, ports_of(path.name)
    )
    (path / "modelDescription.xml").write_bytes(content)
    return path


def test_description_is_valid(folder: Path):
    assert validate_fmu(str(folder)) == []


def test_both_kinds_say_the_same(dist: Path, folder: Path):
    python = everything(read_model_description(str(dist / f"{folder.name}.fmu")))
    native = everything(read_model_description(str(folder)))
    assert len(native["modelVariables"]) == len(ports_of(folder.name)) + 1
    for one, other in zip(python["modelVariables"], native["modelVariables"], strict=True):
        assert one == other
    assert native.keys() == python.keys()
    assert {key for key in native if native[key] != python[key]} == ITS_OWN


def test_native_kind_tells_what_it_is(folder: Path):
    native = read_model_description(str(folder))
    assert native.guid == GUID
    assert native.generationTool == f"auv-fmu {version('auv-fmu')}"
    assert native.generationDateAndTime is None
    [[sources]] = [build.sourceFileSets for build in native.buildConfigurations]
    assert sources.sourceFiles == ["fmi2.c"]
