"""Fill in the parts of pages that come from the code, and write schemas and codemeta.json.

`python tools/pages.py` rewrites every file that is out of date; a test fails while there is one.
Pages are written by hand, except the parts between `<!-- filled: NAME -->` and `<!-- / -->`.
`docs/schemas`, for editors, and `codemeta.json`, for archives, are generated as a whole.

Numbers that take minutes to compute are printed by other tools: `page_numbers.py` for many pages,
`printed_table.py` for docs/explanation/table.md. `pictures.py` draws the figures of studies and
scenarios, and `reference.py` writes `reference`.
"""

from __future__ import annotations

import argparse
import ast
import csv
import json
import re
import textwrap
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import cbrt, radians, sqrt, tan
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from auv_fmu import __citation__, __version__
from auv_fmu.paper.control_point import ELL
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.saturation import MAXIMUM_SLOPE, Saturation
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.attraction import ball, theorem
from auv_fmu.proof.gain_conditions import coupling
from fmus.discovery import FILLED, components, source_of
from fmus.documentation import component_page
from fmus.language.mathematics import CONSTANTS, FUNCTIONS
from fmus.ports.definition import Definition
from fmus.ports.description import local_in
from orchestrator.commands.main import COMMANDS, parser
from orchestrator.figures.run_figures import FIGURES, FLEET
from orchestrator.figures.study_values import Values
from orchestrator.figures.style import printed_unit
from orchestrator.machine.schema import TomlTable, entries
from orchestrator.machine.texts import flatten
from orchestrator.paper.page import table
from orchestrator.program.components import definition_in
from orchestrator.runs.scenario import Scenario, names, read_scenario
from orchestrator.runs.scenario_file import (
    CompareTable,
    EventTable,
    InputsTable,
    PathTable,
    ScenarioFile,
)
from orchestrator.runs.wiring import read_wiring
from orchestrator.studies.study import (
    LABELS,
    FigureTable,
    Study,
    StudyFile,
    read_study,
    ready_studies,
)
from orchestrator.vehicle.indices import INDICES, Index
from orchestrator.vehicle.proof import stated

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
EXAMPLES = ROOT / "examples"

#: Folder of the pictures in docs/; pictures of studies are in its subfolder `studies`.
PICTURES = "images"

#: Folder in it of the small pictures of the gallery, and the figure of each study there.
SMALL = "small"
SMALL_STUDIES = {
    "gains": "front-peak",
    "robustness": "error",
    "noise": "saturation",
    "attraction": "place",
    "sampling": "observer",
    "formation": "messages",
    "distance": "commands",
    "velocity": "worth",
}

#: Scenarios that come first in the gallery, the best first.
_BEST = (
    *("fig5", "formation-lost-link", "remus", "bluerov", "sea", "formation-v", "fig4"),
    *("fault-sensor", "path", "los-remus", "los", "current-step", "formation-change", "fig6"),
    *("fault-thruster", "fig7a", "fig7b", "fig7c"),
)

#: End of the titles of scenarios with two controllers, which the gallery leaves out.
_BOTH = ": proposed and PD controller"

_PLACE = re.compile(r"(<!-- filled: (\w+) -->).*?(<!-- / -->)", re.DOTALL)

