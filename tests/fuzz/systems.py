"""Random systems of random components: their programs do what their FMUs do, bit for bit.

A pool is some components, made from a seed and built once as FMUs of both kinds, and systems that
are wired from them: at random, without rings of direct feedthroughs, with values that change on
their way, steps of components, any order, and any start. Each runs with the FMUs of both kinds, and
as a program that says which component refuses, as a quick one, and as one that events could happen
in. Some components refuse: then so does the program, after as many steps.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from fmus.kinds import KINDS, NATIVE, PYTHON
from fmus.ports.definition import Definition
from fmus.ports.port import H_MAX
from fmus.script import source_of_script
from fuzz.components import BOOL, FLOAT, HELPER, INT, MODE, RULES, Component
from orchestrator.cosim import Component as Fmu
from orchestrator.cosim import (
    Connection,
    Experiment,
    Linear,
    Mapped,
    Plan,
    PortName,
    System,
    Table,
    make_plan,
    read_component,
    simulate_plan,
)
from orchestrator.cosim.connection import can_feed
from orchestrator.machine.errors import InputError
from orchestrator.program.writer import Equations, Text
from support.own import built
from support.programs import compiled, play

#: Components of a pool, and systems that are made of them.
COMPONENTS, SYSTEMS = 4, 12

#: File and line of an exception in the Python kind.
_PLACE = re.compile(r"\S+\.py:\d+: ")

#: Numbers that stay small, mostly: a run should come to its end.
CALM: Mapping[str, Sequence[str]] = {
    FLOAT: (
        "0.5 * {f} - 0.25 * {f}", "({f} if {b} else 0.5 * {f})", "{f} / (2.0 + abs({f}))",
        "{f} * {f} / (1.0 + abs({f}))", "min({f}, max({f}, -3.0))", "sqrt(abs({f}))", "sin({f})",
        "0.001 * {i}", "TABLE[{i} % 3]",
    ),
    INT: RULES[INT],
    BOOL: RULES[BOOL],
    MODE: RULES[MODE],
}  # fmt: skip

#: Names of components in systems, some of which are also names of C or of a program.
NAMES = ("one", "two", "auv.plant", "auv_plant", "double", "it", "steps", "made", "3d", "ü.p")

#: Lengths of components' steps, in steps of the run.
EVERY = (1, 1, 1, 2, 3, 4)


def files_of(seed: int) -> Mapping[str, str]:
    """Texts of all files of a seed's component."""
    text = Component(seed, CALM).text().replace("HELPER", "helping_calm")
    text = text.replace("from pathlib", "from math import sin, sqrt\nfrom pathlib", 1)
    text = text.replace("> 3.0:", "> 0.5:")  # so that some runs are refused
    return {f"calm_{seed}.py": text, "helping_calm.py": HELPER, "table.txt": "0.25 -0.0 1.5\n"}


# Pools and systems


class Made(NamedTuple):
    """A component of a pool: its definition, and its FMUs by their kinds."""

    definition: Definition
    fmus: Mapping[str, Path]


def pool(seeds: Sequence[int], folder: Path) -> list[Made]:
    """The components of some seeds, built."""
    found = []
    for seed in seeds:
        for name, text in files_of(seed).items():
            (folder / name).write_text(text, encoding="utf-8")
        script = folder / f"calm_{seed}.py"
        fmus = {kind: built(script, kind, folder / f"{kind}_{seed}") for kind in KINDS}
        fmus = {kind: path.with_suffix(".fmu") for kind, path in fmus.items()}
        found.append(Made(source_of_script(script).definition, fmus))
    return found


class Drawn(NamedTuple):
    """A system, its experiment, and the components that it needs.

    Attributes:
        parts: its components by their names, which are those of a pool.
        system: with FMUs of one kind.
        experiment: that is run.
        is_tuned: whether its program can change parameters later.

    """

    parts: Mapping[str, Made]
    system: System
    experiment: Experiment
    is_tuned: bool

    def plan(self, kind: str) -> Plan:
        """Plan of a run with FMUs of a kind."""
        return make_plan(
            replace(self.system, components=components(self.parts, kind)), self.experiment
        )

    @property
    def definitions(self) -> dict[str, Definition]:
        """Definitions of all components."""
        return {name: made.definition for name, made in self.parts.items()}


def components(parts: Mapping[str, Made], kind: str) -> dict[str, Fmu]:
    """The FMUs of a kind."""
    return {name: read_component(name, made.fmus[kind]) for name, made in parts.items()}


