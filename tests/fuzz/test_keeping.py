"""No command loses a file of the user's, whatever its name and whatever files are near it.

Every command that writes runs in folders full of files whose names the program itself uses: each
byte of the user's must be there afterwards, at its path or, with `--force`, moved. And files that
the program reads back are damaged, a bit at a time: it refuses or reports that, or the result is
the same.

    pytest tests/fuzz/test_keeping.py --hypothesis-profile=attack -m ''
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, redirect_stderr, redirect_stdout
from importlib.util import find_spec
from io import StringIO
from itertools import chain
from math import modf
from pathlib import Path
from shutil import copytree, rmtree
from typing import Any, NamedTuple
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orchestrator.commands import many_runs
from orchestrator.commands.main import main
from orchestrator.cosim import Checkpoints
from orchestrator.exchange import release
from orchestrator.figures import drawing
from orchestrator.figures.run_figures import figure_files
from orchestrator.machine.disk import LOCK
from orchestrator.paper import report
from orchestrator.paper.report import Section
from orchestrator.runs import bundle
from orchestrator.runs.bundle import MANIFEST, current_fmus
from orchestrator.runs.folder import LEDGER
from orchestrator.studies.columns import Outcomes, Points
from orchestrator.studies.engine import Engine
from orchestrator.studies.store import Store
from support.machine import contents, ended, forked
from support.runs import InThisProcess
from support.tiers import slow

#: Examples of each command; with the profile `attack` some hundred times as many.
EXAMPLES = max(settings.default.max_examples // 10, 4)

STUDIES = all(map(find_spec, ("pyarrow", "scipy")))

RUN = ["run", "fig3a", "--stop-time", "0.1", "--no-figures"]
STUDY = """
scenario = "fig3a"
stop_time = 0.1
[vary]
plant.eta0.z = [1.0, 2.0, 3.0]
"""

#: Commands that write into `{out}`, and read what is `{here}`.
COMMANDS = {
    "run": [*RUN, "--out", "{out}"],
    "compare": ["run", "{here}/both.toml", "--no-figures", "--out", "{out}"],
    "checkpoint": [*RUN, "--checkpoint-every", "0.04", "--out", "{out}"],
    "figures": [*RUN[:-1], "--out", "{out}"],
    "plot": ["plot", "{here}/result", "plant.eta.*", "--out", "{out}/plot.png"],
    "view": ["view", "{here}/result", "--out", "{out}/view.html"],
    "view-beside": ["view", "{out}"],
    "ssp": ["export", "fig3a", "--out", "{out}"],
    "osp": ["export", "fig3a", "--format", "osp", "--out", "{out}"],
    "build": ["build", "--out", "{out}"],
    "release": ["release", "--out", "{out}"],
    "new": ["new", "controller", "Own", "{out}"],
    "script": ["build", "{here}/own.py", "--out", "{out}"],
    "report": ["report", "--out", "{out}"],
}
if STUDIES:
    COMMANDS["sweep"] = ["sweep", "{here}/study.toml", "--out", "{out}"]

#: Names of files that the program writes, or has written once, and some that only look like them.
NAMES = [
    LEDGER, LOCK, f"{LEDGER}.~1~", ".auv-fmu-" + "0" * 32, ".auv-fmu-mine/a", ".unfinished-novel/a",
    ".partial-backup/a", ".partial-1.png", ".whole/run.json", ".whole/a", ".earlier.json", ".spare",
    "result.csv", "result.parquet", "result.csv.~1~", "certificates.csv", "metrics.json",
    "run.json", "view.html", "plot.png", "fig3a.png", "fig3a.svg", "both.png",
    "checkpoint/rows.bin", "checkpoint/state.json", "checkpoint/notes", "checkpoint/fig3a/rows.bin",
    "checkpoint", "incomplete/result.csv", "incomplete/run.json", "incomplete", "incomplete-2/a",
    "fig3b/result.csv", "fig3b", "fig3b/thesis/a", "study.json", "runs.parquet",
    "unfinished.sqlite", "unfinished.sqlite-wal", "unfinished.sqlite-journal", ".figures-mine/a",
    "report.html", "report.md", "figures", "figures/fig3a/fig3a.png",
    "auv.ssp", "AuvPlant.fmu", "build.json", "SHA256SUMS", "bom.cdx.json", "fig3a.ssp",
    "OspSystemStructure.xml", "own.py", "test_own.py", "Own.fmu", "OwnController.fmu", "own.toml",
    "README.md", ".git/HEAD", "thesis/chapter.tex", "notes.md", "a b", "Größe", "-rf", "a\nb",
]  # fmt: skip

#: Names of the run that another one is compared with.
COMPANIONS = ["..", ".", "result.csv", "checkpoint", "incomplete"]

contents_of_files = st.one_of(
    st.binary(max_size=20),
    st.sampled_from(
        [
            b'{"files": ["notes.md", "thesis/chapter.tex", "../outside/a"], "failure": null}',
            json.dumps({"identity": "0" * 32, "files": {"notes.md": "0"}}).encode(),
            b"time,plant.eta.x\n0.0,1.0\n0.1,2.0\n",
            b"SQLite format 3\0" + bytes(84),
        ]
    ),
)


class Folder(NamedTuple):
    """Contents of a folder before a command.

    Attributes:
        ran: whether a run of ours has written into it before.
        changed: whether the user has changed what that wrote.
        files: of the user's, by their names.
        links: to a file or a folder elsewhere.
        force: whether the command is to move them aside.

    """

    ran: bool
    changed: bool
    files: dict[str, bytes]
    links: dict[str, str]
    force: bool


folders = st.builds(
    Folder,
    st.booleans(),
    st.booleans(),
    st.dictionaries(
        st.sampled_from(NAMES) | st.from_regex(r"[\w .~-]{1,30}", fullmatch=True),
        contents_of_files,
        max_size=12,
    ),
    st.dictionaries(st.sampled_from(NAMES), st.sampled_from(["a", ".", "no"]), max_size=2),
    st.booleans(),
)


@pytest.fixture(autouse=True)
def _no_module_of_that_name() -> None:
    """Forget modules of other tests, for which `new` would refuse the name."""
    sys.modules.pop("own", None)


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Inputs of commands: a result, a study, a script, and scenarios of odd names."""
    folder = tmp_path_factory.mktemp("here")
    current_fmus()
    assert main([*RUN, "--out", str(folder / "result")]) == 0
    (folder / "study.toml").write_text(STUDY)
    sys.modules.pop("own", None)
    assert main(["new", "controller", "Own", str(folder / "own")]) == 0
    shutil.copy(folder / "own" / "own.py", folder)
    return folder


