"""Numbers of pages: how a new measurement comes into the page of benchmarks."""

from __future__ import annotations

import re
import shlex

import page_numbers
from page_numbers import BENCHMARKS, PLACE, ROOT, benchmarks, is_written


def test_every_part_of_the_page_has_a_command_that_is_there():
    text = BENCHMARKS.read_text(encoding="utf-8")
    places = PLACE.findall(text)
    assert len(places) == text.count("<!-- filled:") > 10
    for name, command in places:
        assert (ROOT / shlex.split(command)[0]).is_file(), name


def test_a_measurement_takes_its_place(tmp_path, monkeypatch):
    page, script = tmp_path / "page.md", tmp_path / "script.py"
    script.write_text("import sys; print('1.5 us', sys.argv[1:])\n")
    parts = [
        f"<!-- filled: {name} -->\n`python {script} --n 3`, once:\n\n```text\n0\n```\n<!-- / -->"
        for name in ("first", "second")
    ]
    page.write_text("\n\n".join(parts))
    monkeypatch.setattr(page_numbers, "BENCHMARKS", page)
    assert is_written("second", f"{script} --n 3")
    first, second = page.read_text().split("\n\n<!--")
    assert first == parts[0]
    assert re.search(rf"`python {script} --n 3`, \d{{4}}-\d\d-\d\d, .+:\n", second)
    assert "```text\n1.5 us ['--n', '3']\n```\n<!-- / -->" in second
    assert is_written("second", f"{script} --n 4")
    assert page.read_text().count("1.5 us") == 1


def test_a_script_that_fails_changes_nothing_and_others_run(tmp_path, monkeypatch, capsys):
    page, bad, good = (tmp_path / name for name in ("page.md", "bad.py", "good.py"))
    bad.write_text("print('1.5 us'); raise SystemExit(3)\n")
    good.write_text("print('2.5 us')\n")
    parts = [
        f"<!-- filled: {script.stem} -->\n`python {script}`, once:\n\n```text\n0\n```\n<!-- / -->\n"
        for script in (bad, good)
    ]
    page.write_text("".join(parts))
    monkeypatch.setattr(page_numbers, "BENCHMARKS", page)
    assert benchmarks() == 1
    assert page.read_text().startswith(parts[0]) and "2.5 us" in page.read_text()
    assert capsys.readouterr().err == f"bad stays as it is: {bad}: exit status 3\n"
