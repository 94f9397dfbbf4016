"""The environment of a formation: PettingZoo's own tests, and numbers of a simulation by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auv_fmu import Simulation
from orchestrator.machine.compilers import machines_compiler

pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")

from pettingzoo.test import parallel_api_test, parallel_seed_test

from orchestrator.bridges.pettingzoo import Formation

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

AGENTS = ["auv1", "auv2", "auv3"]


def test_it_is_an_environment_with_seeds():
    env = Formation(duration=5.0)
    parallel_api_test(env, num_cycles=120)
    parallel_seed_test(lambda: Formation(duration=5.0), num_cycles=20)
    one, other = (env.reset(seed)[0]["auv2"] for seed in (1, 2))
    assert np.abs(one - other).max() > 1e-3
    assert np.abs(env.reset()[0]["auv2"] - other).max() > 1e-3
    env.close()


def test_an_episode_has_the_numbers_of_a_simulation_by_hand():
    """Messages are 0 or 0.1 s old; only the first two vehicles are nearer than 5 m."""
    quiet = {"auv*.plant.noise.std": 0.0}
    env = Formation(
        "formation-v", quiet, duration=0.55, offset=0.0, message_period=0.2, distance=5.0
    )
    actions = np.random.default_rng(5).uniform(-1.0, 1.0, (5, 3, 3))
    (seen, _), rewards = env.reset(seed=3), {}
    with Simulation("formation-v", quiet) as sim:
        for k in range(6):
            y = {agent: sim[f"{agent}.plant.y"] for agent in AGENTS}
            if k % 2 == 0:
                sent = y
            for agent in AGENTS:
                turn = Rotation.from_euler("ZYX", sim[f"{agent}.plant.eta"][:2:-1])
                own = [
                    y[agent] - sim[f"{agent}.planner.y_d"],
                    sim[f"{agent}.planner.dy_d"],
                    sim[f"{agent}.planner.ddy_d"],
                    [0.0, 0.0, 1.0],
                    [1.0, 0.0, 0.0],
                ]
                others = [sent[other] - y[agent] for other in AGENTS if other != agent]
                expected = [*turn.inv().apply(own + others).ravel(), 0.1 * (k % 2)]
                np.testing.assert_allclose(seen[agent], expected, rtol=0, atol=1e-12)
                if k:
                    price = 0.1 * (actions[k - 1, AGENTS.index(agent)] ** 2).sum()
                    price += 10.0 * (agent != "auv3")
                    squares = (own[0] ** 2).sum()
                    assert rewards[agent] == pytest.approx(-0.1 * (squares + price), rel=1e-6)
            if k == 5:
                break
            assert env.agents == AGENTS
            chosen = dict(zip(AGENTS, actions[k].astype(np.float32), strict=True))
            seen, rewards, terminated, truncated, _ = env.step(chosen)
            for agent, action in chosen.items():
                # All limits are 80 N or 80 N.m.
                sim[f"{agent}.plant.tau"] = 80.0 * action.astype(float)
            sim.run(until=0.1 * (k + 1))
    assert env.agents == []
    assert (terminated, truncated) == (dict.fromkeys(AGENTS, False), dict.fromkeys(AGENTS, True))
    env.close()


def test_a_component_that_fails_ends_the_episode():
    """The second vehicle's planner refuses a reference that is too fast, at 6.9 s."""
    env = Formation(parameters={"auv2.planner.speed_max": 0.1}, offset=0.0)
    env.reset(seed=1)
    still = dict.fromkeys(AGENTS, np.zeros(3, np.float32))
    for _ in range(69):
        assert env.agents == AGENTS
        seen, _, terminated, truncated, infos = env.step(still)
    assert env.agents == [] and set(seen) == {*AGENTS}
    assert (terminated, truncated) == (dict.fromkeys(AGENTS, True), dict.fromkeys(AGENTS, False))
    assert "auv2.planner" in infos["auv1"]["failure"]
    env.reset(seed=1)
    assert env.agents == AGENTS
    env.close()


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        ({"scenario": "remus"}, "plant.tau_min.u"),
        ({"every": 0}, "every = 0"),
        ({"duration": 0.05}, "at least 0.1 s"),
    ],
)
def test_other_systems_and_times_are_refused(arguments, culprit):
    with pytest.raises(ValueError, match=culprit):
        Formation(**arguments)
