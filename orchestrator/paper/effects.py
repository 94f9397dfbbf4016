"""Figures of effects that the paper does not show: attitude, order, noise, saturation function."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from orchestrator.analysis.certificates import COLUMNS
from orchestrator.analysis.figures import (
    COLOURS,
    SETTINGS,
    STYLES,
    Drawn,
    draw_commands,
    overlay,
    save,
)
from orchestrator.analysis.signals import ACTUATORS
from orchestrator.master.table import Table
from orchestrator.paper.published import NOISE_LEVELS
from orchestrator.system.names import PortName


def draw_effects(
    results: Mapping[str, Table], metrics: Mapping[str, Any], runs: Path, folder: Path
) -> None:
    """Write the figures of all effects as PNG.

    Args:
        results: tables of the runs that are drawn, by name.
        metrics: of all runs, by name.
        runs: folder of the runs, for their certificates.
        folder: to write into.

    """
    limit = float(results["fig4-quiet"].parameters[PortName("plant", "tau_max.u")])
    with mpl.rc_context(SETTINGS):
        for name, figure in (
            ("effect-jacobian", overlay(
                "The Jacobian with the full attitude, and (11) as printed (reading 3)",
                [Drawn("full attitude", results["fig5"]),
                 Drawn("(11) as printed", results["fig5-printed"])],
            )),
            ("effect-order", _orders(results)),
            ("effect-noise", _noise(metrics, limit)),
            ("effect-saturation", overlay(
                "tanh and algebraic saturation, Fig. 4 without noise",
                [Drawn("tanh", results["fig4-quiet"]),
                 Drawn("algebraic", results["fig4-algebraic"])],
            )),
            ("certificates", _certificates(runs / "fig4-quiet" / "certificates.csv")),
        ):  # fmt: skip
            save(figure, folder / f"{name}.png")


def _orders(results: Mapping[str, Table]) -> Figure:
    figure = Figure(figsize=(13, 8))
    figure.suptitle("Order of evaluation: a Jacobi master adds a delay of 20 ms (reading 5)")
    panels = figure.subplots(3, 2)
    for column, (title, runs) in enumerate(
        (
            ("proposed controller, Fig. 5", ("fig5", "fig5-jacobi")),
            ("PD controller, Fig. 5", ("fig5-pd", "fig5-jacobi/fig5-pd")),
        )
    ):
        labelled = [
            Drawn(label, results[name])
            for label, name in zip(("Gauss-Seidel", "Jacobi"), runs, strict=True)
        ]
        draw_commands(panels[:, column], labelled, title)
    return figure


def _noise(metrics: Mapping[str, Any], limit: float) -> Figure:
    figure = Figure(figsize=(11, 4.5))
    figure.suptitle("Measurement noise against effort, Fig. 4 (reading 7)")
    effort, peak = figure.subplots(1, 2)
    runs = [metrics[f"fig4-noise-{level:g}"] for level in NOISE_LEVELS]
    # A logarithmic axis that begins at zero: the first level is none at all.
    levels = np.array(NOISE_LEVELS) * 1e3
    for i, (k, colour, style) in enumerate(zip(ACTUATORS, COLOURS, STYLES, strict=False)):
        for axes, key in ((effort, "l2_effort"), (peak, "peak_command")):
            line: Any = {"color": colour, "linestyle": style, "marker": "o"}
            axes.plot(levels, [run[key][i] for run in runs], label=rf"$\tau_{k}$", **line)
    for axes, label in ((effort, "L2 norm of the applied signal"), (peak, "peak command")):
        axes.set(xlabel="standard deviation of the position [mm]", ylabel=f"{label} [N, N·m]")
        axes.set_xscale("symlog", linthresh=0.1)
        axes.set_yscale("log")
    effort.set_ylabel("L2 norm of the applied signal [N·s$^{1/2}$, N·m·s$^{1/2}$]")
    peak.axhline(limit, color="black", linewidth=1, label="limit of (3)")
    peak.legend(fontsize="small")
    return figure


def _certificates(path: Path) -> Figure:
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    column = {name: table[:, i] for i, name in enumerate(COLUMNS)}
    figure = Figure(figsize=(11, 8))
    figure.suptitle("Certificates along Fig. 4 without noise")
    panels = figure.subplots(3, 1, sharex=True)
    panels[0].semilogy(column["time"], column["V_without_theta"], color=COLOURS[0])
    panels[0].set_ylabel("V of (34) [J],\nwithout its term in θ")
    for name, style in (("r_1", "-"), ("r_2", "--")):
        norm = np.linalg.norm([column[f"{name}.{k}"] for k in "xyz"], axis=0)
        colour = COLOURS[name == "r_2"]
        panels[1].semilogy(column["time"], norm, linestyle=style, color=colour, label=f"|{name}|")
    panels[1].set_ylabel("composite errors\n(17), (19) [m/s]")
    panels[1].legend(fontsize="small")
    for k, colour, style in zip(ACTUATORS, COLOURS, STYLES, strict=False):
        margin = column[f"saturation_margin.{k}"]
        panels[2].plot(column["time"], margin, color=colour, linestyle=style, label=rf"$\tau_{k}$")
    panels[2].set(ylabel="distance from the\nnearer limit [N, N·m]", xlabel="time [s]")
    panels[2].legend(fontsize="small", ncols=3)
    for axes in panels:
        axes.margins(x=0)
    return figure
