"""Entries of a scenario file, and the source of scenario-files.md and its JSON schema."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from orchestrator.cosim import Experiment
from orchestrator.machine.schema import Name, Names, OneOf, TomlTable, entry, needed
from orchestrator.vehicle.signals import STANDARD

#: Largest number of vehicles; more would take too long to load.
MOST_VEHICLES = 10_000

#: Interpolations of an input between two rows of its table; the first is the default.
INTERPOLATIONS = ("linear", "hold")

#: Actions of an event without a duration.
AT_ONCE = ("release", "reset", "stop")


class PathTable(TomlTable):
    """Waypoints from a table: `[path]`."""

    file: str = needed(
        "A table in CSV, its path relative to this file, with the columns `x,y,z` [m] or `t,x,y,z` "
        "and a line for each waypoint.",
        '"path.csv"',
    )
    component: str = entry(
        "The [PathPlanner](../../fmus/path_planner/page.md), or [LosGuidance]"
        "(../../fmus/los_guidance/page.md), whose parameters they become.",
        f"`{STANDARD.planner}`",
    )


class InputsTable(TomlTable):
    """Inputs over time, from a table: `[inputs]`, or one of several: `[[inputs]]`."""

    file: str = needed(
        "A table in CSV or Parquet, its path relative to this file: `time` [s] first, then inputs "
        "that nothing feeds, as `component.port`. It holds numbers, `true` and `false`, names of "
        "items of an Enumeration, and texts of a String.",
        '"inputs.csv"',
    )
    between: Annotated[str, OneOf(INTERPOLATIONS)] = entry(
        "Interpolation of Real inputs between two rows. All other inputs hold their values, and so "
        "do Real inputs of variability `discrete`.",
        f"`{INTERPOLATIONS[0]}`",
    )


#: Entries of an event other than its action.
_TIMES_AND_LABEL = ("at", "when", "repeat", "duration", "label")


class EventTable(TomlTable):
    """An event of the run: `[[events]]`."""

    at: float = entry("When it happens [s].", "at `when`")
    when: str = entry(
        "The condition at which it happens: a signal, one of `< > <= >=`, and a number, such as "
        '`"plant.eta.z > 5"`. An event happens when its condition changes from false to true.',
        "at `at`",
    )
    repeat: bool = entry(
        "`true`: it happens each time that `when` becomes true, not only the first time.", "`false`"
    )
    duration: Annotated[float, Field(gt=0.0), "positive number"] = entry(
        "How long it lasts [s].", "until the run ends", key="for"
    )
    label: str = entry("Its name in figures.", "its action")
    set: dict[str, Any] = entry(
        "New values of tunable parameters, and of inputs that nothing feeds."
    )
    override: dict[str, Any] = entry("Values that replace signals from now on.")
    bias: dict[str, Any] = entry("Offsets that are added to signals from now on.")
    freeze: Names = entry("Signals that keep their last value.")
    drop: Names = entry(
        "Sensors that fail: inputs that they feed keep the last value, as with `freeze`."
    )
    lose: Names = entry("Actuators that fail: overridden with zero.")
    release: Names = entry("Signals that return to their values without events.")
    reset: Names = entry(
        "Components that start over, with their parameters as they are at that time."
    )
    stop: Literal[True] = entry("`true`: the run ends here, successfully.")

    @model_validator(mode="after")
    def _happens_once_and_does_one_thing(self) -> Self:
        if (self.at is None) == (self.when is None):
            raise ValueError("write when it happens: either at or when")
        known = [name for name in type(self).model_fields if name not in _TIMES_AND_LABEL]
        actions = [action for action in known if getattr(self, action) is not None]
        if len(actions) != 1:
            hint = f"not {' and '.join(actions)}" if actions else f"one of {', '.join(known)}"
            raise ValueError(f"write one action, {hint}")
        if self.duration is not None and actions[0] in AT_ONCE:
            raise ValueError(f"{actions[0]} has no duration: leave `for` out")
        if self.repeat is not None and self.when is None:
            raise ValueError("repeat is for events with `when`")
        return self


class CompareTable(TomlTable):
    """A second run, and its differences from the scenario: `[compare]`."""

    name: str = needed("Name of the second run, and of its folder.", '"mine-pd"')
    label: str = entry("Name of its lines.", "its name")
    components: dict[str, Name] = entry("Other FMUs, as in the scenario.", "the same")
    wires: dict[str, Name | Literal[False]] = entry("Other wires, as in the scenario.", "the same")
    parameters: dict[str, Any] = entry(
        "Other parameters, as in the scenario; values from the command line win over them.",
        "the same, where its components have them",
    )


class ScenarioFile(TomlTable):
    """A scenario of auv-fmu."""

    title: str = entry(
        "Heading of the figures and of the section in the report.", "the name of the file"
    )
    label: str = entry(
        "Name of its lines when two runs are drawn together.", "the name of the file"
    )
    figure: str = entry("Figure to draw.", "`tracking`")
    z_up: bool = entry(
        "`true`: the path is drawn with z up and y west, as the paper states (reading 16).",
        "`false`: z is down and y east",
    )
    compare: CompareTable = entry(
        "A second run that is drawn together with this one: [see below](#compare).", "none"
    )
    stop_time: float = entry("End of the run [s].", "100 s")
    step: float = entry("Communication step [s].", "the default of the FMUs; 0.02 s in the bundle")
    steps: dict[str, float] = entry(
        "Components that take longer steps, as `component = step` [s], a multiple of "
        "the communication step. Meanwhile they hold their inputs.",
        "none",
    )
    order: Names = entry(
        "Order in which values pass and components are stepped: `feedthrough`, `gauss-seidel`, "
        "`jacobi`, or the names of all components.",
        "`feedthrough` where the outputs of the FMUs follow their inputs between steps, else "
        "`gauss-seidel`",
    )
    coupling: Annotated[str, OneOf(Experiment.COUPLINGS)] = entry(
        "How algebraic loops, which are rings of direct feedthroughs, are closed.",
        "`solve` where the FMUs allow it, else `delay`",
    )
    only: list[Name] = entry(
        "The components to keep; wires to the others are removed too.", "all of them"
    )
    remark: str = entry(
        "Text of the report below the figure, in Markdown without pictures.", "none"
    )
    vehicles: Annotated[int, Field(ge=1, le=MOST_VEHICLES)] = entry(
        "Number of vehicles, `auv1`, `auv2` and so on, each with the closed loop: see "
        "[several vehicles](../how-to/vehicles.md).",
        "one, whose components have no prefix",
    )
    components: dict[str, Name | Literal[False]] = entry(
        "FMUs that replace the closed loop's own, or are added to them, as "
        '`component = "FMU"`: a name of the bundle\'s, or the path of a .fmu file, relative to '
        "this file. The path of a .py file stands for the FMU of this "
        "[component](../explanation/component.md), and a .csv file for a planner that "
        "[follows the table](../how-to/trajectories.md). `false` removes a component, and its "
        "wires.",
        "none",
    )
    wires: dict[str, Name | Literal[False]] = entry(
        'Further wires, as `"component.group" = "component.group"`: every input of the group on '
        "the left takes the output of the same name in the group on the right. If both sides "
        'name a port, only that one is wired, as `"g.u[1]" = "t.y"`. If both sides name a '
        "terminal, their members are joined. `false` removes a wire.",
        "none",
    )
    parameters: dict[str, Any] = entry(
        "Parameters, and inputs that nothing feeds, as `component.parameter = value`, or as "
        "`component.group = [values]` with one for each member. Names with brackets are quoted: "
        '`"controller.K1[1]" = 12.0`.',
        "the FMUs' own",
    )
    path: PathTable = entry("Waypoints of a planner, from a table: [see below](#path).", "none")
    events: list[EventTable] = entry(
        "Events during the run, each as `[[events]]`: [see below](#events).", "none"
    )
    inputs: InputsTable | list[InputsTable] = entry(
        "Tables of inputs over time, as `[inputs]`, or each as `[[inputs]]`: [see below](#inputs).",
        "inputs keep their values",
    )
    ours: Annotated[dict[str, Any], "table of texts"] = entry(
        'Values above that are not the paper\'s, and why: `stop_time = "why"`, '
        '`plant.noise.std = "why"`.',
        "none",
    )
