"""The studies that come with the program can be run and drawn as they stand."""

from __future__ import annotations

import pytest

from orchestrator.runs.loading import loaded
from orchestrator.studies.figure_entries import read_figures
from orchestrator.studies.space import Space
from orchestrator.studies.study import read_study, ready_studies
from orchestrator.studies.study_file import BATCH

pytest.importorskip("scipy", reason="needs scipy: the extra `studies`")

#: As the command line and the pages name them.
NAMES = {"attraction", "robustness", "noise", "gains", "distance", "sampling"}


def test_there_are_six():
    assert set(ready_studies()) == NAMES


@pytest.mark.parametrize("name", ready_studies())
def test_study_holds_the_proposed_controller_against_pd_ten_thousand_times(name):
    study = read_study(name)
    space = Space(study, {scenario: loaded(scenario) for scenario in study.scenario})
    assert study.engine == BATCH
    assert len(space) >= 10_000
    first, second = space[0], space[1]
    assert (first.scenario, second.scenario) == ("fig5", "fig5-pd")
    # Whatever both controllers have is the same in both runs.
    assert dict(second.parameters).items() <= dict(first.parameters).items()
    assert read_figures(name, study.figures, space.columns, space.has_scenarios)
    assert study.remark.count("\n\n") == 1, "two paragraphs"
