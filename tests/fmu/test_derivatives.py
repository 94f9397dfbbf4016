"""Directional derivatives, beside differences, mpmath, and what the standards ask."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from ctypes import c_double, c_size_t, c_uint, c_void_p
from pathlib import Path

import fmpy
import mpmath
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from auv_fmu import casadi
from fmus.discovery import components
from fmus.kinds import NATIVE, PYTHON
from fmus.language.mathematics import FUNCTIONS
from orchestrator.machine.compilers import machines_compiler
from orchestrator.runs.own_components import build_own
from support.all_types import build
from support.derivatives import check, instance
from support.tiers import slow

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

#: Arguments within the domain of each function.
AT = {"acosh": (1.7,), "atanh": (0.3,), "acos": (0.3,), "asin": (-0.3,), "pow": (1.3, -2.4)}

#: Functions whose result is an int or a bool, and products.
ODD = [name for name, about in FUNCTIONS.items() if about.factor or about.result.word != "a float"]

HEAD = """\
from math import *
from typing import Annotated, NamedTuple
from auv_fmu import Matrix, Variable, Vector


class Inputs(NamedTuple):
    x: Annotated[float, Variable("1", "x")] = {x}
    y: Annotated[float, Variable("1", "y")] = {y}


class Outputs(NamedTuple):
{fields}


def outputs(inputs: Inputs{more}) -> Outputs:
    x, y = inputs
    return Outputs({values})
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Callable[..., Path]:
    """Build a component whose outputs are expressions of x and y, and perhaps of t."""

    def build(
        expressions: list[str], x: float = 0.7, y: float = 1.9, kind: str = NATIVE, fmi: str = "2",
        more: str = "",
    ) -> Path:  # fmt: skip
        folder = tmp_path_factory.mktemp("own")
        fields = "\n".join(
            f'    o{i}: Annotated[float, Variable("1", "o")]' for i in range(len(expressions))
        )
        values = ", ".join(expressions)
        text = HEAD.format(x=x, y=y, fields=fields, values=values, more=more)
        (folder / "own.py").write_text(text)
        return build_own(folder / "own.py", folder / "fmu", kind=kind, fmi=fmi)

    return build


def jacobian_of(path: Path, folder: Path) -> np.ndarray:
    """Derivatives of all outputs by all inputs at the start."""
    with instance(path, folder) as it:
        it.begin()
        return it.jacobian(it.having("input"))


#: Sensors. A standard deviation of zero draws no number, so others follow when it is above zero.
SENSORS = ("AttitudeSensor", "DepthSensor", "Dvl", "Imu", "PositionFix")

#: Components that cannot be functions of all parameters.
OTHERS = ("AcousticLink", "Sea")

#: A function of many operations.
LARGE = "NavigationFilter"


@pytest.mark.parametrize("bundle", ["native", "dist3"])
@pytest.mark.parametrize("name", components())
def test_derivatives_equal_differences(request, tmp_path: Path, name: str, bundle: str):
    share = 0.4 if name in SENSORS else 0.9
    check(request.getfixturevalue(bundle) / f"{name}.fmu", tmp_path, share)


@pytest.mark.parametrize(
    "name", [*(name for name in components() if name not in (*OTHERS, LARGE)), *slow(LARGE)]
)
def test_derivatives_equal_casadis(native: Path, tmp_path: Path, name: str):
    """Another differentiation of the same text, at the start, with fresh samples."""
    ca = pytest.importorskip("casadi")
    made = casadi.model(name)
    u, p = ca.SX.sym("u", len(made.inputs)), ca.SX.sym("p", len(made.parameters))
    y = made.observe(made.start(u, p, 0.0), u, p, 0.0)
    both = ca.Function("both", [u, p], [ca.jacobian(y, ca.vertcat(u, p))])
    with instance(native / f"{name}.fmu", tmp_path) as it:
        it.begin()
        it.shake(random.Random(1), 0.3)
        inputs, parameters, outputs = (
            [it.variables[port] for port in ports]
            for ports in (made.inputs, made.parameters, made.outputs)
        )
        known, given = [*inputs, *parameters], it.get(inputs)
        for i, variable in enumerate(inputs):
            if variable.type == "Boolean":
                it.fmu.setBoolean([variable.valueReference], [True])
                given[i] = 1.0
        wanted = both(given, it.get(parameters)).full()
        reals = [i for i, output in enumerate(outputs) if output in it.unknowns]
        rows = [it.unknowns.index(outputs[i]) for i in reals]
        # CasADi has no noise, which its standard deviation changes.
        columns = [i for i, variable in enumerate(known) if variable.name != "noise.std"]
        found = it.jacobian(known)[rows]
    np.testing.assert_allclose(
        found[:, columns], wanted[np.ix_(reals, columns)], rtol=1e-10, atol=1e-13
    )


