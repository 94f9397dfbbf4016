"""The release: an archive with everything that a user of the FMUs needs, per version of FMI.

The same sources and the same compiler give the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from string import Template

from auv_fmu import __version__
from fmus.discovery import REFERENCE, components, licences, source_of, write_archive
from fmus.kinds import FMI_VERSIONS, NATIVE
from orchestrator.machine.compilers import platforms
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.identity import package_folder
from orchestrator.runs.bundle import ARCHIVE, build_bundle, write_checksums
from orchestrator.runs.folder import replace_files

#: Page of an archive, and its template.
_PAGE, _TEMPLATE = "README.md", Path(__file__).with_name("release.md")

#: Folders of the system's reference results, in an installed package and in the repository.
_REFERENCES = Path(__file__).with_name(REFERENCE), Path(__file__).parents[2] / REFERENCE

#: Version of SSP for each version of FMI.
_SSP_VERSIONS: dict[str, str] = dict(zip(FMI_VERSIONS, ("1.0", "2.0"), strict=True))

#: Licences in the package of ziglang for code that it links into libraries: parts of zig's C
#: library and, on Windows, of mingw-w64.
_LINKED = {"zig.txt": "LICENSE", "mingw-w64.txt": "lib/libc/mingw/COPYING"}


def write_release(folder: Path, hear: Callable[[str], None], *, force: bool = False) -> list[Path]:
    """Write the archives of a release.

    Args:
        folder: target folder; made if it does not exist.
        hear: called with a line when a library is made.
        force: move aside the user's files with the names of the archives.

    Returns:
        The archives.

    Raises:
        InputError: the FMUs cannot be built for all platforms, or the folder cannot be written.

    """
    names = {fmi: f"auv-fmu-{__version__}-fmi{fmi}" for fmi in FMI_VERSIONS}
    written = [f"{name}.zip" for name in names.values()]
    with replace_files(folder, written, force=force) as unfinished:
        for fmi, name in names.items():
            with temporary_folder() as temporary:
                contents = _contents(temporary, fmi, hear)
                entries = {f"{name}/{file}": content for file, content in contents}
                write_archive(unfinished / f"{name}.zip", entries)
    return [folder / name for name in written]


def _contents(folder: Path, fmi: str, hear: Callable[[str], None]) -> Iterator[tuple[str, bytes]]:
    """Build the files of an archive in a folder; yield their names and contents."""
    build_bundle(folder, kind=NATIVE, fmi=fmi, platforms="all", hear=hear)
    others = {_PAGE: _page(fmi), **dict(_licences()), **dict(_references())}
    for name, content in others.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
    # Sorted, as the order of a folder differs between machines.
    files = sorted((*folder.glob("*.fmu"), folder / ARCHIVE, *(folder / name for name in others)))
    for path in (*files, write_checksums(folder, files)):
        yield path.relative_to(folder).as_posix(), path.read_bytes()


def _page(fmi: str) -> bytes:
    """Return the page on the files of an archive."""
    described = {name: source_of(name).definition.summary for name in components()}
    fmus = "\n".join(f"| `{name}.fmu` | {text} |" for name, text in described.items())
    names = ", ".join(platform.name for platform in platforms(fmi, "all"))
    page = Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        version=__version__, fmi=f"{fmi}.0", ssp=_SSP_VERSIONS[fmi], fmus=fmus, platforms=names
    )
    return page.encode()


def _licences() -> Iterator[tuple[str, bytes]]:
    """Yield the licences of the FMUs, and of code that the compiler links into their libraries."""
    yield "licenses/auv-fmu.txt", licences(NATIVE).encode()
    for name, file in _LINKED.items():
        yield f"licenses/{name}", (package_folder("ziglang") / file).read_bytes()


def _references() -> Iterator[tuple[str, bytes]]:
    """Yield the reference results of each FMU, and of the system."""
    folder = next(folder for folder in _REFERENCES if folder.is_dir())
    paths = [*folder.glob("auv_*")]
    for name in components():
        # The folder also has files that the FMU itself carries.
        paths += (source_of(name).folder / REFERENCE).glob(f"{name}_*")
    for path in paths:
        yield f"{REFERENCE}/{path.name}", path.read_bytes()
