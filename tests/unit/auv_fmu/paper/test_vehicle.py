"""(1); (2) is tested against its matrix form (6) and (7), and by the plant and the planner."""

from math import cos, sin

import numpy as np
from hypothesis import given

from auv_fmu.paper.attitude import rotate, rotation_from_euler
from auv_fmu.paper.vehicle import euler_rates
from support.strategies import angles, pitch_angles, speeds, vectors


@given(theta=pitch_angles, psi=angles, nu=vectors(speeds, 5))
def test_kinematics_is_equation_1(theta, psi, nu):
    """T_1 and T_2 written out as the paper prints them."""
    u, v, w, q, r = nu
    T_1 = np.array(
        [
            [cos(psi) * cos(theta), -sin(psi), sin(theta) * cos(psi)],
            [sin(psi) * cos(theta), cos(psi), sin(theta) * sin(psi)],
            [-sin(theta), 0.0, cos(theta)],
        ]
    )
    np.testing.assert_allclose(
        rotate(rotation_from_euler(0.0, theta, psi), (u, v, w)), T_1 @ (u, v, w), atol=1e-14
    )
    assert euler_rates(theta, q, r) == (q, r / cos(theta))
