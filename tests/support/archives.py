"""SSP archives of FMUs that are only descriptions: what is read, and never run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from zipfile import ZipFile

from support import small_fmus

_NAMESPACES = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for prefix, name in (
        ("ssd", "Description"),
        ("ssc", "Common"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
        ("ssb", "SignalDictionary"),
    )
)

#: Units that FMUs and descriptions define: a length in three, and two of other things.
UNITS = {
    "m": 'm="1"',
    "mm": 'm="1" factor="0.001"',
    "km": 'm="1" factor="1000"',
    "K": 'K="1"',
    "degC": 'K="1" offset="273.15"',
}

#: An enumeration that FMUs and descriptions define.
ITEMS = {"slow": 2, "fast": 5}


def variable(name: str, causality: str, kind: str = "Real", unit: str = "", **more: str) -> str:
    """A variable of a description, without its value reference."""
    inside = f' unit="{unit}"' if unit else ""
    start = more.pop("start", "2" if kind == "Enumeration" else None)
    if kind == "Enumeration":
        inside += ' declaredType="Speed"'
    if causality == "output":
        start = "0" if start is None and more else start if more else None
    more.setdefault("variability", "fixed" if causality == "parameter" else "discrete")
    return small_fmus.variable(name, "{reference}", causality, kind, start, inside, **more)


def fmu(path: Path, *variables: str) -> Path:
    """An FMU that has these variables and no library."""
    bases = "".join(
        f'<Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in UNITS.items()
    )
    types = small_fmus.enumeration("Speed", ITEMS)
    text = small_fmus.description(
        "m",
        (text.replace("{reference}", str(i)) for i, text in enumerate(variables)),
        (
            small_fmus.unknown(i)
            for i, text in enumerate(variables, start=1)
            if 'causality="output"' in text
        ),
        attributes="",
        definitions=f"<UnitDefinitions>{bases}</UnitDefinitions>"
        f"<TypeDefinitions>{types}</TypeDefinitions>",
    )
    return small_fmus.write(path, text)


#: Variables of FMI 3.0: arrays, types of their own, and some that are not supported.
_FMI3 = """
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<UInt64 name="n" valueReference="1" causality="structuralParameter" start="3"/>
<Float64 name="u" valueReference="2" causality="input" start="0"><Dimension valueReference="1"/>
</Float64>
<Float64 name="y" valueReference="3" causality="output"><Dimension valueReference="1"/></Float64>
<Float64 name="A" valueReference="4" causality="parameter" variability="fixed" start="1 2 3 4">
  <Dimension start="2"/><Dimension start="2"/></Float64>
<String name="s" valueReference="5" causality="parameter" variability="fixed"><Dimension start="2"/>
  <Start value="a b"/><Start value=""/></String>
