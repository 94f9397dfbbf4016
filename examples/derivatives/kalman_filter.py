"""Estimate the motion of the vehicle of Fig. 4 by an extended Kalman filter with exact Jacobians.

    python examples/derivatives/kalman_filter.py

The filter measures the attitude ten times a second and the position once a second, with noise, and
no velocity. It knows the commands and the plant's parameters. The disturbance is part of its state,
as a random force and moment. The covariance is of 18 independent errors: the attitude's is a
rotation vector, since the four numbers of a unit quaternion depend on each other.
"""

from functools import partial
from time import process_time
from timeit import repeat

import casadi as ca
import numpy as np

from auv_fmu import Simulation
from auv_fmu.casadi import model
from auv_fmu.paper.attitude import quaternion_from_euler

RUNS, STOP, STEP = 50, 20.0, 0.02

#: Steps between two measurements of attitude and of position, and noise of the posture [m, rad].
ATTITUDE, POSITION, NOISE = 5, 50, np.array([0.05] * 3 + [np.radians(0.5)] * 3)

#: Standard deviations of the first errors [m, rad, m/s, rad/s, N, N.m], the share of force and
#: moment that a step keeps, and what it adds to the covariance so that they keep their deviation.
FIRST = np.array([0.5] * 3 + [np.radians(5.0)] * 3 + [0.1] * 6 + [1.0] * 6)
KEPT = np.exp(-STEP / 10.0)
ADDED = np.diag(np.append(np.zeros(12), FIRST[12:] ** 2 * (1.0 - KEPT**2)))

PLANT = model("AuvPlant", free=[])
END, DY = PLANT.state.index("state.tau.u"), PLANT.outputs.index("dy.x")


def tangent(x, scale=0.5):
    """Return how a state changes with its errors; at scale 2, the pseudoinverse transposed."""
    a, b, c, d = ca.vertsplit(x[3:7])
    turns = ca.horzcat(ca.vertcat(-b, a, d, -c), ca.vertcat(-c, -d, a, b), ca.vertcat(-d, c, -b, a))
    return ca.diagcat(ca.SX.eye(3), scale * turns, ca.SX.eye(12))


def functions():
    """Return functions of a state x, and of a command, errors or another state, by name."""
    x, tau, dx, other = (ca.SX.sym("x", n) for n in (END + 6, 3, 18, END + 6))
    full, inputs = ca.vertcat(x[:END], ca.SX.zeros(6)), ca.vertcat(tau, x[END:], ca.SX.zeros(6))
    after, _ = PLANT.advance(full, inputs, [], STEP, 0.0)
    after = ca.vertcat(after[:END], KEPT * x[END:])
    out = PLANT.observe(full, inputs, [], 0.0)
    moved = x + tangent(x) @ dx
    moved[3:7] /= ca.norm_2(moved[3:7])
    apart = ca.vertcat(other[:3], other[3:7] / ca.dot(x[3:7], other[3:7]), other[7:]) - x
    jacobian = tangent(after, 2.0).T @ ca.jacobian(after, x) @ tangent(x)
    made = {
        "step": ([x, tau], [after, jacobian]),
        "seen": ([x], [out[:6], ca.jacobian(out[:6], x) @ tangent(x), out[DY : DY + 3]]),
        "moved": ([x, dx], [moved]),
        "errors": ([x, other], [tangent(x, 2.0).T @ apart]),
    }
    return {name: ca.Function(name, *made[name]) for name in made}


def exact(f, x, tau):
    """Return the state after a step, and the Jacobian of its errors."""
    after, jacobian = f["step"](x, tau)
    return after.full().ravel(), jacobian.full()


def differences(f, x, tau, change=1e-6):
    """Return the same by central differences, of two steps for each error."""
    after, _ = f["step"](x, tau)
    sides = change * np.vstack((np.eye(18), -np.eye(18)))
    ends = (f["step"](f["moved"](x, dx), tau)[0] for dx in sides)
    errors = np.hstack([f["errors"](after, end).full() for end in ends])
    return after.full().ravel(), (errors[:, :18] - errors[:, 18:]) / (2.0 * change)


