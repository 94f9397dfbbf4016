"""Systems of small FMUs in C, and the same in a few lines of Python that know no schedule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

from orchestrator.system.component import read_component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System
from orchestrator.system.units import Linear, Mapped, Transformation
from support.compiled import library_of

_SOURCE = Path(__file__).with_name("relay.c")

#: Ports in the order of the C source: outputs behind two inputs, then parameters.
INPUTS, OUTPUTS, PARAMETERS = ("u", "v"), ("g", "y", "t", "h"), ("a", "c")

_VARIABILITY = {"input": "continuous", "output": "continuous", "parameter": "fixed"}
_START = {"input": ' start="0"', "output": "", "parameter": ' start="0"'}


def _description(declares: bool, step: float | None) -> str:
    causes = [*(("input", name) for name in INPUTS), *(("output", name) for name in OUTPUTS)]
    causes += [("parameter", name) for name in PARAMETERS]
    variables = "".join(
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
        f'variability="{_VARIABILITY[causality]}"><Real{_START[causality]}/></ScalarVariable>'
        for reference, (causality, name) in enumerate(causes)
    )
    # Only g follows from an input, the first one, at once.
    said = [' dependencies="1"', *[' dependencies=""'] * 3] if declares else [""] * 4
    unknowns = "".join(f'<Unknown index="{3 + i}"{text}/>' for i, text in enumerate(said))
    experiment = "" if step is None else f'<DefaultExperiment stepSize="{step}"/>'
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="2.0" modelName="Relay" guid="relay">'
        '<CoSimulation modelIdentifier="relay" canHandleVariableCommunicationStepSize="true"/>'
        f"{experiment}<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>"
    )


def relay(folder: Path, declares: bool = True, step: float | None = None) -> Path:
    """The FMU.

    Args:
        folder: for it.
        declares: whether it says what its outputs depend on.
        step: that it was made for [s].

    """
    fmu = folder / f"relay-{declares:d}-{step}.fmu"
    if not fmu.exists():
        with ZipFile(fmu, "w") as archive:
            archive.writestr("modelDescription.xml", _description(declares, step))
            archive.writestr("binaries/linux64/relay.so", library_of(_SOURCE, "-ffp-contract=off"))
    return fmu


class Wire(NamedTuple):
    """What an input takes."""

    source: str
    transformation: Transformation | None = None


def system_of(
    fmus: Mapping[str, Path],
    wires: Mapping[str, Wire | str] | None = None,
    parameters: Mapping[str, float] | None = None,
    **others: object,
) -> System:
    """A system of such FMUs.

    Args:
        fmus: by the names of the components.
        wires: sources by targets.
        parameters: by `component.parameter`.
        others: further attributes of the system.

    """
    components = {name: read_component(name, fmu) for name, fmu in fmus.items()}
    connections = []
    for target, wire in (wires or {}).items():
        source, transformation = (wire, None) if isinstance(wire, str) else wire
        connections.append(Connection(_port(source), _port(target), transformation))
    values = {_port(name): value for name, value in (parameters or {}).items()}
    system = System("relays", components, tuple(connections), **others)  # type: ignore[arg-type]
    return system.with_parameters(values)


def _port(text: str) -> PortName:
    return PortName(*text.split("."))


class Clock(NamedTuple):
    """Whole steps, and perhaps a shorter one.

    Attributes:
        start, step: t_k is start + k step [s].
        whole: how many steps are whole.
        stop: end of a shorter one [s]; None: there is none.

    """

    start: float
    step: float
    whole: int
    stop: float | None = None

    @property
    def steps(self) -> int:
        return self.whole + (self.stop is not None)

    def time(self, k: int) -> float:
        return self.start + k * self.step if k <= self.whole else float(self.stop or 0.0)

    def length(self, k: int, end: int) -> float:
        return (end - k) * self.step if end <= self.whole else self.time(end) - self.time(k)


def expected(
    system: System,
    clock: Clock,
    decimations: Mapping[str, int],
    order: Sequence[str] | None,
    start: Mapping[PortName, float],
) -> list[dict[str, float]]:
    """What all ports show after each step.

    An output is a list of values with the number of the time from which on each of them holds:
    from the beginning of the step that it is computed in, where there is an order and it has
    feedthrough as far as is known, and from its end otherwise.

    Args:
        system: of relays.
        clock: of the steps.
        paces: how many of them one of each component takes.
        order: in which components are stepped; None: side by side.
        start: values of all ports at the start.

    """
    known = {name: [(0, value)] for name, value in start.items()}
    fed = {wire.target: wire for wire in system.connections}
    inputs = {name: value for name, value in start.items() if name.port in INPUTS}
    rows = []

    def value(port: PortName, k: int) -> float:
        return [value for since, value in known[port] if since <= k][-1]

    def at_once(port: PortName) -> bool:
        return order is not None and system.components[port.component].has_feedthrough(port.port)

    for k in range(clock.steps):
        before = {name: value(name, k) for name in known}
        stepped: set[str] = set()
        for name in order or system.components:
            if k % decimations[name]:
                continue
            for target in (PortName(name, port) for port in INPUTS):
                if wire := fed.get(target):
                    source = wire.source
                    # What was computed for this time just now, or else what was seen there.
                    new = at_once(source) and source.component in stepped
                    seen = known[source][-1][1] if new else before[source]
                    inputs[target] = transformed(wire.transformation, seen)
            end = min(k + decimations[name], clock.steps)
            u, v = (inputs[PortName(name, port)] for port in INPUTS)
            a, c = (float(system.value(PortName(name, port)) or 0.0) for port in PARAMETERS)
            t, h = clock.time(k), clock.length(k, end)
            y = known[PortName(name, "y")][-1][1] + h * (u - v)
            for port, result in zip(OUTPUTS, (a * u + c, y, t, h), strict=True):
                output = PortName(name, port)
                known[output].append((k if at_once(output) else end, result))
            stepped.add(name)
        shown = {name: value(name, k if at_once(name) else k + 1) for name in known}
        rows.append({str(name): inputs.get(name, shown[name]) for name in known})
    return rows


def transformed(transformation: Transformation | None, value: float) -> float:
    """A value at the end of a wire."""
    match transformation:
        case Linear(factor, offset):
            return factor * value + offset
        case Mapped(pairs):
            return dict(pairs).get(value, value)
    return value
