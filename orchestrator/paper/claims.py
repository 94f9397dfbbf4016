"""Every printed number and claim of section 4 that a simulation can check, and its measures.

A claim is a function of the runs that are named beside it. The report makes these runs, calls every
claim, and prints the findings in the order of this file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.paper.control_point import ELL
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.saturation import MAXIMUM_SLOPE, Saturation
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.attraction import theorem
from orchestrator.cosim import Table
from orchestrator.paper.kept_runs import KeptRun
from orchestrator.paper.page import actuator_values, numbers
from orchestrator.runs.request import Request
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.signals import STANDARD, applied, real_parameter

#: Control efforts of section 4.2, in the order u, q, r.
EFFORT_PROPOSED, EFFORT_PD = (130.0, 40.0, 53.0), (235.0, 163.0, 172.0)

#: e_f of section 4.2, in the order x, y, z [m].
FINAL_ERROR_PROPOSED, FINAL_ERROR_PD = (0.01, 0.02, 0.06), (0.004, 0.001, 0.001)

#: Turning radius of section 4.1 [m].
TURNING_RADIUS = 0.6

#: The runs of the figures, and what the claims change in them.
FIVE, FIVE_PD = Request("fig5"), Request("fig5-pd")
SIX, SIX_PD = Request("fig6"), Request("fig6-pd")
SEVEN = (Request("fig7a"), Request("fig7b"), Request("fig7c"))
QUIET = Request("fig4", {"plant.noise.std": 0.0})
SHARP = Request("fig5", {"controller.eps_t": 1.0})
TURNING = Request("fig3b", {"plant.tau.u": 80.0, "plant.tau.q": 0.0, "plant.tau.r": 80.0})

#: The noise of our Fig. 4 [m], and the seeds of its draws.
_NOISE, _SEEDS = 0.001, range(1, 6)
_WITH_NOISE = f"with noise of {1e3 * _NOISE:g} mm"

#: A signal that is squared and integrated.
_SQUARED = "·√s"


def noisy(request: Request) -> tuple[Request, ...]:
    """A run with noise, once for each seed."""
    noise = ({"plant.noise.std": _NOISE, "plant.noise.seed": seed} for seed in _SEEDS)
    return tuple(replace(request, parameters={**request.parameters, **one}) for one in noise)


class Finding(NamedTuple):
    """The answer of our runs to a claim.

    Attributes:
        ours: their numbers.
        verdict: agreement with the paper, in words.

    """

    ours: str
    verdict: str


@dataclass(frozen=True)
class Claim:
    """A number or statement of the paper.

    Attributes:
        title: its place in the paper and its subject.
        published: the number or statement in the paper.
        runs: the runs that judge it.
        judge: a function of these runs.

    """

    title: str
    published: str
    runs: tuple[Request, ...]
    judge: Callable[..., Finding]

    def finding(self, kept_runs: Sequence[KeptRun]) -> Finding:
        """Judge the claim by its runs."""
        for kept_run in kept_runs:
            if kept_run.failure is not None:
                return Finding(f"a run ended early: {kept_run.failure}", "none")
        return self.judge(*kept_runs)


#: All claims, in the order of the paper.
CLAIMS: list[Claim] = []


def claim(
    title: str, published: str, *runs: Request
) -> Callable[[Callable[..., Finding]], Callable[..., Finding]]:
    """Register the judge of a claim; of several above a function, the lowest comes first."""

    def register(judge: Callable[..., Finding]) -> Callable[..., Finding]:
        CLAIMS.append(Claim(title, published, runs, judge))
        return judge

    return register


def said(holds: object) -> str:
    """The verdict for a claim that holds, or does not."""
    return "agrees" if holds else "**differs**"


def ratio(ours: Sequence[float], published: Sequence[float]) -> str:
    """Our numbers in parts of the published ones."""
    return f"ratio {numbers(np.divide(ours, published).tolist())}"


def sum_without_step(l2: Any, duration: Any, h: float) -> Any:
    """(59) coded as sqrt(sum of tau_k^2 / T_f), from the L2 norm sqrt(sum of h tau_k^2)."""
    return l2 / np.sqrt(h * duration)


class Approach(NamedTuple):
    """The vehicle's way to the reference.

    Attributes:
        duration: until |e| is at most :data:`REACHED` [s].
        impulse: of the surge force, as applied in that time [N.s].

    """

    duration: float
    impulse: float

    @property
    def least_effort(self) -> float:
        """The least L2 norm that a force with this impulse can have in this time [N.s^0.5].

        (integral of tau)^2 <= T * integral of tau^2 by Cauchy and Schwarz, whatever its course.
        """
        return abs(self.impulse) / sqrt(self.duration)

    def contradicts_until(self, effort: float, h: float) -> float:
        """The T_f before which :func:`sum_without_step` cannot be as small as an effort [s]."""
        return (self.least_effort / effort) ** 2 / h

    def soonest(self, effort: float) -> float:
        """The least time in which a force of an L2 norm [N.s^0.5] can have this impulse [s]."""
        return (self.impulse / effort) ** 2


def errors(table: Table) -> np.ndarray:
    """e of all rows at once, far sooner than :func:`.tracking_error` and equal up to rounding."""
    _, theta, psi = table.group(*STANDARD.attitude).T
    ahead = np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)
    y = table.group(*STANDARD.position) + real_parameter(table, STANDARD.ell) * np.column_stack(
        ahead
    )
    error: np.ndarray = y - table.group(*STANDARD.y_d)
    return error


def approach_of(table: Table) -> Approach | None:
    """The way of a run to its reference; None if it does not come there, or is there already."""
    near = np.linalg.norm(errors(table), axis=1) <= REACHED
    first = int(near.argmax())
    if not near[first] or not first:
        return None
    force = applied(table)[:first, 0]
    return Approach(float(table.time[first]), float(force @ np.diff(table.time[: first + 1])))


def turning_radius(table: Table) -> float:
    """Radius of the level circle that the centre of mass ends on [m]."""
    u, v, r = (table[f"plant.nu.{k}"][-1] for k in "uvr")
    return float(np.hypot(u, v) / abs(r))


def total_variation_until(table: Table, stop_time: float) -> np.ndarray:
    """Sum of |difference| of each applied signal up to a time, in the order u, q, r."""
    signal = applied(table)[table.time[1:] <= stop_time]
    variation: np.ndarray = np.abs(np.diff(signal, axis=0)).sum(axis=0)
    return variation


def largest_error_after(table: Table, start: float) -> float:
    """Largest tracking error of any axis after a time [m]; zero for a shorter run."""
    return float(np.abs(errors(table)[table.time > start]).max(initial=0.0))


def largest_estimate(table: Table) -> float:
    """Largest component of theta_hat in a run."""
    return float(table.step_values(*STANDARD.theta_hat).max())


@claim(
    "4.1: minimum turning radius under the largest surge force and yaw moment",
    f"{TURNING_RADIUS:g} m",
    TURNING,
)
def turning(run: KeptRun) -> Finding:
    radius = turning_radius(run.table)
    return Finding(
        f"{radius:.2f} m; its diameter {2 * radius:.3f} m",
        f"{said(abs(radius / TURNING_RADIUS - 1.0) < 0.1)}, ratio {radius / TURNING_RADIUS:.2f}: "
        f"this is the radius that the printed equations give (reading 11). The diameter rounds to "
        f"{2 * radius:.1f} m",
    )


@claim("Fig. 4: the vehicle tracks the reference without saturation", "no saturation", QUIET)
def no_saturation(quiet: KeptRun) -> Finding:
    return Finding(
        f"peaks {actuator_values(quiet.metrics['peak_command'])} of 80",
        said(not any(quiet.metrics["saturated_fraction"])),
    )


@claim(f"Fig. 5: the same with eps_t = 1, {_WITH_NOISE}", "no saturation", *noisy(SHARP))
@claim(
    f"Figs. 4 and 5: the proposed controller does not saturate, {_WITH_NOISE} (eps_t = 1, and 10)",
    "no saturation",
    *noisy(QUIET),
    *noisy(FIVE),
)
def no_saturation_with_noise(*runs: KeptRun) -> Finding:
    each = [runs[i : i + len(_SEEDS)] for i in range(0, len(runs), len(_SEEDS))]
    peaks = ", and ".join(
        actuator_values(np.max([run.metrics["peak_command"] for run in draws], axis=0).tolist())
        for draws in each
    )
    share = 100.0 * max(max(run.metrics["saturated_fraction"]) for run in runs)
    return Finding(
        f"largest peaks of {len(_SEEDS)} draws {peaks}; at most {share:.2g} % of the steps of a "
        "draw saturate",
        f"{said(share == 0.0)}; in longer runs they do (reading 7)",
    )


@claim("Fig. 4: the tracking errors converge to a neighbourhood of the origin", "no numbers", QUIET)
def convergence(quiet: KeptRun) -> Finding:
    error = quiet.metrics["final_error"]
    return Finding(f"e_f {numbers(error)} m", said(max(error) < 0.1))


@claim("Fig. 4: the estimated parameters are bounded", "no numbers", QUIET)
def bounded_estimates(quiet: KeptRun) -> Finding:
    """A run of finite length can only fail to contradict this."""
    largest = largest_estimate(quiet.table)
    return Finding(
        f"largest {largest:.3g}, still growing at {quiet.table.time[-1]:g} s; (22) cannot exceed "
        "max(G |r|) / sigma",
        said(np.isfinite(largest)),
    )


@claim(
    "4.2: control effort of the proposed controller (u, q, r); L2 norm, reading 6",
    actuator_values(EFFORT_PROPOSED),
    FIVE,
)
def effort_proposed(five: KeptRun) -> Finding:
    effort = five.metrics["l2_effort"]
    return Finding(actuator_values(effort, _SQUARED), ratio(effort, EFFORT_PROPOSED))


@claim(
    "4.2: control effort of the PD controller (u, q, r); L2 norm, reading 6",
    actuator_values(EFFORT_PD),
    FIVE_PD,
)
def effort_pd(pd: KeptRun) -> Finding:
    effort = pd.metrics["l2_effort"]
    return Finding(actuator_values(effort, _SQUARED), ratio(effort, EFFORT_PD))


@claim(
    "4.2: the same two rows by (59) as printed, with 1/T_f under the root",
    f"{actuator_values(EFFORT_PROPOSED)}, and {actuator_values(EFFORT_PD)}",
    FIVE,
    FIVE_PD,
)
def effort_as_printed(five: KeptRun, pd: KeptRun) -> Finding:
    proposed, baseline = five.metrics["rms_effort"], pd.metrics["rms_effort"]
    holds = np.allclose(proposed, EFFORT_PROPOSED, rtol=0.5)
    return Finding(
        f"{actuator_values(proposed)}, and {actuator_values(baseline)}",
        f"{said(holds)}: an RMS of signals within 80 cannot exceed 80 (reading 6)",
    )


@claim(
    "4.2: the same two rows by (59) as a sum over steps without the step, L2 norm / sqrt(h T_f)",
    f"{actuator_values(EFFORT_PROPOSED)}, and {actuator_values(EFFORT_PD)}",
    FIVE,
    FIVE_PD,
)
def effort_as_a_sum(five: KeptRun, pd: KeptRun) -> Finding:
    """It falls with T_f, which is not given."""
    proposed, baseline = (
        sum_without_step(
            np.array(run.metrics["l2_effort"]), run.metrics["stop_time"], run.metrics["step"]
        ).tolist()
        for run in (five, pd)
    )
    return Finding(
        f"{actuator_values(proposed)}, and {actuator_values(baseline)}, at T_f = "
        f"{five.metrics['stop_time']:g} s",
        f"{ratio(proposed, EFFORT_PROPOSED)}, and {ratio(baseline, EFFORT_PD)} (reading 6)",
    )


@claim(
    "4.2: the surge efforts as L2 norms, against the impulse needed to reach the reference",
    f"{EFFORT_PROPOSED[0]:g}, and {EFFORT_PD[0]:g} N{_SQUARED}",
    FIVE,
    FIVE_PD,
)
def effort_of_the_way(five: KeptRun, pd: KeptRun) -> Finding:
    """No course of the force gives that impulse in that time with the printed L2 norm."""
    approaches = [found for run in (five, pd) if (found := approach_of(run.table))]
    published = EFFORT_PROPOSED[0], EFFORT_PD[0]
    if len(approaches) < len(published):
        return Finding(f"|e| does not come to {REACHED:g} m", "none")
    least = [found.least_effort for found in approaches]
    pairs = list(zip(approaches, published, strict=True))
    soonest = [found.soonest(effort) for found, effort in pairs]
    took = ", and ".join(
        f"{found.impulse:.4g} N·s in {found.duration:.3g} s" for found in approaches
    )
    step = five.table.header.experiment.step
    free = [found.contradicts_until(effort, step) for found, effort in pairs]
    return Finding(
        f"{took}, until |e| is {REACHED:g} m: not below {numbers(least)} N{_SQUARED} "
        "(Cauchy-Schwarz inequality)",
        f"{said(all(np.less_equal(least, published)))}: the printed L2 norms give these impulses "
        f"in {numbers(soonest)} s at the soonest. As sums without the step they contradict nothing "
        f"from T_f = {numbers(free)} s on",
    )


@claim("4.2: the same with eps_t = 1 instead of 10", f"{numbers(FINAL_ERROR_PROPOSED)} m", SHARP)
@claim("4.2: e_f of the proposed controller (x, y, z)", f"{numbers(FINAL_ERROR_PROPOSED)} m", FIVE)
def final_error_proposed(run: KeptRun) -> Finding:
    error = run.metrics["final_error"]
    return Finding(f"{numbers(error)} m", ratio(error, FINAL_ERROR_PROPOSED))


@claim("4.2: e_f of the PD controller (x, y, z)", f"{numbers(FINAL_ERROR_PD)} m", FIVE_PD)
def final_error_pd(pd: KeptRun) -> Finding:
    error = pd.metrics["final_error"]
    return Finding(f"{numbers(error)} m", ratio(error, FINAL_ERROR_PD))


@claim(
    "Fig. 5: the proposed controller does not saturate (eps_t = 10, and 1)",
    "no saturation",
    FIVE,
    SHARP,
)
def proposed_does_not_saturate(five: KeptRun, sharp: KeptRun) -> Finding:
    runs = (five.metrics, sharp.metrics)
    return Finding(
        "peaks " + ", and ".join(actuator_values(run["peak_command"]) for run in runs),
        said(not any(any(run["saturated_fraction"]) for run in runs)),
    )


@claim("Fig. 5: the PD controller saturates", "saturation", FIVE_PD)
def pd_saturates(pd: KeptRun) -> Finding:
    shares = [100 * share for share in pd.metrics["saturated_fraction"]]
    return Finding(
        f"{numbers(shares)} % of the steps, peaks {actuator_values(pd.metrics['peak_command'])}",
        said(all(shares)),
    )


@claim(
    "Fig. 5: the PD controller chatters where the proposed one is smooth",
    "chattering",
    FIVE,
    FIVE_PD,
)
def pd_chatters(five: KeptRun, pd: KeptRun) -> Finding:
    return _rougher(pd.metrics["total_variation"], five.metrics["total_variation"])


@claim(
    f"Fig. 5: the same {_WITH_NOISE}; the PD controller measures the velocity without noise",
    "chattering",
    *noisy(FIVE),
    *noisy(FIVE_PD),
)
def pd_chatters_with_noise(*runs: KeptRun) -> Finding:
    variations = np.array([run.metrics["total_variation"] for run in runs])
    proposed, baseline = np.median(variations.reshape(2, len(_SEEDS), -1), axis=1).tolist()
    found = _rougher(baseline, proposed)
    return found._replace(ours=f"{found.ours}, medians of {len(_SEEDS)} draws")


def _rougher(rough: Sequence[float], smooth: Sequence[float]) -> Finding:
    return Finding(
        f"total variation {actuator_values(rough)} against {actuator_values(smooth)}",
        f"{said(np.greater(rough, smooth).all())}, {ratio(rough, smooth)}",
    )


@claim(
    "Fig. 5: the PD controller is more accurate at the end (e_f, x, y, z)",
    f"{numbers(np.divide(FINAL_ERROR_PROPOSED, FINAL_ERROR_PD).tolist())} times",
    FIVE,
    FIVE_PD,
)
def pd_is_accurate(five: KeptRun, pd: KeptRun) -> Finding:
    times = np.divide(five.metrics["final_error"], pd.metrics["final_error"])
    return Finding(f"{numbers(times.tolist())} times", said((times > 1.0).all()))


@claim("Fig. 6: from 100 m the PD controller chatters severely", "severe chattering", SIX, SIX_PD)
def pd_chatters_severely(six: KeptRun, pd: KeptRun) -> Finding:
    proposed, baseline = (total_variation_until(run.table, 60.0).tolist() for run in (six, pd))
    found = _rougher(baseline, proposed)
    return found._replace(ours=f"{found.ours} in the first 60 s")


@claim(
    "4.3, Remark 6: a larger eps_t makes the control smoother and less accurate",
    "eps_t from 1 to 10",
    SHARP,
    FIVE,
)
def smoother_and_less_accurate(sharp: KeptRun, five: KeptRun) -> Finding:
    runs = (sharp.metrics, five.metrics)
    rough, smooth = (run["total_variation"] for run in runs)
    exact, inexact = (max(run["final_error"]) for run in runs)
    return Finding(
        f"total variation from {actuator_values(rough)} to {actuator_values(smooth)}, largest e_f "
        f"from {exact:.3g} to {inexact:.3g} m",
        said(np.greater(rough, smooth).all() and exact < inexact),
    )


@claim(
    "Fig. 7: larger disturbances need more effort",
    "a larger adaptive gain and more chattering",
    *SEVEN,
)
def more_effort(*sevens: KeptRun) -> Finding:
    efforts, variations = (
        [run.metrics[index] for run in sevens] for index in ("l2_effort", "total_variation")
    )
    estimates = [largest_estimate(run.table) for run in sevens]
    grown = np.diff(np.column_stack([efforts, estimates, variations]), axis=0)
    return Finding(
        f"L2 effort {', then '.join(actuator_values(effort, _SQUARED) for effort in efforts)}; "
        f"largest estimate {numbers(estimates)}; total variation "
        f"{', then '.join(map(actuator_values, variations))}",
        said((grown >= 0.0).all()),
    )


@claim(
    "4.3: under very large disturbances the chattering exceeds what the actuators tolerate",
    "not tolerable and feasible",
    SEVEN[-1],
)
def intolerable_chattering(largest: KeptRun) -> Finding:
    saturates = any(largest.metrics["saturated_fraction"])
    return Finding(
        f"peaks of (c) {actuator_values(largest.metrics['peak_command'])} of 80",
        said(True)
        if saturates
        else "**not seen** in Fig. 7: at the largest disturbance it shows, without noise, every "
        "command stays within the limits",
    )


@claim("Fig. 7: the performance degrades gradually", "errors grow from (a) to (c)", *SEVEN)
def gradual_degradation(*sevens: KeptRun) -> Finding:
    errors = [max(run.metrics["final_error"]) for run in sevens]
    return Finding(f"largest e_f {numbers(errors)} m", said((np.diff(errors) > 0).all()))


@claim(
    "Fig. 7: the same, by the largest error of any axis after the first 40 s",
    "errors grow from (a) to (c)",
    *SEVEN,
)
def gradual_degradation_on_the_way(*sevens: KeptRun) -> Finding:
    errors = [largest_error_after(run.table, 40.0) for run in sevens]
    return Finding(
        f"{numbers(errors)} m, when the waves turn at 72 s; 0.2 m holds for e_f, and in (a) "
        "throughout",
        said(errors == sorted(errors)),
    )


@claim("Theorem 1: the gains of section 4.1 meet (30) to (32)", "not stated")
def gains_meet_the_conditions() -> Finding:
    found = theorem(Vehicle(), ELL, Gains(), MAXIMUM_SLOPE[Saturation.TANH])
    verdicts = [condition.verdict for condition in found.conditions]
    first, second, _ = found.conditions
    return Finding(
        f"{', '.join(verdicts)}: (30) {first.left:g}, needed above {first.right:g}; (31) "
        f"{second.left:g}, needed above {second.right + second.least:.4g}",
        f"{said('violated' not in verdicts)} (reading 10); `auv-fmu gains`",
    )


@claim(
    "Theorem 1: the region of attraction grows with the gains to include any initial condition",
    "arbitrarily large",
)
def region_is_arbitrarily_large() -> Finding:
    found = theorem(Vehicle(), ELL, Gains(), MAXIMUM_SLOPE[Saturation.TANH])
    least, there = found.zeta_of_any_gains, found.bounds.lambda_d2
    return Finding(
        f"as printed, (31) asks with any gains for more than {least:.4g} of lambda_d2, which is "
        f"{there:g}; (42) holds for |x| < {found.x_of_any_gains:.2g} at most",
        f"{said(least < there)}: no gain enters alpha_3 with a positive sign "
        "([the proof](#the-region-of-attraction-does-not-grow-with-the-gains))",
    )
