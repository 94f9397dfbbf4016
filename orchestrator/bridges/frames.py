"""Frames of ROS: from the product's north-east-down and back.

===========  =====================================  ==================================
frame        here, as in the paper                  ROS, by REP 103
===========  =====================================  ==================================
earth        x north, y east, z down                x east, y north, z up
body         x forward, y to starboard, z down      x forward, y to port, z up
===========  =====================================  ==================================

Both body frames have their origin in the centre of mass. All numbers but the attitude's
change places and signs only, so they pass without rounding.
"""

from __future__ import annotations

from math import pi

from auv_fmu.language.vectors import Vector3, Vector4
from auv_fmu.paper.attitude import quaternion_from_euler


def earth(vector: Vector3) -> Vector3:
    """Turn a vector of either earth frame into the other one."""
    x, y, z = vector
    return y, x, -z


def body(vector: Vector3) -> Vector3:
    """Turn a vector of either body frame into the other one."""
    x, y, z = vector
    return x, -y, -z


def attitude(phi: float, theta: float, psi: float) -> Vector4:
    """Return the unit quaternion (scalar first) from ROS's body frame to its earth frame.

    Args:
        phi, theta, psi: roll, pitch and yaw of the vehicle [rad].

    """
    return quaternion_from_euler(phi, -theta, pi / 2 - psi)
