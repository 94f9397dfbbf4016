"""libcosim and ecos on third-party systems: `python other_masters.py TOOL FILE SYSTEM OUT`.

SYSTEM is what `ours.py` has written about the same run; OUT is where the rows go.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from orchestrator import load
from orchestrator.cosim import write_osp

#: Attribute with the name of a parameter set.
_PARAMETER_SET = re.compile(r"ParameterSet\b[^>]*\bname=\"([^\"]*)\"")

#: A Real output: component, port, value reference.
Output = tuple[str, str, int]


def libcosim(file: str, step: float, steps: int, outputs: Sequence[Output]) -> np.ndarray:
    """Values of the outputs after each step, from libcosim."""
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415

    # Without a step of its own the archive would end it.
    nanoseconds = round(step * 1e9)
    execution = CosimExecution.from_ssp_file(ssp_path=file, step_size=nanoseconds)
    return _libcosim(execution, steps, outputs)


def libcosim_export(file: str, step: float, steps: int, outputs: Sequence[Output]) -> np.ndarray:
    """Values of the outputs after each step, from libcosim with our export of the system."""
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415

    write_osp(replace(load(file), step=step), Path())
    execution = CosimExecution.from_osp_config_file(osp_path=".")
    return _libcosim(execution, steps, [(c.replace(".", "_"), p, v) for c, p, v in outputs])


def _libcosim(execution: Any, steps: int, outputs: Sequence[Output]) -> np.ndarray:
    from libcosimpy.CosimObserver import CosimObserver  # noqa: PLC0415

    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    places = [
        (execution.slave_index_from_instance_name(component), reference)
        for component, _, reference in outputs
    ]
    rows = []
    for _ in range(steps):
        if not execution.step():
            raise RuntimeError("libcosim has ended the run")
        rows.append([observer.last_real_values(i, [reference])[0] for i, reference in places])
    return np.array(rows)


def ecos(file: str, step: float, steps: int, outputs: Sequence[Output]) -> np.ndarray:
    """Values of the outputs after each step, from ecos."""
    # ecospy needs libtbb, which the wheel tbb puts where the loader does not look.
    for library in Path(sys.prefix, "lib").glob("libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    tool: Any = importlib.import_module("ecospy")
    names = [f"{component}::{port}" for component, port, _ in outputs]
    with tool.EcosSimulation(step_size=step, ssp_path=file) as simulation:
        # It applies no parameter set but the one that it is asked for.
        simulation.init(parameter_set=next(iter(_parameter_sets(file)), None))
        rows = []
        for _ in range(steps):
            simulation.step()
            rows.append([simulation.get_real(name) for name in names])
    return np.array(rows)


def _parameter_sets(file: str) -> list[str]:
    """Names of the parameter sets in an archive."""
    with ZipFile(file) as archive:
        texts = [
            archive.read(n).decode() for n in archive.namelist() if n.endswith((".ssd", ".ssv"))
        ]
    return [name for text in texts for name in _PARAMETER_SET.findall(text)]


#: Tools by the titles of their columns.
TOOLS = {"libcosim": libcosim, "libcosim, exported": libcosim_export, "ecos": ecos}


if __name__ == "__main__":
    system = json.loads(Path(sys.argv[3]).read_text(encoding="utf-8"))
    rows = TOOLS[sys.argv[1]](sys.argv[2], system["step"], system["rows"] - 1, system["outputs"])
    np.save(sys.argv[4], rows)
