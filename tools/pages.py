"""Fill in what the pages of docs/ take from the code, and write the schemas for editors.

`python tools/pages.py` writes each file anew that is not as it would be written; a test holds them
against it. Pages are written by hand except what stands between `<!-- filled: NAME -->` and
`<!-- / -->`, which this replaces; so are the pages of the components. `docs/schemas` is written whole.

`parts` has the long texts. The other tools compute what takes minutes: `page_numbers.py` prints the
numbers of many pages, and `printed_table.py` those of docs/explanation/table.md. `pictures.py`
draws the figures of studies and scenarios, and `reference.py` writes `reference`.
"""

from __future__ import annotations

import argparse
import json
import re
import textwrap
from collections.abc import Iterable, Mapping
from functools import cache
from math import cbrt, radians, sqrt, tan
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from auv_fmu.paper.control_point import ELL
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.saturation import MAXIMUM_SLOPE, Saturation
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.attraction import Theorem, ball, theorem
from auv_fmu.proof.gain_conditions import coupling
from fmus.discovery import components, source_of
from fmus.documentation import component_page
from fmus.language.mathematics import CONSTANTS, FUNCTIONS
from orchestrator.figures.run_figures import FIGURES
from orchestrator.figures.style import printed_unit
from orchestrator.machine.schema import TomlTable, entries
from orchestrator.paper.page import table
from orchestrator.runs.scenario import names, read_scenario
from orchestrator.runs.scenario_file import (
    CompareTable,
    EventTable,
    InputsTable,
    PathTable,
    ScenarioFile,
)
from orchestrator.runs.wiring import read_wiring
from orchestrator.studies.study import Study, ready_studies
from orchestrator.studies.study_file import FigureTable, StudyFile, read_study
from orchestrator.vehicle.indices import INDICES, Index
from orchestrator.vehicle.proof import stated
from parts.command_line import command_line
from parts.examples import examples
from parts.gallery import PICTURES, figures, gallery, picture, seen

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"

_PLACE = re.compile(r"(<!-- filled: (\w+) -->).*?(<!-- / -->)", re.DOTALL)


def files() -> dict[Path, str]:
    """The text of every file that this writes, as it is to be."""
    filled = {
        "explanation/paper.md": paper(),
        "explanation/language.md": {"mathematics": mathematics()},
        "gallery.md": gallery(),
        "reference/command-line.md": {"commands": command_line()},
        "reference/components/README.md": {"components": bundle()},
        "reference/examples.md": examples(),
        "explanation/ready-studies.md": {
            "studies": "\n\n".join(map(_section, map(read_study, ready_studies())))
        },
        "reference/scenario-files.md": scenarios(),
        "how-to/studies.md": {"ready": ready()},
        "reference/study-files.md": studies(),
    }
    return {
        **{DOCS / name: filled_in(DOCS / name, values) for name, values in filled.items()},
        **{page_of(name): component_page(source_of(name)) for name in components()},
        DOCS / "schemas" / "scenario.json": _json(ScenarioFile),
        DOCS / "schemas" / "study.json": _json(StudyFile),
    }


def page_of(component: str) -> Path:
    """The page of a component."""
    return ROOT.joinpath(*components()[component].split(".")[:-1], "page.md")


def filled_in(page: Path, values: Mapping[str, str]) -> str:
    """The text of a page with values in their places; values of several lines are paragraphs.

    Raises:
        ValueError: the page has no place for a value, or a place for none.

    """
    text = page.read_text(encoding="utf-8")
    places = {name for _, name, _ in _PLACE.findall(text)}
    if places != values.keys():
        raise ValueError(f"{page.name}: {', '.join(sorted(places ^ values.keys()))}")

    def filled(place: re.Match[str]) -> str:
        begin, name, end = place.groups()
        value = values[name]
        return f"{begin}\n\n{value}\n\n{end}" if "\n" in value else f"{begin}{value}{end}"

    return _PLACE.sub(filled, text)


def scenarios() -> dict[str, str]:
    """Tables of docs/reference/scenario-files.md."""
    wiring = read_wiring()
    drawn = {read_scenario(name).figure: name for name in sorted(names(), reverse=True)}
    figures = (
        f"`{kind}`" + (f" (as `{drawn[kind]}`)" if kind in drawn else "") for kind in FIGURES
    )
    fmus = (
        (f"`{name}`", _linked(fmu, fmu, "../..")) for name, fmu in wiring["components"].items()
    )
    wires = ((f"`{target}`", f"`{source}`") for target, source in wiring["wires"].items() if source)
    return {
        "entries": _entries(ScenarioFile),
        "compare": _entries(CompareTable),
        "path": _entries(PathTable),
        "events": _entries(EventTable),
        "inputs": _entries(InputsTable),
        "components": _table("component", "FMU", rows=fmus),
        "wires": _table("inputs", "are fed by", rows=wires),
        "figures": ", ".join(figures),
    }


def mathematics() -> str:
    """The functions and constants of docs/explanation/language.md."""
    *names, last = (f"`{name}`" for name in (*FUNCTIONS, *sorted(CONSTANTS)))
    return textwrap.fill(f"{', '.join(names)} and {last}.", 98)


def bundle() -> str:
    """The table of docs/reference/components/README.md."""
    rows = (
        (_linked(f"`{name}`", name, "../../.."), source_of(name).definition.summary)
        for name in components()
    )
    return _table("FMU", "what it is", rows=rows)


