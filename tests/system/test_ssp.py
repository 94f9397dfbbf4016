"""Runs of SSP archives from other tools."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import write_ssp
from orchestrator.cosim.formats.ssp_writer import structure_xml
from orchestrator.machine.errors import InputError
from support.archives import (
    archive,
    binding,
    component,
    connection,
    connector,
    described,
    parameter_set,
    system,
)  # fmt: skip
from support.relay import relay
from support.relay import system_of as relays

#: When the run begins and ends, and its step [s].
START, STOP, STEP = 2.0, 4.0, 0.125

EXPERIMENT = (
    f'<ssd:DefaultExperiment startTime="{START}" stopTime="{STOP}"><ssd:Annotations>'
    '<ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm xmlns:osp="urn:osp">'
    f'<osp:FixedStepAlgorithm baseStepSize="{STEP}"/></osp:Algorithm></ssc:Annotation>'
    "</ssd:Annotations></ssd:DefaultExperiment>"
)


def nested(offset: float) -> str:
    """A value of 3 goes down into a system, as 2 * 3 + offset, and is integrated there.

    What a parameter set at the top gives to a connector of the inner system is subtracted from it.
    """
    inner = system(
        component("b") + component("c", bindings=binding({"a": 'Real value="10"'})),
        connection("u", "b.u") + connection("w", "b.v") + connection("b.y", "c.u")
        + connection("c.g", "y"),
        connector("u", "input") + connector("w", "input") + connector("y", "output"),
        name="inner",
    )  # fmt: skip
    return system(
        component("a", bindings=binding({"c": 'Real value="3"'})) + inner + component("d"),
        connection("a.g", "inner.u", f'<ssc:LinearTransformation factor="2" offset="{offset}"/>')
        + connection("inner.y", "d.u", '<ssc:LinearTransformation factor="-1"/>'),
        bindings=binding({"inner.w": 'Real value="4"'}),
    )  # fmt: skip


@pytest.fixture(scope="module")
def ssp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An archive with two variants; the second is not strictly valid."""
    folder = tmp_path_factory.mktemp("ssp")
    other = described(nested(5.0), after=EXPERIMENT).replace('name="test"', 'name="test" own="1"')
    files = {"a.fmu": relay(folder), "Other.ssd": other}
    return archive(folder / "nested.ssp", described(nested(1.0), after=EXPERIMENT), files)


@pytest.mark.parametrize(("order", "loop"), [("gauss-seidel", "compiled"), ("jacobi", "python")])
def test_nested_system_computes_what_it_says(ssp: Path, order: str, loop: str):
    """The integral of 2 * 3 + 1 - 4 is a ramp, which is exact in these steps."""
    result = simulate(ssp, order=order, loop=loop)
    ramp = (2.0 * 3.0 + 1.0 - 4.0) * (result.time - START)
    assert (result.time[0], result.time[-1], len(result.time)) == (START, STOP, 17)
    assert np.array_equal(result["inner.b.y"], ramp)
    gained, taken = result["inner.c.g"], result["d.u"]
    assert np.array_equal(gained[1:], 10.0 * ramp[:-1])
    # In Jacobi order outputs with feedthrough are passed on a step later.
    late = order == "jacobi"
    assert np.array_equal(taken[1 + late :], -gained[1 : len(gained) - late])


def test_nested_component_is_set_and_shown_by_its_dotted_name(ssp: Path, capsys, tmp_path: Path):
    out = tmp_path / "out"
    arguments = ["run", str(ssp), "--out", str(out), "--no-figures", "--columns", "inner.b.*"]
    assert main([*arguments, "--set", "inner.c.a=7", "--set", "d.c=-1"]) == 0
    header = (out / "result.csv").read_text().splitlines()[0]
    assert header == "time,inner.b.u,inner.b.v,inner.b.g,inner.b.y,inner.b.t,inner.b.h"
    assert simulate(ssp, {"inner.c.a": 7}).parameters["inner.c.a"] == 7.0
    assert main([*arguments, "--set", "inner.b.u=1"]) == 2
    assert "inner.b.u is fed by a.g" in capsys.readouterr().err


def test_variant_is_run_with_a_warning_or_refused_by_the_strict(ssp: Path, capsys, tmp_path: Path):
    arguments = ["run", str(ssp), "--out", str(tmp_path / "out"), "--no-figures"]
    assert main([*arguments, "--variant", "Other"]) == 0
    # There are also messages of the FMUs.
    [line] = [text for text in capsys.readouterr().err.splitlines() if ssp.name in text]
    assert "warning" in line and "'own'" in line
    assert main([*arguments, "--variant", "Other", "--strict"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "'own'" in line
    with pytest.warns(UserWarning, match="'own'"):
        result = simulate(ssp, variant="Other")
    assert result["inner.b.u"][-1] == 2.0 * 3.0 + 5.0
    with pytest.raises(InputError, match="'own'"):
        load(ssp, variant="Other", strict=True)


def test_a_system_that_offers_connectors_is_one_component(tmp_path: Path):
    """In fmpy and here, it integrates a value from outside and gives the result to the outside."""
    parts, fmu = ("in", "out"), relay(tmp_path)
    made = relays(dict.fromkeys(parts, fmu), {"out.u": "in.y"}, step=STEP, stop_time=STOP)
    made = made.renamed({name: f"inner.{name}" for name in parts})
    [path] = write_ssp(made, tmp_path, connectors=True)
    table = simulate_ssp(str(path), 0.0, STOP, STEP, input={"inner_in_u": lambda t: 5.0})
    assert np.array_equal(table["inner_in_y"], 5.0 * table["time"])
    given = f"<ssd:ParameterBindings>{binding(source='set.ssv')}</ssd:ParameterBindings>"
    text = structure_xml(made, connectors=True).decode()
    text = text.replace("<ssd:Elements>", f"{given}<ssd:Elements>", 1)
    values = parameter_set({"inner_in_u": 'Real value="5"'})
    files = {f"resources/{fmu.name}": fmu, "set.ssv": values}
    result = simulate(archive(tmp_path / "fed.ssp", text, files))
    assert np.array_equal(result["inner.in.y"], 5.0 * result.time)
