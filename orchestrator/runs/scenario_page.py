"""The reference page of scenario files, from what declares them."""

from __future__ import annotations

from collections.abc import Iterable
from string import Template

from orchestrator.figures import FIGURES
from orchestrator.runs.inputs import ENTRIES as INPUTS
from orchestrator.runs.scenario import ENTRIES, names, read_scenario
from orchestrator.runs.scenario_events import ENTRIES as EVENT
from orchestrator.runs.waypoints import ENTRIES as PATH
from orchestrator.runs.wiring import read_wiring

_PAGE = Template("""\
# Scenario files

A scenario says what is changed in the closed loop, how long it runs and how it is shown, in a
[TOML](https://toml.io) file. Run one by its path, `auv-fmu run mine.toml`, or from Python,
`simulate("mine.toml")`. `auv-fmu list` names those that come with auv-fmu; they are files of the
same kind, and a copy of one is a good beginning. An empty file is Fig. 4.

This page is written by `auv-fmu docs`, from the declarations; a test runs its examples.

## Entries

$entries

### Path

$path

### Events

What an event does is one of the last entries from `set` on; [the guide](events.md) says what names
mean, and when an event acts.

$events

### Inputs

$inputs

A file with any other entry, or with a value of another kind, is refused in one line that names it.

## The loop

These components run, unless `components` puts others in their places or `only` leaves some out.
Their pages list their ports and parameters.

$components

These wires connect them, unless `wires` says otherwise.

$wires

Inputs that nothing feeds, and that neither parameters, a table nor an event sets, are named in a
warning, with the wire that they seem to want; `--strict` refuses them. Those whose wires a file
removes with `only` or `false` are open on purpose, and so are `plant.water.*`, which are zero.

## Figures

$figures

A panel of which a run lacks a signal is left out, with a word.

## Examples

Less noise, one gain changed, half as long:

```toml
title = "A better position sensor"
stop_time = 50.0

[parameters]
plant.noise.std = 0.0002
"controller.K1[1]" = 12.0
```

Another controller in the place of the paper's. It measures the velocity, so it needs one wire more.
Fig. 4 is drawn with it, from the same start:

```toml
title = "PD and output feedback, from 10 m away"
label = "PD"
figure = "comparison"
compare = "fig4"
stop_time = 60.0

[components]
controller = "PdController"

[wires]
"controller.dy" = "plant.dy"

[parameters]
planner.eta0.z = -10.0
controller.eps_t = 10.0
```

The vehicle alone, with constant inputs:

```toml
title = "Ahead, and slightly to starboard"
figure = "open-loop-turn"
only = ["plant"]
stop_time = 30.0

[parameters]
plant.tau.u = 20.0
plant.tau.r = 2.0
```

No waves and no currents: the wire is removed, and the inputs stay at zero.

```toml
title = "Still water"

[wires]
"plant.tau_w" = false
```

A path through waypoints, from a table `survey.csv` beside the file:

```toml
title = "A survey"

[components]
planner = "PathPlanner"

[path]
file = "survey.csv"

[parameters]
planner.cruise = 0.4
```

Two vehicles in one system. A vehicle is a component that takes `tau` and gives `eta`; its
controller and planner are found by the wires. Each is measured and drawn as if it were alone:
metrics.json has its indices under `vehicles` and its name, and the names of figures, pages, films
and certificates end with that name.

```toml
[components]
tow = "AuvPlant"
pilot = "ObserverController"
guide = "MotionPlanner"

[wires]
"tow.tau" = "pilot.tau"
"pilot.y" = "tow.y"
"pilot.eta" = "tow.eta"
"pilot.y_d" = "guide.y_d"
"pilot.dy_d" = "guide.dy_d"
"pilot.ddy_d" = "guide.ddy_d"

[parameters]
tow.eta0.y = 2.0
```

A controller of one's own, from an FMU beside the file, is in [the guide](own-controller.md).
""")


def scenario_page() -> str:
    """The page, in Markdown."""
    wiring = read_wiring()
    entries = (
        (f"`{name}`", entry.kind, entry.meaning, entry.default) for name, entry in ENTRIES.items()
    )
    path, events, inputs = (
        table(
            ("entry", "value", "meaning", "without it"),
            (
                (f"`{name}`", entry.kind, entry.meaning, entry.default)
                for name, entry in declared.items()
            ),
        )
        for declared in (PATH, EVENT, INPUTS)
    )
    components = (
        (f"`{name}`", f"[{fmu}](components/{fmu}.md)") for name, fmu in wiring["components"].items()
    )
    wires = ((f"`{target}`", f"`{source}`") for target, source in wiring["wires"].items() if source)
    drawn: dict[str, list[str]] = {kind: [] for kind in FIGURES}
    for name in names():
        drawn[read_scenario(name).figure].append(f"`{name}`")
    figures = ((f"`{kind}`", ", ".join(used)) for kind, used in drawn.items())
    return _PAGE.substitute(
        entries=table(("entry", "value", "meaning", "without it"), entries),
        path=path,
        events=events,
        inputs=inputs,
        components=table(("component", "FMU"), components),
        wires=table(("inputs", "are fed by"), wires),
        figures=table(("`figure`", "as drawn for"), figures),
    )


def table(headings: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    return "\n".join((_rows([headings]), "|---" * len(headings) + "|", _rows(rows)))


def _rows(rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)
