"""(15) derived from (1) and (2), exactly: what its d lacks."""

import pytest

sp = pytest.importorskip("sympy", reason="needs the extra `test`")


@pytest.mark.slow
def test_15_needs_one_more_term():
    """J^T times (15), at the acceleration that (1) and (2) give, less tau_a.

    As printed, with the rate of J along the motion, it is off by
    M_1 d(J^-1 J_delta)/dw M_1_bar^-1 C_1_bar(J^-1 dy) J^-1 J_delta.
    """
    theta, psi, u, v, w, q, r = symbols = sp.symbols("theta psi u v w q r")
    ell, m11, m22, m33, m55, m66 = sp.symbols("ell m11 m22 m33 m55 m66", positive=True)
    d11, d22, d33, d55, d66, righting = sp.symbols("d11 d22 d33 d55 d66 righting")
    tau_u, tau_q, tau_r = tau = sp.symbols("tau_u tau_q tau_r")
    w_u, w_v, w_w, w_q, w_r = sp.symbols("tau_wu tau_wv tau_ww tau_wq tau_wr")
    c_theta, s_theta, c_psi, s_psi = sp.cos(theta), sp.sin(theta), sp.cos(psi), sp.sin(psi)

    rates = (
        q,
        r / c_theta,
        (m22 * v * r - m33 * w * q - d11 * u + tau_u - w_u) / m11,
        (-m11 * u * r - d22 * v - w_v) / m22,
        (m11 * u * q - d33 * w - w_w) / m33,
        ((m33 - m11) * u * w - d55 * q - righting * s_theta + tau_q - w_q) / m55,
        ((m11 - m22) * u * v - d66 * r + tau_r - w_r) / m66,
    )

    def dot(x):
        return sum(
            (x.diff(symbol) * rate for symbol, rate in zip(symbols, rates, strict=True)),
            sp.zeros(*x.shape),
        )

    def vanishes(x):
        """Whether all entries are zero; r / cos(theta) is their only quotient."""
        plain = dict(zip((c_theta, s_theta, c_psi, s_psi), sp.symbols("a b c d"), strict=True))
        a, b, c, d = plain.values()
        for entry in x:
            left = sp.expand(sp.expand(entry * c_theta).subs(plain))
            left = sp.rem(left, a**2 + b**2 - 1, b)
            if sp.expand(sp.rem(sp.expand(left), c**2 + d**2 - 1, d)) != 0:
                return False
        return True

    J = sp.Matrix(
        [
            [c_psi * c_theta, -ell * s_theta * c_psi, -ell * s_psi],
            [s_psi * c_theta, -ell * s_theta * s_psi, ell * c_psi],
            [-s_theta, -ell * c_theta, 0],
        ]
    )
    J_delta = sp.Matrix(
        [-v * s_psi + w * s_theta * c_psi, v * c_psi + w * s_theta * s_psi, w * c_theta]
    )
    # The columns of J are orthogonal, of the lengths 1, ell and ell.
    J_inverse = sp.diag(1, 1 / ell**2, 1 / ell**2) * J.T
    drift = sp.Matrix([0, -w / ell, v / ell])
    assert vanishes(J_inverse * J - sp.eye(3))
    assert vanishes(J_inverse * J_delta - drift)

    dy = J * sp.Matrix([u, q, r]) + J_delta
    M_1, D_1 = sp.diag(m11, m55, m66), sp.diag(d11, d55, d66)
    C_1 = sp.Matrix([[0, m33 * w, -m22 * v], [(m11 - m33) * w, 0, 0], [(m22 - m11) * v, 0, 0]])
    T = M_1 * drift.jacobian([v, w]) * sp.diag(1 / m22, 1 / m33)

    def C_1_bar(x):
        return sp.Matrix([[0, 0, m11 * x[0]], [0, -m11 * x[0], 0]])

    a = sp.Matrix([u, q, r]) + drift  # J^-1 dy, by (13)
    printed_d = (C_1 - 2 * T * C_1_bar(drift)) * a + T * C_1_bar(a) * a
    printed_tau_w2 = (
        -(C_1 + D_1) * drift
        + sp.Matrix([w_u, w_q, w_r])
        + T * (sp.diag(d22, d33) * sp.Matrix([v, w]) + sp.Matrix([w_v, w_w]))
        + T * C_1_bar(drift) * drift
    )
    left = (
        M_1 * J_inverse * (dot(dy) - dot(J) * J_inverse * dy)
        + D_1 * a
        + sp.Matrix([0, righting * s_theta, 0])
        + printed_d
        + printed_tau_w2
    )
    missing = -T * C_1_bar(a) * drift
    assert not vanishes(left - sp.Matrix(tau))
    assert vanishes(left + missing - sp.Matrix(tau))