def test_derivatives_of_ports_and_states_of_all_types(tmp_path: Path):
    for fmi in ("2", "3"):
        fmu = build.native(tmp_path / f"native{fmi}", fmi).with_suffix(".fmu")
        check(fmu, tmp_path / fmi, share=0.4)


def test_functions_of_math_have_the_slopes_of_mpmath(made, tmp_path: Path):
    named = {
        "pow": mpmath.power,
        "log2": lambda x: mpmath.log(x, 2),
        # Near 0.7 and 1.9.
        "copysign": lambda x, y: x,
        "fmod": lambda x, y: x,
    }
    expressions, wanted = [], []
    for name in sorted(FUNCTIONS.keys() - ODD):
        at = AT.get(name, (0.7, 1.9)[: FUNCTIONS[name].arguments])
        # Inputs that are zero move all arguments at once.
        arguments = ", ".join(f"{value!r} + {k}" for value, k in zip(at, "xy", strict=False))
        expressions.append(f"{name}({arguments})")
        function = named.get(name) or getattr(mpmath, name)
        orders = [tuple(int(i == k) for i in range(len(at))) for k in range(len(at))]
        slopes = [float(mpmath.diff(function, at, order)) for order in orders]
        wanted.append([*slopes, 0.0][:2])
    found = jacobian_of(made(expressions, x=0.0, y=0.0), tmp_path)
    np.testing.assert_allclose(found, wanted, rtol=1e-13, atol=1e-15)


def test_operators_have_the_slopes_of_calculus(made, tmp_path: Path):
    """x = 0.7, y = 1.9."""
    x, y = 0.7, 1.9
    slopes = {
        "-x * y + x / y": (-y + 1.0 / y, -x - x / y**2),
        "x ** 3 - 2.0 ** 3": (3.0 * x**2, 0.0),
        "y ** -2": (0.0, -2.0 * y**-3),
        "x ** 0": (0.0, 0.0),
        "y % x": (-2.0, 1.0),
        "y // x + floor(x) + round(y)": (0.0, 0.0),
        "degrees(x) + radians(y)": (180.0 / math.pi, math.pi / 180.0),
        "abs(-x) + min(x, y) + max(x, y)": (2.0, 1.0),
        "x if x < y else y": (1.0, 0.0),
        "Vector((x, y)) @ Vector((y, 3.0 * y))": (y, x + 6.0 * y),
        "(Matrix(((x, y), (1.0, x))) @ Vector((y, x)))[0]": (2.0 * y, 2.0 * x),
        "float(int(y)) * x": (1.0, 0.0),
        "float(isfinite(x)) * y": (0.0, 1.0),
    }
    found = jacobian_of(made([*slopes]), tmp_path)
    np.testing.assert_allclose(found, [*slopes.values()], rtol=1e-14)


def test_at_a_kink_the_branch_of_the_value_counts(made, tmp_path: Path):
    kinks = {
        "min(x, 2.0 * y)": (1.0, 0.0),  # the first of equal values, as in Python
        "max(2.0 * y, x)": (0.0, 2.0),
        "x if x > y else 3.0 * y": (0.0, 3.0),
        "abs(x)": (1.0, 0.0),  # by the sign of zero
        "sqrt(x * x + y * y)": (0.0, 0.0),  # a constant under the root
    }
    found = jacobian_of(made([*kinks], x=0.0, y=0.0), tmp_path)
    np.testing.assert_array_equal(found, [*kinks.values()])


def test_an_infinite_derivative_is_discarded(made, tmp_path: Path):
    with instance(made(["sqrt(x)", "y"], x=0.0), tmp_path) as it:
        it.begin()
        x, y = it.having("input")
        with pytest.raises(FMICallException, match="status 2"):
            it.jacobian([x])
        # The instance continues, with derivatives that exist.
        np.testing.assert_array_equal(it.jacobian([y]), [[0.0], [1.0]])
        assert not it.fmu.getBoolean([it.variables["fault"].valueReference])[0]


def test_the_time_is_a_known_of_fmi3(made, tmp_path: Path):
    path = made(["x * sin(t)"], fmi="3", more=", t: float")
    with instance(path, tmp_path) as it:
        it.begin()
        it.fmu.exitInitializationMode()
        it.fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.5)
        found = it.jacobian([it.variables["time"], it.variables["x"]])
    np.testing.assert_allclose(found, [[0.7 * math.cos(0.5), math.sin(0.5)]], rtol=1e-15)


def test_adjoint_derivatives_are_the_rows_of_the_same_matrix(dist3: Path, tmp_path: Path):
    with instance(dist3 / "ObserverController.fmu", tmp_path) as it:
        it.begin()
        knowns = it.having("input", "parameter")
        np.testing.assert_array_equal(it.jacobian(knowns, adjoint=True), it.jacobian(knowns))