def _linked(text: str, component: str, root: str) -> str:
    """A link to the page of a component, from a folder with a relative path to the root."""
    return f"[{text}]({root}/{page_of(component).relative_to(ROOT).as_posix()})"


def ready() -> str:
    """The table of docs/how-to/studies.md."""
    studies = ((f"`{name}`", read_study(name).title) for name in ready_studies())
    return _table("`auv-fmu sweep`", "what it asks", rows=studies)


def studies() -> dict[str, str]:
    """Tables of docs/reference/study-files.md."""
    return {
        "entries": _entries(StudyFile),
        "figures": _entries(FigureTable),
        "indices": _table("index", "meaning", rows=map(_index, INDICES)),
    }


def _index(index: Index) -> tuple[str, str]:
    first, *rest = index.columns
    members = "".join(f" `{name.removeprefix(index.name)}`" for name in rest)
    unit = f" [{printed_unit(index.unit)}]" if index.unit else ""
    return f"`{first}`{members}", index.meaning.replace("|", r"\|") + unit


def _section(study: Study) -> str:
    pictures = (
        f"![{_words(study, figure)}](../{PICTURES}/{picture(study, figure)})"
        for figure in figures(study)
    )
    command = f"`auv-fmu sweep {study.name}`"
    return "\n\n".join([f"## {study.title}", command, *pictures, study.remark.strip()])


def _words(study: Study, figure: str) -> str:
    """What one sees on a figure, below the title of its study."""
    return seen(study, figure).removeprefix(f"{study.title}: ")


def _entries(schema: type[TomlTable]) -> str:
    rows = (
        (f"`{key}`", *(cell.replace("|", r"\|") for cell in declared))
        for key, declared in entries(schema).items()
    )
    return _table("entry", "value", "meaning", "without it", rows=rows)


def _table(*header: str, rows: Iterable[tuple[str, ...]]) -> str:
    return table(header, list(rows))


def _json(table: type[TomlTable]) -> str:
    """The JSON schema of a file, from which an editor completes and explains its entries."""
    schema = table.model_json_schema(schema_generator=_WithoutNull)
    for part in (schema, *schema.get("$defs", {}).values()):
        for declared in part.get("properties", {}).values():
            declared.pop("example", None)
            if declared.get("additionalProperties") is True:
                # Versions of pydantic differ in whether they say so.
                del declared["additionalProperties"]
            if default := declared.pop("without", ""):
                declared["description"] += f" Without it: {default}."
    schema = {"$schema": GenerateJsonSchema.schema_dialect, **schema}
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


class _WithoutNull(GenerateJsonSchema):
    """Leaves out defaults, of which TOML has none to write, and titles that repeat the key."""

    def default_schema(self, schema: Any) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


@cache
def of_the_paper() -> Theorem:
    """The theorem for section 4.1."""
    return theorem(Vehicle(), ELL, Gains(), MAXIMUM_SLOPE[Saturation.TANH])


def paper() -> dict[str, str]:
    """Numbers of docs/explanation/paper.md."""
    vehicle, found = Vehicle(), of_the_paper()
    k, there = coupling(vehicle, ELL), found.bounds.lambda_d2
    speed, power = found.speed_of_any_gains, found.alpha_1_of_any_gains
    turning = vehicle.m55 / ELL**3
    skew = (vehicle.m66 / ELL**2 - vehicle.m11) / ELL
    of_theta = found.bounds.lambda_M2
    slow = theorem(vehicle, ELL, Gains(lambda_=0.1), MAXIMUM_SLOPE[Saturation.TANH], 0.05)
    sigma = Gains().sigma
    return {
        "theorem": "```text\n" + "\n".join(stated(found)) + "\n```",
        "missing_force": f"{0.1 * turning * vehicle.m11 / vehicle.m33:.1f}",
        "skew_part": f"{0.2 * skew:.0f}",
        "power_of_p2_2": f"{-0.5 * vehicle.m66 / ELL**3:.0f}",
        "c_2_at_89_degrees": f"{turning * tan(radians(89.0)):,.0f}",
        "radius_factor": f"{sqrt(of_theta * Gains().gamma):.1f}",
        "lambda_d2": f"{there:g}",
        "zetas_when_slow": f"{slow.conditions[1].least:.1f}",
        "k_d_when_slow": f"{slow.conditions[2].least:.1f}",
        "x_when_slow": f"{slow.x_of_any_gains:.2f}",
        "zetas_of_any_gains": f"{found.zeta_of_any_gains:.1f}",
        "coupling": f"{k:.1f}",
        "quarter_of_the_coupling": f"{0.25 * k:.1f}",
        "largest_speed": f"{speed:.2f}",
        "largest_lambda": f"{2.0 * speed:.2f}",
        # With vanishing gains (31) asks for k / 4 < d11, and k falls with the cube of ell.
        "least_ell": f"{ELL * cbrt(found.zeta_of_any_gains / there):.2f}",
        "ball": f"{ball(0.0, 1.0, sigma):.1f}",
        "ball_of_theta": f"{ball(of_theta, 1.0, sigma):.0f}",
        "largest_alpha_1": f"{power:.3f}",
        "largest_eps_t": f"{power / 3.0:.2f}",
        "x_of_any_gains": f"{found.x_of_any_gains:.2f}",
        "x_at_most": f"{found.x_at_most:.2f}",
    }


def main() -> None:
    """Write the files that are not as they are to be."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for path, text in files().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            print(path)


if __name__ == "__main__":
    main()