#: Examples in docs/reference/examples.md by group, and the parts of the language that each shows.
_GROUPS = {
    "controllers": {
        "lqr": "sampled, no state, `derive` of parameters",
        "pid": "sampled, tunable parameters, `check`",
        "waypoint_guidance": "matrix as parameter, `derive`, internal steps",
    },
    "laws": {
        "backstepping": "sampled, a shared function, `derive`",
        "learned_law": "matrices as parameters, `tanh`, no state",
        "mrac": "sampled, matrix as state, a state as rate",
        "pd_plus": "sampled, no state, groups of parameters",
        "pid_law": "sampled, filter memory, `derive`",
        "predictive": "sampled, optimisation, slices, `break`",
        "super_twisting": "sampled, `copysign`, a name for a type",
    },
    "estimators": {
        "complementary_filter": "`atan2`, several inputs, exact step",
        "extended_kalman_filter": "sampled, `solve`, refusal, `replaced`",
        "kalman_filter": "sampled, matrices as state, `derive`",
        "luenberger_observer": "vectors, Runge-Kutta, internal steps",
        "notch_filter": "sampled, filter memory, sampling period",
    },
    "plants": {
        "battery": "`interpolate`, `derive`, `feedthrough=()`",
        "cart_pendulum": "`solve`, Runge-Kutta, internal steps",
        "dc_motor": "vectors, Runge-Kutta, internal steps",
        "engine_map": "`interpolate`, `derive`, `feedthrough`",
        "lag_with_delay": "delay line, noise, `seed`",
        "quarter_car": "`solve`, `derive` of parameters, implicit rule",
        "rate_limiter": "`min` and `max`, tunable parameters, hysteresis",
        "water_tank": "`derive`, internal steps, Boolean output",
    },
    "logic": {
        "state_machine": "`IntEnum`, `_replace`, Boolean input",
        "thermostat": "`IntEnum` as parameter, counter, exact step",
    },
    "pythonfmu": {
        "resistor": "no state, feedthrough, tunable parameter",
        "sine_network": "constant matrix, `tanh`, no state",
        "step_response": "no state, use of `t`, formula",
    },
    "reference_fmus": {
        "bouncing_ball": "events, Boolean state, internal steps",
        "dahlquist": "internal steps, stability, exact solution",
        "stair": "Integer output, `while`, use of `t`",
        "state_space": "matrices as parameters, vector ports, internal steps",
        "van_der_pol": "internal steps, tunable parameter, Euler's rule",
    },
}

#: Contents of the pictures of scenarios, by kind of figure.
_SEEN = {
    "tracking": "path, tracking errors, commands and estimated parameters",
    "comparison": "both paths, commands and tracking errors",
    FLEET: "paths, tracking errors and distances of all vehicles",
    "comparison-errors": "tracking errors of both controllers",
    "open-loop-surge": "path, surge velocity and acceleration",
    "open-loop-turn": "path, velocities and accelerations",
}


def files() -> dict[Path, str]:
    """Texts of all files, by path."""
    filled = {
        "explanation/paper.md": paper(),
        "explanation/language.md": {"mathematics": mathematics()},
        "gallery.md": gallery(),
        "reference/command-line.md": command_line(),
        "reference/compatibility.md": {"checkers": compatibility()},
        "reference/components/README.md": {"components": bundle()},
        "reference/derivatives.md": {"components": differentiated()},
        "reference/examples.md": examples(),
        "explanation/ready-studies.md": {
            "studies": "\n\n".join(map(_section, map(read_study, ready_studies())))
        },
        "reference/scenario-files.md": scenarios(),
        "reference/study-files.md": studies(),
    }
    return {
        **{DOCS / name: filled_in(DOCS / name, values) for name, values in filled.items()},
        **component_pages(),
        DOCS / "schemas" / "scenario.json": _json(ScenarioFile),
        DOCS / "schemas" / "study.json": _json(StudyFile),
        ROOT / "codemeta.json": codemeta(),
    }


def compatibility() -> str:
    """Table of the checkers' results, with a row for each FMU of the bundle."""
    with (DOCS / "reference" / "compatibility.csv").open(encoding="utf-8", newline="") as file:
        lines = [*csv.DictReader(file)]
    found = defaultdict[str, defaultdict[str, dict[str, str]]](lambda: defaultdict(dict))
    for line in lines:
        checker, form = f"{line['checker']} {line['version']}", f"{line['kind']} {line['fmi']}"
        found[line["fmu"]][checker][form] = line["result"]
    rows = [[fmu, *map(_common, checkers.values())] for fmu, checkers in found.items()]
    return table(["FMU", *next(iter(found.values()))], rows)


def _common(results: Mapping[str, str]) -> str:
    """Return the result of all forms of an FMU, the largest of numbers, or each result."""
    if len(different := {*results.values()}) == 1:
        return different.pop()
    try:
        return max(different, key=float)
    except ValueError:
        return "; ".join(f"{form}: {result}" for form, result in results.items())


def page_of(component: str) -> Path:
    """Page of a component."""
    return ROOT.joinpath(*components()[component].split(".")[:-1], "page.md")


