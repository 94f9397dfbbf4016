"""Build a wheel with FMUs of both kinds for all platforms, the loop in C, and the live page.

`python tools/ready_wheel.py [--out DIR]` needs npm and `pip install -e '.[native,test]'`. With this
wheel, runs need no compiler and build nothing. `pip install .` builds a wheel without these parts.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory

from hatchling.builders.wheel import WheelBuilder

from fmus.kinds import FMI_VERSIONS, NATIVE, PYTHON
from orchestrator.cosim import loop
from orchestrator.live import assembly, module
from orchestrator.live.presets import bundled
from orchestrator.machine.compilers import COMPILERS, TARGETS, compiler_for, library, platforms
from orchestrator.machine.errors import InputError
from orchestrator.runs import bundle

ROOT = Path(__file__).parents[1]


def write_fmus(folder: Path) -> None:
    """Build the FMUs for all platforms, in the layout of `orchestrator.machine.cache`.

    Raises:
        InputError: they cannot be built.

    """
    for fmi in FMI_VERSIONS:
        place = folder / bundle.CATEGORY / bundle.key_of(NATIVE, fmi)
        bundle.run_fmus("build", place, "--kind", NATIVE, "--fmi", fmi, "--platforms", "all")
    with loader_for_any_linux():
        place = folder / bundle.CATEGORY / bundle.key_of(PYTHON, FMI_VERSIONS[0])
        bundle.run_fmus("build", place, "--kind", PYTHON, "--loader", "native")


def write_programs(folder: Path) -> None:
    """Build the parts of the live page and the loop in C, in the same layout.

    Raises:
        OSError: there is no compiler, or it fails.
        InputError: the page cannot be made.

    """
    sources = bundled().sources
    for category, key, files in (
        (module.CATEGORY, module.key_of(sources), module.compiled(sources)),
        (assembly.CATEGORY, assembly.key_of(), assembly.bundled()),
    ):
        place = folder / category / key
        place.mkdir(parents=True)
        for name, content in files.items():
            (place / name).write_bytes(content)
    machines = platforms(FMI_VERSIONS[-1], "all")
    compiler = compiler_for(machines)
    source = loop.SOURCE
    for machine in machines:
        content = library(
            compiler, machine, source.stem, {source.name: source.read_bytes()}, source.name
        )
        place = folder / loop.CATEGORY / loop.key_of(machine.name)
        place.mkdir(parents=True)
        (place / f"{source.stem}{machine.ending}").write_bytes(content)


@contextmanager
def loader_for_any_linux() -> Iterator[None]:
    """Compile the loader of the Python kind with ziglang, for an old glibc."""
    path = os.environ["PATH"]
    with TemporaryDirectory() as folder:
        compiler = Path(folder, COMPILERS[0])
        target = TARGETS["x86_64-linux"]
        compiler.write_text(
            f'#!/bin/sh\nexec {quote(sys.executable)} -m ziglang cc -target {target} "$@"\n',
            encoding="utf-8",
        )
        compiler.chmod(0o755)
        os.environ["PATH"] = os.pathsep.join((folder, path))
        try:
            yield
        finally:
            os.environ["PATH"] = path


def write_wheel(folder: Path, ready: Path) -> Path:
    """Build the wheel with the folder of :func:`write_fmus` and :func:`write_programs`."""
    builder = WheelBuilder(str(ROOT))
    builder.target_config["force-include"][str(ready)] = "orchestrator/ready"
    [wheel] = builder.build(directory=str(folder.resolve()))
    return Path(wheel)


def main(arguments: Sequence[str] | None = None) -> int:
    """Build the wheel, and print its path."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("dist"), metavar="DIR")
    out = parser.parse_args(arguments).out
    try:
        with TemporaryDirectory() as ready:
            write_fmus(Path(ready))
            write_programs(Path(ready))
            print(write_wheel(out, Path(ready)))
    except (OSError, InputError) as error:
        print(f"no wheel: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
