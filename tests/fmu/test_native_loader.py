"""The FMUs in a host written in C, with an empty environment."""

from __future__ import annotations

import subprocess
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from shutil import copytree

import fmpy
import pytest

from fmus.kinds import PYTHON
from fmus.python.packaging import LOADER, LOADER_FLAGS, build_script, loader_compiler
from orchestrator.machine.compilers import machines_compiler
from orchestrator.runs import bundle
from support.hosts import bare_root, host, unpacked
from support.settings import NAMES
from support.tiers import slow

LIBPYTHON = Path(
    str(sysconfig.get_config_var("LIBDIR")), str(sysconfig.get_config_var("INSTSONAME"))
)

#: Processes a test with threads.
REPETITIONS = 3

needs_compiler = pytest.mark.skipif(loader_compiler() is None, reason="there is no C compiler")
needs_libpython = pytest.mark.skipif(
    not LIBPYTHON.name.endswith(".so.1.0") or not LIBPYTHON.is_file(),
    reason="there is no shared library of Python",
)
pytestmark = needs_compiler


def preloaded(folder: Path, text: str) -> str:
    """A library that replaces functions of the C library."""
    source = folder / "preloaded.c"
    source.write_text(f"#define _GNU_SOURCE\n{text}")
    command = [str(machines_compiler()), "-shared", "-fPIC"]
    subprocess.run([*command, "-o", folder / "preloaded.so", source, "-ldl"], check=True)
    return str(folder / "preloaded.so")


#: A host that finds this Python's libpython, as one does where it is installed.
FINDS_LIBPYTHON = ("-Wl,--disable-new-dtags", f"-Wl,-rpath,{LIBPYTHON.parent}")


