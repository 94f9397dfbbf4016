"""The Reference FMUs of the Modelica Association give the results that are published in them.

The variable REFERENCE_FMUS names a folder with a release of github.com/modelica/Reference-FMUs, or
with the products of its own build: FMUs in `2.0` and `3.0`. Both solve with explicit Euler's fixed
steps, so the master has to come to the same numbers bit for bit. No result uses event mode. The
counter of Stair is ten after nine seconds, where it ends the run.
"""

from __future__ import annotations

import csv
import os
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.machine.errors import InputError
from support.texts import mentions

_FOLDER = Path(os.environ.get("REFERENCE_FMUS", ""))
_MODELS = ("BouncingBall", "Dahlquist", "Feedthrough", "Resource", "Stair", "VanDerPol")

#: Outputs that the master does not take, and outputs that FMI 2.0 has.
_LEFT_OUT = ("Binary_output",)
_OF_FMI_2 = (
    "Float64_continuous_output", "Float64_discrete_output", "Int32_output", "Boolean_output",
    "String_output", "Enumeration_output",
)  # fmt: skip

_TRUTH = {"true": 1.0, "false": 0.0}

pytestmark = pytest.mark.skipif(
    "REFERENCE_FMUS" not in os.environ, reason="there are no Reference FMUs"
)


def _fmu(version: str, model: str) -> Path:
    return _FOLDER / version / f"{model}.fmu"


def _published(fmu: Path) -> tuple[np.ndarray, dict[str, list[str]]]:
    """Times, and the texts of each column; elements of an array in columns of their own."""
    with ZipFile(fmu) as archive:
        text = archive.read(f"extra/org.fmi-standard.fmi-ls-ref/{fmu.stem}_out.csv").decode()
    rows = list(csv.DictReader(text.splitlines()))
    columns: dict[str, list[str]] = {}
    for name in rows[0]:
        values = [row[name] for row in rows]
        if name == "y" and " " in values[0]:
            parts = zip(*(value.split() for value in values), strict=True)
            columns |= {f"y[{i}]": list(part) for i, part in enumerate(parts, start=1)}
        else:
            columns[name] = values
    return np.array([float(text) for text in columns.pop("time")]), columns


def _value(text: str) -> float | str:
    try:
        return float(_TRUTH.get(text, text))
    except ValueError:
        return text


@pytest.mark.parametrize(
    ("version", "model"),
    [("2.0", model) for model in _MODELS] + [("3.0", model) for model in (*_MODELS, "StateSpace")],
)
def test_result_is_the_published_one_bit_for_bit(version: str, model: str):
    time, columns = _published(_fmu(version, model))
    result = simulate(
        _fmu(version, model), stop_time=10.0 if model == "Stair" else time[-1], step=time[1]
    )
    assert result.failure is None
    assert result.time.tolist() == time.tolist()
    for name, texts in columns.items():
        known = version == "3.0" or "_" not in name or name in _OF_FMI_2
        if known and name not in _LEFT_OUT:
            found = result[f"{model}.{name}"].tolist()
            assert found == [_value(text) for text in texts], name


def test_stair_ends_the_run():
    result = simulate(_fmu("3.0", "Stair"), stop_time=10.0, step=0.2)
    assert mentions(result.ending.remark or "", "Stair 9 s")


def test_clocks_is_for_scheduled_execution():
    with pytest.raises(InputError) as error:
        simulate(_fmu("3.0", "Clocks"))
    assert mentions(str(error.value), "Clocks.fmu scheduled execution")