@contextmanager
def quick(here: Path) -> Iterator[None]:
    """Replace slow steps that write elsewhere: compilers, processes, most of a report."""

    def copied(module: str, folder: Path, *options: str, **_: object) -> list[Path]:
        source = current_fmus() if module == "build" else here / "own"
        found = [*source.glob("*.fmu"), *source.glob(MANIFEST)]
        return [Path(shutil.copy(path, folder)) for path in found]

    def drawn(
        key: str, title: str, runs: object, folder: Path, stem: str, **_: object
    ) -> list[str]:
        for name in figure_files(key, stem):
            (folder / name).write_bytes(b"drawn")
        return []

    def shown(section: Section, made: object, folder: Path) -> list[str]:
        folder.mkdir(parents=True)
        return drawn(section.scenario.figure, "", made, folder, section.name)

    @contextmanager
    def making(
        engine: Engine, points: Iterable[Points], **_: object
    ) -> Iterator[Iterable[Outcomes]]:
        yield chain(*map(engine.outcomes, points))

    with ExitStack() as stack:
        for what, name, instead in (
            (bundle, "run_fmus", copied),
            (release, "_LINKED", {}),
            (drawing, "draw", drawn),
            (report, "draw_section", shown),
            (report, "workers", lambda: nullcontext(InThisProcess())),
            (report, "CLAIMS", ()),
            (report, "EFFECTS", ()),
            (many_runs, "names", lambda: ["fig3a"]),
        ):
            stack.enter_context(patch.object(what, name, instead))
        if STUDIES:
            stack.enter_context(patch("orchestrator.studies.sweep.making_runs", making))
        yield


