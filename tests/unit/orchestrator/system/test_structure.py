"""A system finds its ports by their names, however many dots these have."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.system.component import read_component
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System
from support.archives import fmu, variable


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    folder: Path = tmp_path_factory.mktemp("fmus")
    path = fmu(
        folder / "a.fmu", variable("k", "parameter"), variable("p.q", "parameter"),
        variable("y", "output"),
    )  # fmt: skip
    return System("s", {name: read_component(name, path) for name in ("a", "a.b", "c d")}, ())


@pytest.mark.parametrize(
    ("text", "port"),
    [
        ("a.k", ("a", "k")),
        ("a.b.k", ("a.b", "k")),
        ("a.p.q", ("a", "p.q")),
        ("a.b.p.q", ("a.b", "p.q")),
        ("c d.p.q", ("c d", "p.q")),
    ],
)
def test_name_belongs_to_the_longest_component_that_has_such_a_port(system, text, port):
    assert system.named(port_name(text)) == PortName(*port)
    assert system.has(port_name(text))
    changed = system.with_parameters({port_name(text): 3})
    assert changed.parameters == {PortName(*port): 3.0}
    assert changed.value(port_name(text)) == 3.0
    changed.check()


def test_two_ports_of_one_name_are_refused(system, tmp_path: Path):
    fmu(tmp_path / "q.fmu", variable("q", "parameter"))
    again = System("s", {**system.components, "a.p": read_component("a.p", tmp_path / "q.fmu")}, ())
    with pytest.raises(InputError, match=r"two ports are named a\.p\.q"):
        again.check()


def test_name_of_no_port_is_refused(system):
    assert not system.has(port_name("a.b.x"))
    with pytest.raises(InputError, match=r"a has no port or parameter 'b\.x'"):
        system.with_parameters({port_name("a.b.x"): 1})


def test_output_that_is_calculated_cannot_be_set(system):
    with pytest.raises(InputError, match=r"a\.y is of causality output and cannot be set"):
        system.with_parameters({port_name("a.y"): 1.0}).check()
