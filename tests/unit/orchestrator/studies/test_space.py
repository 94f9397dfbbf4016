"""The runs of a study."""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import load_scenario
from orchestrator.studies import space as space_module
from orchestrator.studies.columns import Point
from orchestrator.studies.space import Space
from orchestrator.studies.study import MOST_RUNS, study_of

qmc = pytest.importorskip("scipy.stats.qmc", reason="needs the extra `studies`")


def space(**content: Any) -> Space:
    study = study_of("mine", {"scenario": "fig5", **content})
    return Space(study, {name: load_scenario(name) for name in study.scenario})


def test_grid_is_every_combination_whose_last_value_changes_fastest():
    ells, shapes, places = [0.3, 0.4], ["tanh", "algebraic"], [1, 2, 3]
    runs = space(
        vary={"plant.ell": ells, "controller.saturation": shapes, "plant.eta0.y": places},
        parameters={"plant.noise.std": 0},
    )
    expected = [
        {"plant.noise.std": 0.0, "plant.ell": a, "controller.saturation": b, "plant.eta0.y": c}
        for a, b, c in product(ells, shapes, places)
    ]
    assert len(runs) == 12
    assert [runs[i].parameters for i in range(12)] == expected
    assert {type(runs[0].parameters[name]) for name in ("plant.eta0.y", "plant.ell")} == {float}
    assert runs[5] == Point(5, "fig5", expected[5], 100.0, 0.02)
    assert runs.columns == {"plant.ell": float, "controller.saturation": str, "plant.eta0.y": float}


def test_list_for_a_group_is_a_value_for_each_member():
    """Only the proposed controller has K2, whichever scenario comes first; the planner both."""
    runs = space(
        scenario=["fig5-pd", "fig5"],
        parameters={"controller.K2": [1, 2, 3], "planner.eta0": [0, 1, -3, 0, 0.5]},
        vary={"plant.ell": [0.3, 0.4]},
    )
    poses = ("x", 0.0), ("y", 1.0), ("z", -3.0), ("theta", 0.0), ("psi", 0.5)
    shared = {f"planner.eta0.{name}": value for name, value in poses} | {"plant.ell": 0.3}
    gains = {f"controller.K2[{i}]": float(i) for i in (1, 2, 3)}
    assert dict(runs[0].parameters) == shared
    assert dict(runs[1].parameters) == shared | gains
    with pytest.raises(InputError, match=r"controller\.K1: takes 3 values, not 2"):
        space(parameters={"controller.K1": [1, 2]}, vary={"plant.ell": [0.3, 0.4]})


@cache
def formation() -> Any:
    """Loaded in a test, not where tests are collected: FMUs may have to be built."""
    return load_scenario("formation-v")


@given(
    star=st.one_of(
        st.floats(0.0, 1.0),
        st.fixed_dictionaries({"first": st.floats(0.0, 1.0), "step": st.floats(0.0, 1.0)}),
        st.fixed_dictionaries({"each": st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3)}),
    ),
    own=st.dictionaries(st.sampled_from(["auv1", "auv2", "auv3"]), st.floats(2.0, 3.0)),
    is_first=st.booleans(),
)
def test_parameters_have_the_syntax_of_scenarios(star, own, is_first):
    """A name with a star, and values that differ from vehicle to vehicle; others win."""
    named = {f"{vehicle}.plant.noise.std": value for vehicle, value in own.items()}
    stars = {"auv*.plant.noise.std": star}
    parameters = {**stars, **named} if is_first else {**named, **stars}
    content = {"scenario": "x", "parameters": parameters, "vary": {"auv1.plant.ell": [0.3]}}
    runs = Space(study_of("mine", content), {"x": formation()})
    expected = {"auv1.plant.ell": 0.3}
    for k in range(3):
        value = star
        if isinstance(star, dict):
            value = star["each"][k] if "each" in star else star["first"] + k * star["step"]
        expected[f"auv{k + 1}.plant.noise.std"] = value
    assert dict(runs[0].parameters) == {**expected, **named}


def test_values_of_components_in_systems_vary():
    """They have the units of their variables."""
    scenario, system = load_scenario("fig5")
    nested = system.renamed({name: f"auv1.{name}" for name in system.components})
    content = {
        "scenario": "fig5", "parameters": {"auv1.planner.eta0": [0, 1, -3, 0, 0.5]},
        "vary": {"auv1.plant.ell": [0.3, 0.4], "auv1.controller.saturation": ["tanh"]},
    }  # fmt: skip
    runs = Space(study_of("mine", content), {"fig5": (scenario, nested)})
    assert runs.columns == {"auv1.plant.ell": float, "auv1.controller.saturation": str}
    assert runs[1].parameters["auv1.plant.ell"] == 0.4
    assert runs[1].parameters["auv1.planner.eta0.psi"] == 0.5
    assert runs.units["auv1.plant.ell"] == "m"


