"""Make the film of the home page: `python tools/film.py`.

Scenes are what users see: the live page and the report in Chromium, commands and what they print.
Only waiting is cut. It needs Chromium, ffmpeg, a C compiler, npm and the extras `native` and
`studies`, takes some minutes, and writes docs/images/tour.mp4 and its poster, tour.jpg.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from base64 import b64decode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

from orchestrator.live.presets import live_page
from pages import DOCS, PICTURES, ROOT

sys.path.append(str(ROOT / "tests"))

from support.browser import Browser, browser

_TOOLS = ROOT / "tools"

#: Name of the live page.
_LIVE = "live.html"

_WIDTH, _HEIGHT = 1280, 720

#: Frames per second.
_RATE = 15

#: Characters typed in a frame.
_TYPED = 2

#: When the poster is taken [s].
_POSTER = 12.0

_STUDY = """
title = "What a larger command buys"
scenario = ["fig5", "fig5-pd"]
engine = "batch"
parameters.planner.eta0.z = -2.0
sample.n = 512
sample.range.controller.lambda = { from = 0.2, to = 5.0, spacing = "log" }
sample.range.controller.sigma = { from = 0.0001, to = 0.1, spacing = "log" }
sample.range.controller.eps_t = { from = 0.1, to = 100.0, spacing = "log" }
figures.front = { kind = "front", x = "peak_command", y = "late_error" }
"""


class Film:
    """Pictures of a page on their way into a film, and a folder in which commands run."""

    def __init__(self, shown: Browser, frames: IO[bytes], folder: Path) -> None:
        self._shown, self._frames, self._text = shown, frames, ""
        self.folder = folder
        shown.call("Page.setBypassCSP", enabled=True)
        script = (_TOOLS / "film.js").read_text(encoding="utf-8")
        shown.call("Page.addScriptToEvaluateOnNewDocument", source=script)
        size = {"width": _WIDTH, "height": _HEIGHT, "deviceScaleFactor": 1, "mobile": False}
        shown.call("Emulation.setDeviceMetricsOverride", **size)

    def do(self, name: str, *values: object) -> None:
        """Call a function of film.js, and wait until its effect is drawn."""
        call = f"film.{name}({', '.join(map(json.dumps, values))})"
        self._shown.evaluate(f"Promise.resolve({call}).then(film.drawn)")

    def hold(self, seconds: float) -> None:
        """Show the page as it is."""
        taken = self._shown.call("Page.captureScreenshot", format="jpeg", quality=95)
        self._frames.write(b64decode(taken["data"]) * max(1, round(seconds * _RATE)))

    def move(self, seconds: float, name: str) -> None:
        """Call a function of film.js with shares that rise from 0 to 1, and show each."""
        last = round(seconds * _RATE) - 1
        for frame in range(last + 1):
            self.do(name, frame / last)
            self.hold(1 / _RATE)

    def caption(self, text: str) -> None:
        """Change the caption."""
        self.do("caption", text)

    def open(self, page: Path, caption: str) -> None:
        """Open a page with a caption."""
        self._shown.open(page)
        self.do("dress", (_TOOLS / "film.css").read_text() if page.name == _LIVE else "")
        self.caption(caption)

    def live(self, scenario: str, caption: str, charts: list[int], layout: str = "") -> None:
        """Open the live page with some sections of its charts."""
        page = self.folder / _LIVE
        page.write_text(live_page(scenario), encoding="utf-8")
        self.open(page, caption)
        self.do("charts", charts, layout)

    def card(self, html: str, seconds: float) -> None:
        """Show a title."""
        self._stage("card", "")
        self.do("card", html)
        self.hold(seconds)

    def figure(self, file: str, caption: str, seconds: float) -> None:
        """Show a picture, from its top to its end."""
        self._stage("figure", caption)
        self.do("figure", (self.folder / file).as_uri())
        self.hold(0.4 * seconds)
        self.move(0.2 * seconds, "pan")
        self.hold(0.4 * seconds)

    def terminal(self, caption: str) -> None:
        """Open an empty terminal."""
        self._stage("terminal", caption)
        self._text = ""

    def command(self, line: str, seconds: float) -> None:
        """Type a command, run it, and show what it prints."""
        for end in range(0, len(line) + _TYPED, _TYPED):
            self.do("print", f"{self._text}$ {line[:end]}█")
            self.hold(1 / _RATE)
        print("$", line, flush=True)
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        said = subprocess.run(
            line, shell=True, check=True, text=True, cwd=self.folder,
            env={**os.environ, "PATH": path}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ).stdout  # fmt: skip
        self._text += f"$ {line}\n{said}"
        self.do("print", f"{self._text}$ █")
        self.hold(seconds)

    def _stage(self, part: str, caption: str) -> None:
        self.open(_TOOLS / "film.html", caption)
        self.do("part", part)


def live(film: Film) -> None:
    """Play, move a slider, lose the position."""
    film.live("fig4", "Fig. 4 of the paper, computed in your browser", [0, 1])
    film.move(11.0, "seek")
    film.caption("Move a slider: with a larger λ it arrives sooner, and needs far more force")
    film.move(8.0, "slide")
    film.caption("Break something: no position from 50 s to 55 s")
    film.do("fault")
    film.move(10.0, "seek")
    film.hold(1.5)


def formation(film: Film) -> None:
    """Three vehicles, two of which lose the third."""
    told = "Three vehicles: no messages from 50 s to 70 s, and two pass at 0.2 m"
    film.live("formation-lost-link", told, [0, -1], "wide")
    film.move(11.0, "seek")
    film.hold(1.5)


def paper(film: Film) -> None:
    """The paper's controller beside PD."""
    film.terminal("From the command line: Fig. 5 with both controllers")
    film.command("auv-fmu run fig5", 5.0)
    told = "PD passes the limits of 80 N; the paper's controller does not"
    film.figure("results/fig5/fig5.png", told, 9.0)


