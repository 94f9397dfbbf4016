"""Quantities of groups of ports: their members and units.

A member that is a name is written `group.member`, one that is a number `group[member]`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Union

Members = Mapping[Union[str, int], str]

#: Motion of a point in the earth frame.
POSITION: Members = {"x": "m", "y": "m", "z": "m"}
VELOCITY: Members = dict.fromkeys(POSITION, "m/s")
ACCELERATION: Members = dict.fromkeys(POSITION, "m/s2")

#: Roll, pitch and yaw.
EULER: Members = {"phi": "rad", "theta": "rad", "psi": "rad"}

#: Centre of mass and attitude, with and without roll.
ETA: Members = {**POSITION, **EULER}
ETA_WITHOUT_ROLL: Members = {member: unit for member, unit in ETA.items() if member != "phi"}

#: Velocity of the vehicle, and forces on it, in the body frame.
NU: Members = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s"}
NU_WITHOUT_ROLL: Members = {member: unit for member, unit in NU.items() if member != "p"}
TAU_W: Members = {"u": "N", "v": "N", "w": "N", "p": "N.m", "q": "N.m", "r": "N.m"}

#: Force and moments of the actuators: no sway, heave or roll.
TAU: Members = {member: TAU_W[member] for member in ("u", "q", "r")}

#: Time constants of the actuators.
LAG: Members = dict.fromkeys(TAU, "s")

#: Coefficients of (1, |dy_r|, |dy_r|^2, |ddy_r|) in the bound of a force.
THETA: Members = {1: "N", 2: "kg/s", 3: "kg/m", 4: "kg"}


def member_name(group: str, member: str | int) -> str:
    """Structured name of one member of a group."""
    return f"{group}[{member}]" if isinstance(member, int) else f"{group}.{member}"


def group_name(name: str) -> str:
    """Group of a structured name."""
    return name.split(".", maxsplit=1)[0].split("[", maxsplit=1)[0]


def member_of(name: str) -> str:
    """Member of a structured name within its group; the name itself for a scalar."""
    return name[len(group_name(name)) + 1 :].removesuffix("]") or name


def per_axis(unit: str) -> Members:
    """Members of the diagonal of a gain matrix, one for each axis of the control point."""
    return dict.fromkeys((1, 2, 3), unit)
