"""The page of the studies that come with the program, from their files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from orchestrator.studies.figure_entries import LABELS
from orchestrator.studies.study import Study, read_study, ready_studies

#: The pictures of the page, below the folder of the pages, small.
PICTURES = Path("images", "studies")

_HEAD = """\
# Ready studies

Six studies come with auv-fmu, each 10,000 runs or more of the proposed controller against the PD
controller, by the compiled equations. `auv-fmu sweep distance` makes the runs and the figures of
one of them in `results/distance/`; `auv-fmu report --studies` makes all six for the report. Lines
are medians of the runs that have a value in common, bands hold the middle 80 % of them; a white or
black line is a limit. What is said below the figures was read off the runs and not off them:
`python tools/study_numbers.py results/distance` prints the numbers, and of which runs each is the
median, the least or the largest. A study of one's own is a file like theirs: [studies](studies.md).

This page is written by `auv-fmu docs`, from the studies' files.
"""


def ready_page() -> str:
    """The page, in Markdown."""
    return "\n".join([_HEAD, *map(_section, map(read_study, ready_studies()))])


def _section(study: Study) -> str:
    return "\n\n".join([f"## {study.title}", f"`auv-fmu sweep {study.name}`", *_pictures(study),
                        study.remark.strip()]) + "\n"  # fmt: skip


def _pictures(study: Study) -> Iterator[str]:
    for figure in study.figures:
        if figure != LABELS:
            file = PICTURES / f"{study.name}-{figure}.png"
            yield f"![{study.title}: {figure}]({file.as_posix()})"
