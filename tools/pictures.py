"""Draw the pictures of docs/images: `python tools/pictures.py [FOLDER]...`.

Without arguments it runs and draws all scenarios; with folders, such as `results/noise`, it draws
the figures of the ready studies in them. Pictures are smaller than in the results of a run. Studies
keep all their colours, because a palette would leave out colours of their scales.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from orchestrator.commands.main import main as auv_fmu
from orchestrator.figures.drawing import SETTINGS
from orchestrator.figures.study_figures import draw_figures
from orchestrator.figures.study_values import Values
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.scenario import names
from orchestrator.studies.space import Space
from orchestrator.studies.store import StudyResult
from orchestrator.studies.study import read_figures, read_study
from pages import DOCS, PICTURES

#: Pictures are about 1,000 pixels wide.
_DPI = 140

_COLOURS = 256


def main() -> None:
    """Write the pictures of all scenarios, or of the studies in some folders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="*", type=Path, help="of a study; none: the scenarios")
    folders = parser.parse_args().folder
    SETTINGS["savefig.dpi"] = _DPI
    with TemporaryDirectory() as drawn:
        for name in () if folders else names():
            auv_fmu(["run", name, "--out", f"{drawn}/{name}"])
            picture = Image.open(Path(drawn, name, f"{name}.png")).convert("RGB")
            _keep(picture.quantize(_COLOURS, kmeans=1), f"{name}.png")
    for folder in folders:
        result = StudyResult(folder)
        study = read_study(result.record["study"])
        systems = {name: load_scenario(name) for name in study.scenario}
        space = Space(study, systems)
        legends = {name: scenario.legend for name, (scenario, _) in systems.items()}
        entries = read_figures(
            study.name, study.figures, space.columns, space.has_scenarios, space.indices
        )
        with TemporaryDirectory() as drawn:
            list(
                draw_figures(
                    entries,
                    study.title,
                    Values(result, {}, legends, space.units, space.logarithmic),
                    Path(drawn),
                )
            )
            for file in sorted(Path(drawn).glob("*.png")):
                _keep(Image.open(file).convert("RGB"), f"studies/{study.name}-{file.name}")


def _keep(picture: Image.Image, name: str) -> None:
    file = DOCS / PICTURES / name
    picture.save(file, optimize=True)
    print(f"{name}: {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
