"""The FMUs in a host that is no Python program, with an empty environment."""

from __future__ import annotations

import shutil
import subprocess
import sysconfig
from pathlib import Path

import fmpy
import pytest

from fmus.packaging.loader import compiler
from orchestrator.experiments import bundle
from support.instances import NAMES

LIBPYTHON = Path(
    str(sysconfig.get_config_var("LIBDIR")), str(sysconfig.get_config_var("INSTSONAME"))
)

needs_compiler = pytest.mark.skipif(compiler() is None, reason="there is no C compiler")
needs_libpython = pytest.mark.skipif(
    not LIBPYTHON.name.endswith(".so.1.0") or not LIBPYTHON.is_file(),
    reason="this Python has no shared library",
)
pytestmark = needs_compiler


def compiled_host(folder: Path, *options: str) -> Path:
    host = folder / "host"
    source = Path(__file__).with_name("host.c")
    subprocess.run(
        [str(compiler()), "-Wall", "-Werror", "-g", *options, "-o", host, source, "-ldl"],
        check=True,
    )
    return host


def unpacked(dist: Path, folder: Path) -> list[str]:
    """Library and resource location of every FMU, as arguments of the host."""
    arguments = []
    for name in NAMES:
        target = folder / name
        fmpy.extract(dist / f"{name}.fmu", unzipdir=target)
        arguments += [str(target / "binaries/linux64" / f"{name}.so"),
                      (target / "resources").as_uri()]  # fmt: skip
    return arguments


def run(host: Path, *arguments: str, under: tuple[str, ...] = (), **environment: str):
    return subprocess.run(
        [*under, str(host), *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture
def with_libpython(tmp_path: Path) -> Path:
    """A host that finds this Python's libpython, as one does where it is installed."""
    return compiled_host(tmp_path, "-Wl,--disable-new-dtags", f"-Wl,-rpath,{LIBPYTHON.parent}")


@needs_libpython
def test_all_fmus_run_side_by_side_in_a_c_host(dist: Path, tmp_path: Path, with_libpython: Path):
    """1,000 steps each, state saved, serialised and restored bit for bit, all freed, status 0."""
    process = run(with_libpython, *unpacked(dist, tmp_path))
    assert process.stdout.endswith("5 FMUs, 1000 steps each\n")
    assert process.returncode == 0, process.stderr


@needs_libpython
def test_path_with_special_characters_is_no_trap(dist: Path, tmp_path: Path, with_libpython: Path):
    folder = tmp_path / "größe 100% [ü]"
    process = run(with_libpython, *unpacked(dist, folder))
    assert process.returncode == 0, process.stdout


#: Makes every libpython unfindable, as on a machine that has none.
NO_LIBPYTHON = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <string.h>
void *dlopen(const char *name, int flags) {
    void *(*real)(const char *, int) = (void *(*)(const char *, int))dlsym(RTLD_NEXT, "dlopen");
    return name != NULL && strncmp(name, "libpython", 9) == 0 ? NULL : real(name, flags);
}
"""


def test_without_a_libpython_the_host_is_told_what_is_missing(dist: Path, tmp_path: Path):
    host, source, shim = compiled_host(tmp_path), tmp_path / "shim.c", tmp_path / "shim.so"
    source.write_text(NO_LIBPYTHON)
    command = [str(compiler()), "-shared", "-fPIC", "-o", shim, source, "-ldl"]
    subprocess.run(command, check=True)
    process = run(host, *unpacked(dist, tmp_path), LD_PRELOAD=str(shim))
    assert process.returncode == 4
    assert "[hosted] status 3, logStatusError: fmi2Instantiate: no Python" in process.stdout
    assert "libpython3.9 to libpython3.13" in process.stdout


@needs_libpython
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_valgrind_finds_no_error_of_the_loader(dist: Path, tmp_path: Path, with_libpython: Path):
    arguments = unpacked(dist, tmp_path)[:2]
    log = tmp_path / "valgrind.log"
    process = run(
        with_libpython, *arguments,
        under=("valgrind", f"--log-file={log}", "--error-limit=no", "--num-callers=4"),
    )  # fmt: skip
    assert process.returncode == 0, process.stdout
    # Frames name the library: the loader's is AuvPlant.so, PythonFMU's AuvPlant_pythonfmu.so.
    blocks = log.read_text(errors="replace").split("\n==")
    errors = [block for block in blocks if "at 0x" in block and "/AuvPlant.so)" in block]
    assert errors == []


def test_plain_variant_is_there_on_request(tmp_path: Path):
    bundle.build(tmp_path, "plain")
    assert bundle.loader_of(tmp_path) == "plain"
    fmpy.extract(tmp_path / "AuvPlant.fmu", unzipdir=tmp_path / "unpacked")
    libraries = tmp_path / "unpacked/binaries/linux64"
    assert [path.name for path in libraries.iterdir()] == ["AuvPlant.so"]
    fmpy.simulate_fmu(str(tmp_path / "AuvPlant.fmu"), stop_time=0.2)
    assert bundle.build(tmp_path) == [], "what is there stays as it is"
    written = bundle.build(tmp_path, "native")
    assert tmp_path / "AuvPlant.fmu" in written
