"""The pictures of ready-studies.md: `python tools/study_pictures.py results/noise ...`.

Draws the figures of the ready studies that were made in these folders once more, smaller and in all
their colours: a palette would take colours out of their scales.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from orchestrator.figures.study_figures import draw_figures
from orchestrator.figures.style import SETTINGS
from orchestrator.runs.loading import load_scenario
from orchestrator.studies.space import Space
from orchestrator.studies.study_file import read_figures, read_study
from orchestrator.studies.study_result import StudyResult
from pages import DOCS, PICTURES

#: Pictures are 1,000 pixels wide.
_DPI = 140


def main() -> None:
    """Write the pictures of the studies in some folders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="+", type=Path)
    folders = parser.parse_args().folder
    SETTINGS["savefig.dpi"] = _DPI
    for folder in folders:
        result = StudyResult(folder)
        study = read_study(result.record["study"])
        space = Space(study, {scenario: load_scenario(scenario) for scenario in study.scenario})
        entries = read_figures(study.name, study.figures, space.columns, space.has_scenarios)
        with TemporaryDirectory() as drawn:
            list(
                draw_figures(
                    entries, study.title, result, Path(drawn), None, space.units, space.logarithmic
                )
            )
            for picture in sorted(Path(drawn).glob("*.png")):
                file = DOCS / PICTURES / f"{study.name}-{picture.name}"
                Image.open(picture).convert("RGB").save(file, optimize=True)
                print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
