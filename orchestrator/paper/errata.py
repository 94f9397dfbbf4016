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
from auv_fmu.proof.attraction import Theorem, ball, theorem
from auv_fmu.proof.zetas import at_least, coupling
from auv_fmu.saturation import MAXIMUM_SLOPE
from auv_fmu.vehicle import Vehicle
from orchestrator.vehicle.gains import stated

_MODEL = "tests/unit/auv_fmu/proof/test_control_point_model.py"
_ATTRACTION = "tests/unit/auv_fmu/proof/test_attraction.py"
_CONDITIONS = "tests/unit/auv_fmu/proof/test_gain_conditions.py"
_LYAPUNOV = "tests/unit/auv_fmu/proof/test_lyapunov.py"
_OBSERVER = "tests/unit/auv_fmu/test_observer.py"
_SATURATION = "tests/unit/auv_fmu/test_saturation.py"
_ZETAS = "tests/unit/auv_fmu/proof/test_zetas.py"
_SCENARIOS = "tests/system/test_scenarios.py"
_ERRATA = "tests/unit/orchestrator/paper/test_errata.py"
_CLAIMS = "tests/unit/orchestrator/paper/test_claims.py"

_INTRODUCTION = """\
Points at which the paper does not hold as printed: what it says, why that cannot be or does not
follow, what hangs on it, and the test that shows it. Most of the errors leave the proof as it is,
or with larger constants. The gaps do not: Theorem 1 does not apply to the vehicle, the gains and
the reference of section 4.1, and its proof is not complete. Nothing here says that what it claims
is false: the loop follows its reference in the runs of Figs. 4 to 7. Where the paper is silent or
contradicts itself, [the readings]({readings}) say how it is read here."""

_NUMBERS = """\
`auv-fmu gains` says of the vehicle and the gains of section 4.1, and of any others with `--set`:"""

ERROR, GAP, TENSION = "Errors", "Gaps of the proof", "Tensions"

#: What the points of a kind have in common.
KINDS = {
    ERROR: "What is printed and false.",
    GAP: "Steps of Theorem 1 that do not follow as printed, and what it does not reach.",
    TENSION: "What is true, or nearly, and still pulls apart or is easily misread.",
}


@dataclass(frozen=True)
class Erratum:
    """Something that does not hold as printed.

    Attributes:
        title: where, and what.
        text: what is printed, the proof or counterexample, and what follows.
        tests: that show it.
        kind: one of :data:`KINDS`.

    """

    title: str
    text: str
    tests: tuple[str, ...]
    kind: str = ERROR


@cache
def of_the_paper() -> Theorem:
    """The theorem for section 4.1."""
    return theorem(Vehicle(), ELL, Gains(), MAXIMUM_SLOPE["tanh"])


