"""The laws of examples/ on a mass at the control point, whose motion is known in closed form."""

from __future__ import annotations

import inspect
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from auv_fmu import Vector, simulate
from fmus.kinds import NATIVE
from orchestrator.machine.compilers import machines_compiler
from orchestrator.runs import SCENARIOS_FOLDER
from orchestrator.runs.own_components import build_own
from support.examples import EXAMPLES, NAMES, load

#: The laws: every example with gains to tune.
LAWS = [name for name in NAMES if hasattr(load(name), "GAINS")]

#: Roll, pitch and yaw of the vehicle of these tests [rad], which does not turn.
EULER = (0.4, -0.5, 2.0)

#: Body to earth, by scipy.
R = Rotation.from_euler("ZYX", EULER[::-1]).as_matrix()

MASS, DRAG, ELL = (
    np.array([25.0, 15.0 / 0.1225, 22.5 / 0.1225]),
    np.array([30.0, 160.0, 150.0]),
    0.35,
)

#: A reference over time: its position, velocity and acceleration.
Reference = Callable[[float], tuple[Any, Any, Any]]


class Loop:
    """A law in a loop with the mass: its velocity in the body frame is v, its position y."""

    def __init__(
        self, name: str, y: Any, dy: Any, most: float = 1e6, mass: Any = MASS, **gains: Any
    ) -> None:
        """Begin at a position [m] with a velocity [m/s].

        Args:
            name: of the law.
            y, dy: position [m] and velocity [m/s] at the start.
            most: limit of force and moments [N, N.m].
            mass: that the law knows [kg].
            gains: of the law.

        """
        self.law: ModuleType = load(name)
        point = self.law.Parameters().point._replace(
            mass=Vector(mass), drag=Vector(DRAG), ell=ELL, tau_max=(most,) * 3
        )
        self.parameters = self.law.Parameters(point=point, **gains)
        self.y, self.v = np.array(y, float), R.T @ np.array(dy, float)
        self.state: Any = None
        self.t = 0.0

    def call(self, hook: str, **known: Any) -> Any:
        """Call a hook of the law with the arguments that it takes."""
        function = getattr(self.law, hook)
        known |= {"parameters": self.parameters, "state": self.state}
        return function(*(known[name] for name in inspect.signature(function).parameters))

    def sample(self, reference: Reference) -> Any:
        """Force of the law in the body frame [N]; its state is for the next step."""
        y_d, dy_d, ddy_d = reference(self.t)
        given = {"y": self.y, "dy": R @ self.v, "y_d": y_d, "dy_d": dy_d, "ddy_d": ddy_d}
        given = {key: Vector(value) for key, value in given.items()} | {"eta": EULER}
        fields = self.law.Inputs._fields
        self.known = {"inputs": self.law.Inputs(*(given[field] for field in fields))}
        if self.state is None and hasattr(self.law, "start"):
            self.state = self.call("start", **self.known)
        if hasattr(self.law, "derive"):
            self.known["derived"] = self.call("derive", **self.known)
        self.tau = self.call("outputs", **self.known).tau
        return np.array([self.tau[0], self.tau[2] / ELL, -self.tau[1] / ELL])

    def step(self, reference: Reference, h: float, w: Any = (0.0, 0.0, 0.0)) -> None:
        """Move the mass for h seconds with the held force and w [N], both in the body frame."""
        force = self.sample(reference) + w
        if hasattr(self.law, "update"):
            self.state = self.call("update", **self.known, h=h)
        rate, end = DRAG / MASS, force / DRAG
        self.y = self.y + R @ (end * h + (self.v - end) * -np.expm1(-rate * h) / rate)
        self.v = end + (self.v - end) * np.exp(-rate * h)
        self.t += h

    def error(self, reference: Reference) -> Any:
        """Tracking error in the body frame [m]."""
        return R.T @ (self.y - reference(self.t)[0])


