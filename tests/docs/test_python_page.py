"""Every example of docs/python.md, in order."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from support.machine import contents
from support.markdown import DOCS, blocks

NEEDED = ("pandas", "pyarrow")


@pytest.mark.skipif(
    not all(map(find_spec, NEEDED)), reason=f"the examples need {', '.join(NEEDED)}"
)
def test_examples_run_and_print_what_the_page_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    printed = ""
    for language, text in blocks(DOCS / "python.md", "python", "text"):
        if language == "text":
            assert printed == text
            continue
        exec(compile(text, "docs/python.md", "exec"), names)
        printed = capsys.readouterr().out
    assert (tmp_path / "commands.png").is_file()
    files = contents(tmp_path / "results/mine").keys()
    assert files == {"result.parquet", "metrics.json", "run.json"}


def test_first_result_on_the_page_is_shown_as_it_is(capsys):
    first, *_ = blocks(DOCS / "python.md", "python")
    exec(compile(first.text, "docs/python.md", "exec"), {})
    shown = capsys.readouterr().out.strip()
    assert f"`{shown}`" in (DOCS / "python.md").read_text(encoding="utf-8")
