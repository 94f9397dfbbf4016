"""Printed numbers and claims of section 4 that a simulation can check.

A claim is a function of the runs in its decorator. The report makes the runs, and prints the
findings in the order of this file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from orchestrator.paper.page import actuator_values, numbers
from orchestrator.runs.request import Request
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.signals import STANDARD, Loop, applied, real_parameter

#: Control efforts of section 4.2, in the order u, q, r.
EFFORT_PROPOSED, EFFORT_PD = (130.0, 40.0, 53.0), (235.0, 163.0, 172.0)

#: e_f of section 4.2, in the order x, y, z [m].
FINAL_ERROR_PROPOSED, FINAL_ERROR_PD = (0.01, 0.02, 0.06), (0.004, 0.001, 0.001)

#: Turning radius of section 4.1 [m].
TURNING_RADIUS = 0.6

#: Runs of the figures, some with other parameters.
FIVE, FIVE_PD = Request("fig5"), Request("fig5-pd")
SIX, SIX_PD = Request("fig6"), Request("fig6-pd")
SEVEN = (Request("fig7a"), Request("fig7b"), Request("fig7c"))
QUIET = Request("fig4", {"plant.noise.std": 0.0})
SHARP = Request("fig5", {"controller.eps_t": 1.0})
TURNING = Request("fig3b", {"plant.tau.u": 80.0, "plant.tau.q": 0.0, "plant.tau.r": 80.0})

#: Noise of our Fig. 4 [m], and seeds of its draws.
_NOISE, _SEEDS = 0.001, range(1, 6)
_WITH_NOISE = f"with noise of {1e3 * _NOISE:g} mm"

#: Largest relative deviation of a number that agrees.
CLOSE = 0.1

#: Factor in the unit of the L2 norm of a signal.
_SQUARED = "·√s"


def noisy(request: Request) -> tuple[Request, ...]:
    """Return a run with noise, once for each seed."""
    noise = ({"plant.noise.std": _NOISE, "plant.noise.seed": seed} for seed in _SEEDS)
    return tuple(replace(request, parameters={**request.parameters, **draw}) for draw in noise)


@dataclass(frozen=True)
class KeptRun:
    """The part of a run that the report needs.

    Attributes:
        metrics: as in metrics.json; only `failure` for a run that could not be made.
        table: the visible rows, which are all rows of a run of the paper.
        loops: of its vehicles.
        label: the command that makes it, without `auv-fmu run`.

    """

    metrics: Mapping[str, Any]
    table: Table
    loops: Sequence[Loop] = (STANDARD,)
    label: str = ""

    @property
    def failure(self) -> str | None:
        """Reason why the run ended early, or was not made."""
        return self.metrics.get("failure")


class Finding(NamedTuple):
    """Our numbers for a claim, and whether they agree with the paper, in words."""

    ours: str
    verdict: str


@dataclass(frozen=True)
class Claim:
    """A number or statement of the paper.

    Attributes:
        title: place in the paper and subject.
        published: number or statement of the paper.
        runs: that it is compared with.
        judge: function of these runs.

    """

    title: str
    published: str
    runs: tuple[Request, ...]
    judge: Callable[..., Finding]

    def finding(self, kept_runs: Sequence[KeptRun]) -> Finding:
        """Compare the claim with its runs."""
        for kept_run in kept_runs:
            if kept_run.failure is not None:
                return Finding(f"a run ended early: {kept_run.failure}", "none")
        return self.judge(*kept_runs)


#: All claims, in the order of the paper.
CLAIMS: list[Claim] = []


def claim(
    title: str, published: str, *runs: Request
) -> Callable[[Callable[..., Finding]], Callable[..., Finding]]:
    """Register the judge of a claim; of several decorators, the lowest comes first."""

    def register(judge: Callable[..., Finding]) -> Callable[..., Finding]:
        CLAIMS.append(Claim(title, published, runs, judge))
        return judge

    return register


def _verdict(holds: object) -> str:
    return "agrees" if holds else "**differs**"


def _is_close(ours: Sequence[float], published: Sequence[float]) -> bool:
    return np.allclose(ours, published, rtol=CLOSE)


def _compared(ours: Sequence[float], published: Sequence[float]) -> str:
    return f"{_verdict(_is_close(ours, published))}, {ratio(ours, published)}"


def ratio(ours: Sequence[float], published: Sequence[float]) -> str:
    """Return our numbers divided by the published ones."""
    return f"ratio {numbers(np.divide(ours, published).tolist())}"


def sum_without_step(l2: Any, duration: Any, h: float) -> Any:
    """Return (59) coded as sqrt(sum of tau_k^2 / T_f), from the norm sqrt(sum of h tau_k^2)."""
    return l2 / np.sqrt(h * duration)


class Approach(NamedTuple):
    """The vehicle's approach to the reference.

    Attributes:
        duration: until |e| is at most :data:`.REACHED` [s].
        impulse: of the applied surge force in that time [N.s].

    """

    duration: float
    impulse: float

    @property
    def least_effort(self) -> float:
        """The least L2 norm of any force with this impulse in this time [N.s^0.5].

        (integral of tau)^2 <= T * integral of tau^2 by Cauchy and Schwarz.
        """
        return abs(self.impulse) / sqrt(self.duration)

    def contradicts_until(self, effort: float, h: float) -> float:
        """Return the T_f [s] below which :func:`sum_without_step` exceeds an effort."""
        return (self.least_effort / effort) ** 2 / h

    def soonest(self, effort: float) -> float:
        """Return the least time [s] in which a force with an L2 norm [N.s^0.5] has this impulse."""
        return (self.impulse / effort) ** 2


def errors(table: Table) -> np.ndarray:
    """Return e of all rows: :func:`.tracking_error`, much faster and equal up to rounding."""
    _, theta, psi = table.group(*STANDARD.attitude).T
    ahead = np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)
    y = table.group(*STANDARD.position) + real_parameter(table, STANDARD.ell) * np.column_stack(
        ahead
    )
    error: np.ndarray = y - table.group(*STANDARD.y_d)
    return error


def approach_of(table: Table) -> Approach | None:
    """Return the approach of a run; None if it never arrives, or starts at the reference."""
    near = np.linalg.norm(errors(table), axis=1) <= REACHED
    first = int(near.argmax())
    if not near[first] or not first:
        return None
    force = applied(table)[:first, 0]
    return Approach(float(table.time[first]), float(force @ np.diff(table.time[: first + 1])))


def turning_radius(table: Table) -> float:
    """Return the radius of the level circle of the centre of mass at the end of a run [m]."""
    u, v, r = (table[f"plant.nu.{k}"][-1] for k in "uvr")
    return float(np.hypot(u, v) / abs(r))


def total_variation_until(table: Table, stop_time: float) -> np.ndarray:
    """Return the sum of |difference| of each applied signal up to a time, in the order u, q, r."""
    signal = applied(table)[table.time[1:] <= stop_time]
    variation: np.ndarray = np.abs(np.diff(signal, axis=0)).sum(axis=0)
    return variation


def largest_error_after(table: Table, start: float) -> float:
    """Return the largest tracking error of any axis after a time [m]; 0 for a shorter run."""
    return float(np.abs(errors(table)[table.time > start]).max(initial=0.0))


def largest_estimate(table: Table) -> float:
    """Return the largest component of theta_hat in a run."""
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
        f"{_compared([radius], [TURNING_RADIUS])}: this is the radius that the printed equations "
        f"give (reading 11). The diameter rounds to {2 * radius:.1f} m",
    )


@claim("Fig. 4: the vehicle tracks the reference without saturation", "no saturation", QUIET)
def no_saturation(quiet: KeptRun) -> Finding:
    return Finding(
        f"peaks {actuator_values(quiet.metrics['peak_command'])} of 80",
        _verdict(not any(quiet.metrics["saturated_fraction"])),
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
        f"{_verdict(share == 0.0)}; in longer runs they do (reading 7)",
    )


@claim("Fig. 4: the tracking errors converge to a neighbourhood of the origin", "no numbers", QUIET)
def convergence(quiet: KeptRun) -> Finding:
    error = quiet.metrics["final_error"]
    return Finding(f"e_f {numbers(error)} m", _verdict(max(error) < 0.1))


@claim("Fig. 4: the estimated parameters are bounded", "no numbers", QUIET)
def bounded_estimates(quiet: KeptRun) -> Finding:
    """Check that no estimate is infinite: a finite run can show no more."""
    largest = largest_estimate(quiet.table)
    return Finding(
        f"largest {largest:.3g}, still growing at {quiet.table.time[-1]:g} s; (22) cannot exceed "
        "max(G |r|) / sigma",
        _verdict(np.isfinite(largest)),
    )


@claim(
    "4.2: control effort of the proposed controller (u, q, r); L2 norm, reading 6",
    actuator_values(EFFORT_PROPOSED),
    FIVE,
)
def effort_proposed(five: KeptRun) -> Finding:
    effort = five.metrics["l2_effort"]
    return Finding(actuator_values(effort, _SQUARED), _compared(effort, EFFORT_PROPOSED))


@claim(
    "4.2: control effort of the PD controller (u, q, r); L2 norm, reading 6",
    actuator_values(EFFORT_PD),
    FIVE_PD,
)
def effort_pd(pd: KeptRun) -> Finding:
    effort = pd.metrics["l2_effort"]
    return Finding(actuator_values(effort, _SQUARED), _compared(effort, EFFORT_PD))


@claim(
    "4.2: the same two rows by (59) as printed, with 1/T_f under the root",
    f"{actuator_values(EFFORT_PROPOSED)}, and {actuator_values(EFFORT_PD)}",
    FIVE,
    FIVE_PD,
)
def effort_as_printed(five: KeptRun, pd: KeptRun) -> Finding:
    proposed, baseline = five.metrics["rms_effort"], pd.metrics["rms_effort"]
    holds = _is_close(proposed, EFFORT_PROPOSED) and _is_close(baseline, EFFORT_PD)
    return Finding(
        f"{actuator_values(proposed)}, and {actuator_values(baseline)}",
        f"{_verdict(holds)}: an RMS of signals within 80 cannot exceed 80 (reading 6)",
    )


@claim(
    "4.2: the same two rows by (59) as a sum over steps without the step, L2 norm / sqrt(h T_f)",
    f"{actuator_values(EFFORT_PROPOSED)}, and {actuator_values(EFFORT_PD)}",
    FIVE,
    FIVE_PD,
)
def effort_as_a_sum(five: KeptRun, pd: KeptRun) -> Finding:
    """Compare with a sum that falls with T_f, which the paper does not give."""
    proposed, baseline = (
        sum_without_step(
            np.array(run.metrics["l2_effort"]), run.metrics["stop_time"], run.metrics["step"]
        ).tolist()
        for run in (five, pd)
    )
    holds = _is_close(proposed, EFFORT_PROPOSED) and _is_close(baseline, EFFORT_PD)
    return Finding(
        f"{actuator_values(proposed)}, and {actuator_values(baseline)}, at T_f = "
        f"{five.metrics['stop_time']:g} s",
        f"{_verdict(holds)}, {ratio(proposed, EFFORT_PROPOSED)}, and "
        f"{ratio(baseline, EFFORT_PD)} (reading 6)",
    )


@claim(
    "4.2: the surge efforts as L2 norms, against the impulse needed to reach the reference",
    f"{EFFORT_PROPOSED[0]:g}, and {EFFORT_PD[0]:g} N{_SQUARED}",
    FIVE,
    FIVE_PD,
)
def effort_of_the_way(five: KeptRun, pd: KeptRun) -> Finding:
    """Compare the printed L2 norms with the least ones of any force with the same impulse."""
    approaches = [approach for run in (five, pd) if (approach := approach_of(run.table))]
    published = EFFORT_PROPOSED[0], EFFORT_PD[0]
    if len(approaches) < len(published):
        return Finding(f"|e| does not come to {REACHED:g} m", "none")
    least = [approach.least_effort for approach in approaches]
    pairs = list(zip(approaches, published, strict=True))
    soonest = [approach.soonest(effort) for approach, effort in pairs]
    took = ", and ".join(
        f"{approach.impulse:.4g} N·s in {approach.duration:.3g} s" for approach in approaches
    )
    step = five.table.header.experiment.step
    free = [approach.contradicts_until(effort, step) for approach, effort in pairs]
    return Finding(
        f"{took}, until |e| is {REACHED:g} m: not below {numbers(least)} N{_SQUARED} "
        "(Cauchy-Schwarz inequality)",
        f"{_verdict(all(np.less_equal(least, published)))}: the printed L2 norms give these "
        f"impulses in {numbers(soonest)} s at the soonest. As sums without the step they "
        f"contradict nothing from T_f = {numbers(free)} s on",
    )


@claim("4.2: the same with eps_t = 1 instead of 10", f"{numbers(FINAL_ERROR_PROPOSED)} m", SHARP)
@claim("4.2: e_f of the proposed controller (x, y, z)", f"{numbers(FINAL_ERROR_PROPOSED)} m", FIVE)
def final_error_proposed(run: KeptRun) -> Finding:
    error = run.metrics["final_error"]
    return Finding(f"{numbers(error)} m", _compared(error, FINAL_ERROR_PROPOSED))


@claim("4.2: e_f of the PD controller (x, y, z)", f"{numbers(FINAL_ERROR_PD)} m", FIVE_PD)
def final_error_pd(pd: KeptRun) -> Finding:
    error = pd.metrics["final_error"]
    return Finding(f"{numbers(error)} m", _compared(error, FINAL_ERROR_PD))


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
        _verdict(not any(any(run["saturated_fraction"]) for run in runs)),
    )


@claim("Fig. 5: the PD controller saturates", "saturation", FIVE_PD)
def pd_saturates(pd: KeptRun) -> Finding:
    shares = [100 * share for share in pd.metrics["saturated_fraction"]]
    return Finding(
        f"{numbers(shares)} % of the steps, peaks {actuator_values(pd.metrics['peak_command'])}",
        _verdict(all(shares)),
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
    finding = _rougher(baseline, proposed)
    return finding._replace(ours=f"{finding.ours}, medians of {len(_SEEDS)} draws")


def _rougher(rough: Sequence[float], smooth: Sequence[float]) -> Finding:
    return Finding(
        f"total variation {actuator_values(rough)} against {actuator_values(smooth)}",
        f"{_verdict(np.greater(rough, smooth).all())}, {ratio(rough, smooth)}",
    )


@claim(
    "Fig. 5: the PD controller is more accurate at the end (e_f, x, y, z)",
    f"{numbers(np.divide(FINAL_ERROR_PROPOSED, FINAL_ERROR_PD).tolist())} times",
    FIVE,
    FIVE_PD,
)
def pd_is_accurate(five: KeptRun, pd: KeptRun) -> Finding:
    times = np.divide(five.metrics["final_error"], pd.metrics["final_error"])
    return Finding(f"{numbers(times.tolist())} times", _verdict((times > 1.0).all()))


@claim("Fig. 6: from 100 m the PD controller chatters severely", "severe chattering", SIX, SIX_PD)
def pd_chatters_severely(six: KeptRun, pd: KeptRun) -> Finding:
    proposed, baseline = (total_variation_until(run.table, 60.0).tolist() for run in (six, pd))
    finding = _rougher(baseline, proposed)
    return finding._replace(ours=f"{finding.ours} in the first 60 s")


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
        _verdict(np.greater(rough, smooth).all() and exact < inexact),
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
        _verdict((grown >= 0.0).all()),
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
        _verdict(True)
        if saturates
        else "**not seen** in Fig. 7: at the largest disturbance it shows, without noise, every "
        "command stays within the limits",
    )


@claim("Fig. 7: the performance degrades gradually", "errors grow from (a) to (c)", *SEVEN)
def gradual_degradation(*sevens: KeptRun) -> Finding:
    errors = [max(run.metrics["final_error"]) for run in sevens]
    return Finding(f"largest e_f {numbers(errors)} m", _verdict((np.diff(errors) > 0).all()))


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
        _verdict(errors == sorted(errors)),
    )


@claim("Theorem 1: the gains of section 4.1 meet (30) to (32)", "not stated")
def gains_meet_the_conditions() -> Finding:
    result = theorem(Vehicle(), ELL, Gains(), MAXIMUM_SLOPE[Saturation.TANH])
    verdicts = [condition.verdict for condition in result.conditions]
    first, second, _ = result.conditions
    return Finding(
        f"{', '.join(verdicts)}: (30) {first.left:g}, needed above {first.right:g}; (31) "
        f"{second.left:g}, needed above {second.right + second.least:.4g}",
        f"{_verdict('violated' not in verdicts)} (reading 10); `auv-fmu gains`",
    )


@claim(
    "Theorem 1: the region of attraction grows with the gains to include any initial condition",
    "arbitrarily large",
)
def region_is_arbitrarily_large() -> Finding:
    result = theorem(Vehicle(), ELL, Gains(), MAXIMUM_SLOPE[Saturation.TANH])
    least, lambda_d2 = result.zeta_of_any_gains, result.bounds.lambda_d2
    return Finding(
        f"as printed, (31) asks with any gains for more than {least:.4g} of lambda_d2, which is "
        f"{lambda_d2:g}; (42) holds for |x| < {result.x_of_any_gains:.2g} at most",
        f"{_verdict(least < lambda_d2)}: no gain enters alpha_3 with a positive sign "
        "([the proof](#the-region-of-attraction-does-not-grow-with-the-gains))",
    )
