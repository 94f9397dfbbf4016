"""Checkers that fmi-standard.org names, on every FMU of the bundle.

`python benchmarks/compatibility.py [CHECKER=VERSION ...]` builds the FMUs of both kinds and of both
versions of FMI, runs FMPy and the named checkers on each, and writes a table into docs/reference.
`python tools/pages.py` then fills in its page. The commands of the checkers have to be on the PATH;
`sh benchmarks/checkers.sh FOLDER` builds them.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy
import numpy as np
from fmpy.util import read_csv
from fmpy.validation import validate_fmu

from fmus.discovery import REFERENCE, components, source_of
from fmus.kinds import NATIVE, PYTHON
from orchestrator.machine.texts import BOOLEANS
from orchestrator.runs.bundle import current_fmus

#: The table that is written.
TABLE = Path(__file__).parents[1] / "docs" / "reference" / "compatibility.csv"

#: Kinds of FMU, and their versions of FMI.
FORMS = ((PYTHON, "2"), (NATIVE, "2"), (NATIVE, "3"))

#: The checkers that always run.
FMPY = ("FMPy validate", "FMPy simulate")

#: The verdict on an FMU without a flaw.
VALID = "valid"


def main() -> None:
    """Run all checkers, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "checkers", nargs="*", metavar="CHECKER=VERSION", help="VDMCheck, fmuCheck or fmusim"
    )
    named = dict(pair.split("=", 1) for pair in parser.parse_args().checkers)
    if unknown := named.keys() - CHECKERS.keys():
        sys.exit(f"no checker {', '.join(sorted(unknown))}")
    versions = {name: named.get(name, fmpy.__version__) for name in (*FMPY, *named)}
    rows = [*results(versions)]
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["fmu", "kind", "fmi", "checker", "version", "result"])
        table.writerows(rows)


def results(versions: Mapping[str, str]) -> Iterator[tuple[str, ...]]:
    """Yield FMU, kind, FMI, checker, version and result."""
    for kind, fmi in FORMS:
        for name in components():
            fmu = current_fmus(kind, fmi) / f"{name}.fmu"
            for checker, version in versions.items():
                if found := CHECKERS[checker](fmu, fmi):
                    yield name, kind, f"{fmi}.0", checker, version, found


# Checkers


def fmpy_validate(fmu: Path, fmi: str) -> str:
    """Check the description against the schema and the rules that FMPy knows."""
    return "; ".join(map(str, validate_fmu(str(fmu)))) or VALID


def vdm_check(fmu: Path, fmi: str) -> str:
    """Check the description against a formal model of the standard."""
    return _verdict(f"VDMCheck{fmi}.sh", fmu, "No errors found.")


def fmu_check(fmu: Path, fmi: str) -> str:
    """Check the description, and simulate; FMI 2.0 only."""
    clean = ("\t0 warning(s) and error(s)\n", "\t0 Error(s)\n")
    return _verdict("fmuCheck.linux64", fmu, *clean) if fmi == "2" else ""


def _verdict(command: str, fmu: Path, *clean: str) -> str:
    """Return whether the checker says that it finds nothing; its exit status can be 0 without."""
    done = subprocess.run([command, fmu], check=False, capture_output=True, text=True)
    if done.returncode:
        return f"exit status {done.returncode}"
    return VALID if all(words in done.stdout + done.stderr for words in clean) else "not passed"


def fmpy_simulate(fmu: Path, fmi: str) -> str:
    """Simulate with the reference inputs, and return the deviation from the outputs."""
    inputs, outputs, times = _reference(fmu)
    found = fmpy.simulate_fmu(
        str(fmu),
        stop_time=times[-1],
        output_interval=times[1],
        input=read_csv(str(inputs)) if inputs.is_file() else None,
        output=[*outputs][1:],
    )
    return _deviation(outputs, {name: found[name] for name in found.dtype.names})


def fmusim(fmu: Path, fmi: str) -> str:
    """Simulate with the reference inputs, and return the deviation from the outputs."""
    inputs, outputs, times = _reference(fmu)
    command = ["fmusim", "--stop-time", f"{times[-1]}", "--output-interval", f"{times[1]}"]
    command += ["--input-file", str(inputs)] * inputs.is_file()
    command += [word for name in [*outputs][1:] for word in ("--output-variable", name)]
    with TemporaryDirectory() as folder:
        table = Path(folder, "result.csv")
        done = subprocess.run(
            [*command, "--output-file", table, fmu], check=False, capture_output=True, text=True
        )
        return (
            f"exit status {done.returncode}"
            if done.returncode
            else _deviation(outputs, _columns(table))
        )


def _reference(fmu: Path) -> tuple[Path, dict[str, np.ndarray], np.ndarray]:
    """Return the file of inputs, which need not exist, and outputs and times."""
    folder = source_of(fmu.stem).folder / REFERENCE
    outputs = _columns(folder / f"{fmu.stem}_ref.csv")
    return folder / f"{fmu.stem}_in.csv", outputs, outputs["time"]


def _columns(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    values = np.array([[float(BOOLEANS.get(cell, cell)) for cell in row] for row in rows])
    return dict(zip(header, values.T, strict=True))


def _deviation(expected: Mapping[str, np.ndarray], found: Mapping[str, np.ndarray]) -> str:
    """Largest deviation of any output, relative where the output is above one."""
    deviations = [
        np.max(np.abs(found[name] - values) / np.maximum(1.0, np.abs(values)))
        for name, values in expected.items()
    ]
    return f"{max(deviations):.2g}"


#: Functions of an FMU and its version of FMI that return a result, by the name of the checker.
CHECKERS: Mapping[str, Callable[[Path, str], str]] = {
    "FMPy validate": fmpy_validate,
    "VDMCheck": vdm_check,
    "fmuCheck": fmu_check,
    "fmusim": fmusim,
    "FMPy simulate": fmpy_simulate,
}


if __name__ == "__main__":
    main()
