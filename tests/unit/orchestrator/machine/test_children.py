"""Output of children arrives at once, and imports read nothing from the current folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.commands.main import main
from orchestrator.machine.children import run_module
from support.tiers import slow

#: Files that change what matplotlib does, or how it ends.
RC = [
    b"font.size: 30\naxes.facecolor: yellow\nbackend: module://evil\n",
    b"\xff\xfe\x00",
]


def figures(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != ".json"}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("plain") / "r"
    assert main(["run", "fig4", "--stop-time", "0.2", "--out", str(folder)]) == 0
    return figures(folder)


@pytest.mark.parametrize("content", slow(*RC, None))
def test_figures_are_the_same_whatever_a_matplotlibrc_says(workplace, plain, content):
    if content is None:
        os.mkfifo("matplotlibrc")
    else:
        Path("matplotlibrc").write_bytes(content)
    output = subprocess.run(
        [sys.executable, "-P", "-m", "orchestrator", "run", "fig4", "--stop-time", "0.2"],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, timeout=100, check=True,
    ).stderr  # fmt: skip
    assert output == b""
    assert figures(workplace / "results" / "fig4") == plain


@pytest.mark.slow
def test_figures_in_a_program_are_the_same_whatever_it_has_set(workplace, plain):
    import matplotlib as mpl  # noqa: PLC0415

    with mpl.rc_context({"font.size": 30, "axes.facecolor": "yellow"}):
        assert main(["run", "fig4", "--stop-time", "0.2"]) == 0
    assert figures(workplace / "results" / "fig4") == plain


def test_workers_do_not_read_it(workplace):
    os.mkfifo("matplotlibrc")
    code = (
        "from orchestrator.machine.workers import workers\n"
        "def size():\n"
        "    import matplotlib\n"
        "    return matplotlib.rcParams['font.size']\n"
        "if __name__ == '__main__':\n"
        "    with workers() as some:\n"
        "        print(dict(some.results({0: size}, 'run')))\n"
    )
    (workplace / "program.py").write_text(code)
    process = subprocess.run(
        [sys.executable, "program.py"], stdout=subprocess.PIPE, text=True, timeout=100, check=True
    )
    assert process.stdout == "{0: 10.0}\n"


@pytest.mark.slow
def test_programs_take_nothing_from_the_current_folder(workplace, monkeypatch):
    """Neither modules nor headers."""
    pytest.importorskip("scipy", reason="needs the extra `studies`")
    monkeypatch.setenv("XDG_CACHE_HOME", str(workplace / "cache"))
    for name in ("ziglang", "auv_fmu", "plant"):
        Path(f"{name}.py").write_text("open('mark', 'w')\n")
    for name in ("math.h", "stddef.h", "error.h"):
        Path(name).write_text("#error planted\n")
    Path("study.toml").write_text(
        'scenario = "fig5"\nstop_time = 0.2\n[vary]\nplant.eta0.y = [0.0, 4.0]\n'
    )
    before = {path.name for path in workplace.iterdir()}
    command = ("sweep", "study.toml", "--engine", "batch", "--kind", "native", "--workers", "1")
    subprocess.run(
        [sys.executable, "-P", "-m", "orchestrator", *command],
        stdout=subprocess.DEVNULL, check=True,
    )  # fmt: skip
    assert {path.name for path in workplace.iterdir()} == before | {"cache", "results"}


def test_lines_of_a_module_arrive_before_it_ends(workplace, monkeypatch):
    """The module continues only after its first line has arrived."""
    (workplace / "speaker.py").write_text(
        "import pathlib, sys, time\n"
        "print('first', flush=True)\n"
        "while not pathlib.Path('heard').exists():\n"
        "    time.sleep(0.01)\n"
        "print('last')\n"
        "sys.exit('a complaint' + '.' * 100_000)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(workplace))
    lines = []

    def hear(line: str) -> None:
        lines.append(line)
        Path("heard").touch()

    process = run_module("speaker", hear=hear)
    assert lines == process.stdout.splitlines() == ["first", "last"]
    assert process.returncode == 1
    assert process.stderr == "a complaint" + "." * 100_000 + "\n"


def test_an_exception_of_the_callback_ends_the_module(workplace, monkeypatch):
    (workplace / "speaker.py").write_text("while True:\n    print('again', flush=True)\n")
    monkeypatch.setenv("PYTHONPATH", str(workplace))

    def interrupted(line: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_module("speaker", hear=interrupted)