def still(t: float) -> tuple[Any, Any, Any]:
    """A reference that stays at the origin."""
    return np.zeros(3), np.zeros(3), np.zeros(3)


def moving(t: float) -> tuple[Any, Any, Any]:
    """A reference on a curve."""
    w, a = np.array([0.7, 0.5, 0.3]), np.array([1.0, 2.0, 1.5])
    return a * np.sin(w * t), a * w * np.cos(w * t), -a * w * w * np.sin(w * t)


@pytest.mark.parametrize("name", LAWS)
def test_law_is_below_a_hundred_lines_and_keeps_the_contract(name: str) -> None:
    law = load(name)
    assert len((EXAMPLES / name / f"{name}.py").read_text().splitlines()) < 100
    assert {*law.Inputs._fields} <= {"y", "eta", "dy", "y_d", "dy_d", "ddy_d"}
    assert "tau" in law.Outputs._fields
    for gain, (low, high) in law.GAINS.items():
        assert 0.0 < low <= getattr(law.Parameters(), gain) <= high


@pytest.mark.parametrize("name", LAWS)
def test_commands_are_within_the_limits(name: str) -> None:
    loop = Loop(name, [30.0, -20.0, 10.0], [1.0, -1.0, 0.5], most=20.0)
    reached = 0.0
    for _ in range(500):
        loop.step(moving, 0.02)
        reached = max(reached, *map(abs, loop.tau))
    assert 19.9 < reached <= 20.0 + 1e-12


@pytest.mark.parametrize("name", LAWS)
def test_error_dies_out_with_the_default_gains(name: str) -> None:
    """From rest, 5 m away from a reference that moves, within limits that act at first."""
    # PID has no feed-forward.
    reference = still if name == "pid_law" else moving
    loop = Loop(name, [3.0, -3.0, 2.5], [0.0, 0.0, 0.0], most=80.0)
    for _ in range(3000):
        loop.step(reference, 0.02)
    # The learned law is no better than what it saw.
    assert np.linalg.norm(loop.error(reference)) < (0.06 if name == "learned_law" else 0.03)


def test_pid_has_the_poles_of_its_gains() -> None:
    """The matrix of the sampled loop against the polynomial of the continuous one."""
    h, omega, zeta, T_i, T_f = 1e-4, 1.5, 1.2, 5.0, 0.2
    gains = {"omega": omega, "zeta": zeta, "T_i": T_i, "T_f": T_f}

    def after(x: Any) -> Any:
        """Position, velocity and memory one step after x, all along the axes of the body."""
        y, v, i, y_f = x.reshape(4, 3)
        loop = Loop("pid_law", R @ y, R @ v, **gains)
        loop.state = loop.law.State(Vector(R @ i), Vector(R @ y_f), Vector(np.zeros(3)))
        loop.step(still, h)
        return np.concatenate(
            [loop.y @ R, loop.v, np.array(loop.state.i) @ R, np.array(loop.state.y_f) @ R]
        )

    matrix = np.transpose([after(row) for row in np.eye(12)])
    found = np.sort_complex(np.log(np.linalg.eigvals(matrix).astype(complex)) / h)
    expected = []
    for m, d in zip(MASS, DRAG, strict=True):
        k_p, k_d, k_i = omega**2 * m, 2 * zeta * omega * m - d, omega**2 * m / T_i
        # (m s^2 + d s) s (1 + T_f s) + k_p s (1 + T_f s) + k_d s^2 + k_i (1 + T_f s)
        expected += [*np.roots([m * T_f, m + d * T_f, d + k_p * T_f + k_d, k_p + k_i * T_f, k_i])]
    # Half a step of delay by the held force, relative to the fastest pole.
    assert found == pytest.approx(np.sort_complex(expected), rel=2e-3)


