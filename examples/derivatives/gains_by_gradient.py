"""Tune the gains of the paper's controller by derivatives of a whole run of the closed loop.

    python examples/derivatives/gains_by_gradient.py [STARTS]

Scenario, ranges and aim as in `python tools/page_numbers.py gains`: the least largest error of the
second half of a run whose commands stay within a limit. Searches start from the paper's gains, and
STARTS more from random gains.
"""

import sys
from time import process_time

import casadi as ca
import numpy as np
from scipy.optimize import linprog

from auv_fmu.casadi import model

#: Gains and their ranges, and the outputs that count.
RANGES = {
    "lambda": (0.2, 5.0), "k_d": (5.0, 50.0), "gamma": (0.1, 10.0), "sigma": (1e-4, 0.1),
    "eps_t": (0.1, 100.0), **{f"K{n}[{axis}]": (1.0, 100.0) for n in (1, 2) for axis in (1, 2, 3)},
}  # fmt: skip
LOOP = model("fig5", {"planner.eta0.z": -2.0}, [f"controller.{name}" for name in RANGES])
LOW, HIGH = np.log([RANGES[name.partition(".")[2]] for name in LOOP.parameters]).T
PAPER = np.log(LOOP.default_parameters)
SHOWN = [f"controller.{name}" for name in ("e.x", "e.y", "e.z", "tau.u", "tau.q", "tau.r")]

#: The step [s], the number of steps, and the number of errors that count.
H, STEPS = 0.02, 5000
LATE = STEPS // 2 + 1

#: Limits of the commands [N, N.m], and metres that an excess of 1 N costs.
LIMITS, PRICE = (10.0, 20.0, 80.0), 0.1


def run_of():
    """Return late errors and all commands as a function of ln(gains), and its derivatives."""
    state, t = ca.SX.sym("state", len(LOOP.state)), ca.SX.sym("t")
    gains, inputs = ca.SX.sym("gains", len(PAPER)), LOOP.default_inputs
    shown = [LOOP.outputs.index(name) for name in SHOWN]
    begin = LOOP.start(inputs, ca.exp(gains), 0.0)
    first = LOOP.observe(begin, inputs, ca.exp(gains), 0.0)
    after, outputs = LOOP.advance(state, inputs, ca.exp(gains), H, t)
    fast = {"cse": True, "der_options": {"cse": True}}
    start = ca.Function("start", [gains], [begin, first[shown]], fast)
    step = ca.Function("step", [state, gains, t], [after, outputs[shown]], fast)
    gains, times = ca.MX.sym("gains", len(PAPER)), H * np.arange(STEPS)
    begin, first = start(gains)
    _, rows = step.mapaccum(STEPS)(begin, ca.repmat(gains, 1, STEPS), times[None])
    rows = ca.horzcat(first, rows)
    errors = ca.sqrt(ca.sum1(rows[:3, -LATE:] ** 2))
    values = ca.vertcat(errors.T, ca.vec(ca.fabs(rows[3:, :-1])))
    slopes = ca.jacobian(values, gains)
    return ca.Function("run", [gains], [values]), ca.Function("slopes", [gains], [slopes])


def cost(values, limit):
    """Return the largest late error, with the price of commands beyond a limit."""
    return values[:LATE].max() + PRICE * max(values[LATE:].max() - limit, 0.0)


def search(run, slopes, gains, limit, radius=0.5):
    """Return ln(gains), their values, and how many runs and derivatives have been made.

    Each step is the solution of a linear program: the least predicted cost in a box, which grows
    after a good prediction and shrinks after a bad one.
    """
    values, at, counts = run(gains).full()[:, 0], None, np.array([1, 0])
    is_late, target = np.arange(len(values)) < LATE, np.append([0.0] * len(gains), (1.0, PRICE))
    while radius > 1e-3:
        if at is not gains:
            at, counts[1] = gains, counts[1] + 1
            near = values > np.where(is_late, 0.5 * values[:LATE].max(), 0.5 * limit)
            A = np.column_stack((slopes(gains).full(), -1.0 * is_late, is_late - 1.0))[near]
            b = (np.where(is_late, 0.0, limit) - values)[near]
        box = np.clip([gains - radius, gains + radius], LOW, HIGH).T - gains[:, None]
        found = linprog(target, A, b, bounds=[*box, (0.0, None), (0.0, None)])
        if not found.success:
            break
        tried = run(gains + found.x[:-2]).full()[:, 0]
        counts[0] += 1
        gain, promised = (cost(values, limit) - other for other in (cost(tried, limit), found.fun))
        if gain > 0.1 * promised:
            gains, values = gains + found.x[:-2], tried
            radius = min(2.0 * radius, (HIGH - LOW).max())
        else:
            radius /= 4.0
        if promised < 0.01 * cost(values, limit):
            break
    return gains, values, counts


def differences(run, d):
    """Return derivatives by central differences of a run."""

    def slopes(gains):
        pairs = ((run(gains + push), run(gains - push)) for push in d * np.eye(len(gains)))
        return ca.horzcat(*((above - below) / (2.0 * d) for above, below in pairs))

    return slopes


if __name__ == "__main__":
    run, exact = run_of()
    tries = {
        "exact": (exact, PAPER),
        "by 1 %": (differences(run, 1e-2), PAPER),
        "by 0.01 %": (differences(run, 1e-4), PAPER),
    }
    random = np.random.default_rng(1)
    for k in range(int(sys.argv[1]) if len(sys.argv) > 1 else 0):
        tries[f"random {k + 1}"] = exact, random.uniform(LOW, HIGH)
    print("limit  search      late error   command   runs  derivatives    time")
    for limit in LIMITS:
        found = []
        for name, (slopes, start) in tries.items():
            begun = process_time()
            gains, values, counts = search(run, slopes, start, limit)
            found.append((cost(values, limit), gains))
            errors, commands = 100.0 * values[:LATE], values[LATE:]
            row = f"{limit:5.0f}  {name:11} {errors.max():7.2f} cm {commands.max():9.2f}"
            print(row, "{:5} {:12}".format(*counts), f"{process_time() - begun:5.0f} s", flush=True)
        best = np.exp(min(found, key=lambda pair: pair[0])[1])
        names = (name.partition(".")[2] for name in LOOP.parameters)
        print("      ", ", ".join(f"{name} {gain:.6g}" for name, gain in zip(names, best)))
