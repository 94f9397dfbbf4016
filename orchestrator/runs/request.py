"""Options of a run, each declared once: its type, its default and its help.

The fields of these dataclasses are the options of the command line (`commands/options.py`); the
fields of :class:`Options` are also keywords of `simulate`, with the same help.

"""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import (
    Any,
    Concatenate,
    Literal,
    ParamSpec,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from fmus.kinds import AUTO, KindName
from orchestrator.cosim import (
    Checkpoints,
    Experiment,
    Isolation,
    Order,
    Plan,
    RealTime,
    Selection,
    System,
    TableFile,
)
from orchestrator.machine.texts import literal

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")


def option(
    default: Any, text: str, *, is_flag: bool = True, is_hashed: bool = True, **how: Any
) -> Any:
    """Declare a field of a dataclass as an option.

    Args:
        default: its default.
        text: its help, on the command line and in Python.
        is_flag: True if it is an option of the command line.
        is_hashed: True if it counts in the hash of the object.
        how: arguments of `add_argument` that do not follow from the type of the field.

    """
    metadata = {"help": text, "is_flag": is_flag, "how": how}
    if default == {}:
        return field(default_factory=dict, hash=is_hashed, metadata=metadata)
    return field(default=default, hash=is_hashed, metadata=metadata)


def flags(declared: type[Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Find the options of the command line among the fields of a dataclass.

    Yields:
        The name of a field, its flag, and the arguments of `add_argument`.

    """
    hints = get_type_hints(declared)
    for name, entry in declared.__dataclass_fields__.items():
        if entry.metadata.get("is_flag"):
            how = {**_read_as(hints[name]), **entry.metadata["how"]}
            flag = "--" + name.replace("_", "-")
            yield name, flag, {"default": entry.default, "help": entry.metadata["help"], **how}


def _read_as(hint: Any) -> dict[str, Any]:
    """Derive the arguments of `add_argument` from a type."""
    for kind in [hint] if get_origin(hint) is Literal else get_args(hint) or [hint]:
        if kind is bool:
            return {"action": "store_true"}
        if kind in (float, int):
            return {"type": kind, "metavar": "S" if kind is float else "N"}
        if kind is Path:
            return {"type": Path, "metavar": "FILE"}
        if get_origin(kind) is Literal:
            return {"choices": get_args(kind)}
    return {}


def takes_keywords(
    declared: Callable[P, T],
) -> Callable[[Callable[[T], R]], Callable[P, R]]:
    """Let a function of a dataclass take the fields of the dataclass as arguments.

    Its signature, type hints and docstring list these arguments; in the docstring, `{arguments}`
    stands for their help.

    """
    decorator: Callable[[Callable[[T], R]], Callable[P, R]] = _taking(declared, 0)
    return decorator


def method_takes_keywords(
    declared: Callable[P, T],
) -> Callable[[Callable[[S, T], R]], Callable[Concatenate[S, P], R]]:
    """Let a method of a dataclass take its fields as arguments: see :func:`takes_keywords`."""
    decorator: Callable[[Callable[[S, T], R]], Callable[Concatenate[S, P], R]]
    decorator = _taking(declared, 1)
    return decorator


def _taking(declared: Callable[..., Any], before: int) -> Any:
    """Return a decorator for functions of some arguments and a dataclass."""
    hints, shown = get_type_hints(declared), signature(declared)
    texts = {entry.name: entry.metadata["help"] for entry in fields(declared)}  # type: ignore[arg-type]
    described, parameters = [], []
    for name, parameter in shown.parameters.items():
        described.append(textwrap.fill(f"{name}: {texts[name]}.", 92, subsequent_indent=" " * 4))
        # A dataclass shows a placeholder for a new mapping.
        default = {} if repr(parameter.default) == "<factory>" else parameter.default
        parameters.append(parameter.replace(annotation=hints[name], default=default))

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        name = function.__qualname__.removesuffix(".__init__")
        own = [*signature(function).parameters.values()][:before]
        arguments = textwrap.indent("\n".join(described), " " * 8).lstrip()

        @wraps(function)
        def call(*positional: Any, **keywords: Any) -> Any:
            try:
                shown.bind(*positional[before:], **keywords)
            except TypeError as error:
                raise TypeError(f"{name}() {error}") from None
            return function(*positional[:before], declared(*positional[before:], **keywords))

        call.__doc__ = (function.__doc__ or "").replace("{arguments}", arguments)
        returned = get_type_hints(function)["return"]
        call.__annotations__ = {**hints, "return": returned}
        call.__signature__ = shown.replace(  # type: ignore[attr-defined]
            parameters=[*own, *parameters], return_annotation=returned
        )
        return call

    return decorate


#: The loop of systems that are stepped by their compiled program.
PROGRAM = "program"

#: Help of options that studies have, too.
KIND = (
    "kind of the bundle's FMUs: python (source code) or native (its translation to C), with the "
    f"same numbers; default: {AUTO} (native if it is present or can be built)"
)
LOOP = (
    "stepping loop: python, or compiled (in C), with the same rows; default: auto (compiled where "
    "available)"
)
FORCE = "rename your own files that are in the way to NAME.~1~; default: stop"
CHECKPOINT_EVERY = (
    "time between checkpoints [simulated s]; default: none; for a resumed run, the same again"
)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of every run; None: the scenario's."""

    stop_time: float | None = option(None, "end of the run [s]; default: the scenario's")
    step: float | None = option(
        None,
        "communication step [s]; default: the scenario's, else the longest that divides the "
        "default steps of the FMUs, else 0.02",
    )
    order: Order | None = option(
        None,
        "order in which values pass and components are stepped: feedthrough (values of one time "
        "pass before all are stepped), gauss-seidel (the paper's), jacobi (all in parallel, with "
        "the outputs of the last communication point), or the names of all components; default: "
        "the scenario's, else feedthrough where the outputs of the FMUs follow their inputs "
        "between steps, else gauss-seidel",
        type=Experiment.read_order,
        choices=None,
        metavar=f"{'|'.join(Experiment.ORDERS)}|NAME,...",
    )
    coupling: Experiment.Coupling | None = option(
        None,
        "method for algebraic loops: solve them, delay them by one step, or solve them with inputs "
        "that change linearly within the step; default: the scenario's, else solve where the FMUs "
        "allow it",
    )
    kind: KindName = option(AUTO, KIND)
    events: str | Sequence[Mapping[str, Any]] | None = option(
        None,
        "scenario whose events happen in this run, or, in Python, tables as in a scenario file; "
        "default: the scenario's own",
        is_hashed=False,
        metavar="SCENARIO|FILE.toml",
    )
    inputs: str | Path | Sequence[str | Path] | None = option(
        None,
        "table (CSV or Parquet) of unconnected inputs over time, or, repeated, several (in Python, "
        "a list); default: the scenario's own",
        is_hashed=False,
        action="append",
    )
    loop: Plan.Loop = option(Plan.LOOPS[0], LOOP)
    isolate: bool = option(
        False,
        "run each FMU in a separate process, so that a crash or hang cannot take the run down",
    )
    step_timeout: float | None = option(
        None, f"time limit for one call of an isolated FMU [s]; default: {Isolation.step_timeout:g}"
    )
    strict: bool = option(False, "treat warnings as errors")
    steps: Mapping[str, float] = option(
        {},
        "longer steps of single components [s], multiples of the communication step, in place of "
        "the scenario's",
        is_flag=False,
        is_hashed=False,
    )


@dataclass(frozen=True)
class Request(Options):
    """A scenario, and the user's changes.

    Attributes:
        scenario: its name, or the path of a file; empty if a system is given instead.
        parameters: values that replace the scenario's, by `component.parameter`.

    """

    scenario: str = ""
    parameters: Mapping[Any, Any] = field(default_factory=dict, hash=False)

    @property
    def label(self) -> str:
        """Words after `auv-fmu run`; in parentheses, changes that the command line cannot make."""
        words = [self.scenario]
        rest = {"steps": ", ".join(f"{name} = {_text(h)} s" for name, h in self.steps.items())}
        for name, flag, how in flags(Request):
            value = getattr(self, name)
            if value == how["default"]:
                continue
            if name == "events" and not isinstance(value, str):
                # The option takes the name of a scenario, not tables.
                rest[name] = ", ".join(map(str, value)) or "none"
                continue
            if how.get("action") == "append":
                each = [value] if isinstance(value, str | Path) else value
                words += [word for file in each for word in (flag, _text(file))]
                continue
            words.append(flag)
            if how.get("action") != "store_true":
                words.append(Experiment.format_order(value) if name == "order" else _text(value))
        for name, value in self.parameters.items():
            words += ["--set", f"{name}={_text(value)}"]
        added = "; ".join(f"{name}: {text}" for name, text in rest.items() if text)
        return shlex.join(words) + f" ({added})" * bool(added)


@dataclass(frozen=True)
class SystemOptions(Options):
    """A system, and the user's changes, in Python."""

    system: str | Path | Mapping[str, Any] | System = field(
        metadata={
            "help": "name of a scenario, path of a file such as .toml or .ssp, a dictionary with "
            "the entries of a scenario file, or a system from `load`"
        }
    )
    parameters: Mapping[str, object] | None = option(
        None,
        "values in place of the scenario's, by `component.parameter`: numbers, Booleans, names, or "
        "text as on the command line; for a group, such as `plant.eta0`, a list with a value for "
        "each member",
    )
    _: KW_ONLY
    variant: str | None = option(None, "name of a system description in an SSP")


@dataclass(frozen=True, kw_only=True)
class SimulateOptions(SystemOptions):
    """Arguments of :func:`.run.simulate`."""

    progress: bool = option(False, "show a bar on runs that take longer than some seconds")
    checkpoint: str | Path | None = option(
        None,
        "folder for checkpoints, from which another process can continue the run; it is removed "
        "when the run is complete",
    )
    checkpoint_every: float | None = option(None, CHECKPOINT_EVERY)
    resume: bool = option(
        False,
        "continue from the last checkpoint. The result has all rows, as if the run had not been "
        "interrupted; its `resumed_at` has the time at which it continued",
    )


@dataclass(frozen=True)
class Files:
    """Options of a run that writes files.

    Raises:
        InputError: an interval or a factor is not positive.

    """

    interval: float | None = option(
        None, "time between rows in the table [s]; default: a row for each step"
    )
    columns: str = option(
        "all",
        "columns of the table, for example plant.y.*,controller.tau; default: all",
        metavar="outputs|all|PATTERN,...",
    )
    format: TableFile.Format = option("csv", "file format of the table; default: csv")
    no_figures: bool = option(False, "do not draw figures")
    real_time: float | None = option(
        None, "limit the speed to FACTOR times real time", metavar="FACTOR"
    )
    checkpoint_every: float | None = option(None, f"{CHECKPOINT_EVERY}; they go to DIR/checkpoint")
    resume: bool = option(False, "continue from the last checkpoint in DIR/checkpoint")
    force: bool = option(False, FORCE)

    def __post_init__(self) -> None:
        if self.interval is not None:
            Selection.check(self.interval)
        if self.real_time is not None:
            RealTime.check(self.real_time)
        if self.checkpoint_every is not None:
            Checkpoints.check(self.checkpoint_every)


def _text(value: Any) -> str:
    """Return the shortest text that is read back as the same value."""
    if isinstance(value, str | Path):
        return str(value)
    return literal(value).removesuffix(".0") if isinstance(value, float) else literal(value)
