"""Contents of an FMU of the native kind, and its GUID."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from fmus.discovery import source_of
from fmus.native import packaging
from fmus.native.packaging import fmu_entries
from orchestrator.machine.compilers import Compiler, platforms
from support.all_types.build import sources
from support.settings import NAMES, REPRESENTATIVES

PLANT = source_of("AuvPlant").definition

ANY = Compiler(["any"], label="any")


@pytest.fixture(autouse=True)
def _no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Libraries that name their platform, made in no time."""
    monkeypatch.setattr(packaging, "library", lambda compiler, platform, *_: platform.name.encode())


def entries(name: str, fmi: str = "2", names: str = "all") -> dict[str, bytes]:
    return fmu_entries(source_of(name), fmi, platforms(fmi, names), ANY, print)


def guid(contents: dict[str, bytes]) -> str:
    root = ElementTree.fromstring(contents["modelDescription.xml"])
    return root.get("guid") or root.get("instantiationToken") or ""


#: Beside documentation, libraries, and the sources: FMI 2.0.4, section 2.3; FMI 3.0.1, 2.5.1.
FILES = {
    "2": {"modelDescription.xml", "model.png"},
    "3": {
        "modelDescription.xml",
        "sources/buildDescription.xml",
        "terminalsAndIcons/terminalsAndIcons.xml",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/terminal.png",
    },
}


@pytest.mark.parametrize("fmi", FILES)
@pytest.mark.parametrize("name", REPRESENTATIVES)
def test_archive_holds_what_the_standard_names(name: str, fmi: str):
    contents = entries(name, fmi)
    sources = {file for file in contents if file.endswith((".c", ".h"))}
    carried = {file for file in contents if file.startswith("extra/org.fmi-standard.fmi-ls-ref/")}
    assert contents.keys() - sources - carried == FILES[fmi] | {
        "documentation/index.html",
        "documentation/fmi-ls-ref.txt",
        "documentation/licenses/license.txt",
        *(f"binaries/{p.name}/{name}{p.ending}" for p in platforms(fmi, "all")),
    }
    assert {f"sources/fmi{fmi}.c", "sources/equations.c", "sources/ports.h"} < sources
    assert f"sources/fmi{5 - int(fmi)}.c" not in sources, "the other version's"


@pytest.mark.parametrize("fmi", FILES)
def test_identity_is_in_the_description(fmi: str):
    contents = entries("AuvPlant", fmi)
    identity = contents["sources/identity.h"].decode()
    assert f'#define MODEL_GUID "{guid(contents)}"' in identity
    assert '#define MODEL_NAME "AuvPlant"' in identity


def test_guid_is_the_same_for_all_platforms():
    assert guid(entries("AuvPlant", names="linux64")) == guid(entries("AuvPlant", names="all"))


def test_guid_follows_from_sources_and_description(monkeypatch: pytest.MonkeyPatch):
    guids = {guid(entries(name, fmi)) for name in NAMES for fmi in FILES}
    files, written = sources(PLANT), packaging.sources_of
    for file in files:

        def changed(*parts: str, file: str = file) -> dict[str, str]:
            sources = written(*parts)
            return {**sources, file: sources[file] + "\n"}

        monkeypatch.setattr(packaging, "sources_of", changed)
        guids.add(guid(entries("AuvPlant")))
    assert len(guids) == 2 * len(NAMES) + len(files)


@pytest.mark.parametrize("name", REPRESENTATIVES)
def test_licence_and_page_name_only_software_in_the_fmu(name: str):
    contents = entries(name)
    licence = contents["documentation/licenses/license.txt"].decode()
    assert "MIT License" in licence
    assert "PythonFMU" not in licence
    page = contents["documentation/index.html"].decode()
    assert "PythonFMU" not in page
    assert "<code>sources</code>" in page
