"""Write docs/reference/tested-fmus.md and tested-fmus.csv from the results of all files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from csv import writer
from importlib.metadata import PackageNotFoundError, version
from io import StringIO
from typing import Any

from compare import STEPS
from other_masters import TOOLS

#: Deviations up to these are rounding errors: of a system in another tool, of a single FMU.
SYSTEM_BOUND, FMU_BOUND = 1e-9, 1e-12

#: Why what runs deviates, by a part of its path and who it deviates from.
_HOST = "host"
EXPLANATIONS: Mapping[tuple[str, str], str] = {
    ("/LinearTransformation3/", "libcosim"): "it applies no parameter sets of the system",
    ("/algebraic_loop_", "ecos"): "direct feedthrough shows a step earlier",
    ("/0004_Atmos.fmu", _HOST): "its output `CPUtime` is the processor's",
}

#: Reasons why something does not run, and what of a message stands for each; the first counts.
_REASONS = {
    "of another version of FMI": r"is of FMI",
    "for model exchange": r"model exchange|ModelExchange",
    "without a binary for this machine": r"for this machine",
    "with FMUs outside of the archive": r"lies outside|is elsewhere",
    "without a file that it names": r"holds no '",
    "without any FMU": r"holds no component",
    "with a library that does not load or instantiate here": r"cannot be (loaded|instantiated)",
    "with sources that do not compile here": r"cannot be compiled|holds no sources",
    "not valid": "",
}

#: Results of a file, in the words of the page.
_OUTCOMES = {
    "refused": "refused",
    "fails": "ended early",
    "crashes": "crashed",
}

_HEAD = """\
# Public FMUs and SSP archives, tested

Which public FMUs and SSP archives run in auv-fmu. `python benchmarks/foreign FOLDER` writes this
page and [tested-fmus.csv](tested-fmus.csv), which says of every file that does not run why, and of
every archive what its run reported. Files with the same bytes count once.

- **Archives** run unchanged, in the default order, for {steps} steps or to the end that they name.
  They are compared in Jacobi order with {tools}.
  libcosim also runs them as `auv-fmu export --format osp` writes them.
- **FMUs** run one by one, for {steps} steps with all inputs at their start values. They are
  compared with a plain host of {host} lines, which shares no code with the master.
- **A deviation** is the largest over all Real outputs and steps, relative to the size of an output
  where that is above one.
"""


def page(files: Sequence[Mapping[str, Any]], lines_of_host: int) -> str:
    """Text of the page."""
    head = _HEAD.format(steps=STEPS, host=lines_of_host, tools=" and ".join(_tools()))
    there = [file for file in files if file["outcome"] != "absent"]
    archives = [file for file in there if not file["is_fmu"]]
    fmus = [file for file in there if file["is_fmu"]]
    parts = [head.rstrip("\n"), *_archives(archives), *_fmus(fmus), *_parameters(fmus)]
    return "\n".join([*parts, *_not_running(archives, fmus), ""])


def listed(files: Sequence[Mapping[str, Any]]) -> str:
    """Table of files in CSV: reasons of those that do not run, and messages of archives."""
    text = StringIO()
    table = writer(text, lineterminator="\n")
    table.writerow(("kind", "file", "outcome"))
    for file in files:
        kind = "FMU" if file["is_fmu"] else "archive"
        changed = file.get("changed", {})
        if changed.get("lost"):
            table.writerow((kind, _name(file), f"does not take {', '.join(changed['lost'])}"))
        if changed.get("outcome", "runs") != "runs":
            table.writerow((kind, _name(file), f"with other parameters {_why(changed)}"))
        if file["outcome"] == "absent":
            table.writerow((kind, _name(file), "could not be fetched"))
        elif file["outcome"] != "runs":
            table.writerow((kind, _name(file), _why(file)))
        elif not file["is_fmu"]:
            table.writerow((kind, _name(file), f"runs: {_said(file['said'])}"))
    return text.getvalue()


def _tools() -> Iterator[str]:
    for package in ("libcosimpy", "ecospy"):
        try:
            yield f"{package} {version(package)}"
        except PackageNotFoundError:
            continue


def _archives(archives: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    running = [file for file in archives if file["outcome"] == "runs"]
    yield f"\n## Archives\n\n{len(running)} of {len(archives)} run."
    yield "Deviations of those that other programs run:\n"
    yield f"| archive | rows | {' | '.join(TOOLS)} |"
    yield f"| --- | --: |{' --- |' * len(TOOLS)}"
    for file in running:
        tools = file.get("tools", {})
        if all(isinstance(tools.get(tool, ""), str) for tool in TOOLS):
            continue
        cells = (_compared(file, tool, tools.get(tool, "")) for tool in TOOLS)
        yield f"| {_name(file)} | {file['rows']} | {' | '.join(cells)} |"


def _said(lines: Sequence[str]) -> str:
    """A message of a run, in a cell."""
    more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
    return f"{_cell(lines[0])}{more}" if lines else ""


def _compared(file: Mapping[str, Any], tool: str, deviation: float | str) -> str:
    """Result of a comparison: a number, or the reason that there is none."""
    if isinstance(deviation, str):
        return "not run" if deviation else ""
    if deviation <= SYSTEM_BOUND:
        return f"{deviation:.1e}"
    return f"{deviation:.1e}: {_explained(file, tool)}"


def _explained(file: Mapping[str, Any], tool: str) -> str:
    why = [
        text
        for (part, other), text in EXPLANATIONS.items()
        if other == tool and part in file["path"]
    ]
    return why[0] if why else "**not explained**"


def _not_running(*kinds: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Numbers of archives and FMUs that do not run, by reason."""
    counts = [
        Counter(_reason(file) for file in files if file["outcome"] != "runs") for files in kinds
    ]
    yield "\n## What does not run\n\n| reason | archives | FMUs |\n| --- | --: | --: |"
    for reason in _REASONS:
        if any(count[reason] for count in counts):
            yield f"| {reason} | {' | '.join(str(count[reason]) for count in counts)} |"


