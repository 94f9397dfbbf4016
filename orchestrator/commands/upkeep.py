"""`auv-fmu reference` and `docs`: files of this repository that are made by commands."""

from __future__ import annotations

import argparse
from pathlib import Path

from orchestrator.commands.options import add_options, add_out
from orchestrator.commands.streams import OK, show
from orchestrator.exchange.reference import write_reference
from orchestrator.paper.errata import errata_page
from orchestrator.runs.bundle import current_fmus, run_fmus
from orchestrator.runs.folder import replaced
from orchestrator.runs.run import Files
from orchestrator.runs.scenario_page import scenario_page
from orchestrator.studies.ready_page import ready_page
from orchestrator.studies.study_page import study_page


def add_reference(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `auv-fmu reference`."""
    add_out(parser, Path("reference"))
    add_options(parser, Files, "force")
    parser.set_defaults(action=_reference)


def add_docs(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `auv-fmu docs`."""
    add_out(parser, Path("docs"))
    add_options(parser, Files, "force")
    parser.set_defaults(action=_docs)


def _reference(options: argparse.Namespace) -> int:
    with replaced(options.out, force=options.force) as unfinished:
        written = write_reference(current_fmus(), unfinished)
    for path in written:
        show(options.out / path.relative_to(unfinished))
    return OK


def _docs(options: argparse.Namespace) -> int:
    pages = {
        "scenarios.md": scenario_page(),
        "studies.md": study_page(),
        "ready-studies.md": ready_page(),
        "paper.md": errata_page(),
    }
    with replaced(options.out, pages, force=options.force) as unfinished:
        written = run_fmus("documentation", unfinished / "components")
        for name, text in pages.items():
            (unfinished / name).write_text(text, encoding="utf-8")
    for path in (*written, *(unfinished / name for name in pages)):
        show(options.out / path.relative_to(unfinished))
    return OK