def filtered(f, seed, jacobian=exact, is_random=True, stop=STOP):
    """Yield a row a second: state, covariance, errors, and errors of dy of filter and observer.

    The disturbance is random, as the filter takes it, or Fig. 4's own.
    """
    auv, draw = Simulation("fig4", {"plant.noise.seed": seed}), np.random.default_rng(seed)

    def truth():
        eta, nu, tau_w = auv["plant.eta"], auv["plant.nu"], auv["plant.tau_w"]
        return np.concatenate((eta[:3], quaternion_from_euler(*eta[3:]), nu, tau_w))

    first, force = FIRST * draw.normal(size=18), draw.normal(size=6)
    if is_random:
        auv["plant.tau_w"] = force
    first[12:] = -auv["plant.tau_w"]
    x, P = f["moved"](truth(), first).full().ravel(), np.diag(FIRST**2)
    for k in range(1, round(stop / STEP) + 1):
        x, A = jacobian(f, x, auv["plant.tau_applied"])
        P = A @ P @ A.T + ADDED
        auv.step()
        if is_random:
            force = KEPT * force + np.sqrt(1.0 - KEPT**2) * draw.normal(size=6)
            auv["plant.tau_w"] = force
        if k % ATTITUDE == 0:
            eta, H, _ = (value.full() for value in f["seen"](x))
            off = auv["plant.eta"] + NOISE * draw.normal(size=6) - eta.ravel()
            off[3:] = (off[3:] + np.pi) % (2.0 * np.pi) - np.pi
            use = slice(None) if k % POSITION == 0 else slice(3, None)
            H, R = H[use], np.diag(NOISE[use] ** 2)
            gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            x, P = f["moved"](x, gain @ off[use]).full().ravel(), P - gain @ H @ P
        if k % POSITION == 0:
            errors, dy = f["errors"](x, truth()).full().ravel(), auv["plant.dy"]
            yield x, P, errors, f["seen"](x)[2].full().ravel() - dy, auv["controller.dy_hat"] - dy


def rms(errors):
    """Return the root mean square of the lengths of errors after 10 s."""
    return np.sqrt(np.mean(np.sum(np.square(errors[:, 10:]), axis=2)))


if __name__ == "__main__":
    f = functions()
    print("disturbance   position   attitude   velocity       NEES       within 3 sigma")
    for name, is_random in {"random": True, "Fig. 4's": False}.items():
        runs = ([*zip(*filtered(f, seed, is_random=is_random))] for seed in range(RUNS))
        x, P, errors, dy, dy_hat = (np.array(values) for values in zip(*runs))
        nees = np.sum(errors * np.linalg.solve(P, errors[..., None])[..., 0], axis=2).mean(axis=0)
        inside = np.abs(errors) < 3.0 * np.sqrt(np.diagonal(P, axis1=2, axis2=3))
        means = rms(errors[..., :3]), np.degrees(rms(errors[..., 3:6])), rms(dy)
        print(f"{name:11}{{:9.3f}} m {{:9.2f}}° {{:8.3f}} m/s".format(*means), end="")
        print(f"   {nees.min():4.1f} to {nees.max():4.1f} {inside.mean():13.1%}")
    print(f"The paper's observer: {rms(dy_hat):.3f} m/s")
    for jacobian in (exact, differences):
        estimate = [*filtered(f, 0, jacobian, stop=2.0)][-1][0]
        call = partial(jacobian, f, estimate, np.ones(3))
        spent = 1e4 * min(repeat(call, timer=process_time, number=100))
        print(
            f"{jacobian.__name__:11} {spent:6.0f} us a step, surge {estimate[7]:.9f} m/s after 2 s"
        )