def test_pid_does_not_wind_up() -> None:
    """Held 10 m away, then put on the other side: the force turns within the time of the loop."""
    loop = Loop("pid_law", R @ [10.0, 0.0, 0.0], [0.0] * 3, most=80.0, omega=1.0)
    for _ in range(5000):
        loop.step(still, 0.02)
        loop.y, loop.v = R @ [10.0, 0.0, 0.0], np.zeros(3)
    assert loop.tau[0] == -80.0
    loop.y = R @ [-0.5, 0.0, 0.0]
    forces = []
    for _ in range(150):
        loop.step(still, 0.02)
        loop.y, loop.v = R @ [-0.5, 0.0, 0.0], np.zeros(3)
        forces.append(loop.tau[0])
    assert forces[-1] > 0.0


def test_pd_plus_has_the_error_of_its_poles() -> None:
    omega, zeta, h = 1.2, 1.0, 1e-3
    e, de = np.array([0.5, -1.0, 0.8]), np.array([0.2, 0.3, -0.4])
    y_d, dy_d, _ = moving(0.0)
    loop = Loop("pd_plus", y_d + R @ e, dy_d + R @ de, omega=omega, zeta=zeta)
    seen = []
    for _ in range(5000):
        loop.step(moving, h)
        seen.append(loop.error(moving))
    t = h * np.arange(1, 5001)[:, None]
    # Two poles at -omega: e(t) = (e + (de + omega e) t) exp(-omega t).
    assert np.array(seen) == pytest.approx(
        (e + (de + omega * e) * t) * np.exp(-omega * t), abs=2e-3
    )


@pytest.mark.parametrize("h", [2e-3, 1e-3])
def test_super_twisting_reaches_its_surface_in_finite_time_and_stays(h: float) -> None:
    """Under a disturbance with |dw/dt| < L; of the order of h^2, as Levant (1993) proves."""
    L, c = 0.5, 1.0

    def w(t: float) -> Any:
        """Disturbance in the earth frame [m/s2]."""
        return np.array([0.4 * np.sin(t), 0.3 - 0.2 * np.sin(2.0 * t), 0.45 * np.cos(t)])

    loop = Loop("super_twisting", [0.5, 0.0, -0.3], [0.0, 0.5, 0.4], L=L, c=c)
    late = []
    while loop.t < 10.0:
        loop.step(still, h, MASS * (R.T @ w(loop.t)))
        if loop.t > 5.0:
            s = R @ loop.v + c * loop.y
            late.append(np.abs([*(s / (L * h * h)), *((loop.state.v + Vector(w(loop.t))) / L / h)]))
    # In units of L h^2 and of L h: numbers of the order of one, for each h.
    assert np.max(late) < 10.0


def test_backstepping_has_the_energy_of_its_proof() -> None:
    """V falls at its rate, with a constant disturbance, and all errors vanish."""
    k_1, k_2, gamma, h = 0.8, 1.5, 0.6, 2e-3
    w = R @ [0.3, -0.2, 0.1]
    loop = Loop("backstepping", [1.5, 1.0, 1.5], [0.5] * 3, k_1=k_1, k_2=k_2, gamma=gamma)

    def energies() -> tuple[float, float]:
        """V and dV/dt now."""
        y_d, dy_d, _ = moving(loop.t)
        z_1 = loop.y - y_d
        z_2 = R @ loop.v - dy_d + k_1 * z_1
        wrong = w - (0.0 if loop.state is None else np.array(loop.state.w))
        V = (k_1 * k_2 * z_1 @ z_1 + z_2 @ z_2 + wrong @ wrong / gamma) / 2.0
        return V, -(k_1**2) * k_2 * z_1 @ z_1 - k_2 * z_2 @ z_2

    seen = [energies()]
    for _ in range(10_000):
        loop.step(moving, h, MASS * (R.T @ w))
        seen.append(energies())
    V, rate = np.transpose(seen)
    # The sampled loop is half a step late.
    assert np.diff(V) / h == pytest.approx(rate[:-1], abs=0.005 * V[0])
    assert V[-1] < 1e-4 * V[0]


