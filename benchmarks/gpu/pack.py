"""Carry a measurement to a machine with a graphics card: `python benchmarks/gpu/pack.py FOLDER`.

FOLDER then holds wheels of auv-fmu, with its FMUs for this platform, and of the packages that it
needs; `run.sh`, which installs them without a network, beside what the machine has; and
`measure.py`. Copy the folder to the machine, and start `sh run.sh`, which takes the options of
`measure.py`; with `--processor` it tries everything without a card.

A card needs CuPy, which is not carried: the machine has the one for its driver.
"""

from __future__ import annotations

import argparse
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "src"), str(ROOT / "tools")]

from fmus.kinds import FMI_VERSIONS, KINDS  # noqa: E402
from orchestrator.runs import bundle  # noqa: E402
from ready_wheel import write_wheel  # noqa: E402

#: Extras that the measurement needs.
_EXTRAS = "gymnasium,studies"

#: Packages that are large and not needed where gcc is.
_WITHOUT = ("cmake", "ziglang")

#: Oldest C libraries of the wheels.
_PLATFORMS = ("manylinux_2_28", "manylinux_2_27", "manylinux_2_17", "manylinux2014", "linux")

#: Files beside this one that are carried, and the card without a card.
_CARRIED = (
    HERE / "measure.py",
    HERE / "run.sh",
    ROOT / "tests" / "support" / "processor_card.py",
)


def own_wheel(folder: Path) -> Path:
    """Build the wheel of auv-fmu, with the FMUs of both kinds for this machine."""
    with TemporaryDirectory() as ready:
        for kind in KINDS:
            place = Path(ready, bundle.CATEGORY, bundle.key_of(kind, FMI_VERSIONS[0]))
            bundle.run_fmus("build", place, "--kind", kind)
        return write_wheel(folder, Path(ready))


def main() -> None:
    """Make the folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--python",
        metavar="VERSION",
        default=".".join(platform.python_version_tuple()[:2]),
        help="of the machine, such as 3.12; default: this one",
    )
    parser.add_argument(
        "--without",
        metavar="PACKAGE",
        nargs="*",
        default=[],
        help="packages that the machine has, such as numpy scipy pyarrow",
    )
    given = parser.parse_args()
    wheels = given.folder / "wheels"
    shutil.rmtree(wheels, ignore_errors=True)
    wheels.mkdir(parents=True)
    wheel = own_wheel(wheels)
    machine = [f"--platform={name}_{platform.machine()}" for name in _PLATFORMS]
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "download", "--quiet", "--only-binary=:all:"),
            *("--dest", wheels, "--python-version", given.python, *machine),
            f"{wheel}[{_EXTRAS}]",
        ],
        check=True,
    )
    without = {name.replace("-", "_").lower() for name in (*_WITHOUT, *given.without)}
    for path in wheels.iterdir():
        if path.name.partition("-")[0].lower() in without:
            path.unlink()
    for path in _CARRIED:
        shutil.copy(path, given.folder)
    size = sum(path.stat().st_size for path in given.folder.rglob("*") if path.is_file())
    print(f"{given.folder}: {len([*wheels.iterdir()])} wheels, {size / 2**20:.0f} MiB")


if __name__ == "__main__":
    main()
