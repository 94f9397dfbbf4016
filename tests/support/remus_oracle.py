"""Runs of the class remus100 of PythonVehicleSimulator by T. I. Fossen (MIT), to compare with.

`PYTHONPATH=tests:SIMULATOR/src python -m support.remus_oracle` writes the tables that tests use
again. SIMULATOR is a clone of https://github.com/cybergalactic/PythonVehicleSimulator, which is not
on PyPI: so no test depends on it, and those that run it do so where it can be imported. The tables
are of its version 1.0.1, commit c717e073d7a839dcb5956cf20c595132f1fa249a.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from importlib import import_module
from math import cos, pi, radians, sin
from pathlib import Path
from typing import NamedTuple

import numpy as np

#: The sample time of its demonstration [s].
STEP = 0.02

#: Current speed [m/s] and direction [deg] of its demonstration.
CURRENT = 0.5, 170.0

STATES = ("x", "y", "z", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r")
ACTUATORS = ("delta_r", "delta_s", "n")

Vector = np.ndarray


class Row(NamedTuple):
    """The vehicle at a time, and what is commanded from then on, held until the next row."""

    t: float
    command: tuple[float, ...]  #: delta_r, delta_s [rad], n [rev/min]
    state: tuple[float, ...]  #: eta and nu [m, rad, m/s, rad/s]
    actuator: tuple[float, ...]  #: delta_r, delta_s [rad], n [rev/min], within their limits


class Manoeuvre(NamedTuple):
    """A run of the simulator.

    Attributes:
        arguments: of its class.
        command: what it commands, of the vehicle, eta, nu and the time.
        hold: how many steps a command is held.
        seconds: how long it is.

    """

    arguments: tuple[object, ...]
    command: Callable[[object, Vector, Vector, float], Vector]
    hold: int
    seconds: float

    @property
    def water(self) -> tuple[float, float, float]:
        """The velocity of the water [m/s]."""
        speed, direction = self.arguments[4:6] if len(self.arguments) > 4 else (0.0, 0.0)
        return speed * cos(radians(direction)), speed * sin(radians(direction)), 0.0


def _autopilot(hold: int) -> Callable[[object, Vector, Vector, float], Vector]:
    return lambda vehicle, eta, nu, t: vehicle.depthHeadingAutopilot(eta, nu, hold * STEP)


def _everywhere(vehicle: object, eta: Vector, nu: Vector, t: float) -> Vector:
    """Commands up to beyond all limits, ahead and astern."""
    return np.array([0.5 * sin(t / 4.0), 0.35 * cos(t / 5.0), 1800.0 * sin(t / 9.0)])


_DEMO = ("depthHeadingAutopilot", 30, 50, 1525, *CURRENT)

#: Manoeuvres of the simulator's demonstrations.
DEMONSTRATIONS = {
    "step input": Manoeuvre((), lambda vehicle, eta, nu, t: vehicle.stepInput(t), 1, 120.0),
    "autopilot": Manoeuvre(_DEMO, _autopilot(1), 1, 200.0),
}

#: Manoeuvres with tables: commands are rounded and held, so that a table can repeat them.
TABLES = {
    "steps": Manoeuvre((), lambda vehicle, eta, nu, t: vehicle.stepInput(t), 50, 110.0),
    "autopilot": Manoeuvre(_DEMO, _autopilot(25), 25, 60.0),
    "everywhere": Manoeuvre(("", 0, 0, 0, *CURRENT), _everywhere, 50, 60.0),
}


def rows(manoeuvre: Manoeuvre) -> Iterator[Row]:
    """Run the simulator's main loop, with each command held for some steps."""
    gnc = import_module("python_vehicle_simulator.lib.gnc")
    vehicles = import_module("python_vehicle_simulator.vehicles.remus100")
    vehicle = vehicles.remus100(*manoeuvre.arguments)
    largest = np.array([vehicle.deltaMax_r, vehicle.deltaMax_s, vehicle.nMax])
    eta, nu, actuator = np.zeros(6), vehicle.nu, vehicle.u_actual
    command = np.zeros(3)
    for k in range(round(manoeuvre.seconds / STEP) + 1):
        if k % manoeuvre.hold == 0:
            command = manoeuvre.command(vehicle, eta, nu, k * STEP)
            if manoeuvre.hold > 1:
                command = np.round(command, 6)
            # It stores what the first lines of its next step cut off.
            within = np.clip(actuator, -largest, largest)
            yield Row(k * STEP, *(tuple(map(float, x)) for x in (command, [*eta, *nu], within)))
        nu, actuator = vehicle.dynamics(eta, nu, actuator, command, STEP)
        eta = gnc.attitudeEuler(eta, nu, STEP)


def path(name: str) -> Path:
    """Path of a table."""
    return Path(__file__).parent / "remus100" / f"{name}.csv"


def table(name: str) -> list[Row]:
    """A table, as it was written."""
    with path(name).open(newline="") as file:
        _, *lines = csv.reader(file)
    numbers = [tuple(map(float, line)) for line in lines]
    return [Row(n[0], n[1:4], n[4:16], n[16:19]) for n in numbers]


def to_si(values: tuple[float, ...]) -> tuple[float, float, float]:
    """A command, or an actuator's state, with the speed of the propeller in rad/s."""
    delta_r, delta_s, n = values
    return delta_r, delta_s, n * pi / 30.0


def main() -> None:
    """Write all tables."""
    for name, manoeuvre in TABLES.items():
        path(name).parent.mkdir(exist_ok=True)
        with path(name).open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("t", *(f"{x}_c" for x in ACTUATORS), *STATES, *ACTUATORS))
            for row in rows(manoeuvre):
                inputs = [f"{x:.12g}" for x in (row.t, *row.command)]
                writer.writerow((*inputs, *(f"{x:.12e}" for x in (*row.state, *row.actuator))))


if __name__ == "__main__":
    main()