def test_seeds_of_several_knowns_add_up(dist3: Path, tmp_path: Path):
    with instance(dist3 / "PdController.fmu", tmp_path) as it:
        it.begin()
        knowns, outputs = it.having("input", "parameter"), it.having("output")
        seed = [*np.random.default_rng(1).normal(size=len(knowns))]
        references = [[v.valueReference for v in some] for some in (outputs, knowns)]
        found = it.fmu.getDirectionalDerivative(*references, seed)
        np.testing.assert_allclose(found, it.jacobian(knowns) @ seed, rtol=1e-12, atol=1e-12)


def test_arrays_are_serialised(tmp_path: Path):
    examples = Path(__file__).parents[2] / "examples"
    path = build_own(examples / "state_space", tmp_path / "fmu", kind=NATIVE, fmi="3", arrays=True)
    with instance(path, tmp_path / "it") as it:
        it.begin()
        y, D = (it.variables[name].valueReference for name in ("y", "D"))
        found = it.fmu.getDirectionalDerivative([y], [D], [*range(9)], nSensitivity=3)
    # u = (1, 2, 3)
    np.testing.assert_array_equal(found, np.arange(9.0).reshape(3, 3) @ [1.0, 2.0, 3.0])


def test_rates_that_are_refused_leave_the_outputs_their_derivatives(native: Path, tmp_path: Path):
    """The actuators of Remus100 have no rates without time constants."""
    with instance(native / "Remus100.fmu", tmp_path) as it:
        it.set(it.variables["fin.T"], 0.0)
        it.begin()
        give, known = it.fmu.getDirectionalDerivative, it.variables["eta0.x"].valueReference
        assert give([it.variables["eta.x"].valueReference], [known], [1.0]) == [1.0]
        with pytest.raises(FMICallException, match="status 3"):
            give([it.rates[0].valueReference], [known], [1.0])


def test_integers_and_booleans_have_the_derivative_0(native: Path, tmp_path: Path):
    """OMSimulator asks for everything that an output depends on."""
    with instance(native / "AuvPlant.fmu", tmp_path) as it:
        it.begin()
        seed, fault = it.variables["noise.seed"], it.variables["fault"]
        assert not it.jacobian([seed, it.variables["roll"]]).any()
        known = it.having("input")[0].valueReference
        give = it.fmu.getDirectionalDerivative
        assert give([fault.valueReference], [known], [1.0]) == [0.0]


def test_answers_in_all_modes(native: Path, tmp_path: Path):
    """A further get gives the same values."""
    with instance(native / "PdController.fmu", tmp_path) as it:
        [known, *_], outputs = it.having("input"), it.having("output")
        with pytest.raises(FMICallException, match="status 3"):
            it.jacobian([known])  # before the initialisation
        it.begin()
        before = it.get(outputs)
        assert it.jacobian([known]).any()
        np.testing.assert_array_equal(it.get(outputs), before)
        it.fmu.exitInitializationMode()
        assert it.jacobian([known]).any()
        output, this = outputs[0].valueReference, known.valueReference
        for references in (([output], [output]), ([this], [this])):
            with pytest.raises(FMICallException, match="status 3"):
                it.fmu.getDirectionalDerivative(*references, [1.0])
        give = it.fmu.dll.fmi2GetDirectionalDerivative
        n, some = c_size_t(1), (c_uint * 1)(this)
        it.fmu.terminate()
        assert it.jacobian([known]).any()
        # NULL leads to the state error, as everywhere.
        assert give(c_void_p(it.fmu.component), None, n, some, n, (c_double * 1)(1.0), None) == 3


def test_equations_with_large_arrays_are_not_differentiated(tmp_path: Path):
    """Dual numbers take twice the place, and a thread's stack is small."""
    text = """\
from typing import Annotated, NamedTuple
from auv_fmu import Variable, Vector


class Inputs(NamedTuple):
    x: Annotated[float, Variable("1", "x")]


class Outputs(NamedTuple):
    y: Annotated[float, Variable("1", "y")]


def outputs(inputs: Inputs) -> Outputs:
    many = Vector(inputs.x for _ in range({n}))
    return Outputs(many.sum())
"""
    for n, has in ((5_000, True), (12_000, False)):
        folder = tmp_path / str(n)
        folder.mkdir()
        (folder / "own.py").write_text(text.format(n=n))
        path = build_own(folder / "own.py", folder / "fmu", kind=NATIVE)
        stated = fmpy.read_model_description(str(path)).coSimulation.providesDirectionalDerivative
        assert stated is has


def test_the_python_kind_refuses(made, tmp_path: Path):
    path = made(["x"], kind=PYTHON)
    with instance(path, tmp_path) as it:
        it.begin()
        with pytest.raises(FMICallException, match="status 3"):
            it.jacobian(it.having("input"))
