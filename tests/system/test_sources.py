"""FMUs that bring C sources and no library for this machine."""

from __future__ import annotations

import warnings
from pathlib import Path
from zipfile import ZipFile

import pytest

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim.fmi import binary
from orchestrator.machine import user_files
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from support.relay import relay

SUPPORT = Path(__file__).parents[1] / "support"
SOURCE, DEFAULTS, HEADER = (
    (SUPPORT / name).read_text(encoding="utf-8") for name in ("relay.c", "defaults.c", "slave.h")
)
TOGETHER = {"relay.c": SOURCE, "defaults.c": DEFAULTS, "slave.h": HEADER}

BUILD = """<fmiBuildDescription fmiVersion="3.0">
<BuildConfiguration modelIdentifier="other"><SourceFileSet><SourceFile name="none.c"/>
</SourceFileSet></BuildConfiguration>
<BuildConfiguration modelIdentifier="relay"><SourceFileSet language="C99">
<SourceFile name="own/relay.c"/><SourceFile name="own/defaults.c"/>
<PreprocessorDefinition name="NOTHING" value=""/>
<IncludeDirectory name="headers"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>
"""

#: Sources in FMUs: all files of a folder, files in a list, or a build description of FMI 3.0.
WAYS = {
    "all": (TOGETHER, ""),
    "named": (
        {**TOGETHER, "example.c": "int main(void) { broken }"},
        '<SourceFiles><File name="relay.c"/><File name="defaults.c"/></SourceFiles>',
    ),
    "described": (
        {"buildDescription.xml": BUILD, "own/relay.c": SOURCE, "own/defaults.c": DEFAULTS,
         "headers/slave.h": HEADER, "example.c": "broken"},
        "",
    ),
}  # fmt: skip


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of its own; it is skipped where there is no compiler."""
    if machines_compiler() is None:
        pytest.skip("there is no C compiler")
    folder = tmp_path_factory.mktemp("cache")
    folder.chmod(0o700)
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    forget()
    return folder


def with_sources(folder: Path, files: dict[str, str], listed: str = "", name: str = "s") -> Path:
    """The relay without its library."""
    path = folder / f"{name}.fmu"
    with ZipFile(relay(folder)) as old, ZipFile(path, "w") as new:
        text = old.read("modelDescription.xml").decode()
        end = 'canHandleVariableCommunicationStepSize="true"/>'
        assert end in text
        inside = f"{end[:-2]}>{listed}</CoSimulation>" if listed else end
        new.writestr("modelDescription.xml", text.replace(end, inside))
        for file, content in files.items():
            new.writestr(f"sources/{file}", content)
    return path


def rows(fmu: Path, **how: object) -> bytes:
    """Columns of a run, as bytes."""
    [name] = load(fmu).components
    given = {f"{name}.{port}": value for port, value in VALUES.items()}
    result = simulate(fmu, given, stop_time=1.0, step=0.125, **how)
    assert result.failure is None
    return b"".join(result[f"{name}.{port}"].tobytes() for port in ("u", "v", "g", "y", "t", "h"))


VALUES = {"u": 0.3, "v": 0.1, "a": 1.1}


def forget() -> None:
    """Forget unpacked FMUs, like another process."""
    user_files._folders.clear()
    user_files._digests.clear()


@pytest.mark.parametrize("way", WAYS)
def test_sources_give_the_numbers_of_the_library(tmp_path: Path, way: str):
    fmu = with_sources(tmp_path, *WAYS[way])
    before = fmu.read_bytes()
    expected = rows(relay(tmp_path))
    with pytest.warns(UserWarning, match=r"s\.fmu .*compiled"):
        assert rows(fmu) == expected
    forget()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rows(fmu) == expected
    assert fmu.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"s.fmu", relay(tmp_path).name}


#: As written by 20-sim: functions have a prefix unless it is defined, and a header is in a folder.
PREFIXED = """#ifndef FMI2_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX relay_
#endif
#define PASTE(a, b) a##b
#define JOIN(a, b) PASTE(a, b)
#define fmi2DoStep JOIN(FMI2_FUNCTION_PREFIX, fmi2DoStep)
#include "deep.h"
"""


def test_functions_have_no_prefix_and_headers_may_lie_deeper(tmp_path: Path):
    deeper = {**TOGETHER, "relay.c": PREFIXED + SOURCE, "template/own/deep.h": "int unused;"}
    with pytest.warns(UserWarning, match=r"s\.fmu .*compiled"):
        assert rows(with_sources(tmp_path, deeper)) == rows(relay(tmp_path))


def test_an_isolated_fmu_is_also_compiled(tmp_path: Path):
    fmu = with_sources(tmp_path, *WAYS["all"])
    with pytest.warns(UserWarning, match="compiled now"):
        rows(fmu, isolate=True)
    assert rows(fmu, isolate=True) == rows(relay(tmp_path))


def test_check_says_that_sources_are_compiled_and_does_not(own_cache: Path, tmp_path, capsys):
    fmu = with_sources(tmp_path, *WAYS["all"])
    main(["check", str(fmu)])
    assert "sources" in capsys.readouterr().out
    assert not list(own_cache.rglob("*.so"))


@pytest.mark.parametrize(
    ("files", "listed", "why"),
    [
        ({"relay.c": "int x = ;"}, "", "relay.c:1:9: error:"),
        ({"relay.c": SOURCE}, "", "slave.h: "),
        ({"x.c": ""}, '<SourceFiles><File name="y.c"/></SourceFiles>', "holds no sources/y.c"),
        ({"buildDescription.xml": "<x", "x.c": ""}, "", "s.fmu: buildDescription.xml:"),
        ({"readme.txt": ""}, "", "binaries"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*compiled now")
def test_sources_that_cannot_be_compiled_are_said_in_one_line(tmp_path, files, listed, why):
    fmu = with_sources(tmp_path, files, listed)
    with pytest.raises(InputError) as error:
        rows(fmu)
    assert why in str(error.value) and "\n" not in str(error.value)


def test_without_a_compiler_it_is_said_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(binary, "find_compiler", lambda: None)
    fmu = with_sources(tmp_path, *WAYS["all"])
    for command in ("run", "check"):
        arguments = ["--stop-time", "1", "--out", str(tmp_path / "o")] if command == "run" else []
        assert main([command, str(fmu), *arguments]) == 2
        output = capsys.readouterr()
        assert "gcc or clang" in output.out + output.err