def snapshot(folder: Path) -> dict[str, bytes | str]:
    """All files and links below a folder, with their bytes and ends."""
    found: dict[str, bytes | str] = {}
    for place, folders, names in os.walk(folder):
        for name in (*folders, *names):
            path = Path(place, name)
            key = path.relative_to(folder).as_posix()
            if path.is_symlink():
                found[key] = os.readlink(path)  # noqa: PTH115  # not what it leads to
            elif path.is_file():
                found[key] = path.read_bytes()
    return found


def fill(folder: Path, outside: Path, what: Folder) -> None:
    """Write the user's files and links where no other files are."""
    for name, content in what.files.items():
        path = folder / name
        if not os.path.lexists(path) and not path.name.startswith("/"):
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                if not any(parent.is_symlink() for parent in path.parents):
                    path.write_bytes(content)
            except (NotADirectoryError, FileExistsError):
                # There is a file where a folder would have to be.
                pass
    for name, end in what.links.items():
        path = folder / name
        if not os.path.lexists(path) and path.parent.is_dir():
            path.symlink_to(outside / end)


def call(arguments: list[str]) -> tuple[int, str]:
    """Exit status of a command, and its errors."""
    output = StringIO()
    with redirect_stderr(output), redirect_stdout(StringIO()):
        status = main(arguments)
    return status, output.getvalue()


def is_kept(name: str, content: bytes | str, after: dict[str, bytes | str]) -> bool:
    """True if a user's file, or a folder around it, is there or was moved aside."""
    if after.get(name) == content:
        return True
    parts = Path(name).parts
    for i, part in enumerate(parts):
        for n in range(1, 4):
            aside = Path(*parts[:i], f"{part}.~{n}~", *parts[i + 1 :]).as_posix()
            if after.get(aside) == content:
                return True
    return False


def representatives(names: Iterable[str], *fast: str) -> list[Any]:
    """All names as parameters, only some of them fast."""
    return [*fast, *slow(*(name for name in names if name not in fast))]


#: The others write through the same folder, or the same single file.
WRITERS = representatives(COMMANDS, "run", "view", "build", "new")


@pytest.mark.parametrize("name", WRITERS)
def test_every_file_of_the_users_stays(here: Path, name: str):
    @settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(what=folders, companion=st.sampled_from(COMPANIONS))
    def check(what: Folder, companion: str) -> None:
        with tempfile.TemporaryDirectory() as place:
            out, outside = Path(place, "out"), Path(place, "outside")
            out.mkdir()
            outside.mkdir()
            (outside / "a").write_text("elsewhere")
            (here / "both.toml").write_text(
                f'figure = "comparison"\nstop_time = 0.1\ncompare = {{ name = "{companion}" }}\n'
            )
            if what.ran:
                assert call([*RUN, "--out", str(out)])[0] == 0
            ours = snapshot(out)
            if what.ran and what.changed:
                with (out / "metrics.json").open("a") as file:
                    file.write("mine")
            fill(out, outside, what)
            before = {k: v for k, v in snapshot(out).items() if ours.get(k) != v}
            if before.get(LOCK) == b"":
                # Has no byte to lose: as a process leaves it that is killed.
                del before[LOCK]
            elsewhere = snapshot(outside) | snapshot(here)
            arguments = [part.format(out=out, here=here) for part in COMMANDS[name]]
            if what.force and name != "new":
                arguments.append("--force")
            with quick(here):
                status, message = call(arguments)
            after = snapshot(out)
            assert status in (0, 1, 2), message
            assert not [k for k, v in before.items() if not is_kept(k, v, after)], message
            assert snapshot(outside) | snapshot(here) == elsewhere
            if status == 2:
                assert len(message.splitlines()) - message.count("warning: ") == 1, message
                assert what.force or {k: after.get(k) for k in before} == before

    check()