def component_pages() -> dict[Path, str]:
    """Pages of the components, on which parameters that another page has are only named."""
    first = ("AuvPlant", "ObserverController", "Remus100")
    pages, owners = {}, dict[str, str]()
    for name in sorted(components(), key=lambda name: (name not in first, name)):
        lines, shared = [], defaultdict[str, list[str]](list)
        for line in component_page(source_of(name)).splitlines():
            # Only the rows of parameters have five cells.
            if (
                line.startswith("| `")
                and line.count(" | ") == 4
                and owners.setdefault(line, name) != name
            ):
                shared[owners[line]].append(line.split(" | ")[0].removeprefix("| "))
                continue
            if line == FILLED[1]:
                for other, same in shared.items():
                    link = _linked(other, other, "../..")
                    lines.append(f"As in {link}, with the same start values: {', '.join(same)}.\n")
            lines.append(line)
        pages[page_of(name)] = "\n".join(lines) + "\n"
    return pages


def codemeta() -> str:
    """Metadata of the project, from pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    [paper_title] = re.findall(r'"(.+)"', __citation__)
    software = {
        "@context": "https://w3id.org/codemeta/3.0",
        "@type": "SoftwareSourceCode",
        **{name: project[name] for name in ("name", "description", "keywords")},
        "version": __version__,
        "license": f"https://spdx.org/licenses/{project['license']}",
        "author": [{"@type": "Organization", **author} for author in project["authors"]],
        "programmingLanguage": ["Python", "C", "TypeScript"],
        "operatingSystem": "Linux",
        "runtimePlatform": f"Python {project['requires-python']}",
        "softwareRequirements": project["dependencies"],
        "referencePublication": {"@type": "ScholarlyArticle", "name": paper_title},
    }
    return json.dumps(software, indent=2) + "\n"


def filled_in(page: Path, values: Mapping[str, str]) -> str:
    """Text of a page with its parts filled in; values of several lines become paragraphs.

    Raises:
        ValueError: the page has no part for a value, or no value for a part.

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
    """Parts of docs/reference/scenario-files.md."""
    wiring = read_wiring()
    drawn = {read_scenario(name).figure: name for name in sorted(names(), reverse=True)}
    figures = (
        f"`{kind}`" + (f" (as `{drawn[kind]}`)" if kind in drawn else "") for kind in FIGURES
    )
    fmus = ((f"`{name}`", _linked(fmu, fmu, "../..")) for name, fmu in wiring["components"].items())
    wires = ((f"`{target}`", f"`{source}`") for target, source in wiring["wires"].items() if source)
    return {
        "entries": _entries(ScenarioFile),
        "compare": _entries(CompareTable),
        "path": _entries(PathTable),
        "events": _entries(EventTable),
        "inputs": _entries(InputsTable),
        "components": table(("component", "FMU"), [*fmus]),
        "wires": table(("inputs", "are fed by"), [*wires]),
        "figures": ", ".join(figures),
    }


def mathematics() -> str:
    """Functions and constants in docs/explanation/language.md."""
    *names, last = (f"`{name}`" for name in (*FUNCTIONS, *sorted(CONSTANTS)))
    return textwrap.fill(f"{', '.join(names)} and {last}.", 98)


def bundle() -> str:
    """Table in docs/reference/components/README.md."""
    rows = (
        (_linked(f"`{name}`", name, "../../.."), source_of(name).definition.summary)
        for name in components()
    )
    return table(("FMU", "what it is"), [*rows])


def _linked(text: str, component: str, root: str) -> str:
    """Link to the page of a component; `root` is the relative path of the repository's root."""
    return f"[{text}]({root}/{page_of(component).relative_to(ROOT).as_posix()})"


def studies() -> dict[str, str]:
    """Parts of docs/reference/study-files.md."""
    return {
        "entries": _entries(StudyFile),
        "figures": _entries(FigureTable),
        "indices": table(("index", "meaning"), [*map(_index, INDICES)]),
    }


def _index(index: Index) -> tuple[str, str]:
    first, *rest = index.columns
    members = "".join(f" `{name.removeprefix(index.name)}`" for name in rest)
    unit = f" [{printed_unit(index.unit)}]" if index.unit else ""
    return f"`{first}`{members}", index.meaning.replace("|", r"\|") + unit


