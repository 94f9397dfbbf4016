"""What a user asks for when making a run: each option is declared once.

The command line makes its options of these fields (`commands/options.py`), `simulate` its keywords,
and the report calls a request by the command that makes it.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from fmus.kinds import AUTO, KINDS, KindName
from orchestrator.cosim.experiment import (
    COUPLINGS,
    ORDERS,
    CouplingName,
    Order,
    format_order,
    read_order,
)
from orchestrator.cosim.fmi.isolated import STEP_TIMEOUT
from orchestrator.cosim.hooks.checkpoint import Checkpoints
from orchestrator.cosim.loop import LOOPS, LoopName
from orchestrator.cosim.observers.files import TABLE_FORMATS, TableFormat
from orchestrator.cosim.observers.observer import Selection
from orchestrator.machine.texts import literal


class CliOption:
    """How the command line describes and reads a field that is an option there."""

    def __init__(self, help: str, **how: Any) -> None:  # noqa: A002
        """Take the help, and whatever else `argparse` needs."""
        self.help, self.how = help, how


def option_fields(declared: type[Any]) -> dict[str, CliOption]:
    """The fields of a dataclass that are options."""
    hints = get_type_hints(declared, include_extras=True)
    return {
        name: one
        for name, hint in hints.items()
        for one in getattr(hint, "__metadata__", ())
        if isinstance(one, CliOption)
    }


def flag(name: str) -> str:
    """The option of the command line that a field is."""
    return "--" + name.replace("_", "-")


#: Which FMUs of the bundle.
KindOption = Annotated[
    KindName,
    CliOption(
        "kind of the bundle's FMUs: python (source code) or native (its translation to C); both "
        f"give the same numbers; default: {AUTO} (native if it is present or can be built)",
        choices=(AUTO, *KINDS),
    ),
]

#: What makes the steps.
LoopOption = Annotated[
    LoopName,
    CliOption(
        "stepping loop: python, or compiled (in C); both give the same rows; default: auto "
        "(compiled where available)",
        choices=LOOPS,
    ),
]

#: Whether the user's files that are in the way are moved.
Force = Annotated[
    bool,
    CliOption(
        "move your own files out of the way, to NAME.~1~; without this option they stay and "
        "nothing is written",
        action="store_true",
    ),
]


@dataclass(frozen=True)
class Request:
    """A scenario and what the user changes of it; None: as the scenario has it.

    Attributes:
        scenario: its name, or the path of a file; empty where a system is given instead.
        parameters: values that win over the scenario's, by `component.parameter`.
        events: another scenario that has them, or tables as in a scenario file.
        steps: of components with longer steps [s]; they win over the scenario's.

    """

    scenario: str = ""
    parameters: Mapping[Any, Any] = field(default_factory=dict, hash=False)
    stop_time: Annotated[
        float | None,
        CliOption("end time of the run [s]; default: from the scenario", type=float, metavar="S"),
    ] = None
    step: Annotated[
        float | None,
        CliOption(
            "communication step [s]; default: from the scenario, else from the FMUs, else 0.02",
            type=float,
            metavar="S",
        ),
    ] = None
    order: Annotated[
        Order | None,
        CliOption(
            f"order in which values pass and components are stepped: {', '.join(ORDERS)}, or the "
            f"names of all components; default: from the scenario, else feedthrough where the "
            f"outputs of the FMUs follow their inputs between steps, else gauss-seidel",
            type=read_order,
            metavar=f"{'|'.join(ORDERS)}|NAME,...",
        ),
    ] = None
    coupling: Annotated[
        CouplingName | None,
        CliOption(
            "method for algebraic loops: solve them, delay them by one step, or solve them with "
            "inputs that change linearly within the step; default: from the scenario, else solve "
            "where the FMUs allow it",
            choices=COUPLINGS,
        ),
    ] = None
    kind: KindOption = AUTO
    events: Annotated[
        str | Sequence[Mapping[str, Any]] | None,
        CliOption(
            "scenario whose events happen in this run",
            metavar="SCENARIO|FILE.toml",
        ),
    ] = field(default=None, hash=False)
    inputs: Annotated[
        str | Path | None,
        CliOption(
            "table (CSV or Parquet) with values over time for unconnected inputs",
            type=Path,
            metavar="FILE",
        ),
    ] = None
    loop: LoopOption = LOOPS[0]
    isolate: Annotated[
        bool,
        CliOption(
            "run each FMU in a separate process, so that a crash or hang cannot take the run down",
            action="store_true",
        ),
    ] = False
    step_timeout: Annotated[
        float | None,
        CliOption(
            f"time limit for one call of an isolated FMU [s]; default: {STEP_TIMEOUT:g}; needs "
            "--isolate",
            type=float,
            metavar="S",
        ),
    ] = None
    real_time: Annotated[
        float | None,
        CliOption("limit the speed to FACTOR times real time", type=float, metavar="FACTOR"),
    ] = None
    strict: Annotated[bool, CliOption("treat warnings as errors", action="store_true")] = False
    steps: Mapping[str, float] = field(default_factory=dict, hash=False)

    @property
    def label(self) -> str:
        """What it is called: words after `auv-fmu run`, and in parentheses what has no option."""
        words, untouched = [self.scenario], Request()
        rest = {"steps": ", ".join(f"{name} = {_text(h)} s" for name, h in self.steps.items())}
        for name, one in option_fields(Request).items():
            value = getattr(self, name)
            if value == getattr(untouched, name):
                continue
            if name == "events" and not isinstance(value, str):
                # Tables; the option takes the scenario that has them.
                rest[name] = ", ".join(map(str, value)) or "none"
                continue
            words.append(flag(name))
            if one.how.get("action") != "store_true":
                words.append(format_order(value) if name == "order" else _text(value))
        for name, value in self.parameters.items():
            words += ["--set", f"{name}={_text(value)}"]
        told = "; ".join(f"{name}: {text}" for name, text in rest.items() if text)
        return shlex.join(words) + f" ({told})" * bool(told)


@dataclass(frozen=True)
class Files:
    """What a run leaves in its folder.

    Raises:
        InputError: an interval makes no sense.

    """

    interval: Annotated[
        float | None,
        CliOption(
            "time between rows in the table [s]; default: a row for each step",
            type=float,
            metavar="S",
        ),
    ] = None
    columns: Annotated[
        str,
        CliOption(
            "columns of the table, for example plant.y.*,controller.tau; default: all",
            metavar="outputs|all|PATTERN,...",
        ),
    ] = "all"
    format: Annotated[
        TableFormat,
        CliOption("file format of the table; default: csv", choices=tuple(TABLE_FORMATS)),
    ] = "csv"
    no_figures: Annotated[bool, CliOption("do not draw figures", action="store_true")] = False
    checkpoint_every: Annotated[
        float | None,
        CliOption(
            "write a checkpoint to DIR/checkpoint every S simulated seconds",
            type=float,
            metavar="S",
        ),
    ] = None
    resume: Annotated[
        bool, CliOption("continue from the last checkpoint in DIR/checkpoint", action="store_true")
    ] = False
    force: Force = False

    def __post_init__(self) -> None:
        if self.interval is not None:
            Selection.check(self.interval)
        if self.checkpoint_every is not None:
            Checkpoints.check(self.checkpoint_every)


def _text(value: Any) -> str:
    """The shortest text that is read back as the same value."""
    if isinstance(value, str | Path):
        return str(value)
    return literal(value).removesuffix(".0") if isinstance(value, float) else literal(value)
