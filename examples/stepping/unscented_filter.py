"""Estimate the mass and the damping of surge while the vehicle follows the helix of Fig. 4.

    python examples/stepping/unscented_filter.py

An unscented Kalman filter measures position and attitude, with noise, and no velocity. Its 41
sigma points are rows of one `Simulations` of the plant, which gets the commands of the vehicle. The
filter does not know the disturbance, and estimates it as a random walk.
"""

import numpy as np

from auv_fmu import Simulation, Simulations

#: Steps of 20 ms between two measurements, and the noise of these [m, rad].
STEPS, NOISE = 5, np.array([0.01] * 3 + [0.002] * 3)

#: The state is eta, nu, tau_w, m11 [kg] and d11 [kg/s]: the guess of all but eta, the standard
#: deviations of the guess, and of the changes in a second.
GUESS = [0.0] * 12 + [20.0, 25.0]
DEVIATION = np.array([0.01] * 3 + [0.002] * 3 + [0.1] * 6 + [1.0] * 6 + [4.0, 5.0])
DRIFT = np.array([1e-4] * 6 + [1e-3] * 6 + [1.0] * 6 + [0.0, 0.0])


def wrapped(differences):
    """Return differences of postures, with angles within half a turn."""
    differences[..., 3:6] = (differences[..., 3:6] + np.pi) % (2.0 * np.pi) - np.pi
    return differences


def predict(plants, mean, covariance, taus):
    """Return mean and covariance after steps with commands: the unscented transform."""
    n = len(mean)
    root = np.linalg.cholesky((n + 1) * covariance).T
    x = mean + np.concatenate((np.zeros((1, n)), root, -root))
    weights = np.array([2.0] + [1.0] * (2 * n)) / (2 * n + 2)
    names = ("plant.eta0", "plant.nu0", "plant.m11", "plant.d11")
    values = (x[:, :6], x[:, 6:12], x[:, 18], x[:, 19])
    plants.reset(parameters=dict(zip(names, values)))
    plants["plant.tau_w"] = x[:, 12:18]
    for tau in taus:
        plants["plant.tau"] = tau
        plants.step()
    x[:, :6], x[:, 6:12] = plants["plant.eta"], plants["plant.nu"]
    apart = wrapped(x - x[0])
    mean = weights @ apart
    apart -= mean
    return x[0] + mean, apart.T * weights @ apart + np.diag(DRIFT**2 * len(taus) * 0.02)


def estimate(times, parameters=None, seed=1):
    """Yield the time, m11 and its deviation, and d11 and its deviation, at some times."""
    noise = np.random.default_rng(seed)
    auv = Simulation("fig4", parameters, keep=False)
    mean, covariance = np.concatenate((auv["plant.eta"], GUESS)), np.diag(DEVIATION**2)
    plants = Simulations({"only": ["plant"]}, 2 * len(mean) + 1)
    for time in times:
        while auv.time < time - 1e-9:
            taus = []
            for _ in range(STEPS):
                taus.append(auv["plant.tau_applied"])
                auv.step()
            mean, covariance = predict(plants, mean, covariance, taus)
            S = covariance[:6, :6] + np.diag(NOISE**2)
            gain = np.linalg.solve(S, covariance[:6]).T
            mean += gain @ wrapped(auv["plant.eta"] + NOISE * noise.normal(size=6) - mean[:6])
            covariance -= gain @ S @ gain.T
        sigma = np.sqrt(np.diag(covariance))
        yield auv.time, mean[18], sigma[18], mean[19], sigma[19]


if __name__ == "__main__":
    for row in estimate([0.0, 1.0, 2.0, 5.0, 10.0, 20.0]):
        print("{:4.0f} s: m11 = {:.1f} ± {:.1f} kg, d11 = {:.1f} ± {:.1f} kg/s".format(*row))
