"""Environments of Gymnasium: importing this module registers `auv_fmu/Tracking-v0`.

    import gymnasium
    import orchestrator.bridges.gymnasium

    env = gymnasium.make("auv_fmu/Tracking-v0")
    envs = gymnasium.make_vec("auv_fmu/Tracking-v0", num_envs=1000)

Rewards and starts are made here, observations by the component Observation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from orchestrator.cosim import PortName, System, read_component
from orchestrator.machine.errors import InputError
from orchestrator.program.card import Card
from orchestrator.program.many import NAMES_OF_PROCESSOR, as_array
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.preparation import DEFAULT_STEP, load
from orchestrator.runs.request import method_takes_keywords, option
from orchestrator.simulation.simulation import Simulation, SimulationFailed
from orchestrator.simulation.simulations import Simulations
from orchestrator.vehicle.signals import Loop, loops_of

#: Seeds of the noise are drawn below this number.
_SEEDS = 2**31


@dataclass(frozen=True, kw_only=True)
class TrackingOptions:
    """Arguments of :class:`Tracking`."""

    scenario: str | Path | Mapping[str, Any] | System = option(
        "fig4", "scenario, file, dictionary or system with one vehicle and its controller"
    )
    parameters: Mapping[str, Any] = option(
        {}, "values in place of the scenario's, by `component.parameter`"
    )
    duration: float = option(20.0, "length of an episode [s]")
    every: int = option(5, "communication steps that an action lasts")
    offset: float = option(2.0, "largest distance from the scenario's start, on each axis [m]")
    turn: float = option(0.5, "largest difference from the heading of the scenario's start [rad]")
    effort: float = option(0.5, "weight of the squared action in the reward [m]")


@dataclass(frozen=True, kw_only=True)
class TrackingVectorOptions(TrackingOptions):
    """Arguments of :class:`TrackingVector`."""

    num_envs: int = option(1, "number of environments")
    device: str | Card | None = option(
        None, "`cuda` for a graphics card, as of `Simulations`; default: the processor"
    )


class _Task:
    """The task of a single environment, or of many.

    Attributes:
        system: the scenario's, with an observation in place of the controller.
        command, seen: names of the groups that actions set, and of the observation.
        every: steps that an action lasts.
        n_actions: number of actions in an episode.
        observations, actions: spaces.

    """

    def __init__(self, options: TrackingOptions) -> None:
        """Prepare the system.

        Raises:
            InputError: it has not one vehicle and its controller, or a value is not usable.

        """
        given, self.every = options.scenario, options.every
        if self.every < 1:
            raise InputError(f"every = {self.every}: must be at least 1")
        system = given if isinstance(given, System) else load(given)
        self.system, loop = _observed(system.with_parameters(options.parameters))
        self._interval = self.every * (self.system.step or DEFAULT_STEP)
        self.n_actions = round(options.duration / self._interval)
        if self.n_actions < 1:
            raise InputError(f"duration = {options.duration:g} s: at least {self._interval:g} s")
        lower, upper = (self._values(names) for names in (loop.lower_limits, loop.upper_limits))
        self._middle, self._half = (lower + upper) / 2, (upper - lower) / 2
        self.command, self.seen = loop.commanded[0].rpartition(".")[0], f"{loop.controller}.o"
        self._start = dict(zip(loop.start, self._values(loop.start), strict=True))
        self._moves = np.array([options.offset] * 3 + [options.turn])
        self._seed, self._effort = loop.seed, options.effort
        n = len(self.system.members(self.seen, ("output",)))
        self.observations = Box(-np.inf, np.inf, (n,), np.float64)
        self.actions = Box(-1.0, 1.0, (len(loop.commanded),), np.float32)

    def _values(self, names: Sequence[str]) -> np.ndarray:
        return np.array([self.system.value(PortName.read(name)) for name in names])

    def starts(self, generators: Sequence[np.random.Generator]) -> dict[str, np.ndarray]:
        """Draw the parameters of an episode from each generator."""
        moves = np.array([random.uniform(-self._moves, self._moves) for random in generators])
        return self._starts(moves, np.array([random.integers(_SEEDS) for random in generators]))

    def starts_together(self, generator: np.random.Generator, n: int) -> dict[str, np.ndarray]:
        """Draw the parameters of n episodes from one generator."""
        moves = generator.uniform(-self._moves, self._moves, (n, len(self._moves)))
        return self._starts(moves, generator.integers(_SEEDS, size=n))

    def _starts(self, moves: np.ndarray, seeds: np.ndarray) -> dict[str, np.ndarray]:
        starts = {
            name: value + move
            for (name, value), move in zip(self._start.items(), moves.T, strict=True)
        }
        return starts | {self._seed: seeds}

    def use(self, arrays: Any) -> None:
        """Compute with the arrays of a package from now on."""
        self._middle, self._half = map(arrays.asarray, (self._middle, self._half))

    def commands(self, actions: np.ndarray) -> np.ndarray:
        """Return the commands of actions within [-1, 1] [N, N.m]."""
        commands: np.ndarray = self._middle + self._half * actions
        return commands

    def rewards(self, seen: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Return minus the distance and the effort, times the length of an action."""
        distance = np.sqrt((seen[..., :3] ** 2).sum(axis=-1))
        cost: np.ndarray = distance + self._effort * (actions**2).sum(axis=-1)
        return -self._interval * cost


