"""A parallel environment of PettingZoo: the vehicles of a formation, an agent each.

from orchestrator.bridges.pettingzoo import Formation

env = Formation()
observations, infos = env.reset(seed=1)
while env.agents:
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    observations, rewards, terminations, truncations, infos = env.step(actions)
"""

from __future__ import annotations

from collections.abc import Mapping
from math import floor
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv

from auv_fmu.paper.attitude import rotation_from_euler
from orchestrator.cosim import PortName, System
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import load_scenario
from orchestrator.simulation.simulation import Simulation, SimulationFailed
from orchestrator.vehicle.signals import Loop, loops_of

#: Seeds of the noise are drawn below this number.
_SEEDS = 2**31

#: Price of a second too near to another vehicle, as of a squared error [m2].
_NEAR = 10.0

_DOWN_AND_NORTH = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])

Dict: TypeAlias = dict[str, Any]


class Formation(ParallelEnv[str, np.ndarray, np.ndarray]):  # type: ignore[misc]
    """Vehicles without velocity sensors that are to keep their places in a formation.

    Agents are called as the vehicles: `auv1`, `auv2` and so on.

    Observation, all vectors in the body frame: tracking error [m], desired velocity [m/s] and
    acceleration [m/s2], down and north; then, of each other vehicle, the position that its last
    message brought, from the own one [m], and last, if there are others, the age of these messages
    [s]. Positions are those of control points, as measured.

    Action: force and moments, from -1 at the lower to 1 at the upper limits of (3).

    Reward: minus (squared error + effort times squared action + 10 m2 if another vehicle is too
    near) times the seconds of an action.

    An episode begins near the scenario's start, at random, with new seeds of the noise. It is
    truncated after its duration, for all agents, and terminated only if a component fails.
    """

    metadata = {"name": "formation_v0", "render_modes": [], "is_parallelizable": True}  # noqa: RUF012
    render_mode = None

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | System = "formation-v",
        parameters: Mapping[str, Any] | None = None,
        *,
        duration: float | None = None,
        every: int = 5,
        offset: float = 1.0,
        effort: float = 0.1,
        message_period: float = 1.0,
        distance: float = 2.0,
    ) -> None:
        """Load the system.

        Args:
            scenario: scenario, file, dictionary or system whose vehicles have planners.
            parameters: values in place of the scenario's, by `component.parameter`.
            duration: length of an episode [s]; None: the scenario's.
            every: communication steps that an action lasts.
            offset: largest distance from the scenario's start, on each axis [m].
            effort: weight of the squared action in the reward [m2].
            message_period: time between the messages of a vehicle to all others [s].
            distance: of centres of mass, below which vehicles are too near [m].

        Raises:
            ValueError: a name, a value or a file is not usable; the message says what to change.

        """
        if every < 1:
            raise InputError(f"every = {every}: must be at least 1")
        if isinstance(scenario, System):
            system, title = scenario, scenario.name
        else:
            found, system = load_scenario(scenario)
            title = found.name
        self._loops = loops_of(system)
        for name in (name for loop in self._loops for name in _needs(loop)):
            if not system.has(PortName.read(name)):
                raise InputError(f"{title}: has no {name}, which an agent needs")
        self._simulation = Simulation(scenario, parameters, stop_time=duration, keep=False)
        self._every, self._interval = every, every * self._simulation.step_size
        length = self._simulation.stop_time or 0.0
        self._n_actions = floor(length / self._interval + 1e-9)
        if self._n_actions < 1:
            raise InputError(f"duration = {length:g} s: at least {self._interval:g} s")
        self._effort, self._distance = effort, distance
        self._message_period = message_period
        self._moves = np.array([offset] * 3 + [0.0] * 3)
        self._start = self._values("vehicle", "eta0")
        lower, upper = (self._values("vehicle", name) for name in ("tau_min", "tau_max"))
        self._middle, self._half = (lower + upper) / 2, (upper - lower) / 2
        self.possible_agents = [loop.name for loop in self._loops]
        self.agents: list[str] = []
        n_loops = len(self._loops)
        #: Numbers of the others, of each vehicle.
        self._others = np.array(
            [[j for j in range(n_loops) if j != i] for i in range(n_loops)], int
        )
        n = 15 + 3 * (n_loops - 1) + (n_loops > 1)
        self.observation_spaces = {
            agent: Box(-np.inf, np.inf, (n,), np.float64) for agent in self.possible_agents
        }
        self.action_spaces = {
            agent: Box(-1.0, 1.0, (len(loop.commanded),), np.float32)
            for agent, loop in zip(self.possible_agents, self._loops, strict=True)
        }
        self._random = np.random.default_rng()

    def observation_space(self, agent: str) -> Box:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Dict | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Dict]]:
        """Begin an episode; without a seed, the random numbers continue."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        drawn: Dict = {}
        for loop, start in zip(self._loops, self._start, strict=True):
            move = self._random.uniform(-self._moves, self._moves)
            drawn[f"{loop.vehicle}.eta0"] = (start + move).tolist()
            drawn[loop.seed] = int(self._random.integers(_SEEDS))
        self._simulation.reset(drawn)
        self.agents = [*self.possible_agents]
        self._left = self._n_actions
        self._sent_at = -np.inf
        self._seen = self._observed()
        return {**self._seen}, {agent: {} for agent in self.agents}

    def step(
        self, actions: Mapping[str, np.ndarray]
    ) -> tuple[
        dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Dict]
    ]:
        """Take an action of each agent."""
        agents, simulation = self.agents, self._simulation
        chosen = np.clip(np.array([actions[agent] for agent in agents], float), -1.0, 1.0)
        failure = None
        try:
            for loop, values in zip(self._loops, self._middle + self._half * chosen, strict=True):
                simulation[loop.commanded[0].rpartition(".")[0]] = values
            for _ in range(self._every):
                simulation.step()
            self._seen = self._observed()
        except SimulationFailed as error:
            failure = str(error)
        self._left -= 1
        prices = (chosen**2).sum(axis=1) * self._effort + _NEAR * self._is_near
        rewards = {
            agent: -self._interval * float(price + (self._seen[agent][:3] ** 2).sum())
            for agent, price in zip(agents, prices, strict=True)
        }
        terminations = dict.fromkeys(agents, failure is not None)
        truncations = dict.fromkeys(agents, self._left <= 0)
        if failure or self._left <= 0:
            self.agents = []
        infos: dict[str, Dict] = {
            agent: {"failure": failure} if failure else {} for agent in agents
        }
        return {**self._seen}, rewards, terminations, truncations, infos

    def _observed(self) -> dict[str, np.ndarray]:
        """Return what agents observe now, after the messages that are due."""
        y = self._values("vehicle", "y")
        eta = self._values("vehicle", "eta")
        time = self._simulation.time
        if time >= self._sent_at + self._message_period - 1e-9:
            self._sent, self._sent_at = y, time
        apart = np.linalg.norm(eta[self._others, :3] - eta[:, np.newaxis, :3], axis=2)
        self._is_near = (apart < self._distance).any(axis=1)
        y_d, dy_d, ddy_d = (self._values("planner", name) for name in ("y_d", "dy_d", "ddy_d"))
        vectors = np.concatenate(
            (
                np.stack((y - y_d, dy_d, ddy_d), axis=1),
                np.tile(_DOWN_AND_NORTH, (len(y), 1, 1)),
                self._sent[self._others] - y[:, np.newaxis],
            ),
            axis=1,
        )
        rotations = np.array([rotation_from_euler(*euler) for euler in eta[:, 3:].tolist()])
        # rotations[i] has the columns of R as its rows: v R = R^T v.
        seen = (vectors @ rotations.transpose(0, 2, 1)).reshape(len(y), -1)
        if self._others.size:
            seen = np.column_stack((seen, np.full(len(y), time - self._sent_at)))
        return dict(zip(self.possible_agents, seen, strict=True))

    def _values(self, role: str, name: str) -> np.ndarray:
        """Return the values of a group at a component of each loop."""
        simulation = self._simulation
        return np.array([simulation[f"{getattr(loop, role)}.{name}"] for loop in self._loops])

    def close(self) -> None:
        """Free the simulation."""
        self._simulation.close()


def _needs(loop: Loop) -> tuple[str, ...]:
    """Return signals and parameters that the agent of a vehicle needs."""
    at_vehicle = (f"{loop.vehicle}.{name}" for name in ("y.x", "eta0.x"))
    at_planner = (f"{loop.planner}.{name}" for name in ("dy_d.x", "ddy_d.x"))
    signals = (*loop.commanded, *loop.limits, *loop.posture, *loop.y_d, loop.seed)
    return (*signals, *at_vehicle, *at_planner)