def _section(study: Study) -> str:
    """A study in docs/explanation/ready-studies.md."""
    settings = dict(study.parameters)
    if study.stop_time is not None and not study.stop_time.per:
        settings["stop_time"] = study.stop_time.base
    stated = [study.scenario[0], *(f"{key}={value}" for key, value in settings.items())]
    # The live page does not accept stars in names.
    live = "" if any("*" in part for part in stated) else f" <!-- live: {'&'.join(stated)} -->"
    pictures = (
        f"![{seen(study, name)}](../{PICTURES}/studies/{study.name}-{name}.png)"
        for name in study.figures
        if name != LABELS
    )
    command = f"`auv-fmu sweep {study.name}`{live}"
    return "\n\n".join([f"## {study.title}", command, *pictures, study.remark.strip()])


def _entries(schema: type[TomlTable]) -> str:
    rows = (
        (f"`{key}`", *(cell.replace("|", r"\|") for cell in declared))
        for key, declared in entries(schema).items()
    )
    return table(("entry", "value", "meaning", "without it"), [*rows])


def _json(table: type[TomlTable]) -> str:
    """JSON schema of a file, from which editors complete and explain its entries."""
    schema = table.model_json_schema(schema_generator=_WithoutNull)
    for part in (schema, *schema.get("$defs", {}).values()):
        for declared in part.get("properties", {}).values():
            declared.pop("example", None)
            if declared.get("additionalProperties") is True:
                # Only some versions of pydantic write this default.
                del declared["additionalProperties"]
            if default := declared.pop("without", ""):
                declared["description"] += f" Without it: {default}."
    schema = {"$schema": GenerateJsonSchema.schema_dialect, **schema}
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


class _WithoutNull(GenerateJsonSchema):
    """Omit defaults (TOML cannot write None) and titles that repeat the key."""

    def default_schema(self, schema: Any) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def paper() -> dict[str, str]:
    """Numbers in docs/explanation/paper.md."""
    vehicle = Vehicle()
    result = theorem(vehicle, ELL, Gains(), MAXIMUM_SLOPE[Saturation.TANH])
    k, there = coupling(vehicle, ELL), result.bounds.lambda_d2
    speed, power = result.speed_of_any_gains, result.alpha_1_of_any_gains
    turning = vehicle.m55 / ELL**3
    skew = (vehicle.m66 / ELL**2 - vehicle.m11) / ELL
    of_theta = result.bounds.lambda_M2
    slow = theorem(vehicle, ELL, Gains(lambda_=0.1), MAXIMUM_SLOPE[Saturation.TANH], 0.05)
    sigma = Gains().sigma
    return {
        "theorem": "```text\n" + "\n".join(stated(result)) + "\n```",
        "missing_force": f"{0.1 * turning * vehicle.m11 / vehicle.m33:.1f}",
        "skew_part": f"{0.2 * skew:.0f}",
        "power_of_p2_2": f"{-0.5 * vehicle.m66 / ELL**3:.0f}",
        "c_2_at_89_degrees": f"{turning * tan(radians(89.0)):,.0f}",
        "radius_factor": f"{sqrt(of_theta * Gains().gamma):.1f}",
        "lambda_d2": f"{there:g}",
        "zetas_when_slow": f"{slow.conditions[1].least:.1f}",
        "k_d_when_slow": f"{slow.conditions[2].least:.1f}",
        "x_when_slow": f"{slow.x_of_any_gains:.2f}",
        "zetas_of_any_gains": f"{result.zeta_of_any_gains:.1f}",
        "coupling": f"{k:.1f}",
        "quarter_of_the_coupling": f"{0.25 * k:.1f}",
        "largest_speed": f"{speed:.2f}",
        "largest_lambda": f"{2.0 * speed:.2f}",
        # With vanishing gains (31) asks for k / 4 < d11, and k falls with the cube of ell.
        "least_ell": f"{ELL * cbrt(result.zeta_of_any_gains / there):.2f}",
        "ball": f"{ball(0.0, 1.0, sigma):.1f}",
        "ball_of_theta": f"{ball(of_theta, 1.0, sigma):.0f}",
        "largest_alpha_1": f"{power:.3f}",
        "largest_eps_t": f"{power / 3.0:.2f}",
        "x_of_any_gains": f"{result.x_of_any_gains:.2f}",
        "x_at_most": f"{result.x_at_most:.2f}",
    }


