"""Allocation of a force and a moment to eight thrusters, by the pseudo-inverse of their geometry.

Not in the paper, whose vehicle takes tau_u, tau_q and tau_r themselves. Of all thrusts f with
B f = tau the pseudo-inverse gives those with the least sum of squares (Fossen 2021, section 11.2).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.bluerov2.thrusters import COUNT, Curve, Layout, command_of, forces, thrust
from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.linear_algebra import solve
from auv_fmu.language.quantities import TAU, TAU_W, Members
from auv_fmu.language.variable import Refusal, Variable
from auv_fmu.language.vectors import Vector3, Vector6

#: Force and moments that a controller of the paper does not command.
OTHER: Members = {member: unit for member, unit in TAU_W.items() if member not in TAU}

#: Damping of the pseudo-inverse in a check, and the share of a force or moment that may then lack.
#: Together they refuse thrusters that reach a direction with arms below 1 mm.
_DAMPING, _LACKING = 1e-9, 1e-3


class Parameters(NamedTuple):
    """All parameters of the allocation."""

    curve: Annotated[Curve, Variable(name="")] = Curve()
    layout: Annotated[Layout, Variable(name="")] = Layout()


class Wanted(NamedTuple):
    """Wanted force and moment."""

    tau: Annotated[Vector3, Variable(TAU, "Wanted force and moments")]
    tau_vwp: Annotated[Vector3, Variable(OTHER, "Wanted force and moment in the other directions")]


class Allocated(NamedTuple):
    """Commands, and the force and moment that they give."""

    command: Annotated[Annotated[Vector, COUNT], Variable("1", "Command of the thruster, -1 .. 1")]
    tau_attained: Annotated[Vector6, Variable(TAU_W, "Force and moment that the commands give")]


class Derived(NamedTuple):
    """Values that depend on parameters only."""

    P: Annotated[Matrix, COUNT, 6]  #: pseudo-inverse of the geometry of the thrusters
    ahead: float  #: largest thrust ahead [N]
    astern: float  #: largest thrust astern [N]


def effect(layout: Layout) -> Annotated[Matrix, 6, COUNT]:
    """The matrix B of force and moment per thrust [1, m].

    Args:
        layout: of the thrusters.

    """
    return Matrix(
        forces(layout, Vector(1.0 if i == k else 0.0 for i in range(COUNT))) for k in range(COUNT)
    ).T


def pseudo_inverse(
    B: Annotated[Matrix, 6, COUNT], damping: float = 0.0
) -> Annotated[Matrix, COUNT, 6]:
    """The matrix P = B' (B B' + damping I)^-1, without damping the pseudo-inverse of B.

    Args:
        B: force and moment per thrust; without damping, of full rank.
        damping: above 0, P exists for any B, and B P lacks what B does not reach.

    """
    G = B @ B.T + Matrix((damping if i == k else 0.0 for i in range(6)) for k in range(6))
    G_inverse = Matrix(solve(G, Vector(1.0 if i == k else 0.0 for i in range(6))) for k in range(6))
    return B.T @ G_inverse


def check(layout: Layout) -> None:
    """Refuse thrusters that cannot push in all six directions.

    Raises:
        Refusal: a direction is not reached.

    """
    B = effect(layout)
    reached = B @ pseudo_inverse(B, _DAMPING)
    for k in range(6):
        if not reached[k, k] >= 1.0 - _LACKING:
            raise Refusal("the thrusters do not reach all six directions")


def derive(parameters: Parameters) -> Derived:
    """Pseudo-inverse and largest thrusts, for :func:`evaluate`."""
    P = pseudo_inverse(effect(parameters.layout))
    return Derived(P, thrust(parameters.curve, 1.0), -thrust(parameters.curve, -1.0))


def evaluate(parameters: Parameters, derived: Derived, wanted: Wanted) -> Allocated:
    """Commands of the thrusters for a force and a moment.

    If a thruster would have to give more than it can, all thrusts are scaled down together, so that
    the direction of the force and the moment is kept.

    Args:
        parameters: of the allocation.
        derived: from the same parameters.
        wanted: force and moment [N, N.m].

    """
    (u, q, r), (v, w, p) = wanted
    curve = parameters.curve
    thrusts = derived.P @ Vector((u, v, w, p, q, r))
    share = 1.0
    for f in thrusts:
        most = derived.ahead if f > 0.0 else derived.astern
        if abs(f) * share > most:
            share = most / abs(f)
    command = Vector(command_of(curve, share * f) for f in thrusts)
    given = Vector(thrust(curve, c) for c in command)
    return Allocated(command, forces(parameters.layout, given))
