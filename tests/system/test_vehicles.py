"""Several vehicles in one system: each is measured and drawn as if it were alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.runs.wiring import read_wiring
from orchestrator.system.renaming import renamed
from orchestrator.system.structure import System
from orchestrator.vehicle.cautions import velocities_reaching
from orchestrator.vehicle.indices import INDICES, VEHICLES, index_columns
from orchestrator.vehicle.proof import certificates, gain_check
from orchestrator.vehicle.signals import STANDARD, Loop, loops_of

OTHER = Loop("tow", "pilot", "guide", "sea")
STOP = "6"

#: What the second vehicle has otherwise, by the name that its component has when it is alone.
CHANGES = {
    "plant.eta0.y": 2.0, "plant.noise.seed": 7, "controller.eps_t": 30.0, "planner.tau_d.u": 12.0,
    "disturbance.A_f": 20.0,
}  # fmt: skip

ROLES = dict(zip(vars(STANDARD).values(), vars(OTHER).values(), strict=True))


def of_other(name: str) -> str:
    """A port of the standard loop as the other loop has it."""
    component, port = name.split(".", 1)
    return f"{ROLES[component]}.{port}"


def scenario(path: Path, components: dict[str, str], wires: dict, values: dict) -> Path:
    lines = ['figure = "tracking"', 'title = "Two"', "[components]"]
    lines += [f'{name} = "{fmu}"' for name, fmu in components.items()]
    lines += ["[wires]", *(f'"{to}" = {json.dumps(source)}' for to, source in wires.items())]
    lines += ["[parameters]", *(f"{name} = {value}" for name, value in values.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Both together, and the second one alone."""
    folder, standard = tmp_path_factory.mktemp("vehicles"), read_wiring()
    components = {ROLES[name]: fmu for name, fmu in standard["components"].items()}
    wires = {
        of_other(to): source and of_other(source)
        for to, source in standard["wires"].items()
        if source
    }
    values = {of_other(name): value for name, value in CHANGES.items()}
    both = scenario(folder / "two.toml", components, wires, values)
    alone = scenario(folder / "one.toml", {}, {}, CHANGES)
    for name in (both, alone, "fig4"):
        out = str(folder / Path(name).stem)
        run = ["run", str(name), "--kind", "native", "--stop-time", STOP, "--out", out]
        assert main([*run, *(["--no-figures"] if name != both else [])]) == 0
    return folder


def test_loops_are_found_by_ports_and_wires(results):
    assert loops_of(load(results / "two.toml", "native")) == (STANDARD, OTHER)
    assert loops_of(load("fig5-pd", "native")) == (STANDARD,)
    # Alone, what it lacks has the standard name.
    assert loops_of(load("fig3a", "native")) == (STANDARD,)


def test_names_of_the_standard_loop_are_those_of_its_file():
    assert set(vars(STANDARD).values()) == set(read_wiring()["components"])


@pytest.mark.parametrize(("alone", "name"), [("fig4", "plant"), ("one", "tow")])
def test_each_vehicle_has_the_numbers_that_it_has_alone(results, alone, name):
    def values(folder):
        return json.loads((results / folder / "metrics.json").read_text())

    together, single = values("two"), values(alone)
    assert set(together[VEHICLES]) == {"plant", "tow"}
    assert not {index.name for index in INDICES} & set(together)
    found = together[VEHICLES][name]
    assert len(found) == 7 and found["velocities_reaching_controller"] == []
    assert {key: single[key] for key in found} == found
    certificates = "certificates.csv", f"certificates-{name}.csv"
    apart = (results / alone / certificates[0]).read_bytes()
    assert apart == (results / "two" / certificates[1]).read_bytes()


def inner(system: System) -> System:
    """The same with components named as in a nested system, of which several may have a plant."""
    return renamed(system, {name: f"auv1.{name}" for name in system.components})


def test_names_of_components_may_have_dots():
    flat_system = load("fig4", "native")
    system = inner(flat_system)
    [loop] = loops_of(system)
    assert vars(loop) == {role: f"auv1.{name}" for role, name in vars(STANDARD).items()}
    found, flat = (simulate(one, stop_time=1.0) for one in (system, flat_system))
    for key in ("l2_effort", "peak_command", "final_error", "velocities_reaching_controller"):
        assert found.metrics()[key] == flat.metrics()[key]
    assert (certificates(found, loop) == certificates(flat)).all()
    reaching = velocities_reaching(inner(load("fig5-pd", "native")), "auv1.controller")
    assert reaching == [f"auv1.plant.dy.{axis}" for axis in "xyz"]


def test_each_vehicle_is_drawn(results):
    names = {path.name for path in (results / "two").iterdir()}
    for name in ("plant", "tow"):
        figures = (
            f"two-{name}{part}.{kind}" for part in ("", "-velocity") for kind in ("png", "svg")
        )
        assert names.issuperset(figures)
    assert "two.png" not in names
    # What is drawn of one is not drawn of the other.
    assert (
        len({(results / "two" / f"two-{name}.png").read_bytes() for name in ("plant", "tow")}) == 2
    )


def test_each_vehicle_has_a_page(results, capsys):
    pytest.importorskip("plotly", reason="needs the extra `view`")
    assert main(["view", str(results / "two")]) == 0
    pages = [results / "two" / f"view-{name}.html" for name in ("plant", "tow")]
    assert capsys.readouterr().out.split() == list(map(str, pages))
    assert "Two, tow" in pages[1].read_text(encoding="utf-8")


def test_theorem_and_indices_are_said_of_each(results, capsys):
    text = gain_check(load(results / "two.toml", "native"))
    assert text.startswith("plant:\n") and "\ntow:\n" in text
    result = simulate(results / "two.toml", stop_time=1.0, kind="native")
    assert result.metrics()[VEHICLES].keys() == {"plant", "tow"}


def test_a_study_has_columns_of_each(results, tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    from orchestrator import sweep  # noqa: PLC0415

    study = {
        "scenario": str(results / "two.toml"), "stop_time": 2.0,
        "vary": {"pilot.eps_t": [10.0, 30.0]},
    }  # fmt: skip
    result = sweep(study, kind="native", out=tmp_path / "s", workers=1)
    columns = index_columns([STANDARD, OTHER])
    assert set(columns) <= set(result)
    assert len(set(result["plant.l2_effort.u"])) == 1
    assert len(set(result["tow.l2_effort.u"])) == 2
    assert np.isfinite(result["tow.late_error"]).all()
