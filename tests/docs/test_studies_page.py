"""docs/studies.md: names all that there is, and its examples run."""

from __future__ import annotations

import tomllib
from importlib.util import find_spec
from inspect import signature

import pytest

from orchestrator import sweep
from orchestrator.runs.loading import loaded
from orchestrator.studies.space import Space
from orchestrator.studies.study import ready_studies
from orchestrator.studies.study_file import read_figures, study_of
from orchestrator.vehicle.indices import index_columns
from support.markdown import DOCS, blocks

PAGE = DOCS / "studies.md"
TEXT = PAGE.read_text(encoding="utf-8")

needs_extra = pytest.mark.skipif(
    not all(map(find_spec, ("numba", "pyarrow", "scipy"))),
    reason="needs the extra `studies`",
)


def test_page_names_all_columns_options_and_ready_studies():
    for name in index_columns():
        assert f"`{name.split('.')[0].split('[')[0]}" in TEXT, name
    for name in (*signature(sweep).parameters.keys() - {"study", "progress"}, *ready_studies()):
        assert f"--{name} " in TEXT or f"`{name}`" in TEXT, name


@needs_extra
def test_example_is_a_study_of_as_many_runs_as_the_page_says():
    [example] = blocks(PAGE, "toml")
    study = study_of("mine", tomllib.loads(example.text))
    space = Space(study, {name: loaded(name) for name in study.scenario})
    assert len(space) == 8 * 2 * 64 * 2
    assert read_figures("mine", study.figures, space.columns, space.has_scenarios)


@needs_extra
def test_python_on_the_page_runs(workplace, capsys):
    [example] = blocks(PAGE, "python")
    exec(compile(example.text, "docs/studies.md", "exec"), {})
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert first == "6 0 ['run', 'plant.eta0.y', 'controller.saturation', 'l2_effort.u']"
    assert second == "[0. 0. 1. 1. 2. 2.] [None None None None None None]"
