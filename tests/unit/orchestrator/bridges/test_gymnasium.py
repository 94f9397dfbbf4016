"""Environments for learning: the rules of Gymnasium, and numbers that other ways give too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auv_fmu import Simulation
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from support.processor_card import ProcessorCard
from support.texts import mentions

gymnasium = pytest.importorskip("gymnasium")

pytestmark = [
    pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler"),
    # Positions have no bounds.
    pytest.mark.filterwarnings("ignore:.*A Box observation space m.*imum value"),
]

#: The module that registers the environment, and its name.
ID = "orchestrator.bridges.gymnasium:auv_fmu/Tracking-v0"


def same(some: Any, others: Any) -> bool:
    """True if arrays, or dictionaries of arrays, are equal bit for bit, with their types."""
    if isinstance(some, dict):
        return some.keys() == others.keys() and all(same(some[k], others[k]) for k in some)
    return some.dtype == others.dtype and np.array_equal(some, others)


@pytest.mark.filterwarnings("error")
def test_environment_keeps_the_rules_of_gymnasium():
    from gymnasium.utils.env_checker import check_env  # noqa: PLC0415

    check_env(gymnasium.make(ID, duration=1.0).unwrapped)


@pytest.mark.filterwarnings("error")
def test_environment_keeps_the_rules_of_stable_baselines():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make(ID, duration=1.0).unwrapped)


@pytest.mark.parametrize(
    ("parameters", "ending"),
    [
        ({"plant.noise.std": 0.01}, "truncated"),
        # The planner refuses a reference that is too steep.
        ({"planner.tau_d.q": 8.0, "planner.eta0.theta": 1.45}, "terminated"),
    ],
)
def test_vector_has_the_numbers_of_single_environments(parameters, ending):
    """Over the ends of episodes, by time and by failure."""
    ours, theirs = (
        gymnasium.make_vec(ID, 3, mode, parameters=parameters, duration=1.0, every=4)
        for mode in ("vector_entry_point", "sync")
    )
    assert ours.metadata == theirs.metadata
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    random, ends = np.random.default_rng(1), 0
    for seed in (5, None, [7, None, 8]):
        some, others = (envs.reset(seed=seed) for envs in (ours, theirs))
        assert same(some[0], others[0]) and same(some[1], others[1])
        for _ in range(30):
            actions = random.uniform(-1.2, 1.2, (3, 3)).astype(np.float32)
            some, others = (envs.step(actions) for envs in (ours, theirs))
            assert all(map(same, some, others))
            ends += some[2 if ending == "terminated" else 3].sum()
    assert ends >= 18


@pytest.mark.parametrize("ending", [{}, {"planner.tau_d.q": 8.0, "planner.eta0.theta": 1.45}])
def test_on_a_card_environments_have_the_numbers_of_the_processor(ending):
    """From starts without chance, over the ends of episodes."""
    options = {"duration": 1.0, "every": 4, "offset": 0.0, "turn": 0.0}
    parameters = {"plant.noise.std": 0.0, **ending}
    ours, theirs = (
        gymnasium.make_vec(ID, 3, parameters=parameters, device=device, **options)
        for device in (ProcessorCard(), None)
    )
    random, ends = np.random.default_rng(1), 0
    assert same(ours.reset(seed=1)[0], theirs.reset(seed=2)[0])
    for _ in range(30):
        actions = random.uniform(-1.2, 1.2, (3, 3)).astype(np.float32)
        some, others = (envs.step(actions) for envs in (ours, theirs))
        assert all(map(same, some[:4], others[:4])) and some[4].keys() == others[4].keys()
        ends += some[2 if ending else 3].sum()
    assert ends >= 6


def test_on_a_card_one_generator_draws_all_starts():
    envs = gymnasium.make_vec(ID, 100, device=ProcessorCard())
    (seen, starts), (again, _) = envs.reset(seed=1), envs.reset(seed=1)
    assert same(seen, again) and len(np.unique(seen, axis=0)) == 100
    moved = np.transpose([starts[f"plant.eta0.{axis}"] for axis in ("x", "y", "z", "psi")])
    assert (abs(moved - (2.0, 6.0, 0.0, 0.0)) <= (2.0, 2.0, 2.0, 0.5)).all()
    assert len(np.unique(starts["plant.noise.seed"])) == 100
    with pytest.raises(InputError, match="takes an integer or a list of 1, not of 2"):
        envs.reset(seed=[1, 2])


def test_vehicle_steered_by_hand_gives_the_same_observations_and_rewards():
    """In the whole system of Fig. 4, where commands override the controller's."""
    env = gymnasium.make(ID, duration=0.96, every=3, effort=0.25)
    (seen, parameters), random = env.reset(seed=3), np.random.default_rng(2)
    with Simulation("fig4", parameters) as sim:
        moved = np.abs(sim["plant.eta0"] - (2.0, 6.0, 0.0, 0.0, 0.0, 0.0))
        assert (moved <= (2.0, 2.0, 2.0, 0.0, 0.0, 0.5)).all() and moved[[0, 1, 2, 5]].all()
        for n in range(1, 17):
            assert seen == pytest.approx(observation(sim), rel=0, abs=1e-12)
            action = random.uniform(-1.1, 1.1, 3)
            seen, reward, terminated, truncated, _ = env.step(action)
            sim["plant.tau"] = 80.0 * action
            for _ in range(3):
                sim.step()
            distance = np.linalg.norm(sim["plant.y"] - sim["planner.y_d"])
            effort = np.sum(np.clip(action, -1.0, 1.0) ** 2)
            assert reward == pytest.approx(-0.06 * (distance + 0.25 * effort), rel=1e-12)
            assert (terminated, truncated) == (False, n == 16)


def observation(sim: Simulation) -> np.ndarray:
    """The page's formula, with scipy's rotations."""
    body = Rotation.from_euler("ZYX", sim["plant.eta"][[5, 4, 3]]).inv()
    error, vertical = sim["plant.y"] - sim["planner.y_d"], (0.0, 0.0, 1.0)
    vectors = body.apply([error, sim["planner.dy_d"], sim["planner.ddy_d"], vertical])
    return np.asarray(vectors).ravel()


@pytest.mark.parametrize(
    ("options", "culprits"),
    [
        ({"scenario": "formation-v"}, "formation-v vehicle"),
        ({"scenario": "fig3a"}, "fig3a controller"),
        ({"scenario": "remus"}, "plant tau_min.u"),
        ({"every": 0}, "every = 0"),
        ({"duration": 0.01}, "duration 0.01 0.1"),
        ({"parameters": {"plant.m1": 2.0}}, "plant m1 m11"),
    ],
)
def test_wrong_options_are_refused_in_a_line(options, culprits):
    with pytest.raises(InputError) as refusal:
        gymnasium.make(ID, **options)
    assert mentions(str(refusal.value), culprits)
