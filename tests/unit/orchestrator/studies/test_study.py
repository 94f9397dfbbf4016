"""Study files."""

from __future__ import annotations

import tomllib

import pytest

from orchestrator.machine.errors import InputError, Refused
from orchestrator.runs.preparation import load_scenario
from orchestrator.studies.space import Space
from orchestrator.studies.study import (
    BATCH,
    Range,
    Sample,
    StopTime,
    read_figures,
    read_study,
    ready_studies,
    study_of,
)

TEXT = """
scenario = ["fig5", "other.ssp"]
engine = "batch"
stop_time = { base = 60.0, per = { plant.eta0.z = 1.2 } }
step = 0.01
order = "jacobi"
title = "A study"

[parameters]
plant.noise.std = 0.0

[vary]
plant.eta0.z = { from = 1.0, to = 100.0, n = 3, spacing = "log" }
"controller.K1[1]" = { from = 10, to = 20, n = 3 }
controller.saturation = ["tanh", "algebraic"]

[sample]
n = 5

[sample.range]
controller.k_d = [1.0, 2]
controller.gamma = { from = 0.1, to = 10, spacing = "log" }

[figures.map]
kind = "bands"
x = "plant.eta0.z"
show = "lost"
"""


def test_content_of_a_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TEXT)
    study = read_study(str(path))
    assert (study.name, study.title, study.engine) == ("mine", "A study", "batch")
    assert (study.step, study.order) == (0.01, "jacobi")
    assert study.scenario == ("fig5", str(tmp_path / "other.ssp"))
    assert study.stop_time == StopTime(60.0, {"plant.eta0.z": 1.2})
    assert study.parameters == {"plant.noise.std": 0.0}
    assert study.vary == {
        "plant.eta0.z": (1.0, 10.0, 100.0),
        "controller.K1[1]": (10.0, 15.0, 20.0),
        "controller.saturation": ("tanh", "algebraic"),
    }
    ranges = {"controller.k_d": Range(1.0, 2.0), "controller.gamma": Range(0.1, 10.0, "log")}
    assert study.sample == Sample(5, ranges, "sobol", 0)
    assert study.figures == {"map": {"kind": "bands", "x": "plant.eta0.z", "show": "lost"}}
    assert study.varied == (*study.vary, *ranges)


def test_points_go_to_the_sample_or_to_each_range():
    study = study_of("mine", tomllib.loads(TEXT))
    assert study.with_points(16) == study_of("mine", tomllib.loads(TEXT.replace("n = 5", "n = 16")))
    grid = TEXT.partition("[sample]")[0]
    two = study_of("mine", tomllib.loads(grid)).with_points(2)
    assert two == study_of("mine", tomllib.loads(grid.replace("n = 3", "n = 2")))
    with pytest.raises(InputError, match="at most 1,000,000,000"):
        study.with_points(10**10)
    lists = study_of("mine", {"scenario": "fig4", "vary": {"plant.ell": [0.3, 0.4]}})
    with pytest.raises(InputError, match="--points 7: mine has neither a sample nor a range"):
        lists.with_points(7)


def test_quoted_and_dotted_keys_are_the_same():
    quoted = study_of("a", {"scenario": "fig4", "vary": {"plant.eta0.z": [1.0]}})
    dotted = study_of("a", {"scenario": "fig4", "vary": {"plant": {"eta0": {"z": [1.0]}}}})
    assert quoted == dotted


