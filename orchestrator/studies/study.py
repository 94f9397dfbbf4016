"""A study: what varies from run to run, in a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

from orchestrator.cosim import Order
from orchestrator.machine.disk import file_name
from orchestrator.machine.errors import InputError
from orchestrator.machine.user_files import read_text
from orchestrator.runs import names_in

#: What makes the runs; the first is the default.
EngineName: TypeAlias = Literal["fmu", "batch"]
ENGINES: tuple[EngineName, ...] = get_args(EngineName)
FMU, BATCH = ENGINES

#: How values that are not listed are spread between two ends.
SPACINGS = LINEAR_SPACING, LOG_SPACING = "linear", "log"

#: How samples are drawn; the first is the default.
METHODS = SOBOL, LATIN_HYPERCUBE, RANDOM = "sobol", "latin-hypercube", "random"

#: More runs than this are taken for a mistake.
MOST_RUNS = 1_000_000_000

#: Studies that come with the program.
STUDIES_FOLDER = Path(__file__).parent / "ready"

#: What may vary beside parameters.
STEP = "step"

#: Entries that tell a study from a scenario.
_OWN = {"scenario", "vary", "sample"}

#: What a message calls a file that cannot be read.
NOT_A_STUDY = "not a study"


class Range(NamedTuple):
    """Where the samples of a value lie."""

    low: float
    high: float
    spacing: str = LINEAR_SPACING


class Sample(NamedTuple):
    """Points drawn at random.

    Attributes:
        n: how many.
        ranges: of the values, by name; of a norm `|a, b, c|` by all its names.
        method: one of :data:`METHODS`.
        seed: that makes the points what they are.

    """

    n: int
    ranges: Mapping[str, Range]
    method: str = METHODS[0]
    seed: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values, the ones in a norm one by one."""
        return tuple(name for key in self.ranges for name in norm_members(key))


def norm_members(key: str) -> list[str]:
    """The names in a norm `|a, b, c|`, or the one name."""
    return [name.strip() for name in key.strip("|").split(",")] if key.startswith("|") else [key]


class StopTime(NamedTuple):
    """End of a run: a sum over values that vary [s].

    Attributes:
        base: of the sum.
        per: what it grows with, by name.

    """

    base: float
    per: Mapping[str, float]

    def of(self, chosen: Mapping[str, Any]) -> float:
        """The end of one run."""
        return self.base + sum(rate * float(chosen[name]) for name, rate in self.per.items())


@dataclass(frozen=True)
class Study:
    """What varies, and what is run; :mod:`.study_file` says what each entry means.

    Attributes:
        name: of the file, without its ending.
        vary: values by `component.parameter`, in the order of the file.
        folder: of the file; None: there is none.

    """

    name: str
    scenario: Sequence[str]
    title: str = ""
    remark: str = ""
    engine: str = FMU
    stop_time: StopTime | None = None
    step: float | None = None
    order: Order | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    sample: Sample | None = None
    figures: Mapping[str, Any] = field(default_factory=dict)
    folder: Path | None = None

    @property
    def stem(self) -> str:
        """Name of its folder."""
        return file_name(self.name)

    @property
    def varied(self) -> tuple[str, ...]:
        """The names of all values that vary."""
        return (*self.vary, *(self.sample.names if self.sample else ()))


def ready_studies() -> list[str]:
    """The studies that come with the program."""
    return names_in(STUDIES_FOLDER)


def is_study(path: str) -> bool:
    """Whether a file holds a study: a TOML file with a table or entry that no scenario has."""
    if not path.endswith(".toml"):
        return False
    with suppress(InputError, ValueError, RecursionError):
        return bool(_OWN & tomllib.loads(read_text(Path(path), NOT_A_STUDY)).keys())
    return False
