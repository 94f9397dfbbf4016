"""Study files."""

from __future__ import annotations

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.studies.study import (
    ENTRIES,
    Range,
    Sample,
    StopTime,
    read_study,
    ready_studies,
    study_of,
)
from support.texts import mentions

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
x = "plant.eta0.z"
"""


def test_file_says_what_varies(tmp_path):
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
    assert study.figures == {"map": {"x": "plant.eta0.z"}}
    assert study.varied == (*study.vary, *ranges)


def test_quoted_and_dotted_keys_are_the_same():
    quoted = study_of("a", {"scenario": "fig4", "vary": {"plant.eta0.z": [1.0]}})
    dotted = study_of("a", {"scenario": "fig4", "vary": {"plant": {"eta0": {"z": [1.0]}}}})
    assert quoted == dotted


def test_every_entry_has_a_meaning():
    assert all(entry.meaning for entry in ENTRIES.values())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"vary": {}}, "scenario"),
        ({"scenario": []}, "scenario []"),
        ({"vari": {}}, "'vari'; vary"),
        ({"engine": "gpu"}, "engine 'gpu' fmu, batch"),
        ({"order": "random"}, "order 'random'"),
        ({"vary": {"plant.ell": 1.0}}, "vary: plant.ell: [values], from"),
        ({"vary": {"plant.ell": []}}, "vary: plant.ell: [values]"),
        ({"vary": {"plant.ell": {"from": 1, "to": 2}}}, "vary: plant.ell: n"),
        ({"vary": {"plant.ell": {"from": 1, "to": 2, "n": 2.0}}}, "n = 2.0"),
        ({"vary": {"plant.ell": {"from": 1, "to": 2, "n": 0}}}, "plant.ell: n = 0"),
        (
            {"vary": {"plant.ell": {"from": 0, "to": 2, "n": 2, "spacing": "log"}}},
            "plant.ell: 'log' positive",
        ),
        ({"vary": {"plant.ell": {"from": 1, "to": 2, "n": 10**12}}}, "from 1 to 1,000,000"),
        ({"vary": {"plant.ell": {"from": 1, "to": 10**400, "n": 3}}}, "plant.ell: to = 1000"),
        ({"vary": {"plant.ell": {"from": float("nan"), "to": 1, "n": 3}}}, "from = nan"),
        ({"sample": {"n": 10, "range": {"plant.ell": [1, float("inf")]}}}, "write [low, high]"),
        ({"stop_time": float("inf")}, "stop_time inf"),
        ({"stop_time": {"base": 1, "per": {"plant.ell": 10**400}}}, "stop_time number"),
        ({"vary": {"ell": [1.0]}}, "'ell': component.port"),
        ({"parameters": {"step": 0.01}}, "'step': component.port"),
        (
            {"parameters": {"plant.ell": 1.0}, "vary": {"plant.ell": [1.0]}},
            "plant.ell twice",
        ),
        ({"step": 0.01, "vary": {"step": [0.02]}}, "step twice"),
        ({"sample": {"range": {"plant.ell": [1, 2]}}}, "sample: lacks n"),
        ({"sample": {"n": 3}}, "sample: lacks range"),
        ({"sample": {"n": 0, "range": {"plant.ell": [1, 2]}}}, "sample: n = 0"),
        ({"sample": {"n": 1, "range": {}}}, "sample: draws nothing"),
        ({"sample": {"n": 1, "seed": -1, "range": {}}}, "seed -1"),
        (
            {"sample": {"n": 1, "range": {"plant.ell": [1, 2, 3]}}},
            "sample: plant.ell: [low, high]",
        ),
        ({"sample": {"n": 1, "method": "halton", "range": {}}}, "sample: method = 'halton'"),
        *(
            ({"sample": {"n": 1, "range": {norm: ends}}}, "norm two three")
            for norm, ends in (
                ("|plant.nu0.u|", [0, 1]),
                ("|plant.nu0.u, plant.nu0.v", [0, 1]),
                ("|plant.nu0.u, plant.nu0.v|", [0, -1]),
            )
        ),
        (
            {"sample": {"n": 1, "range": {"|plant.ell, a.b|": [1, 2], "plant.ell": [1, 2]}}},
            "plant.ell twice",
        ),
        (
            {"stop_time": {"base": 1.0, "per": {"plant.ell": 1.0}}},
            "stop_time: plant.ell vary",
        ),
        ({"stop_time": {"base": 1.0, "per": {"plant.ell": "x"}}}, "plant.ell 'x'"),
    ],
)
def test_mistakes_are_named_with_their_place(content, words):
    scenario = {} if words == "scenario" else {"scenario": "fig4"}
    with pytest.raises(InputError) as error:
        study_of("mine", scenario | content)
    assert str(error.value).startswith("mine: ")
    assert mentions(str(error.value), words)


def test_unknown_name_and_missing_file_are_one_line():
    with pytest.raises(InputError, match=r"'nothing'.*\.toml"):
        read_study("nothing")
    with pytest.raises(InputError, match=r"nothing\.toml:"):
        read_study("nothing.toml")


@pytest.mark.parametrize("name", ready_studies())
def test_ready_studies_can_be_read(name):
    assert read_study(name).title