BANDS = {"kind": "bands", "x": "plant.eta0.z", "show": "late_error"}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"vary": {}}, 'lacks scenario; write scenario = "fig5"'),
        ({"scenario": []}, "scenario = []: write a name, or list of names"),
        ({"vari": {}}, "unknown entry 'vari'; did you mean vary"),
        ({"engine": "fpga"}, "engine = 'fpga': write fmu, batch or gpu"),
        ({"order": "random"}, "order = 'random': write feedthrough, gauss-seidel or jacobi"),
        ({"vary": {"plant.ell": 1.0}}, "vary: plant.ell: write [values], or { from = 1.0"),
        ({"vary": {"plant.ell": []}}, "vary: plant.ell: write [values]"),
        ({"vary": {"plant.ell": {"from": 1, "to": 2}}}, "vary: plant.ell: lacks n"),
        (
            {"vary": {"plant.ell": {"from": 1, "to": 2, "n": 2.0}}},
            "n = 2.0: write a whole number from 1 to",
        ),
        ({"vary": {"plant.ell": {"from": 1, "to": 2, "n": 0}}}, "plant.ell: n = 0"),
        (
            {"vary": {"plant.ell": {"from": 0, "to": 2, "n": 2, "spacing": "log"}}},
            "plant.ell: spacing = 'log' needs two positive ends",
        ),
        ({"vary": {"plant.ell": {"from": 1, "to": 2, "n": 10**12}}}, "from 1 to 1,000,000"),
        ({"vary": {"plant.ell": {"from": 1, "to": 10**400, "n": 3}}}, "plant.ell: to = 1000"),
        (
            {"vary": {"plant.ell": {"from": float("nan"), "to": 1, "n": 3}}},
            "from = nan: write a finite number",
        ),
        ({"sample": {"n": 10, "range": {"plant.ell": [1, float("inf")]}}}, "write [low, high]"),
        ({"stop_time": float("inf")}, "stop_time = inf: write a number, or table"),
        ({"stop_time": {"base": 1, "per": {"plant.ell": 10**400}}}, "write a table of numbers"),
        ({"vary": {"ell": [1.0]}}, "'ell': write COMPONENT.PORT or COMPONENT.PARAMETER"),
        ({"parameters": {"step": 0.01}}, "'step': write COMPONENT.PORT or COMPONENT.PARAMETER"),
        (
            {"parameters": {"plant.ell": 1.0}, "vary": {"plant.ell": [1.0]}},
            "plant.ell is stated twice",
        ),
        ({"step": 0.01, "vary": {"step": [0.02]}}, "step is stated twice"),
        ({"sample": {"range": {"plant.ell": [1, 2]}}}, "sample: lacks n"),
        ({"sample": {"n": 3}}, "sample: lacks range"),
        ({"sample": {"n": 0, "range": {"plant.ell": [1, 2]}}}, "sample: n = 0"),
        ({"sample": {"n": 1, "range": {}}}, "sample: draws no values"),
        ({"sample": {"n": 1, "seed": -1, "range": {}}}, "seed = -1: write a whole number from 0"),
        (
            {"sample": {"n": 1, "range": {"plant.ell": [1, 2, 3]}}},
            "sample: plant.ell: write [low, high]",
        ),
        ({"sample": {"n": 1, "method": "halton", "range": {}}}, "sample: method = 'halton'"),
        *(
            ({"sample": {"n": 1, "range": {norm: ends}}}, "a norm takes two or three values")
            for norm, ends in (
                ("|plant.nu0.u|", [0, 1]),
                ("|plant.nu0.u, plant.nu0.v", [0, 1]),
                ("|plant.nu0.u, plant.nu0.v|", [0, -1]),
            )
        ),
        (
            {"sample": {"n": 1, "range": {"|plant.ell, a.b|": [1, 2], "plant.ell": [1, 2]}}},
            "plant.ell is stated twice",
        ),
        (
            {"stop_time": {"base": 1.0, "per": {"plant.ell": 1.0}}},
            "stop_time: plant.ell does not vary",
        ),
        (
            {"stop_time": {"base": 1.0, "per": {"plant.ell": "x"}}},
            "stop_time: per = {'plant.ell': 'x'}: write a table of",
        ),
        ({"figures": {"f": 3}}, "figures: f = 3: write a table"),
        (
            {"figures": {"f": {"x": "a.b"}}},
            'figures: f: lacks kind; write kind = "bands" or "maps"',
        ),
        (
            {"figures": {"f": {**BANDS, "kind": "band"}}},
            "kind = 'band': write bands, maps, front or",
        ),
        ({"figures": {"f": {"kind": "maps", "x": "a.b"}}}, "figures: f: lacks y and show"),
        ({"figures": {"f": {**BANDS, "show": []}}}, "figures: f: lacks show"),
        ({"figures": {"f": {**BANDS, "y": "lost"}}}, "a figure of kind 'bands' has no y"),
        ({"figures": {"f": {**BANDS, "colour": "red"}}}, "figures: f: unknown entry 'colour'"),
        ({"figures": {"f": {**BANDS, "limits": {"lost": "one"}}}}, "write a table of numbers"),
        (
            {"figures": {"f": {"kind": "front", "x": ["lost"], "y": "late_error"}}},
            "x is a list; a figure of kind 'front' has one x",
        ),
        ({"figures": {"labels": "late"}}, "figures: labels = 'late': write a table of texts"),
        ({"figures": {"labels": {"lost": 1}}}, "figures: labels = {'lost': 1}: write a table"),
    ],
)
def test_mistakes_are_named_with_their_place(content, words):
    scenario = {} if words.startswith("lacks scenario") else {"scenario": "fig4"}
    with pytest.raises(InputError) as error:
        study_of("mine", scenario | content)
    assert str(error.value).startswith("mine: ")
    assert words in str(error.value)


