"""What a study file may hold; docs/studies.md and its JSON schema are made from this."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, ConfigDict, Field, model_validator

from orchestrator.figures.study_figures import KINDS
from orchestrator.formats.schema import Name, Names, OneOf, TomlTable, entry, needed
from orchestrator.master.experiment import ORDERS
from orchestrator.system.names import flattened
from orchestrator.system.values import is_finite

#: What makes the runs; the first is the default.
ENGINES = FMU, BATCH = "fmu", "batch"

#: How values that are not listed are spread between two ends.
SPACINGS = LINEAR, LOG = "linear", "log"

#: How samples are drawn; the first is the default.
METHODS = SOBOL, LATIN_HYPERCUBE, RANDOM = "sobol", "latin-hypercube", "random"

#: More runs than this are taken for a mistake.
MOST_RUNS = 1_000_000_000

#: More values of one parameter than this are taken for a mistake.
_MOST_VALUES = 1_000_000

#: What the generators of random numbers take.
_LARGEST_SEED = 2**63 - 1


def _of_numbers(table: Mapping[str, Any]) -> Mapping[str, Any]:
    if not all(is_finite(value) for _, value in flattened(table)):
        raise ValueError
    return table


def _of_texts(table: Mapping[str, Any]) -> Mapping[str, Any]:
    if not all(isinstance(value, str) for _, value in flattened(table)):
        raise ValueError
    return table


#: Tables whose keys may be dotted.
_Numbers = Annotated[dict[str, Any], AfterValidator(_of_numbers), "table of numbers"]
_Texts = Annotated[dict[str, Any], AfterValidator(_of_texts), "table of texts"]


class RangeTable(TomlTable):
    """A range under `[sample.range]`."""

    low: float = needed("Where it begins.", "1.0", key="from")
    high: float = needed("Where it ends; it may go either way.", "10.0", key="to")
    spacing: Annotated[str, OneOf(SPACINGS)] = entry(
        "How values lie between the ends.", f"`{SPACINGS[0]}`"
    )


class GridTable(RangeTable):
    """A range under `[vary]`."""

    n: Annotated[int, Field(ge=1, le=_MOST_VALUES)] = needed("How many values it has.", "7")


class SampleTable(TomlTable):
    """Points drawn at random: `[sample]`."""

    method: Annotated[str, OneOf(METHODS)] = entry("How points are drawn.", f"`{METHODS[0]}`")
    n: Annotated[int, Field(ge=1, le=MOST_RUNS)] = needed("How many points.", "64")
    seed: Annotated[int, Field(ge=0, le=_LARGEST_SEED)] = entry(
        "Makes the points what they are.", "`0`"
    )
    range: dict[str, Any] = needed(
        "What is drawn: `component.parameter = [low, high]` or `{ from = 1.0, to = 10.0, spacing = "
        '"log" }`.',
        "{ component.parameter = [low, high] }",
    )


class StopTimeTable(TomlTable):
    """`stop_time` as a sum."""

    base: float = needed("Of the sum [s].", "60.0")
    per: _Numbers = needed("Seconds for each of a value that varies.", "{ plant.eta0.z = 1.2 }")


class FigureTable(TomlTable):
    """A figure: `[figures.NAME]`."""

    kind: Annotated[str, OneOf(tuple(KINDS))] = needed(
        "What it is.", " or ".join(f'"{kind}"' for kind in KINDS)
    )
    x: Names = entry(
        "Value along the horizontal axis; of `bands` also several, a column of panels each; of "
        "`influence` what moves the others."
    )
    y: Name = entry("Value along the vertical axis.")
    show: Names = entry("What is shown, a row each.")
    by: Names = entry(
        "Columns that tell runs apart, by colours or in panels of their own; `[]` for none.",
        "the scenario, if there are several",
    )
    where: dict[str, Any] = entry("Only runs of which these columns have these values.", "none")
    limits: _Numbers = entry("Lines at values of what is shown.", "none")

    @model_validator(mode="after")
    def _has_what_its_kind_has(self) -> Self:
        _, needs, may = KINDS[self.kind]
        if missing := [key for key in needs if not getattr(self, key)]:
            raise ValueError(f"lacks {' and '.join(missing)}")
        if more := self.model_fields_set - {"kind", *needs, *may}:
            raise ValueError(f"a figure of kind {self.kind!r} has no {min(more)}")
        if self.kind in ("maps", "front") and not isinstance(self.x, str):
            raise ValueError(f"x is a list; a figure of kind {self.kind!r} has one x")
        return self


class FiguresTable(TomlTable):
    """What is drawn: `[figures]`."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, FigureTable]
    named: ClassVar = FigureTable

    labels: _Texts = entry("What figures call columns.", "their names")


class StudyFile(TomlTable):
    """A study of auv-fmu."""

    scenario: Name | Annotated[list[Name], Field(min_length=1)] = needed(
        "What is run: a scenario of `auv-fmu list`, or the path of a .toml, .ssp, .ssd or .fmu "
        "file, or of an OspSystemStructure.xml, relative to this one. Of several, each is run at "
        "every point, with the parameters that it has.",
        '"fig5"',
    )
    title: str = entry("Heading of the figures.", "none")
    remark: str = entry("What the report says below the figures, in Markdown.", "none")
    engine: Annotated[str, OneOf(ENGINES)] = entry(
        "What makes the runs: the FMUs, or the equations compiled, which know only the standard "
        "closed loop and give the same numbers.",
        f"`{ENGINES[0]}`",
    )
    stop_time: float | StopTimeTable = entry(
        "End of each run [s]. As a table, `{ base = 60.0, per = { plant.eta0.z = 1.2 } }`, a sum "
        "over values that vary.",
        "the scenario's",
    )
    step: float = entry("Communication step [s].", "the scenario's")
    order: Annotated[str, OneOf(ORDERS)] = entry(
        "In which components are stepped.", "the scenario's"
    )
    parameters: dict[str, Any] = entry(
        "Parameters of all runs, as in a scenario.", "the scenario's"
    )
    vary: dict[str, Any] = entry(
        "Every combination of these values is run: `component.parameter = [values]`, or "
        '`{ from = 1.0, to = 10.0, n = 7, spacing = "linear" }` (or `"log"`). `step` may vary, '
        "too.",
        "nothing",
    )
    sample: SampleTable = entry(
        "Points drawn at random, at every combination of `vary`: `n` of them, by a `method` out "
        f"of {', '.join(METHODS)}, with a `seed`, and under `[sample.range]` "
        '`component.parameter = [low, high]` or `{ from = 1.0, to = 10.0, spacing = "log" }`. '
        '`"|a, b, c|" = [low, high]` draws the norm of two or three numbers, and every direction '
        "with the same chance.",
        "none",
    )
    figures: FiguresTable = entry("What is drawn: see below.", "what moves what")
