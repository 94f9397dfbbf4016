"""Processes killed at random times, and what is then in their folders.

    python tests/fuzz/kills.py --runs 400

Each round writes into a folder with a whole result, by one of run, report, build and export, and
kills the process with SIGKILL at some time. Then the folder must hold the result that was there or
the new one, byte for byte, whatever a reader looks at; no child may stay; and the next command must
leave nothing but its own. So must the one that resumes a run that has left a checkpoint.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from shutil import copytree, rmtree
from unittest.mock import patch

from tqdm import trange

from orchestrator.commands.main import main as auv_fmu
from orchestrator.machine.disk import process_folder
from orchestrator.paper import report
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.folder import LEDGER, open_ledger

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.machine import contents, ended, forked, is_over

#: What differs between two runs of the same: when, how long, and by which command.
_RECORD = "run.json"


def _call(*arguments: str) -> Callable[[Path], int]:
    return lambda folder: auv_fmu([*arguments, "--out", str(folder)])


def _report(scenario: str) -> Callable[[Path], int]:
    """A report of one scenario, without claims."""

    def write(folder: Path) -> int:
        with patch.object(report, "CLAIMS", ()), patch.object(report, "EFFECTS", ()):
            report.write_report(folder, [scenario], ["auv-fmu", "report"], stop_time=1.0)
        return 0

    return write


_FIG5 = _call("run", "fig5", "--stop-time", "0.5")

_RESUMED = ("--checkpoint-every", "0.1", "--resume", "--no-figures")

#: By name: what writes the earlier result, and the new one.
WRITERS: dict[str, tuple[Callable[[Path], int], Callable[[Path], int]]] = {
    "run": (_FIG5, _call("run", "fig4", "--stop-time", "1")),
    "resume": (_FIG5, _call("run", "fig5", "--stop-time", "1", *_RESUMED)),
    "report": (_report("fig3a"), _report("fig4")),
    "build": (_call("build", "--loader", "plain"), _call("build", "--loader", "native")),
    "export": (
        _call("export", "fig5", "--format", "osp"),
        _call("export", "fig4", "--format", "osp"),
    ),
}


def visible(folder: Path) -> dict[str, bytes]:
    """What counts in a folder: no hidden files, no checkpoint, no report's own store, no times."""
    return {
        name: b"" if Path(name).name == _RECORD else content
        for name, content in contents(folder).items()
        if not name.startswith((".", "checkpoint/", "runs/"))
    }


def _quietly(work: Callable[[], object]) -> int:
    """Do some work in a copy of this process, in silence; its process id."""

    def silent() -> object:
        null = os.open(os.devnull, os.O_RDWR)
        os.dup2(null, 1)
        os.dup2(null, 2)
        return work()

    return forked(silent)


class Attack:
    """Kills of one kind of writer.

    Attributes:
        losses: what was found wrong.

    """

    def __init__(self, name: str, workplace: Path) -> None:
        """Write the results that there can be, and see how long that takes."""
        self._name, self._place = name, workplace / name
        self._earlier, self._new = WRITERS[name]
        self._before, after = workplace / f"{name}-before", workplace / f"{name}-after"
        assert ended(_quietly(lambda: self._earlier(self._before))) == 0
        copytree(self._before, after)
        begun = time.monotonic()
        assert ended(_quietly(lambda: self._new(after))) == 0
        self._seconds = time.monotonic() - begun
        self._old_files, self._new_files = visible(self._before), visible(after)
        # What one writes over the other, if it is no result of a run, joins it.
        assert self._old_files != self._new_files
        self.losses: list[str] = []

    def kill(self, share: float, counts: Counter[str]) -> None:
        """Kill a writer when a share of its time has passed."""
        rmtree(self._place, ignore_errors=True)
        copytree(self._before, self._place)
        pid = _quietly(lambda: self._new(self._place))
        time.sleep(share * self._seconds)
        os.kill(pid, signal.SIGKILL)
        killed = ended(pid) == -signal.SIGKILL
        counts[f"{self._name}: {'killed' if killed else 'was done before'}"] += 1
        if not is_over(pid):
            self._lose(share, "a child stays")
        half = '"moving": {}' not in (self._place / LEDGER).read_text()
        counts[f"{self._name}: killed while files took their places"] += half
        with open_ledger(self._place):
            # Goes on with what was begun, as the next command does.
            pass
        found = visible(self._place)
        if found not in (self._old_files, self._new_files):
            self._lose(share, "neither the old result nor the new one")
        counts[f"{self._name}: the new one is there"] += found == self._new_files
        if ended(_quietly(lambda: self._new(self._place))) != 0:
            self._lose(share, "the next one fails")
        if visible(self._place) != self._new_files or self._left():
            self._lose(share, "the next one leaves something else")

    def _left(self) -> list[Path]:
        hidden = [path for path in self._place.rglob(".*") if path.name not in (".", LEDGER)]
        return hidden + list(self._place.glob("checkpoint"))

    def _lose(self, share: float, what: str) -> None:
        self.losses.append(f"{self._name}, killed after {share * self._seconds:.3f} s: {what}")


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--runs", type=int, default=400, help="kills; default: 400")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=WRITERS, action="append", help="may be repeated")
    options = parser.parse_args()
    current_fmus()
    draw = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        temporary = Path(folder, "tmp")
        temporary.mkdir()
        tempfile.tempdir = str(temporary)
        os.environ["TMPDIR"] = str(temporary)
        attacks = [Attack(name, Path(folder)) for name in options.only or WRITERS]
        counts: Counter[str] = Counter()
        for k in trange(options.runs, unit="kill"):
            # Half of them about the end, where files take their places.
            begin = draw.choice((0.0, 0.9))
            attacks[k % len(attacks)].kill(draw.uniform(begin, 1.1), counts)
        # Looks for what others have left.
        own = process_folder()
        left = [path for path in temporary.iterdir() if path != own]
    losses = [loss for attack in attacks for loss in attack.losses]
    for name, n in sorted(counts.items()):
        print(f"{n:6} {name}")
    for loss in losses:
        print(loss)
    print(f"{options.runs} kills, {len(losses)} losses, {len(left)} temporary folders left")
    return int(bool(losses))


if __name__ == "__main__":
    sys.exit(main())
