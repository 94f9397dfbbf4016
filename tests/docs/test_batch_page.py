"""docs/batch.md: its example runs, and its table is the package's."""

from __future__ import annotations

import re
from importlib.util import find_spec

import pytest

import orchestrator.studies.batch
from orchestrator import simulate
from support.markdown import DOCS, blocks

PAGE = DOCS / "batch.md"


@pytest.mark.skipif(find_spec("numba") is None, reason="needs numba: the extra `studies`")
def test_example_gives_what_the_fmus_give(capsys):
    [example] = blocks(PAGE, "python")
    exec(compile(example.text, "docs/batch.md", "exec"), {})
    first, *lines = capsys.readouterr().out.splitlines()
    result = simulate("fig5", {"controller.eps_t": 1.0}, stop_time=40.0, kind="native")
    z, failure = first.split()
    assert (float(z), failure) == (result["plant.eta.z"][-1], "None")
    assert float(lines[-1].split()[0]) == result.metrics()["l2_effort"][0]
    assert len(lines) == 3


def test_modules_on_the_page_are_there():
    listed = re.findall(r"^\| `(\w+)\.py` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == ["support", "kernel", "compilation"]
    assert all(f":mod:`.{name}`" in str(orchestrator.studies.batch.__doc__) for name in listed)
