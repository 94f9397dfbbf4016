"""Linear systems as FMUs, and the exact solution of such FMUs that are coupled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orchestrator.cosim import (
    Connection,
    Experiment,
    PortName,
    System,
    Table,
    make_plan,
    read_component,
    simulate_plan,
)
from support.small_fmus import description, unknown, variable, write

_SOURCE = Path(__file__).with_name("linear.c")

#: Names of inputs, outputs and parameters, by the value references of the C source.
INPUTS, OUTPUTS = ("u0", "u1"), ("y0", "y1")
_MATRICES = [f"{matrix}{i}{j}" for matrix in "ABCD" for i in range(2) for j in range(2)]
_PARAMETERS = [*_MATRICES, "x0", "x1"]


class Part(NamedTuple):
    """x' = A x + B u, y = C x + D u; matrices of up to two rows and columns."""

    A: object = 0.0
    B: object = 0.0
    C: object = 0.0
    D: object = 0.0
    x: object = 0.0

    def matrices(self) -> list[np.ndarray]:
        """A, B, C, D, each (2, 2), and x, (2,)."""
        found = []
        for given in self[:4]:
            whole, some = np.zeros((2, 2)), np.atleast_2d(np.asarray(given, dtype=float))
            whole[: some.shape[0], : some.shape[1]] = some
            found.append(whole)
        start = np.zeros(2)
        start[: np.size(self.x)] = self.x
        return [*found, start]


class Model(NamedTuple):
    """Parts that are coupled.

    Attributes:
        parts: by their names.
        wires: sources by targets.
        outputs: whose errors count.
        stop: end of a run [s].

    """

    parts: Mapping[str, Part]
    wires: Mapping[str, str]
    outputs: Sequence[str]
    stop: float


#: sin t, and cos t.
SINE = Part(A=[[0.0, 1.0], [-1.0, 0.0]], C=np.eye(2), x=[0.0, 1.0])

#: Two masses, and between them a spring and a damper that belong to the second, which is tied to a
#: wall, too.
TWO_MASSES = Model(
    {
        "first": Part(A=[[0, 1], [-1, -0.1]], B=[[0, 0], [1, 0]], C=np.eye(2), x=[1.0, 0.0]),
        "second": Part(
            A=[[0, 1], [-10 - 1, -0.1]],
            B=[[0, 0], [10, 0.1]],
            C=[[1, 0], [10, 0.1]],
            D=[[0, 0], [-10, -0.1]],
        ),
    },
    {"first.u0": "second.y1", "second.u0": "first.y0", "second.u1": "first.y1"},
    ("first.y0", "first.y1", "second.y1"),
    10.0,
)

#: A wheel of 40 kg on a tyre, a quarter of a chassis on a spring and a damper above it, and a road
#: of 5 cm and 1 Hz.
_ROAD = 2.0 * np.pi
QUARTER_TRUCK = Model(
    {
        "road": Part(A=[[0, _ROAD], [-_ROAD, 0]], C=[[0.05, 0], [0, 0]], x=[0.0, 1.0]),
        "wheel": Part(
            A=[[0, 1], [-150000 / 40, 0]], B=[[0, 0], [150000 / 40, -1 / 40]], C=np.eye(2)
        ),
        "chassis": Part(
            A=[[0, 1], [-15000 / 400, -1000 / 400]],
            B=[[0, 0], [15000 / 400, 1000 / 400]],
            C=[[1, 0], [-15000, -1000]],
            D=[[0, 0], [15000, 1000]],
        ),
    },
    {
        "wheel.u0": "road.y0",
        "wheel.u1": "chassis.y1",
        "chassis.u0": "wheel.y0",
        "chassis.u1": "wheel.y1",
    },
    ("wheel.y0", "wheel.y1", "chassis.y0", "chassis.y1"),
    2.0,
)


