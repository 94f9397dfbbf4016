"""Train a small neural network that steers the vehicle of Fig. 4, and write `policy.npz`.

    python examples/policy/train.py
    auv-fmu new component policy --from policy.npz
    auv-fmu build policy/policy.py --kind native --out examples/policy
    auv-fmu run examples/policy/policy.toml

The network learns the commands of a saturated PD law in random states: a force at the control
point, which (11) turns into tau. The law measures the velocity, which the paper's controller does
not.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

#: Gains of the law, limit of the force, resistance of the water, distance of the control point.
K_P, K_D, MOST, DRAG, ELL = 60.0, 40.0, 60.0, 30.0, 0.35

#: Neurons of the two hidden layers, and how long they learn.
NEURONS, STEPS, BATCH, RATE = 32, 6_000, 1_024, 3e-3

#: The inputs: y, eta (phi, theta, psi), y_d, dy_d, dy.
N_INPUTS = 15


def law(e: np.ndarray, de: np.ndarray, dy_d: np.ndarray, euler: np.ndarray) -> np.ndarray:
    """Commands of the law, a row for each state."""
    force = MOST * np.tanh((-K_P * e - K_D * de) / MOST) + DRAG * dy_d
    phi, theta, psi = euler.T
    # Rows of the transposed rotation: the axes of the body in the earth frame.
    b1 = np.stack((np.cos(psi) * np.cos(theta), np.sin(psi) * np.cos(theta), -np.sin(theta)), -1)
    b2 = np.stack(
        (
            -np.sin(psi) * np.cos(phi) + np.cos(psi) * np.sin(theta) * np.sin(phi),
            np.cos(psi) * np.cos(phi) + np.sin(psi) * np.sin(theta) * np.sin(phi),
            np.cos(theta) * np.sin(phi),
        ),
        -1,
    )
    b3 = np.cross(b1, b2)
    f1, f2, f3 = ((force * axis).sum(axis=1) for axis in (b1, b2, b3))
    return np.stack((f1, -ELL * f3, ELL * f2), axis=1)


def states(random: np.random.Generator, n: int) -> np.ndarray:
    """Random states of a vehicle near the helix: e, de, dy_d, angles."""
    near = random.random((n, 1)) < 0.7
    e = random.normal(size=(n, 3)) * np.where(near, 0.3, 4.0)
    de = random.normal(size=(n, 3)) * np.where(near, 0.2, 0.8)
    dy_d = random.normal(size=(n, 3)) * 0.8
    euler = np.stack(
        (
            random.normal(size=n) * 0.1,
            random.uniform(-0.9, 0.9, n),
            random.uniform(-np.pi, np.pi, n),
        ),
        axis=1,
    )
    return np.concatenate((e, de, dy_d, euler), axis=1)


def trained(random: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    """Train three layers by Adam, and return their weights and biases."""
    sizes = (12, NEURONS, NEURONS, 3)
    layers = [[random.normal(size=(m, n)) / np.sqrt(n), np.zeros(m)] for n, m in pairwise(sizes)]
    moments = [[[np.zeros_like(p), np.zeros_like(p)] for p in layer] for layer in layers]
    scale = np.array((MOST, ELL * MOST, ELL * MOST))
    for step in range(1, STEPS + 1):
        x = states(random, BATCH)
        wanted = law(x[:, :3], x[:, 3:6], x[:, 6:9], x[:, 9:]) / scale
        values = [x]
        for i, (W, b) in enumerate(layers):
            z = values[-1] @ W.T + b
            values.append(np.tanh(z) if i < 2 else z)
        gradient = 2.0 * (values[-1] - wanted) / BATCH
        rate = RATE * (1.0 - step / (STEPS + 1))
        for i in (2, 1, 0):
            W, b = layers[i]
            if i < 2:
                gradient = gradient * (1.0 - values[i + 1] ** 2)
            slopes = (gradient.T @ values[i], gradient.sum(axis=0))
            gradient = gradient @ W
            for parameter, slope, (m, v) in zip((W, b), slopes, moments[i], strict=True):
                m += 0.1 * (slope - m)
                v += 0.001 * (slope**2 - v)
                corrected = np.sqrt(v / (1.0 - 0.999**step)) + 1e-8
                parameter -= rate * (m / (1.0 - 0.9**step)) / corrected
        if step % 1000 == 0:
            error = np.sqrt(np.mean((values[-1] - wanted) ** 2))
            print(f"{step}: error {error:.3f} of the largest force", file=sys.stderr)
    layers[2] = [layers[2][0] * scale[:, None], layers[2][1] * scale]
    return [(W, b) for W, b in layers]


def main() -> None:
    """Train the network and write the file."""
    (W1, b1), *others = trained(np.random.default_rng(1))
    # The differences e = y - y_d and de = dy - dy_d are part of the first layer.
    V1 = np.zeros((NEURONS, N_INPUTS))
    e, de, dy_d, euler = (W1[:, i : i + 3] for i in (0, 3, 6, 9))
    V1[:, 0:3], V1[:, 3:6], V1[:, 6:9], V1[:, 9:12], V1[:, 12:15] = e, euler, -e, dy_d - de, de
    arrays = {"W1": V1, "b1": b1}
    for i, (W, b) in enumerate(others, start=2):
        arrays |= {f"W{i}": W, f"b{i}": b}
    np.savez(Path("policy.npz"), **{name: a.astype(np.float32) for name, a in arrays.items()})


if __name__ == "__main__":
    main()
