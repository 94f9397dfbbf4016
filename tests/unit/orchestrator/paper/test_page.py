"""Markdown as a page: anchors, cells, pictures, mentions of readings, and texts of users."""

import base64
import re

import pytest
from markdown_it import MarkdownIt
from PIL import Image

from orchestrator.paper.page import (
    actuator_values,
    contents,
    escape_markdown,
    html,
    linked,
    numbers,
    picture,
    readings,
    table,
    without_pictures,
)


def test_contents_have_the_anchors_of_github():
    text = (
        "# Top\n\n## Fig. 3(a): 10 N, 4 N·m\n## A_f = 1\n\n## Same\n\n### Same\n\n```\n# code\n```"
    )
    anchors = re.findall(r"\(#(.*)\)", contents(text))
    assert anchors == ["fig-3a-10-n-4-nm", "a_f--1", "same", "same-1"]


def test_contents_link_to_headings(tmp_path):
    text = "# Top\n\n## First\n\n### Second `code`\n\n#### Too deep\n\n## First"
    assert contents(text) == (
        "- [First](#first)\n  - [Second `code`](#second-code)\n- [First](#first-1)"
    )
    page = html(f"# Top\n\n{contents(text)}\n\n{text}", tmp_path)
    ids = re.findall(r'id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)


def test_contents_are_folded_above_the_first_chapter(tmp_path):
    page = html("# Top\n\nVerdict\n\n## First\n\n### Second\n\ntext", tmp_path)
    start, rest = page.split("<details>")
    folded, body = rest.split("</details>")
    assert "<p>Verdict</p>" in start and 'id="first"' not in start
    assert re.findall(r'href="#(.*)"', folded) == ["first", "second"]
    assert 'id="first"' in body and "<p>text</p>" in body


def test_cells_name_their_columns_and_verdicts_their_kind(tmp_path):
    rows = [["a", "agrees, ratio 1"], ["b", "**differs**"], ["c", "none"]]
    page = html("# T\n\n" + table(["claim `x`", "verdict"], rows), tmp_path)
    assert re.findall(r'<td data-label="claim x"', page) == ['<td data-label="claim x"'] * 3
    assert re.findall(r'data-label="verdict"(.*?)>', page) == [
        ' class="agrees"',
        ' class="differs"',
        "",
    ]


def test_pictures_are_within_the_page_and_lead_to_their_files(tmp_path):
    file = tmp_path / "a.png"
    Image.new("P", (3, 2)).save(file)
    page = html("# T\n\n" + picture("one", "a.png"), tmp_path)
    assert f"data:image/png;base64,{base64.b64encode(file.read_bytes()).decode()}" in page
    assert 'width="3" height="2"' in page
    assert '<a href="a.png">' in page
    assert 'src="a.png"' not in page


@pytest.mark.parametrize(
    "place", ["../private.png", "PRIVATE", "link.png", "lost.png", "http://x/a.png"]
)
@pytest.mark.parametrize(
    "form", ["![seen]({})", "\\\\![seen]({})", "![seen][1]\n\n[1]: {}", "`![`![seen]({})"]
)
def test_pictures_from_elsewhere_are_not_in_the_page(tmp_path, place, form):
    """A remark of another author may name a private picture, one of the web, or none."""
    (tmp_path / "private.png").write_bytes(b"private")
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "link.png").symlink_to("../private.png")
    text = form.format(place.replace("PRIVATE", str(tmp_path / "private.png")))
    for remark in (text, without_pictures(text)):
        page = html(f"# T\n\n{remark}", folder)
        assert "<img" not in page
        assert "seen" in page
    for token in MarkdownIt().parse(without_pictures(text)):
        assert "image" not in [part.type for part in token.children or ()]


@pytest.mark.parametrize(
    "text", ["<b>bold</b>", "a | b", "*x*, _y_ and __z__", "[l](http://x)", "`c`", "1 # 2", "A_f_d"]
)
def test_escaped_texts_are_plain(text, tmp_path):
    page = html(
        f"# T\n\n## {escape_markdown(text)}\n\n" + table(["c"], [[escape_markdown(text)]]), tmp_path
    )
    escaped = text.replace("<", "&lt;").replace(">", "&gt;")
    assert f">{escaped}</h2>" in page
    assert f'<td data-label="c">{escaped}</td>' in page


def test_html_in_markdown_is_text(tmp_path):
    assert "<script>alert" not in html("# T\n\n<script>alert(1)</script>", tmp_path)


def test_numbers_have_three_digits_and_units():
    assert numbers([1234.5, 0.00123456, 2.0]) == "1.23e+03, 0.00123, 2"
    assert actuator_values([80.0, 1.0, 2.5]) == "80 N; 1, 2.5 N·m"
    assert actuator_values([80.0, 1.0, 2.5], "·s") == "80 N·s; 1, 2.5 N·m·s"


def test_mentions_lead_to_their_sections():
    assert linked("see reading 6)") == "see reading [6](#reading-6))"
    assert linked("Readings 1 to 3, 7.") == (
        "Readings [1](#reading-1) to [3](#reading-3), [7](#reading-7)."
    )


def test_other_mentions_are_not_changed():
    for text in ("#### Reading 6", "reading 99 is none", "readings of 3 sensors", "6 readings"):
        assert linked(text) == text


def test_readings_are_numbered():
    numbers = re.findall(r"^### Reading (\d+)$", readings(), re.MULTILINE)
    assert numbers == [str(n) for n in range(1, 17)]