def linear(
    folder: Path,
    says: str = "dependencies",
    cached: bool = False,
    can: bool = True,
    forgets: bool = False,
    tunable: bool = False,
) -> Path:
    """The FMU.

    Args:
        folder: for it.
        says: of its outputs' dependencies: `dependencies`: first output none, second both inputs;
            `all`: both of both; `nothing`: no attribute; `no outputs`: not even the outputs.
        cached: whether its outputs are computed in steps only.
        can: give its state and derivatives, and let inputs change in a step.
        forgets: whether an input that is set no longer changes.
        tunable: whether parameters are.

    """
    fmu = folder / f"linear-{says.replace(' ', '-')}-{cached:d}{can:d}{forgets:d}{tunable:d}.fmu"
    if fmu.exists():
        return fmu
    causes = dict.fromkeys(INPUTS, "input") | dict.fromkeys(OUTPUTS, "output")
    causes |= dict.fromkeys(_PARAMETERS, "parameter")
    declared = {"dependencies": ("", "1 2"), "all": ("1 2", "1 2"), "nothing": (None, None)}
    able = (
        'canGetAndSetFMUstate="true" canInterpolateInputs="true" '
        'canSerializeFMUstate="true" providesDirectionalDerivative="true"'
    )
    variables = [variable(name, i, causes[name]) for i, name in enumerate(causes)]
    if tunable:
        variables = [
            variable.replace('variability="fixed"', 'variability="tunable"')
            for variable in variables
        ]
    text = description(
        "linear",
        variables,
        (unknown(3 + i, dependencies) for i, dependencies in enumerate(declared.get(says, ()))),
        f'canHandleVariableCommunicationStepSize="true" {able if can else ""}',
    )
    return write(fmu, text, _SOURCE, *["-DCACHED"] * cached, *["-DFORGETS"] * forgets)


def system_of(
    fmus: Mapping[str, Path], parts: Mapping[str, Part], wires: Mapping[str, str], **others: object
) -> System:
    """A system of such FMUs.

    Args:
        fmus: by the names of the components, in their order.
        parts: what each is.
        wires: sources by targets.
        others: of the system.

    """
    values = {
        PortName(name, parameter): float(value)
        for name, part in parts.items()
        for parameter, value in zip(
            _PARAMETERS, np.concatenate([m.ravel() for m in part.matrices()]), strict=True
        )
    }
    connections = tuple(Connection(PortName.read(s), PortName.read(t)) for t, s in wires.items())
    components = {name: read_component(name, fmu) for name, fmu in fmus.items()}
    return System("linear", components, connections, values, **others)


def exact(
    parts: Mapping[str, Part], wires: Mapping[str, str], times: np.ndarray
) -> dict[str, np.ndarray]:
    """Outputs of the coupled system, whose inputs equal their sources at all times.

    x' = A x + B u, y = C x + D u, u = L y, so u = (1 - L D)^-1 L C x; by eigenvalues, or, where a
    matrix has too few eigenvectors, by its exponential series.
    """
    names = list(parts)
    A, B, C, D = (_diagonal([parts[name].matrices()[i] for name in names]) for i in range(4))
    start = np.concatenate([parts[name].matrices()[4] for name in names])
    place = {f"{name}.y{i}": 2 * k + i for k, name in enumerate(names) for i in range(2)}
    wired = np.zeros_like(D)
    for target, source in wires.items():
        name, port = target.split(".")
        wired[2 * names.index(name) + int(port[1]), place[source]] = 1.0
    inputs = np.linalg.solve(np.eye(len(D)) - wired @ D, wired @ C)
    matrix, outputs = A + B @ inputs, C + D @ inputs
    step, state, found = np.inf, start, []
    transition = np.eye(len(matrix))
    for before, time in zip([0.0, *times[:-1]], times, strict=True):
        if time - before != step:
            step = time - before
            transition = _exponential(matrix * step)
        state = transition @ state
        found.append(outputs @ state)
    columns = np.array(found).T
    return {name: columns[i] for name, i in place.items()}


def error(folder: Path, model: Model, experiment: Experiment, says: str = "dependencies") -> float:
    """The largest error of the outputs of a model, relative to their amplitudes."""
    fmus = {name: linear(folder, says) for name in model.parts}
    table = Table()
    simulate_plan(make_plan(system_of(fmus, model.parts, model.wires), experiment), [table])
    assert table.failure is None
    right = exact(model.parts, model.wires, np.asarray(table.time))
    return max(
        float(np.abs(table[name] - right[name]).max() / np.abs(right[name]).max())
        for name in model.outputs
    )


def _diagonal(blocks: list[np.ndarray]) -> np.ndarray:
    whole = np.zeros((2 * len(blocks), 2 * len(blocks)))
    for i, block in enumerate(blocks):
        whole[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
    return whole


def _exponential(matrix: np.ndarray) -> np.ndarray:
    """By scaling and squaring of its series."""
    halvings = max(0, int(np.ceil(np.log2(max(np.linalg.norm(matrix), 1e-300)))) + 1)
    term = whole = np.eye(len(matrix))
    for k in range(1, 25):
        term = term @ matrix / 2**halvings / k
        whole = whole + term
    for _ in range(halvings):
        whole = whole @ whole
    return whole
