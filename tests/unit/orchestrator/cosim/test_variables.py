"""Arrays are their elements, named as FMI's naming convention has it, and some are left alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestrator.cosim.component import Component, read_description
from orchestrator.cosim.variables import references_of
from orchestrator.machine.errors import InputError
from support.small_fmus import description_of_fmi3
from support.texts import mentions

_VARIABLES = """
<UInt64 name="n" valueReference="1" causality="structuralParameter" start="3"/>
<Float64 name="A" valueReference="2" causality="parameter" start="1 2 3 4 5 6">
  <Dimension start="2"/><Dimension valueReference="1"/></Float64>
<Float64 name="u" valueReference="3" causality="input" start="0.5"><Dimension valueReference="1"/>
</Float64>
<String name="s" valueReference="4" causality="parameter"><Dimension start="2"/>
  <Start value="a b"/><Start value=""/></String>
<UInt8 name="k" valueReference="5" causality="parameter" start="7" min="5" max="9"/>
<Binary name="b" valueReference="6" causality="input"><Start value="00"/></Binary>
<Clock name="c" valueReference="7" causality="input" intervalVariability="triggered"/>
<Int32 name="of_c" valueReference="8" causality="output" clocks="7"/>
<Float64 name="y" valueReference="9" causality="output"><Dimension start="2"/>
  <Alias name="z"/></Float64>
<Int8 name="none" valueReference="10" causality="input" start="1"><Dimension start="0"/></Int8>
"""


@pytest.fixture
def component(tmp_path: Path) -> Component:
    structure = '<Output valueReference="9" dependencies=""/><Output valueReference="8"/>'
    text = description_of_fmi3("it", _VARIABLES, structure, 'providesDirectionalDerivatives="true"')
    (tmp_path / "modelDescription.xml").write_text(text)
    return Component("a", tmp_path, read_description(tmp_path).description, "")


def test_elements_count_from_one_the_last_index_first(component):
    starts = {name: component.start(name) for name in component.variables if name[0] in "Ausk"}
    assert starts == {
        "A[1,1]": 1.0, "A[1,2]": 2.0, "A[1,3]": 3.0, "A[2,1]": 4.0, "A[2,2]": 5.0, "A[2,3]": 6.0,
        "u[1]": 0.5, "u[2]": 0.5, "u[3]": 0.5, "s[1]": "a b", "s[2]": "", "k": 7,
    }  # fmt: skip
    assert [variable.name for variable in component.arrays["A"]] == [*starts][:6]
    assert references_of(component.having("parameter")) == [2, 4, 5]
    assert not component.has_feedthrough("y[2]")
    assert component.gives_derivatives


@pytest.mark.parametrize(
    ("name", "words"),
    [("b", "Binary"), ("c", "Clock"), ("of_c", "Clock"), ("z", "y"), ("u", "u[1]"), ("u[4]", "u")],
)
def test_what_is_no_port_is_refused_by_name(component, name, words):
    with pytest.raises(InputError) as error:
        component.variable(name)
    assert mentions(str(error.value), f"a {name} {words}")


def test_sizes_are_not_set_and_ranges_hold(component):
    assert [*component.unsupported] == ["b", "c", "of_c", "none"]
    assert not component.is_settable("n") and component.is_settable("u[1]")
    assert (component.variable("k").min, component.variable("k").max) == ("5", "9")