def drawn(seed: int, made: Sequence[Made]) -> Drawn:
    """Draw a system of components of a pool."""
    draw = Random(seed)
    names = draw.sample(NAMES, draw.randint(2, 6))
    parts = {name: draw.choice(made) for name in names}
    system = _wired(System(f"random {seed}", components(parts, NATIVE), ()), draw)
    system = replace(system, parameters=dict(_parameters(system, draw)))
    step = draw.choice((0.02, 0.1, 0.125, 1.0 / 3.0))
    every = {name: draw.choice(EVERY) for name in names}
    system = replace(
        system, steps={name: n * step for name, n in every.items() if n > 1 or draw.random() < 0.1}
    )
    start = draw.choice((0.0, 0.0, 1.5, -2.3, 1e3))
    length = step * (draw.randint(8, 30) + draw.choice((0.0, 0.0, 0.4, draw.random())))
    order = draw.choice((None, *Experiment.ORDERS, tuple(draw.sample(names, len(names)))))
    experiment = Experiment(start + length, step, order, start)
    return Drawn(parts, system, experiment, draw.random() < 0.3)


def _wired(system: System, draw: Random) -> System:
    """A system whose inputs are fed, most of them, without rings of direct feedthroughs."""
    ports = {
        causality: [
            (PortName(name, variable.name), variable)
            for name, component in system.components.items()
            for variable in component.having(causality)
            if variable.name != "fault"
        ]
        for causality in ("input", "output")
    }
    draw.shuffle(ports["input"])
    for target, variable in ports["input"]:
        fitting = [port for port in ports["output"] if can_feed(port[1], variable)]
        if not fitting or draw.random() < 0.2:
            continue
        for source, output in draw.sample(fitting, min(3, len(fitting))):
            change = _change(output, variable, draw)
            if change is None and variable.family == "Enumeration" != output.family:
                continue
            wire = Connection(source, target, change)
            more = replace(system, connections=(*system.connections, wire))
            if not more.rings() and not any(more.problems()):
                system = more
                break
    return system


def _change(source: Any, target: Any, draw: Random) -> (Linear | Mapped) | None:
    kinds = source.family, target.family
    if draw.random() < 0.5:
        return None
    if kinds == ("Real", "Real"):
        return Linear(draw.choice((-1.0, 0.25, 0.7)), draw.choice((-0.0, 0.0, 0.3)))
    if kinds == ("Boolean", "Boolean"):
        return Mapped(((0, 1), (1, draw.choice((0, 1)))))
    if kinds[1] == "Enumeration":
        values = [*map(int, target.items.values())]
        keys = values if kinds[0] == "Enumeration" else range(-3, 1000)
        return Mapped(tuple((key, draw.choice(values)) for key in keys))
    if kinds[0] != "Real":
        half = 0.5 if kinds[1] == "Real" else 0
        keys = draw.sample(range(10), 3)
        return Mapped(tuple((key, draw.randint(0, 9) + half) for key in keys))
    return None


def _parameters(system: System, draw: Random) -> Iterator[tuple[PortName, Any]]:
    """Values of parameters, and of inputs that nothing feeds."""
    fed = {connection.target for connection in system.connections}
    for name, component in system.components.items():
        for variable in (*component.having("parameter"), *component.having("input")):
            port = PortName(name, variable.name)
            if variable.name == H_MAX:
                if draw.random() < 0.5:
                    yield port, draw.choice((0.011, 0.05, 1.0))
            elif port not in fed and draw.random() < 0.5:
                yield port, _value(variable, draw)


def _value(variable: Any, draw: Random) -> Any:
    match variable.family:
        case "Real":
            return draw.choice((0.0, -0.0, draw.uniform(-3.0, 3.0)))
        case "Boolean":
            return draw.random() < 0.5
        case "Integer":
            return draw.randint(-10, 10)
    return int(draw.choice([*variable.items.values()]))


# Runs


class Run(NamedTuple):
    """Outcome of a run.

    Attributes:
        rows: a column for each name, time first.
        failure: why there is no further row; empty: there is none to come.
        has_begun: whether values came to rest.

    """

    rows: Mapping[str, np.ndarray]
    failure: str
    has_begun: bool = True


def run_of_fmus(plan: Plan) -> Run:
    """A run of the master."""
    table = Table()
    try:
        ending = simulate_plan(plan, [table])
    except InputError as error:
        return Run({}, _PLACE.sub("", str(error)), has_begun=False)
    values = zip(("time", *table.columns), table.rows.T, strict=True)
    rows = {name: column for name, column in values if not name.endswith(".fault")}
    return Run(rows, _PLACE.sub("", ending.failure or ""))


