"""FMUs on a thread with the stack that macOS gives one: 512 kB."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest

from fmus.kinds import FMI_VERSIONS, NATIVE
from fmus.language.build import Untranslatable
from fmus.native.translator import translated
from fmus.script import source_of_script
from orchestrator.machine.compilers import machines_compiler
from support.own import built
from support.tiers import slow

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

TESTS = Path(__file__).parents[1]

#: Every use that a host makes of an instance, on a thread with that stack.
_DRIVE = """\
import sys, threading
from pathlib import Path
from support.fmi3 import Fmi3Library
from support.raw import Library, initialised
done = []

def drive():
    library = (Fmi3Library if sys.argv[2] == "3" else Library)(Path(sys.argv[1]))
    with initialised(library) as host:
        state = host.get_state()
        for k in range(3):
            assert host.step(0.02 * k, 0.02) == 0
        content = host.content()
        assert host.set_state(state) == 0
        status, again = host.deserialised(content)
        assert status == host.set_state(again) == 0
        host.values()
        assert host.step(-1.0, -1.0) == 2
        assert host.free_state(state) == 0
        assert host.call("fmi2Reset") == 0
    done.append(True)

threading.stack_size(512 * 1024)
thread = threading.Thread(target=drive)
thread.start()
thread.join()
sys.exit(not done)
"""

_HEAD = '''\
"""A component."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Matrix, Variable, Vector

N = {n}


class Inputs(NamedTuple):
    """What it follows."""

    u: Annotated[{inputs}, Variable("1", "Input")]


class Outputs(NamedTuple):
    """What is seen."""

    y: Annotated[{outputs}, Variable("1", "Output")]


class Parameters(NamedTuple):
    """What is set."""

    p: Annotated[{parameters}, Variable("1", "Parameter")] = {start}


class State(NamedTuple):
    """What it remembers."""

    x: Annotated[{state}]


'''

#: Types of a component's parts where nothing else is said.
_PLAIN = {"inputs": "float", "outputs": "float", "parameters": "float", "start": "0.0",
          "state": "Vector, 1"}  # fmt: skip

_START = """\
def start(parameters: Parameters, inputs: Inputs) -> State:
    \"\"\"State at the start.\"\"\"
    return State(Vector(0.0 for _ in range({n})))


"""
_UPDATE = """\
def update(state: State) -> State:
    \"\"\"State after a step.\"\"\"
    return state


"""

#: By what is large: types that differ, and hooks. Each is made as large as it may be.
LARGE = {
    "a Runge-Kutta scheme": (
        {"state": "Vector, N"},
        _START.replace("{n}", "N")
        + """\
def _rate(x: Annotated[Vector, N], u: float) -> Annotated[Vector, N]:
    \"\"\"Of the state.\"\"\"
    return Vector(u - y for y in x)


def update(state: State, inputs: Inputs, h: float) -> State:
    \"\"\"State after a step.\"\"\"
    x = state.x
    k1 = _rate(x, inputs.u)
    k2 = _rate(x + 0.5 * h * k1, inputs.u)
    k3 = _rate(x + 0.5 * h * k2, inputs.u)
    k4 = _rate(x + h * k3, inputs.u)
    return State(x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


def outputs(state: State) -> Outputs:
    \"\"\"What is seen.\"\"\"
    return Outputs(state.x[0])
""",
    ),
    "a product of matrices": (
        {"state": "Matrix, N, N"},
        """\
def start(parameters: Parameters, inputs: Inputs) -> State:
    \"\"\"State at the start.\"\"\"
    return State(Matrix((0.001 for _ in range(N)) for _ in range(N)))


def update(state: State) -> State:
    \"\"\"State after a step.\"\"\"
    return State(0.5 * (state.x @ state.x + state.x.T))


def outputs(state: State) -> Outputs:
    \"\"\"What is seen.\"\"\"
    return Outputs(state.x[0][0])
""",
    ),
    "a state that is not credible": (
        {"state": "Vector, N"},
        _START.replace("{n}", "N")
        + """\
RESTARTED = "restarted at {t:g} s"


def credible(state: State) -> bool:
    \"\"\"Whether a step may begin with it; hardly ever.\"\"\"
    return state.x[0] > 1.0


def restarted(state: State) -> State:
    \"\"\"What it is then.\"\"\"
    return State(0.5 * state.x)


def derive(state: State) -> Annotated[Vector, N]:
    \"\"\"From the state.\"\"\"
    return 2.0 * state.x


def update(state: State, derived: Annotated[Vector, N]) -> State:
    \"\"\"State after a step.\"\"\"
    return State(state.x + derived)


def outputs(derived: Annotated[Vector, N], inputs: Inputs) -> Outputs:
    \"\"\"What is seen.\"\"\"
    return Outputs(derived[0] + inputs.u)
""",
    ),
    "ports": (
        {"inputs": "Vector, N", "outputs": "Vector, N", "parameters": "Vector, N",
         "start": "Vector(0.0 for _ in range(N))"},
        _START.replace("{n}", "1")
        + _UPDATE
        + """\
def outputs(parameters: Parameters, state: State, inputs: Inputs) -> Outputs:
    \"\"\"What is seen.\"\"\"
    return Outputs(parameters.p + inputs.u + state.x[0] * inputs.u)
""",
    ),
}  # fmt: skip


def script(folder: Path, what: str, n: int) -> Path:
    types, hooks = LARGE[what]
    text = (_HEAD + hooks).replace("{n}", str(n))
    for name, hint in {**_PLAIN, **types}.items():
        text = text.replace(f"{{{name}}}", hint)
    path = folder / f"large_{[*LARGE].index(what)}_{n}.py"
    path.write_text(text, encoding="utf-8")
    return path


def is_taken(folder: Path, what: str, n: int) -> bool:
    try:
        translated(source_of_script(script(folder, what, n)).definition)
    except Untranslatable as error:
        return re.search("at once|too large", str(error)) is None
    return True


def drive(folder: Path, version: str = "2") -> None:
    command = [sys.executable, "-X", "faulthandler", "-c", _DRIVE, str(folder), version]
    environment = {**os.environ, "PYTHONPATH": str(TESTS)}
    process = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert process.returncode == 0, process.stderr[-2000:]


#: Cases of the quick tests.
QUICK = ("a state that is not credible",)


@pytest.mark.parametrize("what", [*QUICK, *slow(*(w for w in LARGE if w not in QUICK))])
def test_the_largest_that_is_taken_runs_with_512_kb(tmp_path: Path, what: str):
    if what == "ports":
        least = most = 400  # the descriptions of more take minutes
    else:
        most = next(n for n in (2**k for k in range(3, 20)) if not is_taken(tmp_path, what, n))
        least = most // 2
    while most - least > max(1, least // 32):
        n = (least + most) // 2
        least, most = (n, most) if is_taken(tmp_path, what, n) else (least, n)
    for version in FMI_VERSIONS:
        own = script(tmp_path, what, least)
        drive(built(own, NATIVE, tmp_path / f"fmu{version}", version), version)


@pytest.mark.parametrize("name", ["AuvPlant", "FormationPlanner"])
def test_components_run_with_512_kb(native: Path, tmp_path: Path, name: str):
    drive(Path(fmpy.extract(str(native / f"{name}.fmu"), tmp_path / "unpacked")))