def test_each_scenario_gets_the_parameters_that_it_has():
    runs = space(
        scenario=["fig5", "fig5-pd"],
        parameters={"controller.k_d": 40.0},
        vary={"controller.eps_t": [1.0, 2.0], "controller.saturation": ["tanh"]},
    )
    found = [(run.scenario, dict(run.parameters)) for run in map(runs.__getitem__, range(4))]
    observer = {"controller.k_d": 40.0, "controller.saturation": "tanh"}
    assert found == [
        ("fig5", {**observer, "controller.eps_t": 1.0}),
        ("fig5-pd", {"controller.eps_t": 1.0}),
        ("fig5", {**observer, "controller.eps_t": 2.0}),
        ("fig5-pd", {"controller.eps_t": 2.0}),
    ]
    assert runs.has_scenarios
    with pytest.raises(IndexError):
        runs[4]


@pytest.mark.parametrize("method", ["sobol", "latin-hypercube", "random"])
def test_samples_follow_from_the_seed_and_the_ranges(method):
    ranges = {
        "plant.eta0.y": [-2.0, 6.0],
        "controller.k_d": {"from": 1, "to": 100, "spacing": "log"},
    }
    runs = space(sample={"method": method, "n": 12, "seed": 7, "range": ranges})
    shares = {
        "sobol": lambda: qmc.Sobol(2, rng=np.random.default_rng(7)).random(16)[:12],
        "latin-hypercube": lambda: qmc.LatinHypercube(2, rng=np.random.default_rng(7)).random(12),
        "random": lambda: np.random.default_rng(7).random((12, 2)),
    }[method]()
    for i, (a, b) in enumerate(shares):
        found = runs[i].parameters
        assert found["plant.eta0.y"] == pytest.approx(-2.0 + 8.0 * a)
        assert np.log10(found["controller.k_d"]) == pytest.approx(2.0 * b)
    other = space(sample={"method": method, "n": 12, "seed": 8, "range": ranges})
    assert other[3].parameters != runs[3].parameters
    assert other.digest != runs.digest


@pytest.mark.parametrize("method", ["sobol", "random"])
def test_samples_are_drawn_page_by_page_in_any_order(method, monkeypatch):
    monkeypatch.setattr(space_module, "_PAGE", 8)
    ranges = {"plant.eta0.y": [0.0, 1.0], "plant.eta0.z": [0.0, 1.0]}
    runs = space(sample={"method": method, "n": 100, "seed": 7, "range": ranges})
    generator = np.random.default_rng(7)
    expected = (
        qmc.Sobol(2, rng=generator).random_base2(7)[:100]
        if method == "sobol"
        else generator.random((100, 2))
    )
    for numbers in (np.arange(90, 100), np.arange(50), np.array([99, 3, 40, 41, 3])):
        found = runs.points(numbers).values
        assert np.array_equal(np.column_stack([*found.values()]), expected[numbers])


def test_samples_are_drawn_at_every_combination():
    runs = space(
        vary={"plant.ell": [0.3, 0.4]},
        sample={"n": 3, "range": {"plant.eta0.y": [0.0, 1.0]}},
    )
    places = [runs[i].parameters["plant.eta0.y"] for i in range(6)]
    assert places[:3] == places[3:]
    assert len(set(places)) == 3
    assert [runs[i].parameters["plant.ell"] for i in range(6)] == [0.3] * 3 + [0.4] * 3


@pytest.mark.parametrize("names", ["uv", "uvw"])
def test_norm_is_drawn_with_an_even_direction(names):
    members = [f"plant.nu0.{name}" for name in names]
    norm = f"|{', '.join(members)}|"
    size = {"from": 10, "to": 0.1, "spacing": "log"}
    n = 4096
    runs = space(sample={"n": n, "seed": 1, "range": {norm: size, "plant.eta0.y": [0.0, 1.0]}})
    assert runs.columns == dict.fromkeys((*members, "plant.eta0.y"), float)
    found = np.array([[runs[i].parameters[name] for name in members] for i in range(n)])
    sizes = np.linalg.norm(found, axis=1)
    # The logarithm of the size is even: so many below 1, and in each tenth.
    assert np.histogram(np.log10(sizes), 10, (-1.0, 1.0))[0] == pytest.approx(n / 10, abs=2)
    # Even directions: mean 0, covariance 1 / k, and (Archimedes) each of three even in [-1, 1].
    directions = found / sizes[:, np.newaxis]
    assert directions.mean(axis=0) == pytest.approx(0.0, abs=0.005)
    assert directions.T @ directions / n == pytest.approx(np.eye(len(names)) / len(names), abs=0.01)
    if len(names) == 3:
        for part in directions.T:
            assert np.histogram(part, 8, (-1.0, 1.0))[0] == pytest.approx(n / 8, rel=0.05)


