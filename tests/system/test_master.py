"""The master itself: checks before a run, order, time, and what is left after a failure."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import threading
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd
from fmpy.util import read_csv

from orchestrator.errors import InputError
from orchestrator.experiments import bundle
from orchestrator.master.simulation import simulate, stages
from orchestrator.system.ssp import read_ssp, ssp_bytes
from orchestrator.system.structure import Connection, PortName, System, read_component


def port(text: str) -> PortName:
    return PortName(*text.split(".", 1))


@pytest.fixture(scope="module")
def system(dist: Path) -> System:
    return bundle.closed_loop(dist)


def with_connection(system: System, source: str, target: str) -> System:
    """The system with one more connection, in place of the one that feeds the target."""
    kept = tuple(c for c in system.connections if c.target != port(target))
    return replace(system, connections=(*kept, Connection(port(source), port(target))))


def test_gauss_seidel_order_follows_the_declared_feedthrough(system: System):
    assert stages(system, "gauss-seidel") == [["controller", "disturbance", "planner"], ["plant"]]
    assert stages(system, "jacobi") == [["plant", "controller", "disturbance", "planner"]]


def test_feedthrough_in_a_loop_is_named(system: System):
    looped = with_connection(system, "plant.tau_applied.u", "controller.y.x")
    with pytest.raises(InputError, match="loop"):
        stages(looped, "gauss-seidel")


@pytest.mark.parametrize(
    ("source", "target", "reason"),
    [
        ("plant.y.w", "controller.y.x", "no port or parameter 'y.w'; did you mean"),
        ("plante.y.x", "controller.y.x", "no component 'plante'; it has plant, controller"),
        ("plant.y.x", "controller.yx", "no port or parameter 'yx'"),
        ("plant.tau.u", "controller.y.x", "plant.tau.u is a input, not an output"),
        ("plant.y.x", "controller.e.x", "controller.e.x is a output, not an input"),
        ("plant.fault", "controller.y.x", "cannot feed Boolean into Real"),
        ("plant.nu.u", "controller.y.x", "units differ, m/s and m"),
    ],
)
def test_connection_that_does_not_fit_is_refused(system, source, target, reason):
    with pytest.raises(InputError, match=reason.replace("?", r"\?")):
        simulate(with_connection(system, source, target), 1.0, 0.02)


def test_input_with_two_sources_is_refused(system: System):
    twice = replace(system, connections=(*system.connections, system.connections[0]))
    with pytest.raises(InputError, match="one connection"):
        simulate(twice, 1.0, 0.02)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("plant.m1", 1, "did you mean m11"),
        ("plant.m11", "heavy", "not a Real"),
        ("plant.m11", -1, "m11 = -1: must be at least"),
        ("plant.m11", "nan", "must be finite"),
        ("plant.noise.seed", 1.5, "not a Integer"),
        ("controller.printed_jacobian", "perhaps", "not a Boolean"),
        ("controller.saturation", "sigmoid", "use one of tanh, algebraic"),
        ("plant.tau_min.q", 0.0, None),
        ("plant.y.x", 1, "is a output and cannot be set"),
        ("plant.tau.u", 1, "is fed by controller.tau.u"),
        ("pilot.mood", 1, "no component 'pilot'"),
    ],
)
def test_wrong_parameter_is_refused_in_one_line(system, name, value, reason):
    changed = system.with_parameters({port(name): value})
    if reason is None:
        changed = changed.with_parameters({port("plant.tau_max.q"): 0.0})
        reason = "must be below tau_max.q"
    with pytest.raises(InputError, match=reason) as error:
        simulate(changed, 1.0, 0.02)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("experiment", [(0.0, 0.02), (-1.0, 0.02), (1.0, 0.0), (float("nan"), 1.0)])
def test_impossible_experiment_is_refused(system, experiment):
    with pytest.raises(InputError, match="must be positive"):
        simulate(system, *experiment)


def test_time_is_computed_and_the_last_step_ends_at_the_stop_time(system: System):
    result = simulate(system, 1.0, 0.03)
    assert np.array_equal(result.times[:-1], np.arange(34) * 0.03)
    assert result.times[-1] == 1.0
    assert len(simulate(system, 0.3, 0.1).times) == 4


def test_an_open_component_runs_with_inputs_that_were_set(system: System):
    """One FMU, no connections: 10 N against 30 kg/s settle at 1/3 m/s."""
    alone = replace(system, components={"plant": system.components["plant"]}, connections=())
    result = simulate(alone.with_parameters({port("plant.tau.u"): 10.0}), 20.0, 0.02)
    assert result["plant.nu.u"][-1] == pytest.approx(1 / 3, rel=1e-9)
    assert (result["plant.tau.u"] == 10.0).all()


def test_failure_keeps_the_rows_before_it_and_says_why(system: System):
    """h d11 / m11 = 8: Euler's scheme multiplies the surge velocity by -7 in every step."""
    broken = system.with_parameters({port("plant.d11"): 1e4})
    result = simulate(broken, 100.0, 0.02)
    assert result.failure is not None
    assert "stopped at t =" in result.failure
    assert "refused" in result.failure
    assert 10 < result.computed < 5001
    assert np.isfinite(result.rows[: result.computed]).all()


