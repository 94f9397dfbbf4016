"""Pages of the components, from their `page.md` and their declared ports.

Each FMU contains its page as HTML, together with sections that all FMUs share; `tools/pages.py`
writes the tables of ports into each `page.md`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from string import Template

from markdown_it import MarkdownIt

from auv_fmu.language.variable import POSITIVE
from fmus.discovery import FILLED, Source, related_files
from fmus.kinds import NATIVE, PYTHON
from fmus.ports.definition import Model
from fmus.ports.description import TYPES
from fmus.ports.port import FAULT, Port
from orchestrator.machine.mathematics import typeset

#: The icon of every component.
ICON = Path(__file__).with_name("icon.png")

_HTML = Path(__file__).with_name("page.html")

_REFUSALS = """\
## What is refused

The FMU answers with fmi2Discard if the host

- sets a value that is not finite, out of its range or not one of the choices;
- asks for a step whose size is negative or not finite, or whose result would not be finite.

None of the values of such a call is taken, and such a step changes nothing, not even the noise. The
run continues with the next good call. `fault` rises, and stays true until fmi2Reset, or until a
state without a fault is restored.

The FMU answers with fmi2Error if the host

- sets a parameter before the run to a value that cannot be taken, which also raises `fault`;
- sets an output, or a fixed parameter to a new value during the run;
- steps beyond a stop time that it has defined;
- makes a call in the wrong mode;
- uses a value reference that does not exist or is of another type;
- restores a state that no run can have led to.

From then on it answers every call except a get with fmi2Error, until fmi2Reset or a good state. A
refused get has no consequence. fmi2GetReal also gives the numbers of Integers and Booleans.

With logging off, the reason of an fmi2Error is logged, and no other. The complete table of calls,
states and bad arguments is in `docs/reference/fmi-answers.md` of the project."""

#: An index in a list of groups.
_PLACE = re.compile(r"\[\d+\]\.")

#: A link to another page of the project, which is not in the FMU.
_LINK = re.compile(r"\[([^]]+)\]\(\.\./\.\./(docs/[^)]+)\)")

#: The last part of a name with several parts.
_MEMBER = re.compile(r"(?:\.\w+|\[[\d,]+\])$")

_NATIVE = """\
## What it is made of

This FMU holds compiled libraries. It needs only the C library of its platform, not Python. The C
sources are in its folder `sources`. Any importer can compile them for another platform: one file
includes all others. Their equations were translated from the Python source that the FMU's Python
kind runs, so both kinds give the same numbers."""

_REFERENCE = """\
## Reference results

The folder `extra/org.fmi-standard.fmi-ls-ref` in the FMU holds experiments with only this FMU:
parameter sets, inputs over time, and the outputs to compare with. Its format follows the drafts
FMI-LS-REF and MA-HS-Experiments of the Modelica Association. The inputs of a step are set at its
beginning. `auv-fmu verify {name}.fmu` runs the experiments and compares the outputs."""

_EXAMPLE = """\
## Example

Run only this FMU for 10 s, with the inputs at zero:

```sh
fmpy simulate {name}.fmu --stop-time 10 --output-interval {step:g} --output-file result.csv
```

In Python:

```python
import fmpy


result = fmpy.simulate_fmu("{name}.fmu", stop_time=10.0, output_interval={step:g})
```

