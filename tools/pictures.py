"""Draw the pictures of docs/images: `python tools/pictures.py [FOLDER]...`.

Without arguments it runs and draws all scenarios; with folders, such as `results/noise`, it draws
the figures of the ready studies in them. Pictures are smaller than in the results of a run. Studies
keep all their colours, because a palette would leave out colours of their scales.
"""

from __future__ import annotations

import argparse
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from mpl_toolkits.mplot3d.axes3d import Axes3D
from PIL import Image, ImageOps

from orchestrator.commands.main import main as auv_fmu
from orchestrator.figures.drawing import SETTINGS, styled
from orchestrator.figures.run_figures import (
    COMMANDS,
    DISTANCES,
    FIGURES,
    FLEET_FROM_ABOVE,
    PATH,
    Cell,
    box_corners,
)
from orchestrator.figures.study_figures import draw_figures
from orchestrator.figures.study_values import Values
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.result import read_result
from orchestrator.runs.scenario import Scenario, names, read_scenario
from orchestrator.studies.space import Space
from orchestrator.studies.store import StudyResult
from orchestrator.studies.study import read_figures, read_study
from pages import DOCS, PICTURES, SMALL, SMALL_STUDIES

#: Pictures are about 1,000 pixels wide.
_DPI = 140

_COLOURS = 256

#: Size of small pictures [px], which the gallery shows at half of it, and their number of colours.
_SMALL, _SMALL_COLOURS = (720, 480), 32

#: Resolution of small pictures of scenarios, for lines of the width of a figure.
_SMALL_DPI = 170

#: Places of the two panels of a small picture.
_LEFT: dict[str, Any] = {"left": 0.03, "right": 0.51, "bottom": 0.05, "top": 0.95}
_RIGHT: dict[str, Any] = {"left": 0.56, "right": 0.97, "bottom": 0.05, "top": 0.95}

#: Height of the heading of a study's figure [px].
_HEADING = 34


def main() -> None:
    """Write the pictures of all scenarios, or of the studies in some folders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="*", type=Path, help="of a study; none: the scenarios")
    folders = parser.parse_args().folder
    SETTINGS["savefig.dpi"] = _DPI
    with TemporaryDirectory() as drawn:
        for name in () if folders else names():
            folder = Path(drawn, name)
            auv_fmu(["run", name, "--out", str(folder)])
            picture = Image.open(folder / f"{name}.png").convert("RGB")
            _keep(picture.quantize(_COLOURS, kmeans=1), f"{name}.png")
            _keep(_without_words(folder, read_scenario(name)), f"{SMALL}/{name}.png")
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
                picture = Image.open(file).convert("RGB")
                name = f"studies/{study.name}-{file.name}"
                _keep(picture, name)
                if file.stem == SMALL_STUDIES[study.name]:
                    _keep(_below_heading(picture), f"{SMALL}/{name}")


def _without_words(folder: Path, scenario: Scenario) -> Image.Image:
    """Small picture of a run: its path on the left, and beside it what is worth a look."""
    runs = [read_result(path) for path in (folder, *(f for f in folder.iterdir() if f.is_dir()))]
    left, right = PATH, COMMANDS
    if scenario.vehicles:
        left, right = FLEET_FROM_ABOVE, DISTANCES
    elif scenario.figure.startswith("open-loop"):
        *_, (right, _) = FIGURES[scenario.figure][""]
    image = BytesIO()
    with styled():
        width, height = _SMALL
        figure = Figure(figsize=(width / _SMALL_DPI, height / _SMALL_DPI), dpi=_SMALL_DPI)
        figure.set_layout_engine("none")
        for panel, place in ((left, _LEFT), (right, _RIGHT)):
            panel.draw(Cell(figure, figure.add_gridspec(1, 1, **place)[0]), runs)
        for axes in figure.axes:
            axes.tick_params(length=0, labelcolor="none")
            for words in axes.findobj(lambda part: isinstance(part, (Text, Legend))):
                words.set_visible(False)
        if left is PATH:
            _fill(figure.axes[0])
        figure.savefig(image, dpi="figure")
    return Image.open(image).convert("RGB").quantize(_SMALL_COLOURS, kmeans=1)


def _fill(axes: Axes3D) -> None:
    """Let the box of a path in space fill its place, in which it has wide margins."""
    place = axes.get_position(original=True)
    axes.apply_aspect()
    shown = axes.get_position()
    to_figure = axes.transData - axes.figure.transFigure
    points = to_figure.transform(box_corners(axes).reshape(-1, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    scale = min(place.size / (high - low))
    start = (place.min + place.max) / 2 + scale * (shown.min - (low + high) / 2)
    axes.set_position((*start, *(scale * shown.size)))


def _below_heading(picture: Image.Image) -> Image.Image:
    """Small picture of a study's figure."""
    below = picture.crop((0, _HEADING, picture.width, picture.height))
    return ImageOps.pad(below, _SMALL, color="white").quantize(_SMALL_COLOURS, kmeans=1)


def _keep(picture: Image.Image, name: str) -> None:
    file = DOCS / PICTURES / name
    file.parent.mkdir(parents=True, exist_ok=True)
    picture.save(file, optimize=True)
    print(f"{name}: {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