def run(program: Path, *arguments: str, under: Sequence[str] = (), **environment: str):
    return subprocess.run(
        [*under, str(program), *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture
def with_libpython(tmp_path: Path) -> Path:
    return host(tmp_path, "host", *FINDS_LIBPYTHON)


@needs_libpython
def test_all_fmus_run_side_by_side_in_a_c_host(dist: Path, tmp_path: Path, with_libpython: Path):
    """1,000 steps each, state saved, serialised and restored bit for bit, all freed, status 0."""
    process = run(with_libpython, *unpacked(dist, tmp_path))
    assert process.stdout.endswith(f"{len(NAMES)} FMUs, 1000 steps each\n")
    assert process.returncode == 0, process.stderr


@needs_libpython
def test_host_that_ends_python_first_lets_its_instances_go_in_silence(dist, tmp_path):
    """Every other call is an error with the reason."""
    program = host(tmp_path, "ending")
    process = run(program, str(LIBPYTHON), *unpacked(dist, tmp_path, NAMES[:1]))
    assert process.returncode == 0, process.stderr
    assert process.stdout.splitlines() == [
        "with Python 0", "ended 0", "step 3", "free state 3", "another none", "terminate 0",
    ]  # fmt: skip
    messages, silence = process.stderr.split("--\n")
    ended = "the host has ended Python"
    assert messages.splitlines() == [
        f"fmi2DoStep: {ended}",
        f"fmi2FreeFMUstate: {ended}",
        f"ended: logStatusError: fmi2Instantiate: {ended}",
    ]
    assert silence == ""


@needs_libpython
def test_paths_may_have_special_characters(dist: Path, tmp_path: Path, with_libpython: Path):
    folder = tmp_path / "größe 100% [ü]"
    process = run(with_libpython, *unpacked(dist, folder, NAMES[:1]))
    assert process.returncode == 0, process.stdout


#: Makes every libpython unfindable, as on a machine without one.
NO_LIBPYTHON = """
#include <dlfcn.h>
#include <string.h>
void *dlopen(const char *name, int flags) {
    void *(*real)(const char *, int) = (void *(*)(const char *, int))dlsym(RTLD_NEXT, "dlopen");
    return name != NULL && strncmp(name, "libpython", 9) == 0 ? NULL : real(name, flags);
}
"""


def test_without_a_libpython_the_host_is_told_what_is_missing(dist: Path, tmp_path: Path):
    shim = preloaded(tmp_path, NO_LIBPYTHON)
    process = run(host(tmp_path, "host"), *unpacked(dist, tmp_path, NAMES[:1]), LD_PRELOAD=shim)
    assert process.returncode == 4
    assert "[hosted] status 3, logStatusError: fmi2Instantiate: no Python" in process.stdout
    assert "libpython3.9 to libpython3.13" in process.stdout


def in_a_bare_root(folder: Path, dist: Path, *brought: Path) -> subprocess.CompletedProcess[str]:
    """Run the host where there is nothing but it, the FMUs, and what these are linked against."""
    arguments = unpacked(dist, folder, NAMES[:1])
    root = bare_root(folder, host(folder, "host"), *brought)
    inside = [argument.replace(str(folder), "") for argument in arguments]
    return run(Path("/host"), *inside, under=root, LD_LIBRARY_PATH=str(LIBPYTHON.parent))


def test_machine_with_nothing_but_a_c_library_tells_what_is_missing(dist: Path, tmp_path: Path):
    process = in_a_bare_root(tmp_path, dist)
    assert process.returncode == 4
    assert "libpython3.9 to libpython3.13" in process.stdout


@needs_libpython
def test_libpython_without_its_standard_library_does_not_end_the_host(dist, tmp_path):
    process = in_a_bare_root(tmp_path, dist, LIBPYTHON)
    assert process.returncode == 4
    assert "fmi2Instantiate: Python does not start: " in process.stdout


@needs_libpython
@pytest.mark.parametrize("count", [2, *slow(16)])
def test_threads_that_instantiate_at_the_same_moment(dist: Path, tmp_path: Path, count: int):
    """One interpreter starts, and all instances use the same sys.path."""
    program = host(tmp_path, "threads", *FINDS_LIBPYTHON)
    arguments = [word for k in range(3) for word in unpacked(dist, tmp_path / str(k))][: 2 * count]
    for resources in tmp_path.glob("*/*/resources"):
        script = resources / f"{(resources / 'slavemodule.txt').read_text()}.py"
        # Threads take turns as often as can be.
        script.write_text(f"import sys\nsys.setswitchinterval(1e-6)\n{script.read_text()}")
    for _ in range(REPETITIONS):
        process = run(program, *arguments)
        assert (process.returncode, process.stdout) == (0, f"{count} threads\n"), process.stderr


@needs_libpython
def test_no_variable_keeps_python_from_starting(dist, tmp_path, with_libpython):
    variables = {
        **dict.fromkeys(("PYTHONHOME", "PYTHONPATH", "PYTHONPLATLIBDIR", "PATH"), "/nowhere"),
        **dict.fromkeys(("PYTHONIOENCODING", "PYTHONHASHSEED", "PYTHONMALLOC"), "nonsense"),
        **dict.fromkeys(("PYTHONUTF8", "PYTHONTRACEMALLOC", "LC_ALL"), "nonsense"),
        "PYTHONINTMAXSTRDIGITS": "1",
        "PYTHONWARNINGS": "error",
    }
    process = run(with_libpython, *unpacked(dist, tmp_path, NAMES[:1]), **variables)
    assert process.returncode == 0, process.stdout + process.stderr


#: A libpython that only the host has, and a check of calls that must not be nested: the
#: dynamic linker holds one lock while it goes through the libraries, another while it loads one.
PRIVATE_PYTHON = """
#include <dlfcn.h>
#include <link.h>
#include <stdlib.h>
static _Thread_local int inside;
static int (*visit)(struct dl_phdr_info *, size_t, void *);
__attribute__((constructor)) static void load(void) {
    if (dlopen(getenv("LIBPYTHON"), RTLD_LAZY | RTLD_LOCAL) == NULL) exit(42);
}
void *dlopen(const char *name, int flags) {
    void *(*real)(const char *, int) = (void *(*)(const char *, int))dlsym(RTLD_NEXT, "dlopen");
    if (inside) exit(43);
    return real(name, flags);
}
static int visiting(struct dl_phdr_info *info, size_t size, void *data) {
    inside = 1;
    int done = visit(info, size, data);
    inside = 0;
    return done;
}
int dl_iterate_phdr(int (*callback)(struct dl_phdr_info *, size_t, void *), void *data) {
    int (*real)(int (*)(struct dl_phdr_info *, size_t, void *), void *) =
        (int (*)(int (*)(struct dl_phdr_info *, size_t, void *), void *))dlsym(
            RTLD_NEXT, "dl_iterate_phdr");
    visit = callback;
    return real(visiting, data);
}
"""


@needs_libpython
def test_python_that_a_host_has_for_itself_is_used(dist: Path, tmp_path: Path):
    """No library is loaded while the dynamic linker goes through them."""
    program, shim = host(tmp_path, "host"), preloaded(tmp_path, PRIVATE_PYTHON)
    arguments = unpacked(dist, tmp_path, NAMES[:1])
    process = run(program, *arguments, LD_PRELOAD=shim, LIBPYTHON=str(LIBPYTHON))
    assert process.returncode == 0, process.stdout


#: A third-party slave that prints in each step.
TALKATIVE = """
from pythonfmu import Fmi2Slave

class Talkative(Fmi2Slave):
    def do_step(self, t, h):
        print("a step")
        return True
"""


@needs_libpython
def test_what_a_slave_prints_is_there_when_the_host_ends(tmp_path: Path):
    (tmp_path / "talkative.py").write_text(TALKATIVE)
    fmpy.extract(build_script(tmp_path / "talkative.py", tmp_path), unzipdir=tmp_path / "fmu")
    program = host(tmp_path, "threads", *FINDS_LIBPYTHON)
    folder = tmp_path / "fmu"
    process = run(program, str(folder / "binaries/linux64/Talkative.so"), str(folder / "resources"))
    assert process.stdout.count("a step\n") == 20
    assert process.returncode == 0


@pytest.mark.slow
@needs_libpython
def test_sanitizers_find_nothing_whatever_a_host_calls(dist: Path, tmp_path: Path):
    """Right and wrong calls in any order, the loader watched byte by byte."""
    name = "MotionPlanner"
    sanitizers = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-Wall",
                  "-Wextra", "-Werror")  # fmt: skip
    program = host(tmp_path, "random_calls", *FINDS_LIBPYTHON, *sanitizers)
    fmpy.extract(dist / f"{name}.fmu", unzipdir=tmp_path / "fmu")
    library = tmp_path / "fmu/binaries/linux64" / f"{name}.so"
    subprocess.run(
        [str(machines_compiler()), *sanitizers, "-o", library, *LOADER_FLAGS],
        cwd=LOADER,
        check=True,
    )
    for seed in range(2):
        process = run(
            program, str(library), (tmp_path / "fmu/resources").as_uri(), str(seed), "5000",
            # Python keeps what it has until the process ends, and wants to know what is too much.
            ASAN_OPTIONS="detect_leaks=0:allocator_may_return_null=1",
        )  # fmt: skip
        assert process.returncode == 0, process.stderr[-3000:]
        assert "fatal 0," in process.stdout


def test_plain_variant_is_there_on_request(plain: Path, tmp_path: Path, monkeypatch):
    copytree(plain, tmp_path, dirs_exist_ok=True)
    assert bundle.settings_of(tmp_path)["loader"] == "plain"
    fmpy.extract(tmp_path / "AuvPlant.fmu", unzipdir=tmp_path / "unpacked")
    libraries = tmp_path / "unpacked/binaries/linux64"
    assert [path.name for path in libraries.iterdir()] == ["AuvPlant.so"]
    fmpy.simulate_fmu(str(tmp_path / "AuvPlant.fmu"), stop_time=0.2)
    assert bundle.build_bundle(tmp_path) == [], "what is there stays as it is"
    fmus = bundle.current_fmus(PYTHON)
    monkeypatch.setattr(
        bundle, "run_fmus", lambda _, folder, *__, **___: copytree(fmus, folder, dirs_exist_ok=True)
    )
    written = bundle.build_bundle(tmp_path, loader="native")
    assert tmp_path / "AuvPlant.fmu" in written
