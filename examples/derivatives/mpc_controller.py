"""The predictive controller of `nonlinear_mpc.py`, as a script for PythonFMU.

Every 0.2 s it makes one Gauss-Newton step. It needs casadi and numpy wherever its FMU runs, and two
functions of `nonlinear_mpc.py` in files beside it. The reference ahead is not among its inputs: it
continues the present one at constant acceleration.
"""

from pathlib import Path

import casadi as ca
import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

DRIFT, PLANNER = (
    ca.Function.deserialize(Path(__file__).with_name(f"{name}.casadi").read_text())
    for name in ("drift", "planner")
)

#: Inputs, and commands.
POSTURE, VECTOR = ("x", "y", "z", "phi", "theta", "psi"), ("x", "y", "z")
GROUPS = {"eta": POSTURE, "nu": "uvwpqr", "y_d": VECTOR, "dy_d": VECTOR, "ddy_d": VECTOR}
INPUTS = [f"{name}.{k}" for name, parts in GROUPS.items() for k in parts]
OUTPUTS = ["tau.u", "tau.q", "tau.r"]

#: Length of a move [s], the times of their ends from now on, and the share of the wrong velocity
#: that corrects the disturbance.
MOVE = 0.2
ENDS = MOVE * np.arange(1, PLANNER.numel_in(0) // 3 + 1)[:, None]
SHARE = 0.2


class MpcController(Fmi2Slave):
    """The controller as an FMU; PythonFMU calls `do_step` once every communication step."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = dict.fromkeys(INPUTS + OUTPUTS, 0.0)
        self.plan, self.tau_w = np.zeros(PLANNER.numel_in(0)), np.zeros(6)
        self.motion, self.due = None, 0.0
        for name in INPUTS:
            self._register(name, Fmi2Causality.input)
        for name in OUTPUTS:
            self._register(name, Fmi2Causality.output)

    def _register(self, name, causality):
        """Register a variable whose value is stored under its name."""

        def get():
            return self.values[name]

        def put(value):
            self.values[name] = value

        kind = {"causality": causality, "variability": Fmi2Variability.continuous}
        self.register_variable(Real(name, getter=get, setter=put, **kind), nested=False)

    def do_step(self, current_time, step_size):
        """Improve the plan at the end of each move."""
        if current_time < self.due - 1e-9:
            return True
        self.due = current_time + MOVE
        given, tau = np.array([self.values[name] for name in INPUTS]), self.plan[:3]
        if self.motion is not None:
            nu, slope = (value.full() for value in DRIFT(self.motion, tau, self.tau_w))
            wrong = np.linalg.solve(slope, given[6:12] - nu.ravel())
            self.tau_w, self.plan = (
                self.tau_w + SHARE * wrong,
                np.append(self.plan[3:], self.plan[-3:]),
            )
        self.motion, (y_d, dy_d, ddy_d) = given[:12], given[12:].reshape(3, 3)
        ahead = y_d + ENDS * dy_d + ENDS**2 / 2.0 * ddy_d
        givens = np.concatenate((self.motion, self.tau_w, tau, ahead.ravel()))
        self.plan = PLANNER(self.plan, givens).full().ravel()
        self.values.update(zip(OUTPUTS, self.plan[:3].tolist()))
        return True
