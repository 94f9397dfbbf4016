"""Identify masses, damping and righting moments of the vehicle from a recorded run.

    python examples/derivatives/identification.py

Least squares fit a run to measured postures. The derivatives of the run with respect to the
parameters also tell which of them a run can identify, and how large the errors are.
"""

from time import process_time

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from auv_fmu import Simulation
from auv_fmu.casadi import model

#: The parameters: masses, damping and righting moments. The first guess is 30 % too low.
FREE = [f"{kind}{k}{k}" for kind in "md" for k in range(1, 7)] + ["righting"]
PLANT = model("AuvPlant", {"integrator": "rk4"}, FREE)
NAMES, TRUTH = PLANT.parameters, np.array(PLANT.default_parameters)
GUESS = 0.7 * TRUTH

#: The run: the step [s] and the number of steps, standard deviations of the noise [m, rad], and the
#: commands in surge, pitch and yaw [N, N.m], which jump between two values.
H, STEPS = 0.1, 400
NOISE = np.repeat([0.1, np.radians(1.0)], 3)
IS_HIGH = [H * np.arange(STEPS) % period < 0.5 * period for period in (16.0, 10.0, 7.0)]
TAU = np.where(IS_HIGH, [[40.0], [3.0], [5.0]], [[10.0], [-3.0], [-5.0]])
COMMANDS = {"u": (1, 0, 0), "u+q": (1, 1, 0), "u+r": (1, 0, 1), "u+q+r": (1, 1, 1)}

#: Half an interval of 95 %, in standard deviations.
HALF = 1.96


def record(tau, parameters=None, only=("plant",)):
    """Return the posture after each step, in standard deviations of the noise."""
    scheme = {"plant.integrator": "rk4", "plant.h_max": H}
    with Simulation({"only": [*only]}, {**scheme, **(parameters or {})}, step=H) as auv:
        for command in tau.T:
            auv["plant.tau"] = command
            auv.step()
        return (auv.result()["plant.eta"][1:] / NOISE).ravel()


def run_of(tau):
    """Return the same as a function of the parameters, and its derivatives."""
    state, command = ca.SX.sym("state", len(PLANT.state)), ca.SX.sym("tau", 3)
    inputs, theta = ca.vertcat(command, *PLANT.default_inputs[3:]), ca.SX.sym("theta", len(NAMES))
    after = PLANT.advance(state, inputs, theta, H, 0.0)
    fast = {"cse": True, "der_options": {"cse": True}}
    step = ca.Function("step", [state, command, theta], after, fast)
    theta = ca.MX.sym("theta", len(NAMES))
    start = PLANT.start(PLANT.default_inputs, PLANT.default_parameters, 0.0)
    _, outputs = step.mapaccum(STEPS)(start, tau, ca.repmat(theta, 1, STEPS))
    eta = ca.vec(outputs[:6, :] / NOISE)
    slopes = ca.jacobian(eta, theta)
    return ca.Function("run", [theta], [eta]), ca.Function("slopes", [theta], [slopes, eta])


def deviations(slopes):
    """Return standard deviations of estimates."""
    return np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))


def fit(measured, run, slopes):
    """Return the result of a fit, and the time of the processor [s]."""
    begun = process_time()
    found = least_squares(
        lambda theta: run(theta).full()[:, 0] - measured, GUESS, slopes, x_scale=GUESS
    )
    return found, process_time() - begun


def fits(measured, slopes, theta, rounds=4):
    """Return estimates and deviations for many runs, by Gauss-Newton steps side by side."""
    n = len(measured)
    theta, together = np.tile(theta, (n, 1)), slopes.map(n, "thread", 2)
    for _ in range(rounds):
        J, eta = (part.full() for part in together(theta.T))
        J = np.split(J, n, axis=1)
        theta += [np.linalg.lstsq(J[k], measured[k] - eta[:, k], rcond=None)[0] for k in range(n)]
    return theta, np.array([*map(deviations, J)])


def told(commands):
    """Return relative deviations after a run, of parameters that are known to 100 % before."""
    _, slopes = run_of(TAU * np.array([commands]).T)
    return deviations(np.vstack((slopes(TRUTH)[0].full() * TRUTH, np.eye(len(NAMES)))))


if __name__ == "__main__":
    run, slopes = run_of(TAU)
    exact = lambda theta: slopes(theta)[0].full()  # noqa: E731
    clean, draw = record(TAU), np.random.default_rng(1)
    measured = clean + draw.normal(size=(100, len(clean)))
    found, seconds = fit(measured[0], run, exact)
    other, longer = fit(measured[0], run, "2-point")
    theta, sigma = fits(measured, slopes, found.x)
    covered = (np.abs(theta - TRUTH) < HALF * sigma).sum(axis=0)
    known = np.array([*map(told, COMMANDS.values())]).T
    print(f"{'':14} {'estimate':>12} {'truth':>6} {'covered':>7}  known after commands in")
    print(" " * 42, *(f"{name:>7}" for name in COMMANDS))
    for k, half in enumerate(HALF * deviations(found.jac)):
        shares = (f"{share:7.1%}" if share < 0.99 else f"{'-':>7}" for share in known[k])
        estimate = f"{found.x[k]:5.2f} ± {half:4.2f}"
        print(f"{NAMES[k]:14} {estimate} {TRUTH[k]:6.1f} {covered[k]:5} %", *shares)
    away = (np.abs(other.x - found.x) / deviations(found.jac)).max()
    print(f"exact derivatives: {found.nfev} rounds, {seconds:.2f} s")
    print(f"differences: {other.nfev} rounds, {longer:.2f} s, away by {away:.0e} deviations")
    rubbed = record(TAU, {"disturbance.A_d": 0.0}, ["plant", "disturbance"])
    found, _ = fit(rubbed + draw.normal(size=len(clean)), run, exact)
    wrong = np.abs(found.x - TRUTH) > HALF * deviations(found.jac)
    rms = np.sqrt(2.0 * found.cost / len(clean))
    print(f"with friction: {wrong.sum()} of {len(NAMES)} intervals miss, residuals {rms:.2f}")