@cache
def errata() -> tuple[Erratum, ...]:
    """All points; within each kind in the order of the paper."""
    vehicle, found = Vehicle(), of_the_paper()
    first, second, third = found.conditions
    k, there = coupling(vehicle, ELL), found.bounds.lambda_d2
    turning = vehicle.m55 / ELL**3
    missing = turning * vehicle.m11 / vehicle.m33
    skew = (vehicle.m66 / ELL**2 - vehicle.m11) / ELL
    # With vanishing gains (31) asks for k / 4 < d11, and k falls with the cube of ell.
    far_enough = ELL * cbrt(found.zeta_of_any_gains / there)
    factor = sqrt(found.bounds.lambda_M2 * Gains().gamma)
    slow = theorem(vehicle, ELL, Gains(lambda_=0.1), MAXIMUM_SLOPE["tanh"], 0.05)
    speed, power = found.speed_of_any_gains, found.alpha_1_of_any_gains
    of_theta = found.bounds.lambda_M2
    balls = [
        ball(theta, eps_t, Gains().sigma) for eps_t in (1.0, 10.0) for theta in (0.0, of_theta)
    ]
    return (
        Erratum(
            "(7) prints w where v belongs",
            "(8) has three columns and w two entries. With v = (u, q, r) after it the product is "
            "(m11 u r, -m11 u q), which is what (2) has. The lines below (14) have it right.",
            (f"{_MODEL}::test_equations_6_and_7_are_equation_2",),
        ),
        Erratum(
            "(15): d lacks a term",
            "Below (14), C_1_bar(v) v at v = J^-1 dy - J^-1 J_delta is expanded as if "
            "C_1_bar(a) b were C_1_bar(b) a. But C_1_bar(a) has the surge of a, and "
            "J^-1 J_delta = (0, -w/ell, v/ell) has none. So the mixed terms as printed are zero, "
            "and d lacks -J^-T M_1 d(J^-1 J_delta)/dw M_1_bar^-1 C_1_bar(J^-1 dy) J^-1 J_delta: "
            f"{0.1 * missing:.1f} N at u = 1 m/s and w = 0.1 m/s. It is linear in dy and bounded "
            "with w by Assumption 1: the proof keeps its form, with larger zetas.",
            (
                "tests/unit/auv_fmu/proof/test_derivation.py::test_15_needs_one_more_term",
                f"{_MODEL}::test_equation_15_holds_with_what_d_lacks",
                f"{_MODEL}::test_equation_15_as_printed_lacks_a_force",
                f"{_MODEL}::test_what_d_lacks_is_linear_in_dy_and_in_w",
            ),
        ),
        Erratum(
            "(15): C_2 depends on more than dy",
            "The rate of J follows (u, q, r) = J^-1 (dy - J_delta), so (15) and P2.2 hold with C_2 "
            "at the velocity dy - J_delta; that does not vanish with dy, against P2.4. As "
            "C_2(eta, dy), which is how the proof and this code use it, it leaves "
            "-C_2(eta, J_delta) dy to d, and dM_2/dt - 2 C_2 is not skew-symmetric: at "
            f"v = 0.2 m/s its symmetric part has an entry of {0.2 * skew:.0f} kg/s at level "
            "attitude. Both are linear in w: the proof keeps its form, with larger zetas.",
            (
                f"{_MODEL}::test_equation_15_holds_with_what_d_lacks",
                f"{_MODEL}::test_p2_2_fails_where_sway_and_heave_are_left_out",
                f"{_MODEL}::test_p2_2_rate_of_inertia_minus_twice_coriolis_is_skew",
            ),
        ),
        Erratum(
            "P2.2 and P2.3 exclude each other in (15)",
            "P2.3 makes C_2(x) y symmetric in x and y, so the product C_2(dy) dy of (15) fixes it: "
            "it is (C_2(x) y + C_2(y) x) / 2 with the printed C_2. Take a level vehicle, x ahead "
            "and y to starboard, of 1 m/s each. Under x the vehicle does not turn, so M_2 is at "
            "rest and P2.2 asks for y^T C_2(x) y = 0; it is -m66 / (2 ell^3) = "
            f"{-0.5 * vehicle.m66 / ELL**3:.0f} W. C_2 as printed has P2.2 and not P2.3 (reading "
            "14). Christoffel symbols, with the rate of M_2 under each dy for its derivative, have "
            "both; (15) differs from them by a force that is quadratic in dy and does no work, for "
            "d to take. Or the proof does without P2.3: C_2(dy) dy_r = C_2(r_1) dy_r + "
            "C_2(dy_r) dy_r puts C_2(r_1) dy_r where chi_1 has C_2(dy_r) r_1.",
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
            "-r tan(theta), and |C_2| is at least m55 tan(theta) / ell^3 per m/s: "
            f"{turning * tan(radians(80.0)):,.0f} kg/m at 80 degrees, "
            f"{turning * tan(radians(89.0)):,.0f} at 89. No constant bounds it, so (26) and (29) "
            "have finite zetas only for pitches that keep off the vertical, and our Fig. 5 passes "
            "it. With the full rotation of reading 3 the rates are the body's own, and "
            "|C_2| <= lambda_M2 |omega|: P2.4 then needs a bound on the roll rate beside dy.",
            (
                f"{_MODEL}::test_p2_4_fails_at_the_vertical",
                f"{_MODEL}::test_p2_4_has_no_pole_with_the_full_rotation",
            ),
        ),
        Erratum(
            "P2.5 holds for a bounded velocity only",
            "d is quadratic in dy. At x_1 = x_2 + h its change has a term |x_2| |h|, which no "
            "d_M1 |h| + d_M2 |h|^2 bounds for all x_2. The proof needs it only at x_2 = dy_r, "
            "which (16) and Assumption 4 bound: it holds there, with a d_M1 that grows with "
            "lambda.",
            (
                f"{_MODEL}::test_p2_5_fails_for_an_unbounded_velocity",
                f"{_MODEL}::test_p2_5_holds_for_a_bounded_second_velocity",
            ),
        ),
        Erratum(
            "Lemma 1: a factor, a matrix and a square",
            "(i): the integral of tanh(k_1 r) is ln(cosh(k_1 xi)) / k_1, and ln(cosh(xi)) lies "
            "within the printed bounds at k_1 = 1 only. (v) is printed for every Psi; positive "
            "definite is not enough: Psi = [[1, 5], [5, 26]] and x = (10, -1) make "
            "x^T Psi Tanh(x) = -13.3. It is enough if Psi is diagonal as well. (vi): from (i) "
            "follows s^2 <= s'_M^2 xi^2, and s'_M without the square is too little for 2 tanh(xi). "
            "The proof of Theorem 1 has k_1 = s'_M = 1 and diagonal matrices: nothing hangs on it.",
            (
                f"{_SATURATION}::test_lemma_1_as_printed_fails",
                f"{_SATURATION}::test_lemma_1_iv_to_vi",
            ),
        ),
        Erratum(
            "(24) contradicts its initial value",
            "At t = 0 (24) is dy_hat_o = dy_r; below it stands dy_hat_o(0) = 0 for z(0) = 0. Both "
            "are true only where dy_r(0) = 0, and Fig. 4 starts 6.6 m away. (51) with the "
            "printed initial value is free of that (reading 4).",
            (
                f"{_OBSERVER}::test_24_starts_from_dy_r",
                f"{_OBSERVER}::test_state_of_the_observer_is_equation_24",
            ),
        ),
        Erratum(
            "(33) has min where (47) needs max",
            "(47) has the sum (lambda_u / lambda_x) |u|^2 + (0.5 lambda_max(Gamma^-1) / lambda_x) "
            "|theta - theta_hat|^2, which only the larger factor times |vartheta|^2 bounds. On the "
            "boundary of (33) with all of vartheta in u, (47) is missed. With the values of "
            f"section 4.1, in SI units, the radius is smaller by a factor of {factor:.1f}.",
            (
                f"{_ATTRACTION}::test_33_as_printed_admits_starts_that_47_excludes",
                f"{_ATTRACTION}::test_33_needs_the_max_for_47",
            ),
        ),
        Erratum(
            "(41) needs the largest entry of Sigma",
            "Completing the square leaves 0.5 kappa^2 lambda_max(Sigma) |theta - theta_0|^2 in "
            "gamma, where (41) has mu_sigma, which is the smallest. With Sigma = diag(0.001, "
            "0.001, 0.001, 0.1), kappa = 1, theta - theta_0 = (0, 0, 0, 1) and theta_tilde half "
            "of that, the last term of (40) is 0.025, and what (41) has for it below 0.0004. With "
            "equal entries, as in section 4.1, the two are the same.",
            (
                f"{_ATTRACTION}::test_41_needs_the_largest_entry_of_sigma",
                f"{_ATTRACTION}::test_41_holds_with_the_largest_entry_of_sigma",
            ),
        ),
        Erratum(
            "(45): V may rise inside Omega_p",
            "V falls outside Omega_p; that gives V(t) <= max{V(0), sup of V over Omega_p}, where "
            "(45) has V(0) only. Start at e = z = r_1 = r_2 = 0 with theta_hat = theta: V(0) = 0, "
            "and the first disturbance makes V positive. (46), (47) and (33) inherit it.",
            (f"{_ERRATA}::test_v_rises_from_zero",),
        ),
        Erratum(
            "4.1: the quoted turning radius has the size of the diameter",
            "With the printed parameters (2) has one steady turn under 80 N and 80 N·m, at "
            "r = 3.875 rad/s on a radius of 0.280 m. Its diameter, 0.561 m, rounds to the printed "
            "0.6 m (reading 11).",
            (
                f"{_ERRATA}::test_the_circle_is_the_one_of_2",
                f"{_SCENARIOS}::test_smallest_turning_radius_is_that_of_the_printed_equations",
            ),
        ),
        Erratum(
            "Three slips that change nothing",
            "Sigma of (22) is in R^4x4, not R^4. 4.1 limits all three commands to 80 Nm, and "
            "tau_u is a force. Assumption 3 names sensors of position and heading; (9) and (11) "
            "need the pitch too.",
            (
                "tests/unit/auv_fmu/test_control_point.py::test_control_point_is_equation_9",
                "tests/unit/auv_fmu/test_control_point.py::test_jacobian_is_equation_11",
            ),
        ),
        Erratum(
            "Assumption 1 is about the closed loop",
            "B_w bounds sway and heave for all time and enters the zetas, but (7) drives both with "
            "m11 u r and m11 u q, which the theorem is to bound. It depends on the controller and "
            "on the start: the largest |(v, w)| at the printed step is 0.41 m/s in our Fig. 5, "
            "2.08 with PD, and 1.81 from the start of Fig. 4 with 2.5 m/s ahead and 4 rad/s of "
            "yaw. The zetas, and with them the gains, then depend on the start that they are to "
            "cover, and B_w on the gains: the proof does not break that circle.",
            (f"{_ERRATA}::test_sway_and_heave_depend_on_controller_and_start",),
            GAP,
        ),
        Erratum(
            "The limits (3) are not in the theorem",
            "(25) has the command of (21) for the force, so neither (3) nor C3 of Definition 1 "
            "enters. (21) has |F_i| <= k_1i + 2 k_2i + rho_hat, and nothing known beforehand "
            "bounds rho_hat: theta_0 can take the command beyond any limit. Section 1 claims a "
            "smaller risk of saturation, and section 4 shows it by simulation.",
            (
                "tests/unit/auv_fmu/test_output_feedback.py"
                "::test_first_three_terms_cannot_exceed_their_gains",
                f"{_ERRATA}::test_rho_hat_takes_the_command_beyond_any_limit",
            ),
            GAP,
        ),
        Erratum(
            "(30) to (32) have a unit of speed in them",
            "(30) adds N to N m/s, (31) adds N to kg/s, and |x| adds m/s to pure numbers, all "
            "counted in m/s. With r_1 / v0 and r_2 / v0 in x, and |chi_i| / v0 in (26) and (29), "
            "the same steps hold for any v0: (30) then has k_2max v0 for k_2max, (31) and (32) "
            "have k_2max / v0. (k_1max comes with the slope of Tanh(dy_o - dy_r) in (21), which is "
            "per m/s in any case.) At "
            "v0 = 0.05 m/s and lambda just above 0.1 m/s, (30) is met, the zetas take "
            f"{slow.conditions[1].least:.1f} of the {there:g} kg/s of (31) at least, (32) asks for "
            f"k_d > {slow.conditions[2].least:.1f} at least and (42) for |x| < "
            f"{slow.x_of_any_gains:.2f} at most. So Remark 4 is right that less restrictive "
            "conditions may be found; what is said below of every v0 holds for these too. One "
            "gamma and one sigma for four units, and Tanh of metres and of m/s, are part of the "
            "law.",
            (
                f"{_CONDITIONS}::test_another_unit_of_speed_is_other_units_throughout",
                f"{_ATTRACTION}::test_alphas_bound_what_is_known_of_37",
                f"{_ATTRACTION}::test_units_in_which_the_conditions_leave_room",
            ),
            GAP,
        ),
        Erratum(
            "(30) to (32): the gains of section 4.1",
            f"As printed, (30) is {first.verdict}: {first.left:g} is not above {first.right:g}. "
            f"(31) is {second.verdict}: {second.left:g} is not above {second.right:g} and the "
            f"zetas, which make it {second.right + second.least:.1f} at least. (32) is "
            f"{third.verdict}: {third.left:g} is above {third.right + third.least:.1f}, but the "
            "zetas may be larger, and have no bound at all attitudes (P2.4). "
            f"alpha_1 = {found.alphas.alpha_1:g} suffices to leave (33) empty. Any v0 below "
            "0.5 m/s mends (30), and none (31): at lambda = 1 m/s, 0.5 (zeta_1 + zeta_2) is above "
            f"{0.25 * k:.1f} kg/s for every v0. Remark 4 calls the conditions sufficient and "
            "conservative, and the loop converges; but not by Theorem 1.",
            (
                f"{_CONDITIONS}::test_the_papers_gains_miss_conditions_30_and_31",
                f"{_CONDITIONS}::test_condition_30_can_be_met_by_a_larger_lambda",
                f"{_ATTRACTION}::test_alphas_of_the_paper",
                f"{_ATTRACTION}::test_31_asks_for_a_small_lambda_in_any_unit",
            ),
            GAP,
        ),
        Erratum(
            "(31): no gains meet it with the reference of section 4.1",
            "Take a vehicle without sway and heave, z = 0, e = 0, a reference that moves "
            "ahead at V, and r_1 to starboard. Then |chi_1| = k V |r_1| with k = m11 m66 / "
            f"(m22 ell^3) = {k:.1f} kg/m, so 0.5 (zeta_1 + zeta_2) >= 0.5 k V, whatever the gains "
            f"and v0; lambda_d2 is {there:g} kg/s, and V must be below {speed:.2f} m/s. The "
            "reference of section 4.1 makes 0.167 m/s. (Without P2.3 the same holds, for a "
            "reference to starboard.) Even for one at rest, with e astern and r_1 between ahead "
            "and starboard, 0.5 (zeta_1 + zeta_2) >= 0.25 k sqrt(v0^2 + lambda^2). So lambda "
            f"must be below {2.0 * speed:.2f} m/s whatever v0 is, and as printed, at v0 = 1 m/s, "
            f"no gains do: {found.zeta_of_any_gains:.1f} kg/s at lambda = 0, "
            f"{second.least:.1f} at 1 m/s, "
            f"{0.5 * at_least(vehicle, ELL, 2.0).zeta_1_2:.1f} at 2. "
            "Remark 4 calls (31) not restrictive, because water damps; but damping must outweigh "
            "how turning drives sway, which falls with ell^3: as printed, ell above "
            f"{far_enough:.2f} m is necessary. A proof that keeps the sign of r_1^T chi_1 may do "
            "better: ahead it damps, astern it drives.",
            (
                f"{_ZETAS}::test_chi_1_is_the_coupling_times_a_reference_ahead",
                f"{_ZETAS}::test_bound_on_chi_1_is_attained_at_norm_one",
                f"{_ATTRACTION}::test_31_asks_for_a_slow_reference_in_any_unit",
                f"{_ATTRACTION}::test_31_asks_for_a_small_lambda_in_any_unit",
                f"{_ATTRACTION}::test_no_gains_meet_31_as_printed_with_the_vehicle_of_the_paper",
                f"{_ATTRACTION}::test_the_control_point_must_be_far_ahead",
            ),
            GAP,
        ),
        Erratum(
            "(38) rests on an approximation",
            "By (17), (19) and the definition below (21), r_1 + r_2 less its estimate is 2 dz/dt, "
            "of first order in |x|. In the derivative of (34) the factor of Tanh is r_1 + r_2, and "
            "its argument and (22) have the estimate; (37) has the estimate in all of them, (38) "
            "r_1 + r_2. What is left out, beside the 3 eps_t below (39), is up to "
            "2 (sqrt(3) rho_hat + rho) |dz/dt|, and 2 rho |dz/dt| where the estimate is zero and "
            "theta_hat = theta; no condition bounds rho. Remark 5 calls the approximation "
            "reasonable for large k_d and Lambda. Without noise it is: over the first 50 s of "
            "Fig. 4, 2 |dz/dt| is below 1 % of the estimate in the median and 27 % at most. With "
            "the 1 mm of noise that is ours it is 104 % in the median.",
            (
                f"{_LYAPUNOV}::test_remark_5_leaves_out_twice_the_rate_of_z",
                f"{_LYAPUNOV}::test_what_remark_5_leaves_out",
                f"{_ERRATA}::test_remark_5_in_figure_4",
            ),
            GAP,
        ),
        Erratum(
            "(44): the ball holds every position error",
            "c < mu_sigma and gamma >= 3 eps_t. At the best kappa, sqrt(gamma / c) is at least "
            f"{balls[0]:.1f} even if theta_0 = theta, and {balls[1]:.0f} with |theta - theta_0| = "
            f"lambda_M2 = {of_theta:.0f}, which is theta_4 by P2.1 where theta_0 = 0, in SI "
            f"units; at eps_t = 10, {balls[2]:.0f} and {balls[3]:.0f}. But both Tanh in x "
            "stay below sqrt(6) together: Omega_p holds every e and z, and that e is bounded does "
            "not follow. So far this is owed to the units in p, and (43) mends it: V falls where "
            "c_m |x|^2 > gamma. That bounds e if gamma is below c_m, and so below alpha_1. But "
            f"where (31) holds, alpha_1 is below {power:.3f} W for this vehicle, whatever the "
            f"gains and v0: eps_t must be below {power / 3.0:.2f} W, and the paper has 1 and 10.",
            (
                f"{_ATTRACTION}::test_ball_of_44_at_the_best_kappa",
                f"{_ATTRACTION}::test_ball_of_44_holds_every_error",
                f"{_ATTRACTION}::test_alpha_1_is_small_in_any_unit_where_31_holds",
                f"{_ATTRACTION}::test_alpha_1_at_most_is_attained",
            ),
            GAP,
        ),
        Erratum(
            "The region of attraction does not grow with the gains",
            "alpha_3 = lambda_d2 - k_1max - 0.5 k_2max / v0 - 0.5 (zeta_1 + zeta_2) has the gains "
            "only with a minus, and alpha_m is no more than v0^2 alpha_3. Nor does it help to ask "
            "for (26) on a ball |x| <= rho only: with dy_r = 0 and r_1 halfway between ahead and "
            "starboard, zeta_1 + zeta_2 rho >= k v0 rho / 2, and (42) asks for 2 zeta_1 + "
            "zeta_2 (1 + rho^2) < 2 lambda_d2. As 1 + rho^2 >= 2 rho, v0 rho < 2 lambda_d2 / k = "
            f"{speed:.2f} m/s with any gains and v0; as printed |x| < {found.x_of_any_gains:.2f}, "
            f"and {found.x_at_most:.2f} with the gains of section 4.1 if (30) held. So a start on "
            f"the reference with a velocity error of {speed:.2f} m/s is not covered, and the "
            "semi-global claim does not follow; and where the reference moves ahead at V, "
            f"zeta_1 >= k V leaves no ball at all above {speed / 2.0:.2f} m/s. The claim may be "
            "true: runs from 6.6, 31 and 100 m converge.",
            (
                f"{_ATTRACTION}::test_no_gain_makes_alpha_3_larger",
                f"{_ATTRACTION}::test_no_zetas_reach_further",
                f"{_ATTRACTION}::test_no_ball_is_left_for_a_reference_that_moves",
                f"{_ATTRACTION}::test_alphas_are_those_below_40",
                f"{_ZETAS}::test_chi_1_is_half_the_coupling_times_the_square_of_r_1",
            ),
            GAP,
        ),
        Erratum(
            "Remark 6 does not follow from (44)",
            "(i): larger Lambda, K_2 and k_d are to increase c. But c = min{c_m, mu_sigma (1 - 0.5 "
            "/ kappa^2)}, and the second has none of them; of the alphas in c_m, alpha_3 and "
            "alpha_4 fall with K_2. (ii): a smaller Sigma is to decrease gamma / c. Where the "
            "second is the smaller, gamma / c >= 3 eps_t / mu_sigma: 300, 3,000 and 30,000 at "
            "eps_t = 1 and sigma = 0.01, 0.001 and 0.0001. Where c_m is, (ii) follows, and "
            "(i) for k_d where alpha_4 is the least. In simulation (ii) holds: `auv-fmu sweep "
            "gains`.",
            (
                f"{_ATTRACTION}::test_ball_of_44_at_the_best_kappa",
                f"{_ATTRACTION}::test_alphas_are_those_below_40",
            ),
            GAP,
        ),
        Erratum(
            "(1) and (2): the roll is held and its rate left out",
            "(1) holds the roll at zero, for which the body must roll at p = -r tan(theta); (2) "
            "has p = 0. So a body on which no force acts, with m11 = m22 = m33, at 1 m/s with a "
            "pitch of 0.6 rad and a yaw rate of 0.6 rad/s, changes its velocity along z from -0.56 "
            "to 0.56 m/s within 5.2 s. Without pitch the two agree. The paper gives both for low "
            "speeds and a vehicle with roll actuators, takes what roll adds as a disturbance and "
            "simulates six degrees of freedom (reading 1).",
            (f"{_MODEL}::test_1_and_2_turn_a_body_on_which_nothing_acts",),
            TENSION,
        ),
        Erratum(
            "(11) is written for a vehicle that does not roll",
            "For (1) and (2) it is right: its columns are R e1, -ell R e3 and ell R e2 at zero "
            "roll. The vehicle that section 4.1 simulates rolls; beyond a quarter turn the last "
            "two columns of the printed J point backwards, and the loop feeds back with the wrong "
            "sign. With the full R it does not (reading 3).",
            (f"{_SCENARIOS}::test_jacobian_as_printed_saturates_where_the_full_attitude_does_not",),
            TENSION,
        ),
        Erratum(
            "Assumption 4: the helix is not bounded",
            "It asks for a bounded y_d; section 4.1's moves along z for good, from -2.0 m at "
            "first to -5.2 after 100 s and -35.1 after 1,000 s. That y and eta are bounded, with "
            "which the proof ends, hangs on it (and the yaw of a helix is not bounded either); the "
            "rest needs dy_d and ddy_d only.",
            (f"{_ERRATA}::test_the_helix_is_not_bounded",),
            TENSION,
        ),
        Erratum(
            "(18) and (23) name two signals almost alike",
            "dy_o of (18) is dy_hat - Lambda Tanh(z), the state with a hat of (23) is that less "
            "k_d z. The law (21) needs the first, as it is printed: only with it is "
            "d/dt (r_1 - r_2) = k_d r_2, as above (28) (reading 15).",
            (f"{_OBSERVER}::test_observer_is_the_one_of_the_proof",),
            TENSION,
        ),
        Erratum(
            "(30) and the limits (3) pull apart",
            "With equal entries in K_2, (30) is lambda > 2 m/s as printed. The commands grow "
            "steeply with lambda: at 2.1, from the start of Fig. 4 and without noise, the "
            "controller commands 651 N where 80 can be had (`auv-fmu run fig4 --set "
            "controller.lambda=2.1 --set plant.noise.std=0`; 556 N in steps of 2 ms), and 59 N at "
            "the paper's 1. So with the paper's other gains a lambda that meets (30) as printed "
            "saturates the actuators that the controller is made to spare. (With `--set "
            "controller.gamma=0.01` it does not: 46 N, and a larger error.) With speeds "
            "counted in a smaller v0 (30) is lambda > 2 v0, and the conflict is gone.",
            (
                f"{_CONDITIONS}::test_condition_30_can_be_met_by_a_larger_lambda",
                f"{_ERRATA}::test_30_costs_what_is_said",
            ),
            TENSION,
        ),
        Erratum(
            "4.1: exponential convergence, within a metre",
            "The tracking errors are said to converge exponentially. Where r_1 = z = 0, (17) is "
            "de/dt = -lambda tanh(e) in each direction, which has sinh(e), not e, fall "
            "exponentially: beyond a metre e falls at nearly the constant speed lambda, from "
            "6 to 1.1 m in 5 s at 1 m/s. Nearer it is exponential.",
            (f"{_SATURATION}::test_a_saturated_error_falls_at_constant_speed_first",),
            TENSION,
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
            TENSION,
        ),
        Erratum(
            "4.2: efforts that belong to the step of 20 ms",
            "The PD controller's L2 effort in tau_q, printed as 163, is 165 N·m·√s after 60 s at "
            "the printed step and 132 at half of it (`auv-fmu run fig5-pd --stop-time 60 --step "
            "0.01`); the one in tau_r, printed as 172, is 182 at the printed step and 172 at a "
            "quarter of it. The rest is Euler's scheme, and no property of the controller. The "
            "proposed controller's efforts change by 4 % at most.",
            (f"{_ERRATA}::test_pd_efforts_belong_to_the_step",),
            TENSION,
        ),
    )


def section() -> str:
    """The points in Markdown, a heading of the fourth level each."""
    introduction = _INTRODUCTION.format(readings="#readings")
    return "\n\n".join((introduction, *_points("###")))


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
    for kind, common in KINDS.items():
        yield f"{level} {kind}"
        yield common
        for erratum in errata():
            if erratum.kind == kind:
                yield f"{level}# {erratum.title}"
                yield erratum.text
                yield "Shown by " + ", ".join(f"`{test}`" for test in erratum.tests) + "."
