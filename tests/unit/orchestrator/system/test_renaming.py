"""Other names for components change nothing else."""

from __future__ import annotations

from pathlib import Path

from orchestrator.system.component import read_component
from orchestrator.system.names import PortName
from orchestrator.system.renaming import flattened, renamed
from orchestrator.system.structure import Connection, System
from orchestrator.system.units import Linear
from support.archives import fmu, variable


def system_of(folder: Path, *names: str) -> System:
    ports = variable("u.x", "input"), variable("y", "output"), variable("k", "parameter")
    path = fmu(folder / "a.fmu", *ports)
    first, last = names[0], names[-1]
    return System(
        "s",
        {name: read_component(name, path) for name in names},
        (Connection(PortName(first, "y"), PortName(last, "u.x"), Linear(2.0)),),
        {PortName(last, "k"): 3.0},
        steps={first: 0.5},
        left_open={PortName(first, "u.x")},
    )


def test_all_that_names_a_component_has_its_new_name(tmp_path: Path):
    system = renamed(system_of(tmp_path, "a", "b", "c"), {"a": "v.a", "c": "a"})
    assert [(name, part.name) for name, part in system.components.items()] == [
        ("v.a", "v.a"), ("b", "b"), ("a", "a"),
    ]  # fmt: skip
    assert system.connections == (
        Connection(PortName("v.a", "y"), PortName("a", "u.x"), Linear(2.0)),
    )
    assert system.parameters == {PortName("a", "k"): 3.0}
    assert system.steps == {"v.a": 0.5}
    assert system.left_open == {PortName("v.a", "u.x")}
    assert system.parameters_of("a") == {"k": 3.0} and system.open_inputs("a") == []


def test_flat_names_are_distinct(tmp_path: Path):
    names = ["v.a", "v_a", "v.a_", "w", "v_.a", "v.b.c", "v.b_c"]
    system = flattened(system_of(tmp_path, *names))
    assert list(system.components) == ["v_a_", "v_a", "v_a__", "w", "v__a", "v_b_c", "v_b_c_"]
    flat = system_of(tmp_path, "a", "b_c")
    assert flattened(flat) is flat