def _reason(file: Mapping[str, Any]) -> str:
    return next(name for name, part in _REASONS.items() if re.search(part, file["reason"]))


def _fmus(there: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    running = [file for file in there if file["outcome"] == "runs"]
    numbers = [file["deviation"] for file in running if isinstance(file["deviation"], float)]
    yield f"\n## FMUs one by one\n\n{len(running)} of {len(there)} run{_versions(there)}.\n"
    yield (
        f"{len(numbers)} have Real outputs that the plain host also reads. {_equal(numbers)} "
        f"agree bit for bit, {_within(numbers)} to {FMU_BOUND:g}.\n"
    )
    for file in running:
        if isinstance(file["deviation"], float) and not file["deviation"] <= FMU_BOUND:
            yield f"- {_name(file)} deviates by {file['deviation']:.1e}: {_explained(file, _HOST)}."


def _versions(fmus: Sequence[Mapping[str, Any]]) -> str:
    """Numbers of FMUs that run, by version of FMI."""
    counts = Counter(file["fmi"] for file in fmus)
    running = Counter(file["fmi"] for file in fmus if file["outcome"] == "runs")
    shares = (f"{running[fmi]} of {counts[fmi]} of FMI {fmi}" for fmi in sorted(running))
    return ": " + ", ".join(shares)


def _equal(numbers: Iterable[float]) -> int:
    return sum(d == 0.0 for d in numbers)


def _within(numbers: Iterable[float]) -> int:
    return sum(d <= FMU_BOUND for d in numbers)


def _parameters(fmus: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Results with other values of all Real parameters."""
    changed = [file for file in fmus if "changed" in file and file["changed"].get("wanted") != 0]
    ran = [file for file in changed if file["changed"]["outcome"] == "runs"]
    lost = [file for file in ran if file["changed"]["lost"]]
    silent = [file for file in lost if file["changed"]["silent"]]
    yield (
        f"\n## Parameters\n\n{len(changed)} of the FMUs that run have Real parameters. All "
        "parameters of an FMU were changed at once, by a hundredth, and read back after "
        "initialisation.\n\n"
        "| FMUs | how many |\n| --- | --: |\n"
        f"| that keep all new values | {len(ran) - len(lost)} |\n"
        f"| that do not, with a message | {len(lost) - len(silent)} |\n"
        f"| that do not, silently | {len(silent)} |\n"
        f"| that do not run with these values | {len(changed) - len(ran)} |\n"
    )
    numbers = [file["changed"].get("deviation") for file in ran]
    compared = [number for number in numbers if isinstance(number, float)]
    yield (
        f"{_within(compared)} of {len(compared)} with Real outputs agree to {FMU_BOUND:g} with the "
        "plain host, which sets the same values.\n"
    )
    for file in ran:
        deviation = file["changed"].get("deviation")
        if isinstance(deviation, float) and not deviation <= FMU_BOUND:
            yield f"- {_name(file)} deviates by {deviation:.1e}: {_explained(file, _HOST)}."


def _name(file: Mapping[str, Any]) -> str:
    """Source of a file, and its number of copies."""
    more = f" ({file['copies']} more)" if file["copies"] else ""
    return f"{file['place']}: {_cell(file['path'])}{more}"


def _why(file: Mapping[str, Any]) -> str:
    # A single FMU has the name of its file.
    reason = re.sub(r"^fmu: (\S+\.fmu )?", "", file["reason"])
    return f"{_OUTCOMES[file['outcome']]}: {_cell(reason)}"


def _cell(text: str) -> str:
    """A text in one cell of a table."""
    return re.sub(r"\s+", " ", text).replace("|", "\\|").replace("<", "&lt;")