If the FMU has a parameter `h_max`, a longer step is split evenly, with held inputs."""


def component_page(source: Source) -> str:
    """Write the text of a component's `page.md`, with the tables of its ports.

    Sections that all components share are in docs/reference/components/README.md.
    """
    begin, end = FILLED
    return _joined(_parted(source.page, (begin, *_tables(source.definition.ports, {}), end)))


def page_of(model: Model, head: Sequence[str], fmi: str = "2", more: Sequence[str] = ()) -> str:
    """Write the page of a model in Markdown for its FMU.

    The ports come before the second heading of the first text in `head`, and `more` before the
    example.
    """
    refusals = _REFUSALS
    if fmi == "3":
        refusals = refusals.replace("fmi2GetReal", "fmi3GetFloat64").replace("fmi2", "fmi3")
    tables = _tables((*model.ports, FAULT), TYPES if fmi == "3" else {})
    experiment = model.experiment
    example = _EXAMPLE.format(name=model.name, step=experiment.step)
    first, *others = head
    return _joined((*_parted(first, tables), *others, refusals, *more, example))


def _joined(parts: Iterable[str]) -> str:
    return "\n\n".join(parts) + "\n"


def _parted(page: str, tables: Iterable[str]) -> Iterator[str]:
    """Yield the parts of a page, with the tables of ports before its second heading."""
    first, heading, rest = page.partition("\n\n## ")
    yield first
    yield from tables
    if heading:
        yield f"## {rest}"


def _tables(ports: Sequence[Port], types: Mapping[str, str]) -> Iterator[str]:
    """Yield the tables of inputs, outputs and parameters; `types` renames types."""
    for causality, heading in (
        ("input", "Inputs"),
        ("output", "Outputs"),
        ("parameter", "Parameters"),
    ):
        chosen = [port for port in ports if port.causality == causality]
        if not chosen:
            continue
        columns = ["name", "unit or type", "description"]
        if causality == "parameter":
            columns[2:2] = ["start", "range"]
        elif any(port.feedthrough for port in chosen):
            columns.append("direct feedthrough from")
        lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
        rows = (_row(ports, types)[: len(columns)] for ports in _alike(chosen))
        lines += ["| " + " | ".join(row) + " |" for row in rows]
        yield f"## {heading}\n\n" + "\n".join(lines)


def _alike(ports: Sequence[Port]) -> Iterable[list[list[Port]]]:
    """Group ports into rows: members of a group, such as `y.x` and `y.y`, that differ in no cell.

    Each member is a list of ports, such as `waypoint[1].x` to `waypoint[9].x`, most often of one.
    """
    rows: dict[object, dict[str, list[Port]]] = {}
    for port in ports:
        listed = _PLACE.sub("[].", port.name)
        key = (_MEMBER.sub("", listed), port.type, port.variability, _described(port),
               _range(port), _groups(port))  # fmt: skip
        rows.setdefault(key, {}).setdefault(listed, []).append(port)
    return ([*members.values()] for members in rows.values())


def _described(port: Port) -> str:
    """Return the description without the name of a member at its end."""
    match = _MEMBER.search(port.name)
    end = f": {match[0].strip('.[]')}" if match else ""
    return port.description.removesuffix(end).replace("|", r"\|")


def _groups(port: Port) -> str:
    """Return the groups of inputs with direct feedthrough to an output."""
    groups = dict.fromkeys(name.split(".")[0] for name in port.feedthrough)
    return ", ".join(f"`{group}`" for group in groups)


def _row(members: Sequence[Sequence[Port]], types: Mapping[str, str]) -> list[str]:
    port = members[0][0]
    cells = [_names([member[0] for member in members])]
    if len(members[0]) > 1:
        cells[0] += f" to {_names([member[-1] for member in members])}"
    units = dict.fromkeys(member[0].unit or types.get(port.type, port.type) for member in members)
    cells.append(", ".join(units))
    description = _described(port)
    if port.causality != "parameter":
        return [*cells, description, _groups(port)]
    starts = [_starts(member) for member in members]
    if len({*starts}) == 1:
        starts = starts[:1]
    tunable = "; tunable" if port.variability == "tunable" else ""
    between = "; " if len(members[0]) > 1 else ", "
    return [*cells, between.join(starts), _range(port), f"{description}{tunable}"]


def _names(ports: Sequence[Port]) -> str:
    """Return the name of the first port, and the last parts of the others' names."""
    first, *others = (port.name for port in ports)
    ends = (match[0] for match in map(_MEMBER.search, others) if match)
    return f"`{' '.join((first, *ends))}`"


def _starts(ports: Sequence[Port]) -> str:
    starts = [_start(port) for port in ports]
    while len(starts) > 1 and starts[-1] == starts[-2]:
        starts.pop()
    return ", ".join(starts)


def _start(port: Port) -> str:
    for name, number in port.choices.items():
        if number == port.start:
            return name
    return f"{port.start:g}" if isinstance(port.start, float) else str(port.start).lower()


def _range(port: Port) -> str:
    if port.choices:
        return ", ".join(f"{number:d} {text}" for text, number in port.choices.items())
    lower = upper = ""
    if port.minimum is not None:
        lower = "> 0" if port.minimum == POSITIVE else f"≥ {port.minimum:g}"
    if port.maximum is not None:
        upper = "< 0" if port.maximum == -POSITIVE else f"≤ {port.maximum:g}"
    return " ".join(filter(None, (lower, upper)))


def fmu_documents(source: Source, kind: str = PYTHON, fmi: str = "2") -> dict[str, bytes]:
    """Return the documentation and reference results of an FMU, by their paths in it."""
    related, reference = related_files(source), _REFERENCE.format(name=source.name)
    head = [_LINK.sub(r"\1 (`\2` of the project)", source.page)]
    head += [_NATIVE] if kind == NATIVE else []
    page = page_of(source.definition, head, fmi, [reference] if related else ())
    html = html_of(source.name, page, source.definition.origin.citation)
    documents = {"documentation/index.html": html.encode()}
    if related:
        documents["documentation/fmi-ls-ref.txt"] = f"{reference}\n".encode()
    return documents | related


def html_of(title: str, page: str, citation: str = "") -> str:
    """Render a page in Markdown as one HTML file."""
    body = typeset(MarkdownIt("commonmark").enable("table").render(page))
    body = body.replace("<table>", '<div class="table" tabindex="0"><table>')
    body = body.replace("</table>", "</table></div>")
    return Template(_HTML.read_text(encoding="utf-8")).substitute(
        title=title, citation=citation, body=body
    )