def _observed(system: System) -> tuple[System, Loop]:
    """Return a system with an observation in place of its controller, and the loop of its vehicle.

    Raises:
        InputError: it has not one vehicle and its controller.

    """
    loop, *others = loops_of(system)
    if others or loop.controller not in system.components:
        raise InputError(f"{system.name}: must have one vehicle and its controller")
    observation = read_component(loop.controller, current_fmus() / "Observation.fmu")
    observed = replace(
        system,
        components={**system.components, loop.controller: observation},
        connections=tuple(
            connection
            for connection in system.connections
            if connection.source.component != loop.controller
            and (
                connection.target.component != loop.controller
                or connection.target.port in observation.variables
            )
        ),
        parameters={
            port: value
            for port, value in system.parameters.items()
            if port.component != loop.controller
        },
        left_open={*system.left_open, *map(PortName.read, loop.commanded)},
    )
    if missing := observed.open_inputs(loop.controller):
        raise InputError(f"{system.name}: nothing feeds {loop.controller}.{missing[0]}")
    return observed, loop


class Tracking(gymnasium.Env[np.ndarray, np.ndarray]):  # type: ignore[misc]
    """A vehicle that is to follow a reference, without velocity sensors.

    Observation: 12 numbers in the body frame, the output of the component Observation: tracking
    error [m], desired velocity [m/s] and acceleration [m/s2], and the vertical.

    Action: force and moments, from -1 at the lower to 1 at the upper limits of (3).

    Reward: minus (distance from the reference + effort times squared action) times the seconds that
    an action lasts.

    An episode begins near the scenario's start, at random, with a new seed of the noise. It is
    truncated after its duration, and terminated only if a component fails.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    @method_takes_keywords(TrackingOptions)
    def __init__(self, options: TrackingOptions) -> None:
        """Load the system.

        Args:
            {arguments}

        Raises:
            ValueError: a name, a value or a file is not usable; the message says what to change.

        """
        self._task = _Task(options)
        self.observation_space, self.action_space = self._task.observations, self._task.actions
        self._simulation = Simulation(self._task.system, keep=False)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; the information has its parameters."""
        super().reset(seed=seed)
        starts = self._task.starts([self.np_random])
        parameters = {name: values.item() for name, values in starts.items()}
        self._simulation.reset(parameters)
        self._left = self._task.n_actions
        self._seen: np.ndarray = self._simulation[self._task.seen]
        return self._seen, parameters

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take an action."""
        task, simulation = self._task, self._simulation
        action = np.clip(action, -1.0, 1.0)
        terminated = False
        try:
            simulation[task.command] = task.commands(action)
            for _ in range(task.every):
                simulation.step()
            self._seen = simulation[task.seen]
        except SimulationFailed:
            terminated = True
        self._left -= 1
        reward = float(task.rewards(self._seen, action))
        return self._seen, reward, terminated, self._left <= 0, {}

    def close(self) -> None:
        """Free the simulation."""
        self._simulation.close()


class TrackingVector(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):  # type: ignore[misc]
    """Many :class:`Tracking` side by side, stepped on all cores or on a graphics card.

    The numbers are those of `SyncVectorEnv`, with the seeds `seed`, `seed + 1` and so on: an
    environment whose episode has ended begins the next one in the following step.

    On a card, observations, rewards and flags are arrays of CuPy, which torch and jax take without
    a copy (DLPack), and actions may be theirs. One generator draws the starts of all episodes,
    so a seed gives other episodes than on the processor.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    @method_takes_keywords(TrackingVectorOptions)
    def __init__(self, options: TrackingVectorOptions) -> None:
        """Load the system, whose components have to be in the language of equations.

        Args:
            {arguments}

        Raises:
            ValueError: a name, a value or a file is not usable; the message says what to change.

        """
        self._task, self.num_envs = _Task(options), options.num_envs
        self._simulations = Simulations(self._task.system, self.num_envs, device=options.device)
        self._arrays: Any = self._simulations.arrays
        with self._simulations.device:
            self._task.use(self._arrays)
        self.single_observation_space = self._task.observations
        self.single_action_space = self._task.actions
        self.observation_space, self.action_space = (
            batch_space(space, self.num_envs)
            for space in (self._task.observations, self._task.actions)
        )
        #: One for each environment, but on a card one for all.
        self._draws_together = options.device not in NAMES_OF_PROCESSOR
        n_generators = 1 if self._draws_together else self.num_envs
        self._generators = [np.random.default_rng() for _ in range(n_generators)]

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode in each environment."""
        if seed is not None:
            n = len(self._generators)
            seeds = range(seed, seed + n) if isinstance(seed, int) else seed
            if len(seeds) != n:
                raise InputError(f"seed: takes an integer or a list of {n}, not of {len(seeds)}")
            for i, each in enumerate(seeds):
                if each is not None:
                    self._generators[i], _ = np_random(each)
        arrays = self._arrays
        with self._simulations.device:
            self._left = arrays.empty(self.num_envs, int)
            self._seen = arrays.empty(self.observation_space.shape or ())
            self._ended = arrays.zeros(self.num_envs, bool)
            return self._seen, self._begin(~self._ended)

    def _begin(self, which: np.ndarray) -> dict[str, np.ndarray]:
        """Begin an episode in some environments, and return their parameters."""
        arrays, numbers = self._arrays, self._arrays.flatnonzero(which)
        if self._draws_together:
            starts = self._task.starts_together(self._generators[0], len(numbers))
        else:
            starts = self._task.starts([self._generators[i] for i in numbers])
        self._simulations.reset(numbers, starts)
        self._left[numbers] = self._task.n_actions
        self._seen[numbers] = self._simulations[self._task.seen][numbers]
        infos = {}
        for name, values in starts.items():
            infos[name] = arrays.zeros(self.num_envs, values.dtype)
            infos[name][numbers] = arrays.asarray(values)
            infos[f"_{name}"] = which
        return infos

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take an action in each environment, or begin an episode where the last one has ended."""
        task, simulations, ended = self._task, self._simulations, self._ended
        arrays: Any = self._arrays
        with simulations.device:
            actions = arrays.clip(as_array(arrays, actions), -1.0, 1.0)
            if not ended.all():
                simulations[task.command] = task.commands(actions)
                simulations.step(task.every)
            self._left -= 1
            terminated, truncated = simulations.failed, self._left <= 0
            failed, seen = terminated[:, np.newaxis], simulations[task.seen]
            self._seen = arrays.where(failed, self._seen, seen)
            rewards = task.rewards(self._seen, actions)
            infos = {}
            if ended.any():
                infos = self._begin(ended)
                rewards[ended], terminated[ended], truncated[ended] = 0.0, False, False
            self._ended = terminated | truncated
        return self._seen, rewards, terminated, truncated, infos


gymnasium.register(
    "auv_fmu/Tracking-v0",
    entry_point=f"{__name__}:Tracking",
    vector_entry_point=f"{__name__}:TrackingVector",
)
