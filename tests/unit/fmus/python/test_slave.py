"""The slave of a component: one class, whose methods are what the behaviour says."""

from __future__ import annotations

from types import ModuleType

import pytest

from fmus.motion_planner import ports as of_a_planner
from fmus.observer_controller import behaviour, ports
from fmus.python.slave import slave_of


def test_instances_share_one_class_that_is_named_like_the_component():
    made = slave_of("ObserverController", ports, behaviour)
    assert slave_of("ObserverController", ports, behaviour) is made
    assert (made.__module__, made.__name__) == ("fmus.observer_controller", "ObserverController")


def test_ports_of_another_component_are_refused():
    with pytest.raises(TypeError, match="has the groups"):
        slave_of("Mixed", of_a_planner, behaviour)


def test_parameter_without_a_meaning_is_refused():
    more = ModuleType("more")
    vars(more).update(vars(ports))
    more.PORTS = (*ports.PORTS, next(p for p in of_a_planner.PORTS if p.name == "m11"))
    with pytest.raises(TypeError, match="Odd: not every parameter has a meaning, or a port"):
        slave_of("Odd", more, behaviour)
