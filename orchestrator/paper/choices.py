"""What the paper leaves open about the runs of its printed table, and the possible choices.

Section 4.2 prints twelve numbers. What made them is not all said: each :class:`Choice` is one thing
that is not, or that is printed so that another meaning can be thought of. Where an option
contradicts what is printed, it says what.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial, reduce
from itertools import product
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.paper.disturbance import Disturbance
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.motion_planner import TAU_D
from auv_fmu.paper.vehicle import Vehicle
from orchestrator.cosim.experiment import OrderName
from orchestrator.paper.measures import (
    EFFORT_PD,
    EFFORT_PROPOSED,
    FINAL_ERROR_PD,
    FINAL_ERROR_PROPOSED,
    sum_without_step,
)
from orchestrator.studies.engine import Point

#: The scenarios of the two columns of the table.
PROPOSED, PD = "fig5", "fig5-pd"

#: What is printed, by scenario: three efforts and three errors.
PUBLISHED = {
    PROPOSED: np.array([*EFFORT_PROPOSED, *FINAL_ERROR_PROPOSED]),
    PD: np.array([*EFFORT_PD, *FINAL_ERROR_PD]),
}

#: End times that are looked at [s].
END_TIMES = tuple(map(float, range(20, 201)))

_NOTHING: Mapping[str, Any] = MappingProxyType({})


class Option(NamedTuple):
    """One way to fill something in.

    Attributes:
        text: what it is.
        parameters: that it sets, by `component.parameter`.
        against: what is printed that it contradicts; empty for none.
        order: of evaluation, if it sets that.

    """

    text: str
    parameters: Mapping[str, Any] = _NOTHING
    against: str = ""
    order: OrderName | None = None


class Choice(NamedTuple):
    """Something that the paper leaves open.

    Attributes:
        name: what it is.
        options: ways to fill it in.
        ours: which of them the scenarios have.
        of_proposed: whether only the proposed controller has it.

    """

    name: str
    options: tuple[Option, ...]
    ours: int = 0
    of_proposed: bool = False


_WAVES, _SIGN = Disturbance(), "(2): the sign of tau_w"

#: What the reference's surge force drives it at, straight on [m/s].
_UNDER_WAY = TAU_D[0] / Vehicle().d11

#: Name of the choice that runs with five degrees of freedom have one option of.
VEHICLE_CHOICE = "vehicle"

#: Choices that a run depends on.
OF_RUNS = (
    Choice(
        "eps_t of the proposed controller",
        (Option("10, as for PD"), Option("1, as for Fig. 4", {"controller.eps_t": 1.0})),
        of_proposed=True,
    ),
    Choice(
        "observer",
        (Option("(51)"), Option("(24), integral from zero", {"controller.observer": "integral"})),
        of_proposed=True,
    ),
    Choice(
        "start",
        (
            Option("(2, 6, 0), the reference at z = -30 m"),
            Option("the origin", {"plant.eta0.x": 0.0, "plant.eta0.y": 0.0}, "4.1: (2, 6, 0)"),
            Option("the reference at z = +30 m", {"planner.eta0.z": 30.0}, "4.2: z_d(0) = -30"),
        ),
    ),
    Choice(
        "noise",
        (
            Option("none"),
            Option("1 mm", {"plant.noise.std": 1e-3}),
            Option("1 cm", {"plant.noise.std": 1e-2}, "Fig. 4: no saturation"),
        ),
    ),
    Choice(
        "Jacobian",
        (
            Option("of the full attitude"),
            Option(
                "(11) as printed",
                {"controller.printed_jacobian": True},
                "Fig. 5: feasible commands",
            ),
        ),
    ),
    Choice(
        VEHICLE_CHOICE,
        (
            Option("six degrees of freedom, righting moment in roll 5 N·m"),
            Option("six, no righting moment in roll", {"plant.righting.roll": 0.0}),
        ),
    ),
    Choice(
        "plant",
        (
            Option("Euler's scheme"),
            Option("fourth-order Runge-Kutta", {"plant.integrator": "rk4"}, "4.1: Euler, 20 ms"),
        ),
    ),
    Choice(
        "disturbance",
        (
            Option("tau_w as in (2)"),
            Option(
                "-tau_w",
                {"disturbance.A_f": -_WAVES.A_f, "disturbance.A_d": -_WAVES.A_d},
                _SIGN,
            ),
            Option("friction reversed", {"disturbance.A_f": -_WAVES.A_f}, _SIGN),
            Option("waves reversed", {"disturbance.A_d": -_WAVES.A_d}, _SIGN),
        ),
    ),
    Choice(
        "theta_hat(0)",
        (
            Option("0"),
            Option(
                "1, and theta_0",
                {f"controller.theta_0[{i}]": 1.0 for i in range(1, 5)},
                "4.1: theta_0 = 0",
            ),
        ),
    ),
    Choice(
        "order",
        (
            Option("everything at t_k"),
            Option("Jacobi, 20 ms late", order="jacobi"),
        ),
    ),
    Choice(
        "reference at t = 0",
        (
            Option("at rest"),
            Option("in motion, at tau_ud / d11", {"planner.nu0.u": _UNDER_WAY}),
        ),
    ),
)

#: The vehicle of (1) and (2), and what it contradicts. From 30 m away it passes the pole of (1),
#: and no single run says what it gives then.
FIVE_DEGREES, AGAINST_FIVE = Option("five degrees of freedom", {"plant.roll": False}), "4.1: 6-DOF"

#: What a run of five depends on, of what contradicts nothing else.
OF_RUNS_OF_FIVE = tuple(
    choice._replace(options=(FIVE_DEGREES,))
    if choice.name == VEHICLE_CHOICE
    else choice._replace(options=tuple(each for each in choice.options if not each.against))
    for choice in OF_RUNS
)

#: What the efforts are taken of: (59) speaks of "the control input".
SIGNALS = (Option("applied"), Option("commanded"))

#: The order in which they are printed.
ORDERS_OF_EFFORTS = (
    Option("(u, q, r)"),
    Option("(u, r, q)", against="below (6): tau_a = (tau_u, tau_q, tau_r)"),
)

#: What they are: with signals within 80, (59) as printed cannot be 130.
FORMULAS = (
    Option("L2 norm, (59) without 1/T_f"),
    Option("(59) as a sum over steps, without the step"),
    Option("mean square, (59) without the root"),
)

#: Where u, q and r stand, by ORDERS_OF_EFFORTS.
_ORDERED = ([0, 1, 2], [0, 2, 1])

_T_F = np.array(END_TIMES)[:, np.newaxis]

#: What is printed, of L2 norms with an axis for END_TIMES before the three; by FORMULAS.
_TABULATED = (
    lambda l2: l2,
    partial(sum_without_step, duration=_T_F, h=STEP),
    lambda l2: l2**2 / _T_F,
)

#: Choices that are left when a run is done.
OF_READING = (
    Choice("efforts of the signal", SIGNALS),
    Choice("order of the efforts", ORDERS_OF_EFFORTS),
    Choice("formula of the efforts", FORMULAS),
    Choice(
        "T_f",
        tuple(Option(f"{time:g} s") for time in END_TIMES),
        ours=END_TIMES.index(100.0),
    ),
)


def choice_options(choice: Choice, scenario: str) -> tuple[Option, ...]:
    """The options of a choice in a scenario: one where it has none."""
    if choice.of_proposed and scenario != PROPOSED:
        return (choice.options[choice.ours],)
    return choice.options


def runs(scenario: str, of_runs: Sequence[Choice] = OF_RUNS) -> Iterator[Point]:
    """A run for each combination, in the order of the choices; the last varies fastest."""
    combinations = product(*(choice_options(choice, scenario) for choice in of_runs))
    for number, combination in enumerate(combinations):
        yield run_of(scenario, combination, number)


def run_of(scenario: str, combination: Sequence[Option], number: int = 0) -> Point:
    """The run with an option of each choice."""
    parameters = {
        name: value for option in combination for name, value in option.parameters.items()
    }
    order = next((option.order for option in combination if option.order), None)
    return Point(number, scenario, parameters, END_TIMES[-1], STEP, order)


def contradicts_nothing(scenario: str, choices: Sequence[Choice]) -> np.ndarray:
    """Whether a combination of options contradicts nothing that is printed, an axis a choice."""
    flags = [[not option.against for option in choice_options(each, scenario)] for each in choices]
    found: np.ndarray = reduce(np.logical_and, np.meshgrid(*flags, indexing="ij", sparse=True))
    return found


def as_read(numbers: np.ndarray, order: int, formula: int) -> np.ndarray:
    """Six numbers as printed, of some with L2 norms; axes for END_TIMES and the six come last."""
    efforts = _TABULATED[formula](numbers[..., _ORDERED[order]])
    return np.concatenate((efforts, numbers[..., 3:]), axis=-1)
