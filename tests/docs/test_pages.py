"""README and the other pages: true to the command line and to the packaging, with no dead links."""

from __future__ import annotations

import argparse
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from auv_fmu import __version__
from orchestrator.commands.main import main, parser
from orchestrator.machine.mathematics import typeset
from support.markdown import DOCS, blocks

ROOT = DOCS.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *ROOT.glob("fmus/*/page.md")])


def commands() -> dict[str, argparse.ArgumentParser]:
    [group] = [a for a in parser()._actions if isinstance(a, argparse._SubParsersAction)]
    return dict(group.choices)


def test_readme_names_every_command_and_no_other():
    rows = re.findall(r"^\| `auv-fmu [^|]*", README, re.MULTILINE)
    assert set(re.findall(r"`(?:auv-fmu )?([a-z]+)", "".join(rows))) | {"list"} == {*commands()}


def test_readme_is_short():
    assert len(README.splitlines()) <= 100


def test_page_of_result_files_names_every_file_of_a_run(tmp_path):
    page = (DOCS / "reference" / "result-files.md").read_text(encoding="utf-8")
    assert main(["run", "fig5", "--stop-time", "0.1", "--out", str(tmp_path)]) == 0
    for file in tmp_path.rglob("*.*"):
        kind = "SCENARIO.png`, `.svg`" if file.suffix in (".png", ".svg") else file.name
        assert f"| `{kind}" in page, file.name


def test_python_on_the_first_screen_runs(capsys):
    [example] = blocks(ROOT / "README.md", "python")
    exec(compile(example.text, "README.md", "exec"), {})
    assert "[" in capsys.readouterr().out


def test_extras_that_pages_name_are_there():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for page in PAGES:
        for extras in re.findall(r"'\.\[([\w,]+)\]'", page.read_text(encoding="utf-8")):
            assert set(extras.split(",")) <= project["optional-dependencies"].keys(), page


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path):
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_code_is_fenced_and_names_its_language(page: Path):
    tokens = MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))
    code = [token for token in tokens if token.type in ("code_block", "fence")]
    assert all(token.info for token in code)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_mathematics_is_typeset(page: Path):
    """A line that begins with a mark is HTML, in which Markdown and mathematics are not read."""
    text = page.read_text(encoding="utf-8")
    markdown = MarkdownIt("commonmark").enable("table")
    marked = [token.content for token in markdown.parse(text) if token.type == "html_block"]
    assert not re.search(r"`|\$", "".join(marked))
    assert typeset(markdown.render(text)).count("<math") == len(
        re.findall(r"\$`|^```math", text, re.M)
    )


@pytest.mark.parametrize(
    "page", sorted(ROOT.glob("fmus/*/page.md")), ids=lambda page: page.parent.name
)
def test_page_of_a_component_begins_with_its_purpose_and_its_ports(page: Path):
    text = page.read_text(encoding="utf-8")
    assert re.match(r"# \w+\n\n([^\n]+\n){1,3}\n<!-- filled: ports -->\n", text)


def test_packages_say_that_they_are_typed():
    for package in ("auv_fmu", "fmus", "orchestrator"):
        [folder] = import_module(package).__path__
        assert Path(folder, "py.typed").is_file()


def test_citation_and_recipe_are_of_this_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    recipe = (ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8")
    assert f"\nversion: {__version__}\n" in citation
    assert f'\n  version: "{__version__}"\n' in recipe
    assert f"\nlicense: {project['license']}\n" in citation
    assert f"\n  license: {project['license']}\n" in recipe
    [keywords] = re.findall(r"^keywords:\n((?:  - .*\n)+)", citation, re.MULTILINE)
    assert [line.removeprefix("  - ") for line in keywords.splitlines()] == project["keywords"]
    oldest = project["requires-python"].removeprefix(">=")
    assert f'\n  python_min: "{oldest}"\n' in recipe
    # conda-forge divides fmpy and matplotlib, and names the lean part fmpy-base; what only some
    # machines need, pages can do without.
    _, needed = re.sub(r"-base(?= >)", "", recipe).split("python >=${{ python_min }}\n")
    needed, _ = needed.split("\n\n", 1)
    everywhere = [each for each in project["dependencies"] if ";" not in each]
    assert [line.replace(" ", "")[1:] for line in needed.splitlines()] == everywhere