def test_mrac_has_the_energy_of_its_proof() -> None:
    """Errors and wrong parameters have an energy that falls at its rate, for a wrong mass."""
    omega, zeta, gamma, h = 1.2, 0.9, 0.8, 2e-3
    known, w = np.array([20.0, 150.0, 200.0]), np.array([4.0, -20.0, 15.0])
    given = {"omega": omega, "zeta": zeta, "gamma": gamma, "sigma": 0.0}
    loop = Loop("mrac", [0.5, 0.0, -0.5], [0.3, -0.2, 0.4], mass=known, **given)
    # With these, m dv/dt = f - d v + w is the model for f = m_0 (a + Theta Phi) + d v.
    nothing = np.zeros(3)
    right = np.transpose([nothing, nothing, MASS / known - 1.0, -w / known])
    P = np.array([[omega**2 * (1 + 2 * zeta**2), zeta * omega], [zeta * omega, 1.0]])
    Q = 2 * zeta * omega * np.diag([omega**2, 1.0])
    A = np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]])
    assert np.allclose(A.T @ P + P @ A, -Q)

    def energies() -> tuple[float, float]:
        """V and dV/dt now."""
        y_m, dy_m, Theta = (np.array(part) for part in loop.state)
        x = np.array([loop.y - y_m, R @ loop.v - dy_m])
        wrong = known / MASS @ ((Theta - right) ** 2).sum(axis=1) / gamma
        return np.trace(x.T @ P @ x) + wrong, -np.trace(x.T @ Q @ x)

    loop.sample(moving)
    # Away from the model, with which the law begins.
    loop.state = loop.state._replace(y_m=loop.state.y_m + Vector((0.3, -0.4, 0.2)))
    seen = [energies()]
    for _ in range(5_000):
        loop.step(moving, h, w)
        seen.append(energies())
    V, rate = np.transpose(seen)
    # The sampled loop is half a step late.
    assert np.diff(V) / h == pytest.approx(rate[:-1], abs=0.005 * V[0])
    assert V[-1] < 0.5 * V[0]


