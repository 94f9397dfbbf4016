"""The ready studies in the report: what their runs show of thousands of vehicles."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from orchestrator.paper.formatting import picture, plain
from orchestrator.runs.folder import inner
from orchestrator.studies.study import Study, read_study, ready_studies
from orchestrator.studies.sweep import Means, swept
from orchestrator.system.names import file_name

_WITHOUT = (
    f"Not in this report: {', '.join(ready_studies())}, each 10,000 runs or more. "
    "`auv-fmu report --studies` makes them, or what is missing of them."
)


def make_studies(
    names: Sequence[str], folder: Path, kind: str, command: Sequence[str], force: bool = False
) -> list[Study]:
    """Make what is missing of some studies.

    Args:
        names: of ready studies, or paths of files.
        folder: in which each has a folder, from one report to the next.
        kind: of the bundle's FMUs.
        command: for the record.
        force: move aside files of the user's that are in the way.

    Raises:
        InputError: something about a study is not usable, or cannot be written.
        KeyboardInterrupt: somebody wants it to stop; what is done is kept.

    """
    studies = [read_study(name) for name in names]
    for study in studies:
        place = inner(folder, study.stem)
        swept(study, Means(kind=kind, force=force), place, command, progress=True)
    return studies


def sections(studies: Sequence[Study], kept: Path, folder: Path) -> Iterator[str]:
    """A section for each study, in Markdown.

    Args:
        studies: that were made.
        kept: the folder that has their folders.
        folder: of the report, into which their figures go.

    """
    if not studies:
        yield _WITHOUT
    for study in studies:
        title = plain(study.title or study.name)
        yield f"### {title}"
        figures = Path("figures", "studies", study.stem)
        (folder / figures).mkdir(parents=True)
        for figure in study.figures:
            file = kept / study.stem / f"{file_name(figure)}.png"
            if file.is_file():
                shutil.copy(file, folder / figures)
                yield picture(f"{title}: {figure}", (figures / file.name).as_posix())
        if study.remark:
            yield study.remark.strip()
        yield f"- `auv-fmu sweep {study.name}`"
