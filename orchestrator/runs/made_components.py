"""FMUs of the scripts and tables among the components of a scenario.

They are made once, and kept in the user's cache folder.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

from fmus.discovery import ORIGIN, digest_at, fingerprint, name_of, origin_of
from fmus.kinds import AUTO, FMI_VERSIONS, NATIVE
from orchestrator.machine.cache import category_folder, users_folder
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError
from orchestrator.runs.bundle import (
    CATEGORY,
    LOG,
    Form,
    best_kind,
    kept_fmus,
    run_fmus,
    settings_of,
    words_of,
)
from orchestrator.runs.scenario import Scenario
from orchestrator.runs.tracks import planner

#: Endings of scripts and of tables with tracks.
SCRIPT, TRACK = ".py", ".csv"


def with_fmus(scenario: Scenario, folder: Path, kind: str, targets: str | None = None) -> Scenario:
    """Replace scripts and tables among the components of a scenario by their FMUs.

    Args:
        scenario: whose components may be scripts, or tables with tracks.
        folder: of the bundle's FMUs; those that are made have the same kind.
        kind: that was asked for; with `auto`, they are of the Python kind where there is no
            compiler.
        targets: the platforms of the FMUs, with commas between them; None: this machine.

    Raises:
        InputError: a file cannot be read, or no FMU can be made of it.

    """
    files = {
        component: Path(str(file))
        for component, file in scenario.components.items()
        if str(file).endswith((SCRIPT, TRACK))
    }
    if not files:
        return scenario
    settings = settings_of(folder)
    made, fmi = settings["kind"], settings.get("fmi", FMI_VERSIONS[0])
    if kind == AUTO and made == NATIVE:
        made = best_kind(fmi)
    words = tuple(words_of(Form(kind=made, fmi=fmi, platforms=targets)))
    fmus = {
        component: str((_component if file.suffix == SCRIPT else planner)(file, made, words))
        for component, file in files.items()
    }
    return replace(scenario, components={**scenario.components, **fmus})


def _component(script: Path, kind: str, words: Sequence[str]) -> Path:
    """Return the FMU of a script, with the place of the script in it.

    Modules and data files that it uses are known when its FMU is built, by their digests in it.
    """
    if not script.is_file():
        raise InputError(f"{script}: no such file")
    digests: Mapping[str, str | None] = {script.name: digest_at(script)}
    while True:
        fmu = _built(script.resolve(), digests, kind, words)
        with ZipFile(fmu) as archive:
            origin = origin_of(archive.read(ORIGIN))
        if origin is None or not origin.changed(fmu):
            return fmu
        digests = {name: digest_at(script.parent / name) for name in origin.digests}


def _built(
    script: Path, digests: Mapping[str, str | None], kind: str, words: Sequence[str]
) -> Path:
    """Return the FMU of a script whose files have some digests."""
    try:
        # Folders within this one differ only in their names.
        place = Path(os.path.relpath(script.parent, category_folder(CATEGORY) / "key")).as_posix()
    except ValueError as error:
        # Windows has no path from one drive to another.
        raise InputError(
            f"{script}: cannot be on another drive than {users_folder()}; build its FMU"
        ) from error
    text = f"{words} {fingerprint(kind)} {place} {script.name} {sorted(digests.items())}"

    def build() -> dict[str, bytes]:
        LOG.info("building the FMU of %s (only once) ...", script.name)
        with temporary_folder() as folder:
            run_fmus("build", folder, str(script), *words, "--from", place)
            return {path.name: path.read_bytes() for path in folder.glob("*.fmu")}

    kept = kept_fmus(sha256(text.encode()).hexdigest()[:16], build)
    return kept[f"{name_of(script.stem)}.fmu"]
