"""Train a small neural network that steers the vehicle of Fig. 4, by PPO; write `policy.onnx`.

    pip install stable-baselines3 onnx
    python examples/tracking/train.py

`docs/how-to/learn.md` makes an FMU of it.
"""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

import orchestrator.bridges.gymnasium  # noqa: F401

#: Environments side by side, and all their steps.
N, STEPS = 256, 2_000_000

#: Episodes begin up to 6 m from the reference on each axis, with any heading.
TASK = {"parameters": {"plant.eta0": [0.0, 0.0, -2.0, 0.0, 0.0, 0.0]}, "offset": 6.0, "turn": np.pi}


class SideBySide(VecEnv):
    """A vector environment of Gymnasium in the form of Stable-Baselines3.

    All its episodes end at the same time.
    """

    def __init__(self, envs: gymnasium.vector.VectorEnv) -> None:
        """Take the environments."""
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self.envs = envs

    def reset(self) -> np.ndarray:
        """Begin episodes."""
        seed, self._seeds = self._seeds[0], [None] * self.num_envs
        return self.envs.reset(seed=seed)[0]

    def step_async(self, actions: np.ndarray) -> None:
        """Take the next actions."""
        self.actions = actions

    def step_wait(self) -> Any:
        """Make a step; after the last one of an episode, begin the next."""
        seen, rewards, _, ended, _ = self.envs.step(self.actions)
        infos: list[dict[str, Any]] = [{} for _ in ended]
        if ended.all():
            infos = [{"terminal_observation": each, "TimeLimit.truncated": True} for each in seen]
            seen = self.envs.step(self.actions)[0]
        return seen, rewards, ended, infos

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of each environment."""
        return [getattr(self.envs, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse to set attributes."""
        raise NotImplementedError

    def env_method(self, *_: Any, **__: Any) -> list[Any]:
        """Refuse to call methods."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No environment is wrapped."""
        return [False] * self.num_envs


class Commands(torch.nn.Module):
    """The policy's most likely action, as force and moments [N, N.m]."""

    def __init__(self, policy: Any, largest: float) -> None:
        """Take the policy, and the limit of the commands."""
        super().__init__()
        self.policy, self.largest = policy, largest

    def forward(self, o: torch.Tensor) -> torch.Tensor:
        """Return the commands."""
        actions = self.policy.action_net(self.policy.mlp_extractor.forward_actor(o))
        return self.largest * torch.clamp(actions, -1.0, 1.0)


def main() -> None:
    """Train, and write the file."""
    # Several threads for such small matrices only wait for each other.
    torch.set_num_threads(1)
    envs = gymnasium.make_vec("auv_fmu/Tracking-v0", num_envs=N, **TASK)
    model = PPO(
        "MlpPolicy", SideBySide(envs), n_steps=25, batch_size=800, n_epochs=5, gamma=0.97,
        learning_rate=lambda left: 1e-3 * left, seed=0,
        policy_kwargs={"log_std_init": -1.0, "net_arch": [32, 32]},
    )  # fmt: skip
    start = time.perf_counter()
    model.learn(STEPS)
    print(f"{STEPS} steps in {time.perf_counter() - start:.0f} s")
    commands = Commands(model.policy.cpu().eval(), 80.0)
    torch.onnx.export(
        commands, (torch.zeros(1, 12),), "policy.onnx", input_names=["o"], output_names=["tau"],
        opset_version=17, dynamo=False,
    )  # fmt: skip


if __name__ == "__main__":
    main()
