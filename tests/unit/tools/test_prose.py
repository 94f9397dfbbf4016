"""The prose linter: where sentences end, what is read of a page, and words to avoid."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("proselint")

from prose import (
    Block,
    Page,
    c_blocks,
    findings,
    html_blocks,
    length,
    markdown_blocks,
    notebook_blocks,
    pages,
    python_blocks,
    rules,
    sentences,
)


@pytest.mark.parametrize(
    "text",
    [
        "One sentence, e.g. this one, i.e. the first.",
        "See Fig. 4, Figs. 5 and 6, eq. (3), Eq. (4), sec. 2 and No. 7.",
        "PD vs. Ours: 1.5 m, cf. Section 4.1, et al. 2020, approx. 3 m.",
        "Version 1.5 Beta and this `…` are in `…`.",
        "Is it § 4.2?",
        "No end",
    ],
)
def test_one_sentence(text: str):
    assert list(sentences(text)) == [text]


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("One. Two.", 2),
        ("One? Two! Three.", 3),
        ("It ends in 1.5. The next begins.", 2),
        ("(In brackets.) Then another.", 2),
        ('He says "no." Then he leaves.', 2),
        ("One.\nThe second is on\nanother line.", 2),
        ("It ends. `…` begins the next.", 2),
        ("See section 4. § 5 is next. (30) is third.", 3),
        ("It takes 1 us. ecos takes 2 us.", 2),
        ("a. small letters follow. so they do.", 1),
    ],
)
def test_several_sentences(text: str, count: int):
    parts = list(sentences(text))
    assert len(parts) == count
    assert " ".join(" ".join(parts).split()) == " ".join(text.split())


def test_length_counts_words():
    assert length("The gain `…` is 1.5 m/s, at most - or less.") == 10


PAGE = """# A heading

A paragraph with `code that. Is long` and
[a link](target.md), <!-- filled: x -->12<!-- / --> m long.

- A sentence in a list.
- no sentence

| a | cell. That |
|---|---|
| of | a table |

```python
behind = "alone"
```

    behind

![A picture.](file.png)
"""


def test_what_is_read_of_a_page():
    blocks = list(markdown_blocks(PAGE))
    assert [(block.line, block.text) for block in blocks if block.is_prose] == [
        (3, "A paragraph with `…` and\na link, 12 m long."),
        (6, "A sentence in a list."),
    ]
    assert [(block.line, block.text) for block in blocks if not block.is_prose] == [
        (1, "A heading"),
        (7, "no sentence"),
        (9, "a"),
        (9, "cell. That"),
        (11, "of"),
        (11, "a table"),
        (19, ""),
        (19, "A picture."),
    ]


def test_a_notebook_is_read_by_the_lines_of_its_file():
    cells = [
        {"cell_type": "code", "source": ["x = 1  # behind\n"]},
        {"cell_type": "markdown", "source": ["# A heading\n", "\n", "A sentence."]},
    ]
    text = json.dumps({"cells": cells}, indent=1)
    [heading, sentence] = notebook_blocks(text)
    assert text.splitlines()[heading.line - 1].strip() == r'"# A heading\n",'
    assert text.splitlines()[sentence.line - 1].strip() == '"A sentence."'


def test_docstrings_comments_messages_and_test_names_of_a_module_are_read():
    text = (
        '"""A module.\n\nText::\n\n    what = 1\n\n``what`` is\nread."""\n\n'
        "#: A constant\n#: on two lines.\n"
        'say("the file", f"{name} is not\\n{there!r} yet", "x", 3)  # noqa: what\n'
        "def test_a_name(): ...  # Beside\n"
    )
    blocks = sorted(python_blocks(text))
    assert [(b.line, b.text.split("\n")[-1]) for b in blocks if b.is_inside] == [
        (1, "read."),
        (10, "on two lines."),
        (13, "Beside"),
    ]
    assert [(b.line, b.text) for b in blocks if b.is_message] == [
        (12, "`…` is not\n`…` yet"),
        (12, "the file"),
    ]
    assert [b.text for b in blocks if not b.is_inside and not b.is_message] == ["a name"]
    assert "what" not in "".join(block.text for block in blocks)


def test_comments_in_c_are_read():
    text = '/* What a file\n * holds. */\nchar *s = "// no"; // One\n// comment.\nx = 1; // noqa\n'
    assert [(b.line, b.text.split("\n")[-1].strip()) for b in c_blocks(text)] == [
        (1, "holds."),
        (3, "comment."),
    ]


@pytest.mark.parametrize("opening", ["What a row holds.", "Whether it ends.", "Have it end."])
def test_an_opening_is_found_in_docstrings_and_comments_only(opening: str):
    [finding] = findings(Page("x.py", [Block(2, opening, False, is_inside=True)]))
    assert finding.startswith("x.py:2: ")
    assert not list(findings(Page("x.md", [Block(2, opening, True)])))
    inside = Block(2, f"A row: {opening}", False, is_inside=True)
    assert not list(findings(Page("x.py", [inside])))


def test_texts_between_tags_are_read_with_their_lines():
    text = '<p title="not this">\nThe <b>bold text</b> ends.</p>\n<p>{{data}}</p>\n'
    assert [(block.line, block.text) for block in html_blocks(text)] == [(2, "bold text")]


def test_a_finding_names_its_line_and_what_to_write():
    page = Page(
        "page.md", list(markdown_blocks("# Title\n\nIt is one.\nThe one behind\nit is two."))
    )
    assert list(findings(page)) == [
        'page.md:4: "is one. The one behind it is two." -> "after", for an order or a time'
    ]


@pytest.mark.parametrize(
    "wrong",
    [
        "The row behind it.",
        "The gains are those of Fig. 4.",
        "It writes the table alone.",
        "Nobody answers.",
        "Bring one's own FMU.",
        "A wheel, to be had there.",
        "Our FMUs are held against their reference.",
        "A page on what is wrong with a file.",
        "All components but for the plant.",
        "All that is there.",
        "A folder, of which two files are kept.",
        "A list of what was written.",
        "What is damaged is refused.",
        "It runs native FMUs as well.",
        "The run goes\non after that.",
        "It ends. So does the other.",
        "It is no sandbox.",
        "The paper gives none.",
        "The FMUs of others.",
        "A very long run.",
        "It is is twice.",
    ],
)
def test_words_to_avoid(wrong: str):
    assert len(list(findings(Page("", list(markdown_blocks(wrong)))))) == 1


@pytest.mark.parametrize(
    "right",
    [
        "The file is left alone.",
        "FMUs as well as SSPs.",
        "There is no sandbox, and it is no longer than that.",
        "Two of which are drawn.",
        "Up to 80 m, for every platform.",
        "`behind` and [that](behind.md) differ.",
        "# A\n\n# A\n",
    ],
)
def test_words_that_are_right(right: str):
    assert list(findings(Page("", list(markdown_blocks(right))))) == []


def test_every_rule_says_what_to_write():
    assert len(rules()) > 30
    assert all(rule.write and not rule.find.search("") for rule in rules())


def test_pages_of_a_folder(tmp_path):
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "page.md").write_text("A sentence.\n")
    (tmp_path / "other.txt").write_text("No page.\n")
    [page] = pages([tmp_path])
    assert page.name == (tmp_path / "below" / "page.md").as_posix()