def test_all_mistakes_are_found_at_once():
    content = {"titel": "", "stop_time": {"bas": 1.0}, "sample": {"n": 0}, "figures": {"f": {}}}
    with pytest.raises(Refused) as refused:
        study_of("mine", content)
    assert {text.partition("; ")[0] for text in refused.value.problems} == {
        "mine: unknown entry 'titel'",
        "mine: lacks scenario",
        "mine: stop_time: unknown entry 'bas'",
        "mine: stop_time: lacks base and per",
        "mine: sample: n = 0: write a whole number from 1 to 1,000,000,000",
        "mine: sample: lacks range",
        "mine: figures: f: lacks kind",
    }
    vary = {"plant.ell": 1.0, "plant.m11": [], "plant.d11": {"from": 1.0}}
    with pytest.raises(Refused) as refused:
        study_of("mine", {"scenario": "fig4", "vary": vary})
    assert [text.split(": ")[2] for text in refused.value.problems] == [*vary]


def test_unknown_name_and_missing_file_are_one_line():
    with pytest.raises(InputError, match=r"no study 'nothing'; there are .*give a \.toml file"):
        read_study("nothing")
    with pytest.raises(InputError, match=r"nothing\.toml: no such file"):
        read_study("nothing.toml")


VARIED = {"plant.eta0.z": float, "controller.k_d": float, "controller.observer": str}


def entries(is_compared=True, **figures):
    return read_figures("mine.toml", figures, VARIED, is_compared)


def test_an_entry_is_a_name_or_a_list():
    figure = {"kind": "bands", "x": "plant.eta0.z", "show": ["late_error", "lost"]}
    labels = {"plant": {"eta0": {"z": "depth [m]"}}}
    [entry] = entries(far={**figure, "limits": {"late_error": 1.0}}, labels=labels)
    assert (entry.name, entry.x, entry.show) == ("far", ["plant.eta0.z"], ["late_error", "lost"])
    assert entry.limits == {"late_error": 1.0}
    assert entry.labels == {"plant.eta0.z": "depth [m]"}


def test_scenarios_are_distinguished_unless_the_file_declares_otherwise():
    front = {"kind": "front", "x": "peak_command", "y": "late_error"}
    assert entries(f=front)[0].by == ["scenario"]
    assert entries(f={**front, "by": []})[0].by == []
    assert entries(is_compared=False, f=front)[0].by == []


def test_without_figures_all_numbers_that_vary_are_drawn():
    [entry] = entries()
    assert entry.chart == "influence"
    assert entry.x == ["plant.eta0.z", "controller.k_d"]
    assert read_figures("mine.toml", {}, {}, False) == ()


@pytest.mark.parametrize(
    ("figure", "complaint"),
    [
        (
            {**BANDS, "show": "late_errors"},
            "show: the runs have no number 'late_errors'; did you mean",
        ),
        ({**BANDS, "x": "plant.eta0.x"}, "x: the runs have no number 'plant.eta0.x'"),
        ({**BANDS, "x": "controller.observer"}, "x: the runs have no number 'controller.observer'"),
        ({**BANDS, "by": "controller.observe"}, "by: the runs have no column 'controller.observe'"),
        ({**BANDS, "where": {"step": 0.1}}, "where: the runs have no column 'step'"),
    ],
)
def test_mistakes_of_figures_are_one_line(figure, complaint):
    with pytest.raises(InputError, match=f"^mine.toml: figures: f: .*{complaint}") as error:
        entries(f=figure)
    assert "\n" not in str(error.value)


def test_a_figure_is_named_as_a_file_can_be():
    with pytest.raises(InputError, match="cannot be the name of a file"):
        entries(**{"../mine": BANDS})


#: Ready studies that compare the controllers, and all.
COMPARISONS = {"attraction", "robustness", "noise", "gains", "distance", "sampling"}
NAMES = {*COMPARISONS, "formation", "velocity"}


def test_ready_studies():
    assert set(ready_studies()) == NAMES


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_ready_study_makes_thousands_of_runs(name):
    study = read_study(name)
    assert study.title
    assert study.engine == BATCH
    assert len(study.remark.split()) > 100, "results of the runs"
    pytest.importorskip("scipy", reason="needs the extra `studies`")
    space = Space(study, {scenario: load_scenario(scenario) for scenario in study.scenario})
    assert len(space) >= 8_000
    columns = space.columns, space.has_scenarios, space.indices
    assert read_figures(name, study.figures, *columns)
    if name in COMPARISONS:
        first, second = space[0], space[1]
        assert (first.scenario, second.scenario) == ("fig5", "fig5-pd")
        # Parameters of both controllers have the same values in both runs.
        assert dict(second.parameters).items() <= dict(first.parameters).items()
    elif name == "formation":
        assert len(space.prepared["formation-lost-link"].loops) == 3