@pytest.mark.parametrize("ends", [[1, 4], {"from": 4, "to": 1}])
def test_whole_numbers_have_the_same_chance(ends):
    runs = space(
        sample={"method": "latin-hypercube", "n": 4000, "range": {"plant.noise.seed": ends}}
    )
    found = Counter(runs[i].parameters["plant.noise.seed"] for i in range(len(runs)))
    # A Latin hypercube has one sample in each of 4,000 equal parts.
    assert found == {1: 1000, 2: 1000, 3: 1000, 4: 1000}
    assert {type(number) for number in found} == {int}


def test_stop_time_and_step_vary():
    runs = space(
        stop_time={"base": 10.0, "per": {"plant.eta0.y": 2.0, "plant.eta0.z": -1.0}},
        vary={"plant.eta0.y": [0.0, 3.0], "plant.eta0.z": [-1.0, 5.0], "step": [0.01, 1]},
    )
    found = [(run.stop_time, run.step) for run in map(runs.__getitem__, range(8))]
    # The step changes fastest, then z, then y.
    ends = [11.0, 5.0, 17.0, 11.0]
    assert found == list(product(ends, [0.01, 1.0]))
    assert "step" not in runs[0].parameters


def test_other_points_have_another_digest():
    first, same, other = (
        space(vary={"plant.eta0.y": values}) for values in ([1.0, 2.0], [1, 2], [1.0, 3.0])
    )
    assert first.digest == same.digest != other.digest


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"vary": {"plnt.ell": [1.0]}}, "'plnt'.*plant"),
        ({"vary": {"plant.el": [1.0]}}, "'el'.*ell"),
        ({"parameters": {"plant.el": 1.0}}, "'el'"),
        (
            {"parameters": {"controller.K1": [1, 2, 3]}, "vary": {"controller.K1[2]": [1.0]}},
            r"controller\.K1\[2\] is stated twice",
        ),
        ({"vary": {"plant.ell": [0.3, 0.4, 0.3]}}, "plant.ell: 0.3 is stated twice"),
        ({"vary": {"plant.noise.seed": [1, 2, 1]}}, "plant.noise.seed: 1 is stated twice"),
        ({"vary": {"plant.ell": {"from": 1, "to": 1, "n": 2}}}, "plant.ell: 1.0 is stated twice"),
        ({"vary": {"step": [0.02, 0.02]}}, "step: 0.02 is stated twice"),
        ({"vary": {"plant.ell": ["long"]}}, "plant.ell = long"),
        ({"vary": {"plant.ell": [-1.0]}}, "plant.ell = -1.0"),
        ({"vary": {"plant.noise.seed": [1.5]}}, "plant.noise.seed = 1.5"),
        ({"vary": {"plant.eta.x": [1.0]}}, "plant.eta.x.* output"),
        ({"vary": {"step": ["fast"]}}, "step = 'fast'"),
        ({"vary": {"step": [0.02, 10**400]}}, "step = 1000"),
        ({"vary": {"step": [0.02, 0.0]}}, "step 0 s"),
        ({"stop_time": -1.0}, "stop time -1 s"),
        (
            {
                "stop_time": {"base": 1.0, "per": {"plant.eta0.y": 1.0}},
                "vary": {"plant.eta0.y": [1.0, -2.0]},
            },
            "stop time -1 s",
        ),
        (
            {"sample": {"n": 1, "range": {"controller.printed_jacobian": [0, 1]}}},
            "numbers",
        ),
        ({"sample": {"n": 1, "range": {"plant.ell": [-1, 1]}}}, "plant.ell = -1"),
        (
            {"sample": {"n": 1, "range": {"|plant.nu0.u, plant.noise.seed|": [0, 1]}}},
            "plant.noise.seed",
        ),
        (
            {"vary": {name: {"from": 1, "to": 2, "n": 40_000} for name in ("plant.ell", "step")}},
            f"1,600,000,000.*{MOST_RUNS:,}",
        ),
    ],
)
def test_impossible_values_are_refused_before_any_run(content, words):
    with pytest.raises(InputError, match=words):
        space(**content)
