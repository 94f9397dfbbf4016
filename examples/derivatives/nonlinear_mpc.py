"""Steer the vehicle of Fig. 4 by nonlinear model predictive control with exact derivatives.

    python examples/derivatives/nonlinear_mpc.py

Every 0.2 s the commands of the next 3 s are planned within the limits: by IPOPT, or by one
Gauss-Newton step from the last plan. Both know the true posture and velocity, the plant's
parameters, and the reference ahead. Of the disturbance they see only by how much the last predicted
velocity was wrong, and take it for a constant force and moment.
"""

from time import process_time

import casadi as ca
import numpy as np

from auv_fmu import Simulation, simulate
from auv_fmu.casadi import model

QUIET, STOP, STARTS = {"plant.noise.std": 0.0}, 40.0, 5

#: Moves that are planned, the steps of 20 ms that each is held, and its length [s]: one step of the
#: classical Runge-Kutta scheme.
MOVES, HOLD, MOVE = 15, 10, 0.2

#: Limit of the commands [N, N.m], weights of commands and of their changes against a metre, and the
#: share of the wrong velocity that corrects the disturbance.
LIMIT, WEIGHT, CHANGE, SHARE = 80.0, 0.01, 0.075, 0.2

PLANT = model("AuvPlant", {"integrator": "rk4"}, free=["eta0", "nu0"])
NU, END = PLANT.state.index("state.nu_r.u"), PLANT.state.index("state.tau.u")
Y = PLANT.outputs.index("y.x")


def functions():
    """Return drift(motion, tau, tau_w), and planners by name: functions of a plan and its givens.

    A motion is eta and nu. The drift is nu after a move, and how tau_w changes it. Givens are the
    motion, tau_w, the last command and y_d after each move.
    """
    state, tau, tau_w = ca.SX.sym("state", END), ca.SX.sym("tau", 3), ca.SX.sym("tau_w", 6)
    full, inputs = ca.vertcat(state, ca.SX.zeros(6)), ca.vertcat(tau, tau_w, ca.SX.zeros(6))
    after, out = PLANT.advance(full, inputs, PLANT.default_parameters, MOVE, 0.0)
    move = ca.Function("move", [state, tau, tau_w], [after[:END], out[Y : Y + 3]])
    motion = ca.SX.sym("motion", 12)
    first = PLANT.start(PLANT.default_inputs, motion, 0.0)[:END]
    begin, nu = ca.Function("begin", [motion], [first]), move(first, tau, tau_w)[0][NU:]
    drift = ca.Function("drift", [motion, tau, tau_w], [nu, ca.jacobian(nu, tau_w)])

    sizes = 12, 6, 3, 3 * MOVES
    plan, given = ca.MX.sym("plan", 3 * MOVES), ca.MX.sym("given", sum(sizes))
    motion, tau_w, before, y_d = ca.vertsplit(given, [0, *np.cumsum(sizes).tolist()])
    taus = ca.reshape(plan, 3, MOVES)
    _, y = move.mapaccum(MOVES)(begin(motion), taus, ca.repmat(tau_w, 1, MOVES))
    changes = plan - ca.vertcat(before, plan[:-3])
    residuals = ca.vertcat(ca.vec(y) - y_d, WEIGHT * plan, CHANGE * changes)

    problem = {"x": plan, "p": given, "f": ca.sumsqr(residuals) / 2}
    quiet = {"print_level": 0, "sb": "yes", "mu_init": 1e-5, "tol": 1e-4}
    options = {"expand": True, "print_time": False, "ipopt": quiet}
    ipopt = ca.nlpsol("solver", "ipopt", problem, options)
    J = ca.jacobian(residuals, plan)
    linear = ca.Function("linear", [plan, given], [J.T @ J, J.T @ residuals])
    quiet = {"print_iter": False, "print_header": False, "print_info": False}
    qp = ca.conic("qp", "qrqp", {"h": linear.sparsity_out(0)}, quiet)
    h, g = linear(plan, given)
    change = qp(h=h, g=g, lbx=-LIMIT - plan, ubx=LIMIT - plan)["x"]
    solved = ipopt(x0=plan, p=given, lbx=-LIMIT, ubx=LIMIT)["x"]
    plans = {"IPOPT": solved, "one step": plan + change}
    return drift, {name: ca.Function("better", [plan, given], [plans[name]]) for name in plans}


def mpc(functions, planner, y_d, start, stop=STOP):
    """Return the result of following y_d, a row for each move, and the processor times [s]."""
    (drift, planners), auv = functions, Simulation("fig4", {**QUIET, **start})
    motion, plan, tau, tau_w, times = None, np.zeros(3 * MOVES), np.zeros(3), np.zeros(6), []
    for k in range(round(stop / MOVE)):
        begun, before, motion = process_time(), motion, np.append(auv["plant.eta"], auv["plant.nu"])
        if k > 0:
            nu, slope = (value.full() for value in drift(before, tau, tau_w))
            tau_w = tau_w + SHARE * np.linalg.solve(slope, motion[6:] - nu.ravel())
        given = np.concatenate((motion, tau_w, tau, y_d[k : k + MOVES].ravel()))
        plan = planners[planner](plan, given).full().ravel().clip(-LIMIT, LIMIT)
        times.append(process_time() - begun)
        auv["plant.tau"] = tau = plan[:3]
        auv.run(until=(k + 1) * MOVE)
        plan = np.append(plan[3:], plan[-3:])
    return auv.result(), times


def reference(stop=STOP):
    """Return the control point of the reference at the end of each move, also beyond the stop."""
    ahead = simulate("fig4", QUIET, stop_time=stop + MOVES * MOVE)
    y_d = ahead.group("planner.y_d.x", "planner.y_d.y", "planner.y_d.z")
    return y_d[HOLD::HOLD]


def started(seed):
    """Return parameters of a random start; of seed 0, Fig. 4's."""
    x, y, z, psi = np.random.default_rng(seed).uniform(-1.0, 1.0, 4)
    eta0 = {"x": 2.0 + 5.0 * x, "y": 6.0 + 5.0 * y, "z": 5.0 * z, "psi": np.pi * psi}
    return {f"plant.eta0.{name}": value for name, value in eta0.items()} if seed else {}


if __name__ == "__main__":
    pd = {"components": {"controller": "PdController"}, "wires": {"controller.dy": "plant.dy"}}
    y_d, made, systems = reference(), functions(), {"paper": "fig4", "PD": pd}
    print("          within 0.5 m     final error   effort in u, q, r   planned in")
    for name in (*systems, "IPOPT", "one step"):
        rows, times = [], []
        for start in map(started, range(STARTS)):
            if name in systems:
                result = simulate(systems[name], {**QUIET, **start}, stop_time=STOP)
            else:
                result, spent = mpc(made, name, y_d, start)
                times += spent
            away = np.linalg.norm(result["plant.y"] - result["planner.y_d"], axis=1)
            after, indices = result.time[away > 0.5][-1], result.metrics()
            rows.append((after, max(indices["final_error"]), *indices["l2_effort"]))
        after, error, *effort = np.median(rows, axis=0)
        line = f"{name:8} {after:5.1f} s ({max(rows)[0]:4.1f} s)  {error:7.3f} m    "
        line += "".join(f"{k:5.0f}" for k in effort)
        if times:
            line += f"    {1e3 * np.median(times):4.1f} ms ({1e3 * max(times):.0f} ms)"
        print(line)
