"""Effects that the paper does not show, each a function of the runs in its decorator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike

from auv_fmu.paper.euler import STEP
from auv_fmu.paper.output_feedback import Gains
from orchestrator.figures.drawing import name_runs, one_figure, save, styled
from orchestrator.figures.run_figures import draw_commands
from orchestrator.figures.style import COLOURS, FIGURE_WIDTH, STYLES, Drawn
from orchestrator.paper.claims import (
    EFFORT_PD,
    EFFORT_PROPOSED,
    FIVE,
    FIVE_PD,
    QUIET,
    SEVEN,
    KeptRun,
)
from orchestrator.paper.page import actuator_values, escape_markdown, numbers, picture
from orchestrator.runs.request import Request
from orchestrator.vehicle.proof import CERTIFICATE_COLUMNS, certificates
from orchestrator.vehicle.signals import ACTUATORS, AXES, limits

#: Levels of measurement noise [m].
NOISE_LEVELS = (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2)

#: Steps [s]; section 4.1 has the first.
STEPS = (STEP, 0.01, 0.005, 0.002)

#: Values of lambda [m/s]; section 4.1 has the second.
LAMBDAS = (0.5, 1.0, 1.5, 2.1, 3.0, 4.0)

#: Names of the actuators' signals in figures.
_SIGNALS = tuple(rf"$\tau_{k}$" for k in ACTUATORS)

_PRINTED = replace(FIVE, parameters={"controller.printed_jacobian": True})
_JACOBI, _JACOBI_PD = (replace(request, order="jacobi") for request in (FIVE, FIVE_PD))
_NOISY = tuple(Request("fig4", {"plant.noise.std": level}) for level in NOISE_LEVELS)
_QUICK = tuple(
    QUIET
    if value == Gains().lambda_
    else replace(QUIET, parameters={**QUIET.parameters, "controller.lambda": value})
    for value in LAMBDAS
)
_STEPPED = (
    *(
        request if step == STEP else replace(request, step=step)
        for request in (FIVE, FIVE_PD)
        for step in STEPS
    ),
    replace(FIVE_PD, parameters={**FIVE_PD.parameters, "plant.integrator": "rk4"}),
)
_ALGEBRAIC = replace(QUIET, parameters={**QUIET.parameters, "controller.saturation": "algebraic"})


#: Text and figure of an effect.
Shown = tuple[str, Figure]


@dataclass(frozen=True)
class Effect:
    """An effect that a comparison of runs shows.

    Attributes:
        name: of the figure's file.
        title: of the section.
        runs: to compare.
        show: returns text and figure.

    """

    name: str
    title: str
    runs: tuple[Request, ...]
    show: Callable[..., Shown]


#: All effects, in the order of the report.
EFFECTS: list[Effect] = []


def effect(
    name: str, title: str, *runs: Request
) -> Callable[[Callable[..., Shown]], Callable[..., Shown]]:
    """Register a function of kept runs as an effect."""

    def register(show: Callable[..., Shown]) -> Callable[..., Shown]:
        EFFECTS.append(Effect(name, title, runs, show))
        return show

    return register


def show_effect(name: str, kept_runs: Sequence[KeptRun], folder: Path) -> str:
    """Write `NAME.png` of an effect into a folder and return its text; a task for a worker."""
    for kept_run in kept_runs:
        if kept_run.failure is not None:
            return f"A run ended early: {escape_markdown(kept_run.failure)}"
    [shown] = [effect for effect in EFFECTS if effect.name == name]
    with styled():
        text, figure = shown.show(*kept_runs)
        save(figure, folder / f"{name}.png")
    return f"{text}\n\n{picture(shown.title, f'{folder.name}/{name}.png')}"


def _draw_lines(
    axes: Axes, x: ArrayLike, rows: ArrayLike, names: Sequence[str] = _SIGNALS, marker: str = "o"
) -> None:
    """Draw a line for each column of rows of three numbers."""
    columns = zip(names, np.transpose(rows), COLOURS, STYLES, strict=False)
    for name, column, colour, style in columns:
        axes.plot(x, column, label=name, color=colour, linestyle=style, marker=marker)


def _draw_limit(axes: Axes, run: KeptRun) -> None:
    axes.axhline(limits(run.table)[1][0], color="black", linewidth=1, label="limit of (3)")


@effect("effect-disturbance", "Fig. 7 in one figure", *SEVEN)
def disturbance(*sevens: KeptRun) -> Shown:
    labels = ("(a)", "(b)", "(c)")
    runs = [Drawn(label, run.table) for label, run in zip(labels, sevens, strict=True)]
    errors = [max(run.metrics["final_error"]) for run in sevens]
    peaks = [max(run.metrics["peak_command"]) for run in sevens]
    return (
        "Errors and commands of (a), (b) and (c) in the same scale. The largest e_f grows as "
        f"{numbers(errors)} m; the largest command is {numbers(peaks)} N, soon after the start.",
        one_figure("overlay", "", runs),
    )


@effect("effect-jacobian", "(11) as printed against the full attitude", FIVE, _PRINTED)
def jacobian(full: KeptRun, printed: KeptRun) -> Shown:
    saturated, rest = (100 * max(run.metrics["saturated_fraction"]) for run in (printed, full))
    return (
        f"With (11) as printed, {saturated:.3g} % of the steps of Fig. 5 saturate and e_f is "
        f"{numbers(printed.metrics['final_error'])} m; with the full attitude {rest:.3g} % and "
        f"{numbers(full.metrics['final_error'])} m (reading 3). The vehicle tumbles on its way "
        "with (11) as printed; the large errors on the way drive theta_hat up, and with it the "
        "accuracy at the end, as a smaller eps_t would.",
        one_figure(
            "overlay",
            "",
            [Drawn("full attitude", full.table), Drawn("(11) as printed", printed.table)],
        ),
    )


@effect("effect-order", "Jacobi against Gauss-Seidel", FIVE, _JACOBI, FIVE_PD, _JACOBI_PD)
def order(full: KeptRun, jacobi: KeptRun, pd: KeptRun, jacobi_pd: KeptRun) -> Shown:
    variation = [
        actuator_values(run.metrics["total_variation"]) for run in (full, jacobi, pd, jacobi_pd)
    ]
    figure = Figure(figsize=(FIGURE_WIDTH, 4.5))
    panels = figure.subplots(3, 2, sharex=True, width_ratios=(1, 2))
    for column, (title, runs) in enumerate(
        (
            ("proposed controller, Fig. 5", (full, jacobi)),
            ("PD controller, Fig. 5", (pd, jacobi_pd)),
        )
    ):
        labels = ("Gauss-Seidel", "Jacobi")
        drawn = [Drawn(label, run.table) for label, run in zip(labels, runs, strict=True)]
        draw_commands(panels[:, column], drawn, title)
    name_runs(figure, drawn)
    return (
        "A Jacobi master adds a delay of 20 ms to the loop (reading 5). Total variation of the "
        f"signals of Fig. 5: proposed {variation[0]} in Gauss-Seidel order and {variation[1]} in "
        f"Jacobi order; PD {variation[2]} and {variation[3]}.",
        figure,
    )


@effect("effect-step", "The step of 20 ms", *_STEPPED)
def step(*runs: KeptRun) -> Shown:
    *stepped, exact = (run.metrics["l2_effort"] for run in runs)
    proposed, pd = np.reshape(stepped, (2, len(STEPS), len(ACTUATORS)))
    figure = Figure(figsize=(FIGURE_WIDTH, 3.2))
    for axes, title, ours, published in zip(
        figure.subplots(1, 2),
        ("proposed controller, Fig. 5", "PD controller, Fig. 5"),
        (proposed, pd),
        (EFFORT_PROPOSED, EFFORT_PD),
        strict=True,
    ):
        _draw_lines(axes, STEPS, ours)
        for value, colour in zip(published, COLOURS, strict=False):
            axes.axhline(value, color=colour, linestyle=":", linewidth=1)
        axes.set_title(title)
        axes.set(xlabel="step [ms]", ylabel="L2 effort [N·√s, N·m·√s]", xscale="log")
        axes.set_xticks(STEPS, [f"{1e3 * step:g}" for step in STEPS], minor=False)
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_ylim(bottom=0.0)
        axes.legend()
    spread = 100.0 * float(np.abs(proposed / proposed[0] - 1.0).max())
    steps = numbers([1e3 * step for step in STEPS])
    return (
        f"Steps of {steps} ms; dotted lines are the printed values. The PD controller's L2 effort "
        f"in tau_q is {numbers(pd[:, 1].tolist())} N·m·√s, in tau_u "
        f"{numbers(pd[:, 0].tolist())} N·√s and in tau_r {numbers(pd[:, 2].tolist())} N·m·√s. That "
        f"its tau_q of 20 ms is near the printed {EFFORT_PD[1]:g} comes from Euler's scheme in the "
        "plant, not from the controller or its sampling: with plant.integrator = rk4 it is "
        f"{exact[1]:.3g} at 20 ms. "
        "While its surge force is at the limit the vehicle swings about its path, ever "
        "wider, and the scheme adds to that. Efforts of the proposed controller change by "
        f"{spread:.2g} % at most.",
        figure,
    )


@effect("effect-noise", "Measurement noise against effort", *_NOISY)
def noise(*runs: KeptRun) -> Shown:
    one_mm, one_cm = (runs[NOISE_LEVELS.index(level)].metrics for level in (1e-3, 1e-2))
    figure = Figure(figsize=(FIGURE_WIDTH, 3.2))
    effort, peak = figure.subplots(1, 2)
    # A logarithmic axis that begins at zero, the first level.
    levels = np.array(NOISE_LEVELS) * 1e3
    for axes, key, title, unit in (
        (effort, "l2_effort", "L2 norm of the applied signals", "N·√s, N·m·√s"),
        (peak, "peak_command", "peak commands", "N, N·m"),
    ):
        _draw_lines(axes, levels, [run.metrics[key] for run in runs])
        axes.set_title(title)
        axes.set(xlabel="standard deviation of the position [mm]", ylabel=f"[{unit}]")
        axes.set_xscale("symlog", linthresh=0.1)
        axes.set_xticks(levels, [f"{level:g}" for level in levels])
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_locator(NullLocator())
    _draw_limit(peak, runs[0])
    peak.legend()
    return (
        "The observer multiplies the noise by k_d = 50 (reading 7). In one draw of 100 s, white "
        "noise of 1 mm leaves the peaks of Fig. 4 at "
        f"{actuator_values(one_mm['peak_command'])}; 1 cm drives them to "
        f"{actuator_values(one_cm['peak_command'])}, and "
        f"{100 * max(one_cm['saturated_fraction']):.3g} % of the steps saturate.",
        figure,
    )


@effect("effect-lambda", "Condition (30) against the limits of (3)", *_QUICK)
def condition_30(*runs: KeptRun) -> Shown:
    figure = Figure(figsize=(FIGURE_WIDTH, 3.2))
    peak, error = figure.subplots(1, 2)
    for axes, key, names, title, unit in (
        (peak, "peak_command", _SIGNALS, "peak commands", "N, N·m"),
        (error, "final_error", AXES, "final errors e_f", "m"),
    ):
        _draw_lines(axes, LAMBDAS, [run.metrics[key] for run in runs], names)
        axes.axvline(2.0, color="grey", linestyle=":", label="(30) holds above")
        axes.set(xlabel="lambda [m/s]", ylabel=f"[{unit}]", yscale="log", title=title)
    _draw_limit(peak, runs[0])
    for axes in (peak, error):
        axes.legend()
    paper, met = (runs[LAMBDAS.index(value)].metrics for value in (1.0, 2.1))
    return (
        "With equal entries in K_2, (30) as printed asks for lambda > 2 m/s. From the start of "
        f"Fig. 4, without noise, the peaks are {actuator_values(paper['peak_command'])} at the "
        f"paper's lambda = 1 and {actuator_values(met['peak_command'])} at 2.1, where "
        f"{100 * max(met['saturated_fraction']):.3g} % of the steps saturate; e_f falls from "
        f"{numbers(paper['final_error'])} to {numbers(met['final_error'])} m. With the "
        "paper's other gains, a lambda that meets it does not spare the actuators.",
        figure,
    )


@effect("effect-saturation", "tanh against algebraic saturation", QUIET, _ALGEBRAIC)
def saturation(tanh: KeptRun, algebraic: KeptRun) -> Shown:
    efforts = [actuator_values(run.metrics["l2_effort"], "·√s") for run in (tanh, algebraic)]
    errors = [numbers(run.metrics["final_error"]) for run in (tanh, algebraic)]
    return (
        f"Fig. 4 without noise. L2 effort {' against '.join(efforts)}; "
        f"e_f {errors[0]} m against {errors[1]} m.",
        one_figure("overlay", "", [Drawn("tanh", tanh.table), Drawn("algebraic", algebraic.table)]),
    )


@effect("certificates", "Certificates along a run", QUIET)
def certificates_along_a_run(quiet: KeptRun) -> Shown:
    column = dict(zip(CERTIFICATE_COLUMNS, certificates(quiet.table).T, strict=True))
    figure = Figure(figsize=(FIGURE_WIDTH, 5.5))
    panels = figure.subplots(3, 1, sharex=True)
    panels[0].semilogy(column["time"], column["V_without_theta"], color=COLOURS[0])
    panels[0].set_ylabel("V of (34) [J],\nwithout its term in θ")
    for name, colour, style in zip(("r_1", "r_2"), COLOURS, STYLES, strict=False):
        norm = np.linalg.norm([column[f"{name}.{k}"] for k in "xyz"], axis=0)
        panels[1].semilogy(column["time"], norm, linestyle=style, color=colour, label=f"|{name}|")
    panels[1].set_ylabel("composite errors\n(17), (19) [m/s]")
    panels[1].legend()
    margins = [column[f"saturation_margin.{k}"] for k in ACTUATORS]
    _draw_lines(panels[2], column["time"], np.transpose(margins), marker="")
    panels[2].set(ylabel="distance from the\nnearer limit [N, N·m]", xlabel="time [s]")
    panels[2].legend(ncols=3)
    for axes in panels:
        axes.margins(x=0)
    return (
        "For Fig. 4 without noise, from the true state of the plant: the Lyapunov function (34) "
        "without its term in the unknown theta, the composite errors r_1 (17) and r_2 (19), and "
        "the distance of each command from its nearer limit. V falls by some orders of "
        "magnitude, not monotonically, and then stays in a band: ultimate boundedness, not "
        "convergence. Every run of the proposed controller has these columns in its "
        "`certificates.csv`.",
        figure,
    )