def run_of_program(text: Text, path: Path) -> Run:
    """A run of a program."""
    found, failure = play(text, path), ""
    if found.outcome:
        component, made = found.refused
        at = f"stopped at t = {text.plan.experiment.time(made):.12g} s: " * found.has_begun
        failure = f"{at}{text.components[component]}"
    names = ("time", *map(str, text.columns))
    return Run(dict(zip(names, found.rows.T, strict=True)), failure, found.has_begun)


class Ways:
    """Ways to make programs of the components of a pool."""

    def __init__(self, made: Sequence[Made], folder: Path) -> None:
        self._folder = folder
        self._shared = Equations((drawn.definition for drawn in made), (), is_tuned=True)
        self._object = compiled(self._shared.apart(), folder / "equations.o", "-DAPART=", "-c")

    def programs(self, drawn: Drawn, number: int) -> Iterator[tuple[str, Text, Path]]:
        """Programs of a system, each with the name of the way in which it was made."""
        plan, place = drawn.plan(NATIVE), self._folder / f"{number}"
        text = Text(plan, drawn.definitions, has_events=True, shared=self._shared)
        options = "-DAPART=", self._object, "-shared"
        yield "alters", text, compiled(text.apart(), place.with_suffix(".a.so"), *options)
        is_quick = number % 2 == 1
        text = Text(plan, drawn.definitions, is_tuned=drawn.is_tuned, is_quick=is_quick)
        library = compiled(text.text(), place.with_suffix(".b.so"), "-shared")
        yield QUICK if text.is_quick else "careful", text, library


# Findings

#: The way of programs that are checked once a step.
QUICK = "quick"

#: Ends of a run.
WHOLE, REFUSED, NOT_BEGUN = "to the end", "refused later", "refused at the start"


class Outcome(NamedTuple):
    """Outcome of a system.

    Attributes:
        system: its name.
        end: of its run, :data:`WHOLE` or another of these.
        findings: what differs, in lines.

    """

    system: str
    end: str
    findings: Sequence[str]


def outcomes(seed: int, systems: int = SYSTEMS) -> Iterator[Outcome]:
    """Run the systems of a pool."""
    first = seed * COMPONENTS
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        try:
            made = pool(range(first, first + COMPONENTS), folder)
            ways = Ways(made, folder)
            for number in range(seed * systems, (seed + 1) * systems):
                yield _outcome(drawn(number, made), ways, number)
        finally:
            _forget(folder)


def _forget(folder: Path) -> None:
    """Forget the modules of a folder, so that others may have their names."""
    place = str(folder.resolve())
    sys.path.remove(place)
    for name, known in [*sys.modules.items()]:
        if str(getattr(known, "__file__", None) or "").startswith(place):
            del sys.modules[name]


def _outcome(drawn: Drawn, ways: Ways, number: int) -> Outcome:
    wanted, other = (run_of_fmus(drawn.plan(kind)) for kind in (PYTHON, NATIVE))
    runs = {"FMUs": other}
    for way, text, library in ways.programs(drawn, number):
        runs[way] = run_of_program(text, library)
    found = [
        f"{way}: {what}"
        for way, run in runs.items()
        if (what := difference(wanted, run, way == QUICK))
    ]
    end = NOT_BEGUN if not wanted.has_begun else REFUSED if wanted.failure else WHOLE
    return Outcome(drawn.system.name, end, found)


def difference(wanted: Run, found: Run, is_quick: bool = False) -> str:
    """The first difference of a run: a program reports only which component refuses, and when."""
    if is_quick and wanted.failure and found.failure:
        # It does not say what it was, nor when.
        return ""
    if wanted.has_begun != found.has_begun:
        return f"{found.failure or 'begins'} instead of {wanted.failure or 'beginning'}"
    for name, values in wanted.rows.items():
        for k, (expected, value) in enumerate(zip(values, found.rows[name], strict=False)):
            if expected.tobytes() != value.tobytes():
                return f"{name} is {value!r} in row {k}, not {expected!r}"
    is_so = wanted.failure.startswith(found.failure) and bool(wanted.failure) == bool(found.failure)
    if not is_so:
        return f"{found.failure or 'no failure'} instead of {wanted.failure or 'none'}"
    n, m = (len(run.rows.get("time", ())) for run in (wanted, found))
    return f"{m} rows, not {n}" if m != n else ""


def findings(seed: int) -> list[str]:
    """List the differences in the systems of a pool."""
    return [f"{outcome.system}: {line}" for outcome in outcomes(seed) for line in outcome.findings]