def flipped(folder: Path, place: float, bit: int) -> str:
    """Change a bit of the files below a folder, and return the name of the file."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.stat().st_size)
    # Each file as often as any other, however long it is.
    share, file = modf(place * len(files))
    path = files[int(file)]
    content = bytearray(path.read_bytes())
    content[int(share * len(content))] ^= 1 << bit
    path.write_bytes(content)
    return path.relative_to(folder).as_posix()


def stop_after(n: int, what: type, method: str) -> Callable[[], None]:
    """Return a function that kills this process after `n` calls of a method."""

    def prepare() -> None:
        called, left = getattr(what, method), [n]

        def counted(*arguments: object) -> object:
            answer = called(*arguments)
            left[0] -= 1
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)
            return answer

        setattr(what, method, counted)

    return prepare


#: By name: what leaves something to read, what ends it early, and what reads it then.
READERS = {
    "checkpoint": (
        [*RUN, "--checkpoint-every", "0.04", "--out", "{out}"],
        stop_after(1, Checkpoints, "_write"),
        [*RUN, "--resume", "--out", "{out}"],
    ),
    "result": ([*RUN, "--out", "{out}"], None, ["plot", "{out}", "--out", "{out}/plot.png"]),
}
if STUDIES:
    READERS["study"] = (COMMANDS["sweep"], None, COMMANDS["sweep"])
    READERS["unfinished-study"] = (
        COMMANDS["sweep"],
        stop_after(2, Store, "add"),
        COMMANDS["sweep"],
    )

#: Times and durations in files.
TIMES = re.compile(rb'"(started|seconds|command|resumed_at)": .*|Written by .*')


def made(folder: Path) -> dict[str, bytes]:
    """The files of a folder without times, ledgers and unfinished files."""
    found = {name: TIMES.sub(b"", content) for name, content in contents(folder).items()}
    return {name: found[name] for name in found if not name.startswith(".auv-fmu-")}


@pytest.mark.parametrize("name", representatives(READERS, "checkpoint"))
def test_no_changed_bit_is_taken_in_silence(here: Path, tmp_path: Path, name: str):
    begin, prepare, read = READERS[name]
    left, whole = tmp_path / "left", tmp_path / "out"

    def work() -> int:
        if prepare is not None:
            prepare()
        with quick(here):
            return call([part.format(out=left, here=here) for part in begin])[0]

    assert ended(forked(work)) == (0 if prepare is None else -signal.SIGKILL)
    arguments = [part.format(out=whole, here=here) for part in read]

    def reading() -> tuple[int, str]:
        with quick(here):
            return call(arguments)

    copytree(left, whole)
    assert reading()[0] == 0
    right = made(whole)

    @settings(max_examples=EXAMPLES * 3, suppress_health_check=list(HealthCheck))
    @given(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 7))
    def check(place: float, bit: int) -> None:
        rmtree(whole)
        copytree(left, whole)
        file = flipped(whole, place, bit)
        before = made(whole)
        status, message = reading()
        if status == 0 and "was changed since" not in message:
            assert {**made(whole), file: b""} == {**right, file: b""}, message
            assert file not in right or made(whole)[file] in (right[file], before[file])
        elif status != 0:
            assert status == 2, message
            assert all(line.startswith("auv-fmu: ") for line in message.splitlines()), message
            assert str(whole) in message.splitlines()[-1]
            assert made(whole) == before

    check()