def own_controller(film: Film) -> None:
    """A template, one changed line, its run, the comparison."""
    film.terminal("Your own controller is one Python file")
    film.command("auv-fmu new controller my_law", 2.5)
    film.command("grep -o '\"Proportional gain.*' my_law/my_law.py", 1.5)
    film.caption("Change a line, build, run")
    film.command("sed -i 's/= 120.0/= 160.0/' my_law/my_law.py", 0.5)
    film.command("auv-fmu build my_law/my_law.py", 1.0)
    film.terminal("Change a line, build, run")
    film.command("auv-fmu run my_law/my_law.toml --out mine", 2.5)
    film.command("auv-fmu run fig4 --out paper", 2.5)
    film.terminal("Compare")
    film.command("auv-fmu plot mine paper controller.tau --out both.png", 0.7)
    film.figure("both.png", "Its command is smoother than the paper's", 6.0)


def other_tools(film: Film) -> None:
    """The loop in another tool, and its numbers against ours."""
    film.terminal("Use it in your tool: the loop as one FMU that needs no Python")
    film.command("auv-fmu export fig4 --format fmu", 1.5)
    simulate = "fmpy simulate exports/fig4/fig4.fmu --stop-time 100 \\\n"
    film.command(f"{simulate}    --output-interval 0.02 --output-file loop.csv", 1.0)
    film.caption("FMPy's numbers are ours to the last bit, in 5,000 rows")
    film.command("auv-fmu verify loop.csv --tolerance 0", 6.0)


def study(film: Film) -> None:
    """A thousand runs."""
    (film.folder / "gains.toml").write_text(_STUDY, encoding="utf-8")
    film.terminal("A study: 1,024 runs with other gains")
    film.command("auv-fmu sweep gains.toml", 2.0)
    film.figure("results/gains/front.png", "What a larger command buys in accuracy", 6.0)


def report(film: Film) -> None:
    """The verdict on the paper."""
    film.terminal("And the paper? One command runs all of it")
    film.command("auv-fmu report", 1.5)
    film.open(film.folder / "results/report/report.html", "Every printed number, with a verdict")
    film.do("verdict")
    film.hold(7.0)


_SCENES: dict[str, Callable[[Film], None]] = {
    scene.__name__: scene
    for scene in (live, formation, paper, own_controller, other_tools, study, report)
}


@contextmanager
def _encoder(file: Path) -> Iterator[IO[bytes]]:
    """A pipe for pictures, which become a film."""
    ffmpeg = "ffmpeg -loglevel error -y"
    frames = f"-f image2pipe -c:v mjpeg -framerate {_RATE} -i -"
    film = "-c:v libx264 -preset slow -crf 27 -pix_fmt yuv420p -movflags +faststart"
    command = [*f"{ffmpeg} {frames} {film}".split(), str(file)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        yield process.stdin
    if process.returncode:
        sys.exit("ffmpeg has failed")
    poster = f"-ss {_POSTER} -frames:v 1 -q:v 5"
    command = [*f"{ffmpeg} -i".split(), str(file), *poster.split()]
    subprocess.run([*command, str(file.with_suffix(".jpg"))], check=True)


def main() -> None:
    """Make the film, or one of some scenes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="*", help=f"{', '.join(_SCENES)}; none: all")
    parser.add_argument("--out", type=Path, default=DOCS / PICTURES / "tour.mp4")
    options = parser.parse_args()
    software = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    with (
        TemporaryDirectory() as profile,
        TemporaryDirectory() as folder,
        _encoder(options.out) as frames,
        browser(Path(profile), *software) as shown,
    ):
        film = Film(shown, frames, Path(folder))
        title = "An autonomous underwater vehicle<br>and its controllers as FMUs"
        film.card(f"<h1>auv-fmu</h1><p>{title}</p>", 3.5)
        for name in options.scene or _SCENES:
            _SCENES[name](film)
        film.card("<p><code>pip install .</code></p><p><code>auv-fmu run fig4</code></p>", 3.5)


if __name__ == "__main__":
    main()
