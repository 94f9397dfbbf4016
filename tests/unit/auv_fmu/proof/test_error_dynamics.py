"""(20), (25) and (28): what follows from (15), and what P2.3 is needed for."""

import numpy as np
from hypothesis import given

from auv_fmu.proof.control_point_model import C_2, D_2, G_2, M_2, d
from auv_fmu.proof.error_dynamics import chi_1, chi_2, xi
from auv_fmu.vehicle import Vehicle
from support.strategies import angles, forces, pitch_angles, speeds, vectors

VEHICLE, ELL = Vehicle(), 0.35
three = vectors(speeds, 3)


@given(
    theta=pitch_angles,
    psi=angles,
    w=vectors(speeds, 2),
    dy_r=three,
    ddy_r=three,
    r_1=three,
    r_2=three,
    force=vectors(forces, 3),
    tau_w2=vectors(forces, 3),
)
def test_error_dynamics_are_those_of_15_but_for_p2_3(
    theta, psi, w, dy_r, ddy_r, r_1, r_2, force, tau_w2
):
    """M_2 dr_1/dt of (15) is that of (20); that less k_d M_2 r_2 is (28).

    Each is so but for C_2(x_1) x_2 - C_2(x_2) x_1, which P2.3 takes to be zero.
    """
    at = (VEHICLE, theta, psi)
    w, dy_r, ddy_r, r_1, r_2, force, tau_w2 = map(
        np.array, (w, dy_r, ddy_r, r_1, r_2, force, tau_w2)
    )
    dy = dy_r + r_1
    M, D = M_2(*at, ELL), D_2(*at, ELL)

    def C(x):
        return C_2(*at, x, ELL)

    ddy = np.linalg.solve(
        M, force - C(dy) @ dy - D @ dy - d(*at, w, dy, ELL) - G_2(*at, ELL) - tau_w2
    )
    found = M @ (ddy - ddy_r)
    lumped = xi(*at, w, dy_r, ddy_r, tau_w2, ELL)
    scale = 1.0 + np.abs(found).max() + np.abs(C(dy)).max() * 10.0
    by_20 = force - C(dy) @ r_1 - D @ r_1 + chi_1(*at, w, dy_r, r_1, ELL) + lumped
    crossed = C(dy_r) @ r_1 - C(r_1) @ dy_r
    np.testing.assert_allclose(found, by_20 + crossed, atol=1e-10 * scale)
    by_28 = force - C(dy) @ r_2 + chi_2(*at, w, dy_r, r_1, r_2, ELL) + lumped
    crossed = C(r_1) @ dy_r - C(dy_r) @ r_1
    np.testing.assert_allclose(found, by_28 + crossed, atol=1e-10 * scale)
