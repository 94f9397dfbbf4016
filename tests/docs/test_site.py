"""The site: built strictly, complete without a network, with answers to newcomers' questions."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from posixpath import dirname, join, normpath
from urllib.parse import unquote

import pytest
from lxml import html

import orchestrator
from support.markdown import DOCS

pytest.importorskip("mkdocs", reason="needs the extra `site`")

HOME = "index.html"

#: Made by npm and a compiler, and tested elsewhere; here it may be a page that says why not.
LIVE = "live.html"

HERE = Path(__file__).parent
QUESTIONS = tomllib.loads((HERE / "questions.toml").read_text(encoding="utf-8"))

#: Number of pages at the top of the search among which the answer is.
FIRST = 4


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    build = (sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder))
    made = subprocess.run(build, cwd=DOCS.parent, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site) -> dict[str, html.HtmlElement]:
    """Pages by their address in the site."""
    paths = (path for path in site.rglob("*.html") if path.name not in ("404.html", LIVE))
    return {path.relative_to(site).as_posix(): html.parse(path).getroot() for path in paths}


def targets(page: str, elements: html.HtmlElement, links: str = "//a") -> Iterator[tuple[str, str]]:
    """The pages and anchors of the site that links on a page lead to."""
    for link in elements.xpath(f"{links}/@href"):
        if not re.match(r"\w+:", link):
            address, _, anchor = unquote(link).partition("#")
            yield normpath(join(dirname(page), address)) if address else page, anchor


def test_every_link_leads_to_a_page_and_its_anchor(site, pages):
    for page, content in pages.items():
        for address, anchor in targets(page, content):
            assert (site / address).is_file(), f"{page}: {address}"
            if anchor and address != LIVE:
                found = pages[address].xpath("//*[@id=$anchor]", anchor=anchor)
                assert found, f"{page}: {address}#{anchor}"


def test_nothing_is_loaded_from_a_network(site, pages):
    loaded = re.compile(r"^(\w+:)?//")
    for page, content in pages.items():
        sources = content.xpath("//@src | //@srcset | //link[not(@rel='canonical')]/@href")
        assert not [source for source in sources if loaded.match(source)], page
    for style in site.rglob("*.css"):
        text = style.read_text(encoding="utf-8")
        assert not re.search(r"""(url\(|@import )\s*["']?(\w+:)?//""", text), style


def test_every_image_has_an_alternative_in_words(pages):
    for page, content in pages.items():
        for image in content.xpath("//img"):
            assert len((image.get("alt") or "").split()) > 3, f"{page}: {image.get('src')}"


def test_cells_of_tables_name_their_column(pages):
    for page, content in pages.items():
        for table in content.xpath("//article//table[thead and not(@class)]"):
            names = [head.text_content() for head in table.xpath("thead//th")]
            for row in table.xpath("tbody/tr"):
                assert [cell.get("data-column") for cell in row] == names, page


def test_page_of_the_python_interface_has_every_public_name(pages):
    names = pages["reference/python-api.html"].xpath("//article//h2/@id")
    assert {f"orchestrator.{name}" for name in orchestrator.__all__} <= set(names)


def test_there_are_forty_questions():
    assert len(QUESTIONS) >= 40


def test_answers_are_two_clicks_from_home(pages):
    # In the text and, of the pages' tree, what a wide window shows: tabs, and their own section.
    text, tabs = "//article//a", "//nav[@class='md-tabs']//a"
    section = (
        "//nav[contains(@class, 'md-nav--primary')]/ul"
        "/li[contains(@class, 'md-nav__item--active')]//a"
    )
    near = {address for links in (text, tabs) for address, _ in targets(HOME, pages[HOME], links)}
    reached = near | {
        address
        for page in near & pages.keys()
        for links in (text, section)
        for address, _ in targets(page, pages[page], links)
    }
    for question, answer in QUESTIONS.items():
        page, _, anchor = answer.partition("#")
        assert page in reached, question
        assert not anchor or pages[page].xpath("//article//*[@id=$anchor]", anchor=anchor), question


@pytest.mark.skipif(not shutil.which("node"), reason="needs Node.js")
def test_search_finds_the_answers(site):
    asked = subprocess.run(
        ["node", str(HERE / "search.mjs"), str(site)],
        input="\n".join(QUESTIONS), capture_output=True, text=True, check=True,
    )  # fmt: skip
    answers = [json.loads(line) for line in asked.stdout.splitlines()]
    missed = [
        question
        for (question, answer), found in zip(QUESTIONS.items(), answers, strict=True)
        if answer not in {location for page in found[:FIRST] for location in page}
    ]
    assert not missed
