"""A user's script, which mypy checks with the packages and nothing runs.

A line that a type checker must refuse says so; mypy complains of a comment that is not needed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from auv_fmu import Result, load, read, simulate, sweep
from orchestrator import StudyResult


def accepted(folder: Path) -> None:
    """Calls as the documentation has them."""
    system = load("fig4", "native", fmi="3")
    result: Result = simulate(system, {"plant.eta0": [0.0] * 6}, order="jacobi", loop="compiled")
    simulate({"stop_time": 1.0, "parameters": {"plant.noise.std": 0.0}}, kind="python")
    simulate(folder / "mine.toml", order=["plant", "controller"], coupling="delay")
    column: np.ndarray = result["plant.eta.x"]
    again: Result = read(result.save(folder, format="parquet"))
    again.plot("plant.y", result).savefig("plot.png")
    again.figure(result, name="comparison").savefig("figure.png")
    study: StudyResult = sweep({"scenario": "fig4"}, engine="batch", kind="auto")
    print(column, again.metrics(), study["failure"], study.to_dataframe())


def refused(result: Result) -> None:
    """Names that do not exist."""
    load("fig4", "nativ")  # type: ignore[arg-type]
    load("fig4", fmi="1")  # type: ignore[arg-type]
    simulate("fig4", kind="nativ")  # type: ignore[arg-type]
    simulate("fig4", loop="fast")  # type: ignore[arg-type]
    simulate("fig4", order="jacobian")  # type: ignore[arg-type]
    simulate("fig4", coupling="solved")  # type: ignore[arg-type]
    result.save("mine", format="xls")  # type: ignore[arg-type]
    sweep("attraction", engine="fmus")  # type: ignore[arg-type]
    sweep("attraction", kind="c")  # type: ignore[arg-type]
    sweep("attraction", loop="c")  # type: ignore[arg-type]