def command_line() -> dict[str, str]:
    """Parts of docs/reference/command-line.md: common arguments, and a section for each command."""
    top = commands(parser(COMMANDS))
    leaves = [leaf for command in top.values() for leaf in commands(command).values() or [command]]
    rows = Counter(_row(argument) for leaf in leaves for argument in _arguments(leaf))
    common = {row for row, uses in rows.items() if uses > 1}
    sections = (
        section
        for name, command in top.items()
        for section in _sections(f"auv-fmu {name}", COMMANDS[name][1], command, common)
    )
    return {
        "common": table(
            ("argument", "meaning"), sorted(common, key=lambda row: (row[0].lower(), row[1]))
        ),
        "commands": "\n\n".join(sections),
    }


def commands(group: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Commands of a parser, by name."""
    return {
        name: command
        for action in group._actions
        if isinstance(action, argparse._SubParsersAction)
        for name, command in action.choices.items()
    }


def _arguments(command: argparse.ArgumentParser) -> list[argparse.Action]:
    """Arguments of a command: first those by position, then options."""
    ignored = argparse._HelpAction, argparse._SubParsersAction
    actions = [action for action in command._actions if not isinstance(action, ignored)]
    return sorted(actions, key=lambda action: bool(action.option_strings))


def _sections(
    name: str,
    meaning: str,
    command: argparse.ArgumentParser,
    common: set[tuple[str, str]],
    level: int = 2,
) -> Iterator[str]:
    below, actions = commands(command), _arguments(command)
    yield f"{'#' * level} `{name}`"
    yield command.description or f"{meaning[0].upper()}{meaning[1:]}."
    if not below:
        yield f"```text\n{_usage(name, actions)}\n```"
    if command.epilog and actions:
        _, _, example = command.epilog.partition("Example: ")
        yield f"Example: `{example}`"
    if rows := [row for row in map(_row, actions) if row not in common]:
        yield table(("argument", "meaning"), rows)
    texts = {
        choice.dest: choice.help or ""
        for action in command._actions
        if isinstance(action, argparse._SubParsersAction)
        for choice in action._choices_actions
    }
    for word, subcommand in below.items():
        yield from _sections(f"{name} {word}", texts[word], subcommand, common, level + 1)


def _usage(name: str, actions: Sequence[argparse.Action]) -> str:
    # Lines break only between arguments.
    parts = (_part(action).replace(" ", "\0") for action in actions)
    lines = textwrap.wrap(
        " ".join((name.replace(" ", "\0"), *parts)),
        80,
        subsequent_indent=" " * (len(name) + 1),
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines).replace("\0", " ")


def _part(action: argparse.Action) -> str:
    """An argument in a usage."""
    written = " ".join(filter(None, (*action.option_strings[-1:], _value(action))))
    is_optional = action.option_strings or action.nargs in ("?", "*")
    repeats = action.nargs in ("*", "+") or isinstance(action, argparse._AppendAction)
    return (f"[{written}]" if is_optional else written) + ("..." if repeats else "")


def _row(action: argparse.Action) -> tuple[str, str]:
    """An argument in a table."""
    written = " ".join(filter(None, (*action.option_strings, _value(action))))
    text = (action.help or "").replace("%%", "%")
    if action.default not in (None, False, [], argparse.SUPPRESS) and "default:" not in text:
        text = f"{text}; default: {action.default}"
    return f"`{written}`".replace("|", r"\|"), text.replace("|", r"\|")


def _value(action: argparse.Action) -> str:
    if action.nargs == 0:
        return ""
    if isinstance(action.metavar, str):
        is_optional = action.nargs == "?" and action.option_strings
        return f"[{action.metavar}]" if is_optional else action.metavar
    return "|".join(map(str, action.choices)) if action.choices else action.dest.upper()


def examples() -> dict[str, str]:
    """Parts of docs/reference/examples.md: a table for each group.

    Raises:
        ValueError: the groups and the folder of the examples differ.

    """
    listed = [name for group in _GROUPS.values() for name in group]
    if sorted(listed) != [
        p.stem for p in sorted(EXAMPLES.glob("*/*.py")) if p.stem == p.parent.name
    ]:
        raise ValueError("the groups and the folder of the examples differ")
    return {
        group: table(
            ("example", "what it is", "shows"),
            [(_link(name), _first_line(name), shown) for name, shown in members.items()],
        )
        for group, members in _GROUPS.items()
    }


def _link(name: str) -> str:
    return f"[`{name}`](../../examples/{name}/{name}.py)"


def _first_line(name: str) -> str:
    """First line of an example's docstring."""
    text = (EXAMPLES / name / f"{name}.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]


def differentiated() -> str:
    """Table of the Reals of each component and example."""
    found = {_linked(name, name, "../.."): source_of(name).definition for name in components()}
    for path in sorted(EXAMPLES.glob("*/*.py")):
        if path.stem == path.parent.name:
            found[_link(path.stem)] = definition_in(path)
    head = ("component", "outputs", "inputs", "parameters", "states", "event indicators")
    return table(head, [(link, *_reals(definition)) for link, definition in found.items()])


def _reals(definition: Definition) -> Iterator[str]:
    """Yield the numbers of a component's Reals."""
    local = local_in(definition.local)
    reals = Counter(port.causality for port in definition.ports if port.type == "Real")
    counts = (*map(reals.get, ("output", "input", "parameter")), len(local.states))
    yield from (str(n or "") for n in (*counts, len(local.switches)))


def gallery() -> dict[str, str]:
    """The pictures in docs/gallery.md: scenarios, and a figure of each study."""
    scenarios = sorted(map(read_scenario, names()), key=_place)
    return {
        "scenarios": _grid(map(_scenario, scenarios)),
        "studies": _grid(map(_study, SMALL_STUDIES)),
    }


def _grid(entries: Iterable[str]) -> str:
    return "\n\n".join(['<div class="gallery" markdown>', *entries, "</div>"])


def seen(study: Study, figure: str) -> str:
    """Content of a study's figure in words."""
    declared = FigureTable.model_validate(study.figures[figure])
    labels = study.figures.get(LABELS, {})

    def words(columns: str | list[str] | None) -> str:
        named = [columns] if isinstance(columns, str) else columns or []
        called = (labels.get(column) or Values({}).label(column) for column in named)
        return ", ".join(re.sub(r" \[.*\]$|[|]|\$.*\$, ", "", text) for text in called)

    x, y, show = declared.x, declared.y, declared.show
    text = {
        "bands": f"{words(show)} over {words(x)}",
        "maps": f"{words(show)} as colours over {words(x)} and {words(y)}",
        "front": f"{words(y)} against {words(x)}, and the runs that no other run beats in both",
        "influence": f"how much the values that vary move {words(show)}",
    }[declared.kind]
    only = "".join(f", {words(key)} {value}" for key, value in flatten(declared.where or {}))
    return text + only


def _entry(alternative: str, file: str, *lines: str) -> str:
    """Entry of the gallery: a small picture that leads to the whole one, and lines below it."""
    picture = f"[![{alternative}]({PICTURES}/{SMALL}/{file})]({PICTURES}/{file})"
    return "\n\n    ".join([f"- {picture}", *lines])


def _scenario(scenario: Scenario) -> str:
    name = scenario.name
    return _entry(
        _SEEN[FLEET if scenario.vehicles else scenario.figure],
        f"{name}.png",
        f"**{scenario.title.removesuffix(_BOTH)}**",
        f"`auv-fmu run {name}`",
        f"<!-- live: {name} -->",
    )


def _study(name: str) -> str:
    study, figure = read_study(name), SMALL_STUDIES[name]
    heading = re.sub(r"[^\w -]", "", study.title.lower()).replace(" ", "-")
    return _entry(
        seen(study, figure),
        f"studies/{name}-{figure}.png",
        f"**{study.title}**",
        f"`auv-fmu sweep {name}`",
        f"[All its figures](explanation/ready-studies.md#{heading})",
    )


def _place(scenario: Scenario) -> tuple[int, str]:
    """Sort key: the best first."""
    name = scenario.name
    return _BEST.index(name) if name in _BEST else len(_BEST), name


def main() -> None:
    """Rewrite the files that are out of date."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for path, text in files().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            print(path)


if __name__ == "__main__":
    main()