def test_interrupt_keeps_the_rows_and_does_not_reach_the_fmus(system: System):
    """Ctrl-C after half a second of a run that would take minutes."""
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    result = simulate(system, 1e4, 0.02)
    assert result.failure is not None
    assert "interrupted at t =" in result.failure
    assert result.computed > 100
    assert np.isfinite(result.rows[: result.computed]).all()


def test_nothing_is_left_in_the_temporary_folder(system, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    simulate(system, 0.1, 0.02)
    with pytest.raises(InputError):
        simulate(system.with_parameters({port("plant.m11"): -1.0}), 0.1, 0.02)
    assert simulate(system.with_parameters({port("plant.d11"): 1e4}), 50.0, 0.02).failure
    assert list(tmp_path.iterdir()) == []


def test_temporary_folder_that_would_crash_the_fmu_is_refused(system, tmp_path, monkeypatch):
    folder = tmp_path / "größe"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    with pytest.raises(InputError, match="TMPDIR"):
        simulate(system, 0.1, 0.02)


def test_broken_and_missing_fmus_are_refused(tmp_path: Path, dist: Path):
    with pytest.raises(InputError, match="no such FMU"):
        read_component("plant", tmp_path / "missing.fmu")
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"not a zip")
    with pytest.raises(InputError, match="not a readable FMU"):
        read_component("plant", broken)
    hollow = tmp_path / "hollow.fmu"
    with zipfile.ZipFile(dist / "AuvPlant.fmu") as full, zipfile.ZipFile(hollow, "w") as archive:
        archive.writestr("modelDescription.xml", full.read("modelDescription.xml"))
    alone = System("alone", {"plant": read_component("plant", hollow)}, ())
    with pytest.raises(InputError, match="cannot be loaded"):
        simulate(alone, 1.0, 0.02)


def test_ssp_holds_the_system_it_was_made_from(system, dist, tmp_path):
    """Also valid against the schema: fmpy's reader checks it."""
    read_ssd(str(dist / "auv.ssp"))
    again = read_ssp(dist / "auv.ssp", tmp_path)
    assert set(again.connections) == set(system.connections)
    assert list(again.components) == list(system.components)
    assert (again.stop_time, again.step) == (100.0, 0.02)
    assert ssp_bytes(system) == (dist / "auv.ssp").read_bytes()


def test_ssp_with_parameters_and_a_swapped_component_runs(dist: Path, tmp_path: Path):
    """What a user does: edit the structure, add a parameter set, zip it again."""
    with zipfile.ZipFile(dist / "auv.ssp") as archive:
        archive.extractall(tmp_path / "edited")
    structure = tmp_path / "edited" / "SystemStructure.ssd"
    shutil.move(
        tmp_path / "edited/resources/MotionPlanner.fmu", tmp_path / "edited/resources/Mine.fmu"
    )
    (tmp_path / "edited" / "quiet.ssv").write_text(
        '<?xml version="1.0"?><ssv:ParameterSet version="1.0" name="mine" '
        'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"><ssv:Parameters>'
        '<ssv:Parameter name="noise.std"><ssv:Real value="0.0"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet>"
    )
    text = structure.read_text().replace("resources/MotionPlanner.fmu", "resources/Mine.fmu")
    end = text.index("</ssd:Component>")
    structure.write_text(
        text[:end]
        + '<ssd:ParameterBindings><ssd:ParameterBinding source="quiet.ssv"/>'
        + "</ssd:ParameterBindings>"
        + text[end:]
    )
    mine = tmp_path / "mine.ssp"
    with zipfile.ZipFile(mine, "w") as archive:
        for path in (tmp_path / "edited").rglob("*"):
            archive.write(path, path.relative_to(tmp_path / "edited"))
    mine_system = read_ssp(mine, tmp_path / "unpacked")
    assert mine_system.parameters == {port("plant.noise.std"): "0.0"}
    result = simulate(mine_system, 1.0, 0.02)
    assert result.parameters[port("plant.noise.std")] == 0.0
    assert result.failure is None


def test_csv_opens_in_the_reader_of_fmpy_and_loses_no_digit(system, tmp_path):
    result = simulate(system, 1.0, 0.02)
    result.write_csv(tmp_path / "result.csv")
    table = read_csv(tmp_path / "result.csv")
    assert table.dtype.names == ("time", *result.columns)
    assert np.array_equal(table["time"], result.time)
    for name in result.columns:
        assert np.array_equal(table[name], result[name])
