"""What is wrong in the paper: each point with its proof or counterexample, and its test.

`docs/paper.md` is :func:`errata_page`, the report has :func:`section`, and beside both stand the
lines that `auv-fmu gains` prints. Numbers of the theorem are computed where they are said.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from math import cbrt, radians, sqrt, tan

from auv_fmu.control_point import ELL
from auv_fmu.output_feedback import Gains
from auv_fmu.proof.attraction import Theorem, theorem
from auv_fmu.proof.zetas import at_least, coupling
from auv_fmu.saturation import MAXIMUM_SLOPE
from auv_fmu.vehicle import Vehicle
from orchestrator.analysis.gains import stated

_MODEL = "tests/unit/auv_fmu/proof/test_control_point_model.py"
_ATTRACTION = "tests/unit/auv_fmu/proof/test_attraction.py"
_ZETAS = "tests/unit/auv_fmu/proof/test_zetas.py"
_SCENARIOS = "tests/system/test_scenarios.py"
_ERRATA = "tests/unit/orchestrator/paper/test_errata.py"
_CLAIMS = "tests/unit/orchestrator/paper/test_claims.py"

_INTRODUCTION = """\
Points at which the paper cannot be right as printed: what it says, why that cannot be, what follows
from it, and the test that shows it. None of them touches the control law (21) to (24), which does
what the paper's figures show; most are slips that the proof survives. Two it does not: no gains
meet (31) for this vehicle, and the region of attraction does not grow with the gains. Where the
paper is silent, [the readings]({readings}) say how it is read here."""

_NUMBERS = """\
`auv-fmu gains` says of the vehicle and the gains of section 4.1, and of any others with `--set`:"""


@dataclass(frozen=True)
class Erratum:
    """Something that is printed and cannot be.

    Attributes:
        title: where, and what.
        text: what is printed, the proof or counterexample, and what follows.
        tests: that show it.

    """

    title: str
    text: str
    tests: tuple[str, ...]


@cache
def of_the_paper() -> Theorem:
    """The theorem for section 4.1."""
    return theorem(Vehicle(), ELL, Gains(), MAXIMUM_SLOPE["tanh"])


@cache
def errata() -> tuple[Erratum, ...]:
    """All points, in the order of the paper."""
    vehicle, found = Vehicle(), of_the_paper()
    first, second, third = found.conditions
    k, there = coupling(vehicle, ELL), found.bounds.lambda_d2
    turning = vehicle.m55 / ELL**3
    missing = turning * vehicle.m11 / vehicle.m33
    skew = (vehicle.m66 / ELL**2 - vehicle.m11) / ELL
    # With vanishing gains (31) asks for k / 4 < d11, and k falls with the cube of ell.
    far_enough = ELL * cbrt(found.zeta_of_any_gains / there)
    factor = sqrt(found.bounds.lambda_M2 * Gains().gamma)
    return (
        Erratum(
            "(7) prints w where v belongs",
            "(8) has three columns and w two entries. With v = (u, q, r) behind it the product is "
            "(m11 u r, -m11 u q), which is what (2) has. The lines below (14) have it right.",
            (f"{_MODEL}::test_equations_6_and_7_are_equation_2",),
        ),
        Erratum(
            "(11) is written for a vehicle that does not roll",
            "Its columns are R e1, -ell R e3 and ell R e2 at zero roll. The vehicle that section "
            "4.1 simulates rolls; beyond a quarter turn the two columns of the printed J point "
            "backwards, and the loop feeds back with the wrong sign. With the full R it does not "
            "(reading 3).",
            (f"{_SCENARIOS}::test_jacobian_as_printed_saturates_where_the_full_attitude_does_not",),
        ),
        Erratum(
            "(15): d lacks a term",
            "Below (14), C_1_bar(v) v at v = J^-1 dy - J^-1 J_delta is expanded as if "
            "C_1_bar(a) b were C_1_bar(b) a. But C_1_bar(a) has the surge of a, and "
            "J^-1 J_delta = (0, -w/ell, v/ell) has none. So the mixed terms as printed are zero, "
            "and d lacks -J^-T M_1 d(J^-1 J_delta)/dw M_1_bar^-1 C_1_bar(J^-1 dy) J^-1 J_delta: "
            f"{0.1 * missing:.1f} N at u = 1 m/s and w = 0.1 m/s. It is linear in dy and bounded "
            "with w by Assumption 1: the proof survives with larger zetas.",
            (
                "tests/unit/auv_fmu/proof/test_derivation.py::test_15_needs_one_more_term",
                f"{_MODEL}::test_equation_15_holds_with_what_d_lacks",
                f"{_MODEL}::test_equation_15_as_printed_lacks_a_force",
                f"{_MODEL}::test_what_d_lacks_is_linear_in_dy_and_in_w",
            ),
        ),
        Erratum(
            "(15): C_2 is no function of dy alone",
            "The rate of J follows (u, q, r) = J^-1 (dy - J_delta), so (15) and P2.2 hold with C_2 "
            "at the velocity dy - J_delta; that does not vanish with dy, against P2.4. As "
            "C_2(eta, dy), which is how the proof and this code use it, it leaves "
            "-C_2(eta, J_delta) dy to d, and dM_2/dt - 2 C_2 is not skew-symmetric: at "
            f"v = 0.2 m/s its symmetric part has an entry of {0.2 * skew:.0f} kg/s at level "
            "attitude. Both are linear in w: the proof survives with larger zetas.",
            (
                f"{_MODEL}::test_equation_15_holds_with_what_d_lacks",
                f"{_MODEL}::test_p2_2_fails_where_sway_and_heave_are_left_out",
                f"{_MODEL}::test_p2_2_rate_of_inertia_minus_twice_coriolis_is_skew",
            ),
        ),
        Erratum(
            "P2.2 and P2.3 exclude each other in (15)",
            "P2.3 makes C_2(x) y symmetric in x and y, so the product C_2(dy) dy of (15) fixes it: "
            "it is (C_2(x) y + C_2(y) x) / 2. Take a level vehicle, x ahead and y to starboard. "
            "Under x the vehicle does not turn, so M_2 is at rest and P2.2 asks for "
            f"y^T C_2(x) y = 0; it is -m66 / (2 ell^3) = {-0.5 * vehicle.m66 / ELL**3:.0f}. C_2 as "
            "printed has P2.2 and not P2.3 (reading 14). The Christoffel symbols of M_2 have both; "
            "(15) differs from them by a force that is quadratic in dy and does no work, for d to "
            "take. Or the proof does without P2.3: C_2(dy) dy_r = C_2(r_1) dy_r + C_2(dy_r) dy_r "
            "puts C_2(r_1) dy_r where chi_1 has C_2(dy_r) r_1.",
            (
                f"{_MODEL}::test_no_c_2_has_both_p2_2_and_p2_3",
                f"{_MODEL}::test_p2_3_fails_for_other_velocities",
                f"{_MODEL}::test_christoffel_symbols_have_both_p2_2_and_p2_3",
                "tests/unit/auv_fmu/proof/test_error_dynamics.py"
                "::test_error_dynamics_are_those_of_15_but_for_p2_3",
            ),
        ),
        Erratum(
            "P2.4: C_2 has a pole at the vertical",
            "(1) turns the axes of J about the vertical at r / cos(theta), so they roll at "
            "r tan(theta), and |C_2| is at least m55 tan(theta) / ell^3 per m/s: "
            f"{turning * tan(radians(80.0)):,.0f} kg/m at 80 degrees, "
            f"{turning * tan(radians(89.0)):,.0f} at 89. No constant bounds it, so (26) and (29) "
            "hold only away from the vertical, which Fig. 5 passes. With the full rotation of "
            "reading 3 the rates are the body's own, and |C_2| <= lambda_M2 |omega|: P2.4 then "
            "needs a bound on the roll rate beside dy.",
            (
                f"{_MODEL}::test_p2_4_fails_at_the_vertical",
                f"{_MODEL}::test_p2_4_has_no_pole_with_the_full_rotation",
            ),
        ),
        Erratum(
            "P2.5 holds for a bounded velocity only",
            "d is quadratic in dy. At x_1 = x_2 + h its change has a term |x_2| |h|, which no "
            "d_M1 |h| + d_M2 |h|^2 bounds for all x_2. The proof needs it at x_2 = dy_r alone, "
            "which (16) and Assumption 4 bound: it survives.",
            (
                f"{_MODEL}::test_p2_5_fails_for_an_unbounded_velocity",
                f"{_MODEL}::test_p2_5_holds_for_a_bounded_second_velocity",
            ),
        ),
        Erratum(
            "Lemma 1: a square and a factor",
            "(vi): from (iv) follows s^2 <= s'_M^2 xi^2, and s'_M without the square is too little "
            "for 2 tanh(xi). (i): the integral of tanh(k_1 r) is ln(cosh(k_1 xi)) / k_1, and "
            "ln(cosh(xi)) lies within the printed bounds at k_1 = 1 only. The proof of Theorem 1 "
            "has s'_M = k_1 = 1.",
            ("tests/unit/auv_fmu/test_saturation.py::test_lemma_1_as_printed_fails",),
        ),
        Erratum(
            "(24) contradicts its initial value",
            "At t = 0 (24) is dy_hat_o = dy_r; below it stands dy_hat_o(0) = 0 for z(0) = 0. Both "
            "are true for dy_r(0) = 0 alone, and Fig. 4 starts 6.6 m away. (51) with the "
            "printed initial value is meant (reading 4).",
            (
                "tests/unit/auv_fmu/test_observer.py::test_24_starts_from_dy_r",
                "tests/unit/auv_fmu/test_observer.py::test_state_of_the_observer_is_equation_24",
            ),
        ),
        Erratum(
            "(18) and (23) name two signals almost alike",
            "dy_o of (18) is dy_hat - Lambda Tanh(z), the state with a hat of (23) is that less "
            "k_d z. The law (21) needs the first: only with it is d/dt (r_1 - r_2) = k_d r_2, as "
            "above (28) (reading 15).",
            ("tests/unit/auv_fmu/test_observer.py::test_observer_is_the_one_of_the_proof",),
        ),
        Erratum(
            "(30) to (32): the gains of section 4.1",
            f"(30) is {first.verdict}: {first.left:g} is not above {first.right:g}. (31) is "
            f"{second.verdict}: {second.left:g} is not above {second.right:g} and the zetas, which "
            f"make it {second.right + second.least:.1f} at least. (32) is {third.verdict}: "
            f"{third.left:g} is above {third.right + third.least:.1f}, but the zetas may be larger "
            f"than is known. alpha_1 = {found.alphas.alpha_1:g} alone leaves (33) empty. Remark 4 "
            "calls the conditions sufficient and conservative, and the loop converges; but not by "
            "Theorem 1.",
            (
                "tests/unit/auv_fmu/proof/test_gain_conditions.py"
                "::test_the_papers_gains_miss_conditions_30_and_31",
                f"{_ATTRACTION}::test_alphas_of_the_paper",
            ),
        ),
        Erratum(
            "(31): no gains meet it for this vehicle",
            "(26) at |x| = 1 is |chi_1| <= zeta_1 + zeta_2. Take a reference at rest, a level "
            "vehicle without sway and heave, e = z = r_2 = 0, and r_1 of length 1 halfway between "
            "ahead and starboard: then chi_1 = -d(r_1), of the size m11 m66 / (2 m22 ell^3) = "
            f"{0.5 * k:.1f}. So 0.5 (zeta_1 + zeta_2) is at least {found.zeta_of_any_gains:.1f} "
            f"whatever the gains, and lambda_d2 is {there:g}. With chi_1 as printed it grows as "
            f"sqrt(1 + lambda^2): {second.least:.1f} at 1, "
            f"{0.5 * at_least(vehicle, ELL, 2.0).zeta_1_2:.1f} at 2. Remark 4 calls (31) not "
            "restrictive, because water damps; but damping must outweigh how turning drives sway, "
            f"and that falls with ell^3: ell above {far_enough:.2f} m is necessary. (32) may hold: "
            f"0.5 (zeta_3 + zeta_4) is at least {0.5 * found.zetas.zeta_3_4:.1f}, and "
            f"{third.room * found.bounds.lambda_m2:g} is there.",
            (
                f"{_ZETAS}::test_chi_1_is_half_the_coupling_times_the_square_of_r_1",
                f"{_ZETAS}::test_bound_on_chi_1_is_attained_at_norm_one",
                f"{_ZETAS}::test_bound_on_chi_2_is_reached_at_norm_one",
                f"{_ATTRACTION}::test_no_gains_meet_31_with_the_vehicle_of_the_paper",
                f"{_ATTRACTION}::test_the_control_point_must_be_far_ahead",
            ),
        ),
        Erratum(
            "The region of attraction does not grow with the gains",
            "alpha_3 = lambda_d2 - k_1max - 0.5 k_2max - 0.5 (zeta_1 + zeta_2) has the gains with "
            "a minus alone, and alpha_m is no more. Nor does it help to ask for (26) on a ball "
            f"|x| <= rho only: with the r_1 above, zeta_1 + zeta_2 rho >= k rho / 2, k = {k:.1f}, "
            "and (42) asks for 2 zeta_1 + zeta_2 (1 + rho^2) < 2 lambda_d2. As 1 + rho^2 >= 2 rho, "
            f"k rho < 2 lambda_d2: rho < {found.x_of_any_gains:.2f} with any gains, "
            f"{found.x_at_most:.2f} with those of section 4.1 if (30) held. A start further from "
            "the reference than that, in metres, is not covered, and the semi-global claim does "
            "not follow. It may be true: runs from 6.6, 30 and 100 m converge.",
            (
                f"{_ATTRACTION}::test_no_gain_makes_alpha_3_larger",
                f"{_ATTRACTION}::test_no_zetas_reach_further",
                f"{_ATTRACTION}::test_alphas_are_those_below_40",
            ),
        ),
        Erratum(
            "(33) has min where (47) needs max",
            "(47) has the sum (lambda_u / lambda_x) |u|^2 + (0.5 lambda_max(Gamma^-1) / lambda_x) "
            "|theta - theta_hat|^2, which only the larger factor times |vartheta|^2 bounds. On the "
            "boundary of (33) with all of vartheta in u, (47) is missed. With the values of "
            f"section 4.1 the radius is smaller by a factor of {factor:.1f}.",
            (
                f"{_ATTRACTION}::test_33_as_printed_admits_starts_that_47_excludes",
                f"{_ATTRACTION}::test_33_needs_the_max_for_47",
            ),
        ),
        Erratum(
            "(30) and the limits (3) pull apart",
            "With equal entries in K_2, (30) is lambda > 2. The commands grow steeply with lambda: "
            "at 2.1, from the start of Fig. 4 and without noise, the controller commands 651 N "
            "where 80 can be had (`auv-fmu run fig4 --set controller.lambda=2.1 --set "
            "plant.noise.std=0`), and 59 N at the paper's 1. Gains that meet (30) saturate the "
            "actuators that the controller is made to spare.",
            (
                "tests/unit/auv_fmu/proof/test_gain_conditions.py"
                "::test_condition_30_can_be_met_by_a_larger_lambda",
                f"{_ERRATA}::test_30_costs_what_is_said",
            ),
        ),
        Erratum(
            "4.1: the quoted turning radius has the size of the diameter",
            "(2) at rest under 80 N and 80 N·m has one solution, r = 3.875 rad/s, and turns on a "
            "radius of 0.280 m. Its diameter, 0.561 m, rounds to the printed 0.6 m (reading 11).",
            (
                f"{_ERRATA}::test_the_circle_is_the_one_of_2",
                f"{_SCENARIOS}::test_smallest_turning_radius_is_that_of_the_printed_equations",
            ),
        ),
        Erratum(
            "(59) is not what was tabulated",
            "The root of the mean square of a signal within 80 is within 80, and the paper prints "
            "130, 163, 172 and 235. Two slips give numbers of that size: the L2 norm, which is "
            "(59) without 1/T_f, and (59) coded as a sum over steps without their length, "
            "sqrt(sum tau_k^2 / T_f). The sum is the L2 norm / sqrt(h T_f): the same number at "
            "T_f = 50 s, a smaller one later. Which of them it was, if either, is not known "
            "(reading 6).",
            (
                f"{_ERRATA}::test_59_cannot_exceed_the_limit",
                f"{_ERRATA}::test_a_sum_without_the_step_is_the_norm_at_50_s",
            ),
        ),
        Erratum(
            "4.2: as L2 norms, surge efforts below what the way takes",
            "Until |e| is 1 m, tau_u of Fig. 5 has an impulse of 1058 N·s in 40.4 s with the "
            "proposed controller, and of 1077 N·s in 15.0 s with PD. By Cauchy and Schwarz "
            "(integral of tau_u)^2 <= T * integral of tau_u^2, so the L2 norms are at least 166 "
            "and 278 N·√s, and more at every later T_f. The paper prints 130 and 235, which are "
            "thus no L2 norms of such runs, whatever is chosen of what it leaves open (`auv-fmu "
            "table`). Sums without the step have bounds that shrink, 166 and 278 divided by "
            "sqrt(0.02 T_f). From T_f = 82 s on with the proposed controller and 70 s with PD, "
            "the printed numbers contradict nothing.",
            (
                f"{_ERRATA}::test_surge_efforts_cannot_be_smaller",
                f"{_CLAIMS}::test_no_force_has_less_effort_than_its_impulse_takes",
                f"{_CLAIMS}::test_a_way_against_damping_takes_an_impulse_of_its_own",
            ),
        ),
        Erratum(
            "4.2: efforts that belong to the step of 20 ms",
            "The PD controller's L2 effort in tau_q, printed as 163, is 165 N·m·√s after 60 s at "
            "the printed step and 132 at half of it (`auv-fmu run fig5-pd --stop-time 60 --step "
            "0.01`); the one in tau_r, printed as 172, is 182 at the printed step and 172 at a "
            "quarter of it. The rest is Euler's scheme, and no property of the controller. The "
            "proposed controller's efforts change by 4 % at most.",
            (f"{_ERRATA}::test_pd_efforts_belong_to_the_step",),
        ),
    )


def section() -> str:
    """The points in Markdown, a heading of the fourth level each."""
    introduction = _INTRODUCTION.format(readings="#readings")
    return "\n\n".join((introduction, *_points("####")))


def errata_page() -> str:
    """The page of the documentation."""
    numbers = "\n".join(stated(of_the_paper()))
    parts = (
        "# What is wrong in the paper",
        _INTRODUCTION.format(readings="readings.md"),
        "This page is written by `auv-fmu docs`.",
        "## The theorem in numbers",
        _NUMBERS,
        f"```\n{numbers}\n```",
        *_points("##"),
    )
    return "\n\n".join(parts) + "\n"


def _points(level: str) -> Iterator[str]:
    for erratum in errata():
        yield f"{level} {erratum.title}"
        yield erratum.text
        yield "Shown by " + ", ".join(f"`{test}`" for test in erratum.tests) + "."
