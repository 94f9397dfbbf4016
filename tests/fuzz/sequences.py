"""Fuzz FMUs of either kind with sequences of calls and with mutated states.

    PYTHONPATH=tests python -m fuzz.sequences --fmus fmus/dist --runs 10000

Sequences come out of seeds and are held against the model that is made from fmi-answers.md, and
against a second instance that gets the good calls alone; with `--twin`, against FMUs of the other
kind. FMUs are native code, so everything runs in processes of its own; what makes one crash, hang
or answer otherwise is shrunk by playing shorter sequences again, and printed as calls.

hypothesis has a machine for this (RuleBasedStateMachine). It shrinks in the process that the FMU
has just ended, and takes 17 ms for a sequence of 30 empty rules, as long as these take with calls.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from fuzz.generator import generated
from fuzz.mutants import Taken, Trials, reached
from fuzz.player import Calls, Difference, Players, pairs, play
from fuzz.twins import twins
from support.hosts import sanitize, sanitizers
from support.raw import Description, Host, Library
from support.worker import Lost, Worker

KINDS = ("sequences", "states")

#: What is done with sequences where there are two kinds of FMUs.
TWINS = "twins"

#: Sequences or mutants in one task, and the longest time for one of them [s].
BATCH, PATIENCE = 25, 30.0

#: Shrinking ends after so many replays.
MOST_REPLAYS = 300

#: Runs whose states are mutated.
RUNS = 6


class Task(NamedTuple):
    """What a process is asked: to attack with `sequences`, `states` or `twins` out of seeds, to
    `describe` the FMU, to `make` the sequence of a seed, to `show` one, or to `play` it.
    """

    kind: str
    seeds: Sequence[int] = ()
    sequence: Calls | None = None


class Finding(NamedTuple):
    """A seed and what came of it."""

    seed: int
    what: str


class Loaded(NamedTuple):
    """FMUs of one kind in this process, by name."""

    libraries: dict[str, Library]
    contents: dict[str, list[bytes]]
    foreign: dict[str, bytes]


def _loaded(folders: Mapping[str, Path], first: str) -> Loaded:
    libraries = {n: Library(folders[n]) for n in dict.fromkeys([first, *folders])}
    contents = {n: reached(library, 0) for n, library in libraries.items()}
    names = [*contents]
    # The state that is foreign to an FMU is that of the one before it.
    foreign = {n: contents[names[i - 1]][-1] for i, n in enumerate(names)}
    return Loaded(libraries, contents, foreign)


def serve(
    folders: Mapping[str, Path], twin: Mapping[str, Path], name: str
) -> Callable[[Task], Any]:
    """Prepare a process for tasks on an FMU; the others lend it company and states.

    Args:
        folders: of the FMUs.
        twin: of those of the other kind; empty: sequences are held against the model.
        name: of the FMU.

    """
    ours = _loaded(folders, name)
    theirs = _loaded(twin, name) if twin else None
    descriptions = {n: library.description for n, library in ours.libraries.items()}
    mutants: list[Trials] = []

    def sequence_of(seed: int) -> Calls:
        return generated(seed, name, descriptions)

    def cast(sequence: Calls) -> dict[str, Players]:
        if theirs is None:
            return pairs(sequence, ours.libraries, ours.foreign)
        libraries = (ours.libraries, theirs.libraries)
        return twins(sequence, libraries, (ours.foreign, theirs.foreign))

    def played(sequence: Calls, seed: int = 0) -> list[Finding]:
        try:
            play(sequence, cast(sequence))
        except Difference as difference:
            return [Finding(seed, str(difference))]
        except Exception as error:
            return [Finding(seed, f"{type(error).__name__}: {error}")]
        return []

    def do(task: Task) -> Any:
        if task.kind == "states":
            if not mutants:
                others = [c for n in ours.contents if n != name for c in ours.contents[n]]
                mutants.append(_mutants(ours.libraries[name], others))
            return [f for seed in task.seeds for f in _tried(mutants[0], seed)]
        if task.kind in ("sequences", TWINS):
            return [f for seed in task.seeds for f in played(sequence_of(seed), seed)]
        if task.kind == "describe":
            return descriptions[name]
        if task.sequence is None:
            return sequence_of(task.seeds[0])
        if task.kind == "show":
            return task.sequence.shown(ours.libraries)
        return played(task.sequence)

    return do


def _mutants(library: Library, foreign: Sequence[bytes]) -> Trials:
    host = Host(library)
    assert host.instantiate()
    bases = [content for seed in range(RUNS) for content in reached(library, seed)]
    return Trials(host, bases, foreign)


def _tried(trials: Trials, seed: int) -> list[Finding]:
    try:
        trials(seed)
    except Taken as taken:
        return [Finding(seed, str(taken))]
    return []


class Fuzzer:
    """One FMU under attack."""

    def __init__(
        self, folders: Mapping[str, Path], name: str, twin: Mapping[str, Path] | None = None
    ) -> None:
        """Prepare an attack.

        Args:
            folders: of unpacked FMUs.
            name: of the one that is attacked.
            twin: folders of those of the other kind that sequences are played on, too.

        """
        self.name = name
        self._worker: Worker[Task, Any] = Worker(serve, folders, twin or {}, name)

    def __enter__(self) -> Fuzzer:
        return self

    def __exit__(self, *_: object) -> None:
        self._worker.close()

    def attack(self, kind: str, seeds: Sequence[int]) -> Iterator[tuple[int, list[Finding]]]:
        """How many seeds were tried, and findings; a seed that ends the process is one."""
        for first in range(0, len(seeds), BATCH):
            batch = seeds[first : first + BATCH]
            found = self._ask(Task(kind, batch))
            if isinstance(found, Lost):
                found = [f for seed in batch for f in self._alone(kind, seed)]
            yield first + len(batch), found

    def _alone(self, kind: str, seed: int) -> list[Finding]:
        found = self._ask(Task(kind, [seed]))
        return [Finding(seed, found.why)] if isinstance(found, Lost) else found

    def _ask(self, task: Task) -> Any:
        return self._worker.ask(task, PATIENCE * max(1, len(task.seeds) // 5))

    def description(self) -> Description:
        made: Description = self._ask(Task("describe"))
        return made

    def sequence(self, seed: int) -> Calls:
        made: Calls = self._ask(Task("make", [seed]))
        return made

    def show(self, sequence: Calls) -> str:
        """A sequence as a text to be read."""
        return "\n".join(f"    {line}" for line in self._ask(Task("show", (), sequence)))

    def replay(self, sequence: Calls) -> str:
        """What comes of a sequence; empty: nothing."""
        found = self._ask(Task("play", (), sequence))
        if isinstance(found, Lost):
            return found.why
        return found[0].what if found else ""

    def shrunk(self, sequence: Calls) -> Calls:
        """A sequence that fails the same way, and no action of which can be left out."""
        actions, replays = [*sequence.actions], 0
        wanted = _kind_of(self.replay(sequence))
        size = len(actions) // 2
        while size and replays < MOST_REPLAYS:
            first = 0
            while first < len(actions) and replays < MOST_REPLAYS:
                fewer = actions[:first] + actions[first + size :]
                replays += 1
                if _kind_of(self.replay(sequence._replace(actions=fewer))) == wanted:
                    actions = fewer
                else:
                    first += size
            size //= 2
        return sequence._replace(actions=actions)

    def explained(self, kind: str, finding: Finding) -> str:
        """A finding as a text to be read, with the calls that lead to it."""
        said = f"{self.name}, {kind}, seed {finding.seed}: {finding.what}"
        if kind == "states":
            return said
        sequence = self.shrunk(self.sequence(finding.seed))
        again = self.replay(sequence) or "not seen again"
        return f"{said}\nshrunk: {again}\n{self.show(sequence)}"


def _kind_of(finding: str) -> str:
    """A finding without where it was made."""
    return finding.rpartition(": ")[2]


@contextmanager
def unpacked(fmus: Sequence[Path]) -> Iterator[dict[str, Path]]:
    """Folders of unpacked FMUs, by name."""
    with tempfile.TemporaryDirectory(prefix="auv_fmu_fuzz_") as temporary:
        folders = {}
        for fmu in fmus:
            folders[fmu.stem] = Path(temporary, fmu.stem)
            with zipfile.ZipFile(fmu) as archive:
                archive.extractall(folders[fmu.stem])
        yield folders


def attack(
    fuzzer: Fuzzer, kind: str, seeds: Sequence[int], most: int, progress: Callable[[str], None]
) -> list[str]:
    """Attack an FMU and tell of it.

    Args:
        fuzzer: of the FMU.
        kind: `sequences`, `states` or `twins`.
        seeds: of them.
        most: kinds of findings that are explained.
        progress: is told how far it is.

    Returns:
        A summary, and a text for each kind of finding.

    """
    findings: list[Finding] = []
    start = time.monotonic()
    for done, found in fuzzer.attack(kind, seeds):
        findings += found
        progress(f"{fuzzer.name}: {done} of {len(seeds)} {kind}, {len(findings)} findings")
    summary = (
        f"{fuzzer.name}: {len(seeds)} {kind}, {len(findings)} findings, "
        f"{time.monotonic() - start:.0f} s"
    )
    kinds: dict[str, list[Finding]] = {}
    for finding in findings:
        kinds.setdefault(_kind_of(finding.what), []).append(finding)
    return [
        summary,
        *(
            f"{len(alike)} times: {fuzzer.explained(kind, alike[0])}"
            for alike in [*kinds.values()][:most]
        ),
    ]


def main() -> int:
    """Command line of the module."""
    parser = argparse.ArgumentParser(prog="python -m fuzz.sequences", description=__doc__)
    parser.add_argument("--fmus", type=Path, default=Path("fmus/dist"), help="folder of FMUs")
    parser.add_argument("--twin", type=Path, help="folder of the same FMUs of the other kind")
    parser.add_argument(
        "--sanitize",
        action="store_true",
        help="compile the sources of the FMUs again, with AddressSanitizer and UBSan",
    )
    parser.add_argument("--only", nargs="*", help="names of FMUs")
    parser.add_argument("--runs", type=int, default=10_000, help="sequences, and states, an FMU")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kind", choices=KINDS, help="default: both")
    parser.add_argument("--show", type=int, metavar="SEED", help="print a sequence and play it")
    parser.add_argument("--most", type=int, default=5, help="kinds of findings to explain")
    parser.add_argument("--jobs", type=int, default=2, help="FMUs attacked at the same time")
    options = parser.parse_args()
    kinds = [TWINS] if options.twin else [options.kind] if options.kind else KINDS
    seeds = range(options.first, options.first + options.runs)
    failed = False
    with ExitStack() as stack:
        folders, twin = (
            stack.enter_context(unpacked(sorted(folder.glob("*.fmu")) if folder else []))
            for folder in (options.fmus, options.twin)
        )
        if not folders or (options.twin and folders.keys() != twin.keys()):
            parser.error("no FMUs, or not the same ones of each kind: auv-fmu build makes them")
        if options.sanitize:
            for folder in (twin or folders).values():
                sanitize(folder)
            found = stack.enter_context(sanitizers())
            stack.callback(lambda: print(found))

        def one(name: str) -> list[list[str]]:
            with Fuzzer(folders, name, twin) as fuzzer:
                if options.show is not None:
                    sequence = fuzzer.sequence(options.show)
                    print(fuzzer.show(sequence), fuzzer.replay(sequence) or "no finding", sep="\n")
                    return []
                return [attack(fuzzer, kind, seeds, options.most, _progress) for kind in kinds]

        with ThreadPoolExecutor(options.jobs) as pool:
            for reports in pool.map(one, options.only or folders):
                for report in reports:
                    print("\n\n".join(report), flush=True)
                    failed = failed or len(report) > 1
    return 1 if failed else 0


def _progress(text: str) -> None:
    print(f"\r{text:70}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