<Int32 name="k" valueReference="6" causality="parameter" variability="fixed" start="1"/>
<Float64 name="x" valueReference="7" causality="input" start="0"/>
<Float64 name="z" valueReference="8" causality="output"/>
<Int64 name="i" valueReference="9" causality="parameter" variability="fixed" start="1"/>
<Binary name="b" valueReference="10" causality="input"><Start value="00"/></Binary>
<Binary name="c" valueReference="11" causality="output"/>
<Clock name="t" valueReference="12" causality="input" intervalVariability="triggered"/>
<Float32 name="v" valueReference="13" causality="input" start="0"/>
"""


def fmu3(path: Path) -> Path:
    """An FMU of FMI 3.0 without a library."""
    outputs = "".join(f'<Output valueReference="{n}" dependencies=""/>' for n in (3, 8, 11))
    return small_fmus.write(path, small_fmus.description_of_fmi3("m3", _FMI3, outputs))


def described(system: str, version: str = "1.0", after: str = "") -> str:
    """A description of a system, with the units and the enumeration."""
    bases = "".join(
        f'<ssc:Unit name="{name}"><ssc:BaseUnit {base}/></ssc:Unit>' for name, base in UNITS.items()
    )
    items = "".join(f'<ssc:Item name="{name}" value="{value}"/>' for name, value in ITEMS.items())
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><ssd:SystemStructureDescription {_NAMESPACES} '
        f'version="{version}" name="test">{system}<ssd:Enumerations><ssc:Enumeration name="Speed">'
        f"{items}</ssc:Enumeration></ssd:Enumerations><ssd:Units>{bases}</ssd:Units>{after}"
        "</ssd:SystemStructureDescription>"
    )


def system(
    elements: str = "",
    connections: str = "",
    connectors: str = "",
    name: str = "top",
    bindings: str = "",
    more: str = "",
) -> str:
    """A system, at the top or in another."""
    parts = [
        f"<ssd:{tag}>{text}</ssd:{tag}>"
        for tag, text in (
            ("Connectors", connectors),
            ("ParameterBindings", bindings),
            ("Elements", elements),
            ("Connections", connections),
        )
        if text
    ]
    return f'<ssd:System name="{name}">{"".join(parts)}{more}</ssd:System>'


def connector(name: str, kind: str, unit: str = "", type_: str = "Real") -> str:
    """A connector."""
    stated = f' unit="{unit}"' if unit else ""
    if type_ == "Enumeration":
        stated = ' name="Speed"'
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{type_}{stated}/></ssd:Connector>'


def component(name: str, source: str = "a.fmu", bindings: str = "", **more: str) -> str:
    """A component with the connectors of its FMU."""
    inside = f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else ""
    attributes = "".join(f' {key}="{value}"' for key, value in more.items())
    return f'<ssd:Component name="{name}" source="{source}"{attributes}>{inside}</ssd:Component>'


def connection(start: str, end: str, inside: str = "", **more: str) -> str:
    """A connection; ends are `element.connector`, or `connector` of the system itself."""
    ends = ""
    for which, text in (("start", start), ("end", end)):
        element, dot, port = text.partition(".")
        ends += f' {which}Element="{element}"' if dot else ""
        ends += f' {which}Connector="{port if dot else element}"'
    ends += "".join(f' {key}="{value}"' for key, value in more.items())
    return f"<ssd:Connection{ends}>{inside}</ssd:Connection>"


def parameter_set(values: Mapping[str, str], version: str = "1.0") -> str:
    """A parameter set; a value is the inside of a parameter, such as `Real value="1"`."""
    parameters = "".join(
        f'<ssv:Parameter name="{name}"><ssv:{value}/></ssv:Parameter>'
        for name, value in values.items()
    )
    return (
        f'<ssv:ParameterSet {_NAMESPACES} version="{version}" name="set">'
        f"<ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet>"
    )


def mapping(*entries: str) -> str:
    """A mapping of entries such as `source="a" target="b"`, or these and what is inside them."""
    inside = "".join(
        f"<ssm:MappingEntry {attributes}>{transformation}</ssm:MappingEntry>"
        for attributes, _, transformation in (entry.partition("|") for entry in entries)
    )
    return f'<ssm:ParameterMapping {_NAMESPACES} version="1.0">{inside}</ssm:ParameterMapping>'


def binding(values: Mapping[str, str] | None = None, mapped: str = "", **more: str) -> str:
    """A binding, with its values inside it or in the file that it names as its source."""
    attributes = "".join(f' {key}="{value}"' for key, value in more.items())
    inside = ""
    if values is not None:
        inside = f"<ssd:ParameterValues>{parameter_set(values)}</ssd:ParameterValues>"
    if mapped:
        inside += f"<ssd:ParameterMapping>{mapped}</ssd:ParameterMapping>"
    return f"<ssd:ParameterBinding{attributes}>{inside}</ssd:ParameterBinding>"


def archive(path: Path, description: str, files: Mapping[str, str | Path]) -> Path:
    """An archive of a description and further files: texts, or files that are there."""
    with ZipFile(path, "w") as content:
        content.writestr("SystemStructure.ssd", description)
        for name, file in files.items():
            if isinstance(file, Path):
                content.write(file, name)
            else:
                content.writestr(name, file)
    return path