def test_predictive_law_is_the_regulator_of_its_horizon_without_limits() -> None:
    """The gain of the Riccati recursion over the moves, with a discrete model by scipy."""
    omega, moves = 1.7, 12
    T = 4.0 / omega / moves
    step = expm(T * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
    A, B = step[:2, :2], step[:2, 2:]
    Q, cost = np.diag([1.0, 0.0]), omega**-4
    P = Q
    for k in range(moves):
        gain = np.linalg.solve(B.T @ P @ B + cost, B.T @ P @ A)
        P = (Q if k < moves - 1 else 0.0) + A.T @ P @ (A - B @ gain)
    loop = Loop("predictive", [3.0, -1.0, 2.0], [0.2, 0.9, -1.0], omega=omega)
    y_d, dy_d, ddy_d = moving(0.0)
    e, de = R.T @ (loop.y - y_d), loop.v - R.T @ dy_d
    u = -(gain @ [e, de])[0]
    assert loop.sample(moving) == pytest.approx(MASS * (u + R.T @ ddy_d) + DRAG * loop.v, rel=1e-9)


def test_predictive_law_has_the_best_plan_within_the_limits() -> None:
    """First moves against scipy's bounded least squares, for random errors and limits."""
    law, rng = load("predictive"), np.random.default_rng(1)
    stacked = np.vstack([law.G, np.eye(law.N)])
    wrong = []
    for _ in range(300):
        x, (low, high) = rng.normal(size=2) * 2.0, rng.uniform((-1.0, 0.1), (-0.1, 1.0))
        right = np.append(-np.array(law.S) @ x, np.zeros(law.N))
        best = lsq_linear(stacked, right, (low, high), tol=1e-12).x[0]
        wrong.append(abs(law.first(*x, low, high) - best) / (high - low))
    # A few plans need more than ROUNDS steps of the gradient method.
    assert np.quantile(wrong, 0.95) < 1e-9
    assert max(wrong) < 0.03


def test_learned_law_is_its_network() -> None:
    omega, a_0 = 1.4, 0.6
    loop = Loop("learned_law", [1.0, -2.0, 0.5], [0.3, 0.1, -0.4], omega=omega, a_0=a_0)
    y_d, dy_d, ddy_d = moving(0.0)
    e, de = R.T @ (loop.y - y_d), loop.v - R.T @ dy_d
    x = np.concatenate([omega**2 * e, omega * de, omega * loop.v]) / a_0
    u = a_0 * np.array(loop.law.W_2) @ np.tanh(np.array(loop.law.W_1) @ x)
    expected = MASS * (u + R.T @ ddy_d) + DRAG * loop.v
    assert loop.sample(moving) == pytest.approx(expected, rel=1e-12)


#: Errors in the last 20 s [m] that no law exceeds with its default gains, and PID.
SCENARIOS = {"fig4": (0.2, 0.3), "remus": (0.3, 0.3), "bluerov": (0.6, 1.5)}


@pytest.mark.slow
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
@pytest.mark.parametrize("name", LAWS)
def test_default_gains_are_stable_on_three_vehicles(name: str, tmp_path: Path) -> None:
    """In the scenarios of the bundle; what the law knows is in the parameters of the planner."""
    fmu = build_own(EXAMPLES / name, tmp_path, kind=NATIVE)
    fields = load(name).Inputs._fields
    for scenario, (most, most_of_pid) in SCENARIOS.items():
        text = (SCENARIOS_FOLDER / f"{scenario}.toml").read_text()
        table = {key: value for key, value in tomllib.loads(text).items() if key != "compare"}
        table.setdefault("components", {})["controller"] = str(fmu)
        wires = table.setdefault("wires", {})
        if "dy" in fields:
            wires["controller.dy"] = "plant.dy"
        if "ddy_d" not in fields:
            wires["controller.ddy_d"] = False
        known = {"ell": ELL, "tau_max": [80.0] * 3}
        if planner := table["parameters"].get("planner", {}):
            ell = planner["ell"]
            known = {
                "ell": ell,
                "tau_max": planner["tau_max"],
                "mass": [planner["m11"], planner["m66"] / ell**2, planner["m55"] / ell**2],
                "drag": [planner["d11"], planner["d66"] / ell**2, planner["d55"] / ell**2],
            }
        table["parameters"]["controller"] = known
        result = simulate(table)
        error = np.linalg.norm(result.group("plant.y") - result.group("planner.y_d"), axis=1)
        late = error[result.time > result.time[-1] - 20.0].max()
        assert late < (most_of_pid if name == "pid_law" else most), scenario


@pytest.mark.slow
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_training_has_made_the_learned_law_better(tmp_path: Path) -> None:
    """On vehicles that neither trained nor chose it, with the cost of the training."""
    for name in ("learned_law.py", "train.py"):
        shutil.copy(EXAMPLES / "learned_law" / name, tmp_path)
    build_own(tmp_path / "learned_law.py", tmp_path, kind=NATIVE)
    program = (
        "import learned_law, numpy as np, train\n"
        "from auv_fmu import Simulations\n"
        "sims = Simulations(train.LOOP, 200)\n"
        "drawn = train.vehicles(np.random.default_rng(7), 200)\n"
        "learned = np.concatenate([np.ravel(learned_law.W_1), np.ravel(learned_law.W_2)])\n"
        "for weights in (train.beginning(np.random.default_rng(1)), learned):\n"
        "    print(train.costs(sims, np.tile(weights, (200, 1)), drawn).mean())\n"
    )
    command = [sys.executable, "-c", program]
    printed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    before, after = map(float, printed.stdout.split())
    assert after < 0.75 * before
