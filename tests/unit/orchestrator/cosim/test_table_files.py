"""Tables written as they come: what is read again is the same to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.observers import TABLE_FORMATS, Ending, Header
from orchestrator.runs.tables import read_columns, read_rows


@pytest.mark.parametrize("ending", TABLE_FORMATS)
def test_what_is_written_is_read_again_exactly(tmp_path: Path, ending: str):
    if ending == "parquet":
        pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    path = tmp_path / f"result.{ending}"
    rows = np.random.default_rng(1).normal(scale=1e3, size=(20_001, 4))
    rows[5] = [1e-310, -0.0, 1.7976931348623157e308, np.nextafter(1.0, 2.0)]
    file = TABLE_FORMATS[ending](path)
    file.begin(Header(("a.x", "a.y", "b.z"), Experiment(1.0, 0.1)))
    for block in np.split(rows, [1, 600, 19_000]):
        file.take(block)
    file.end(Ending())
    assert read_columns(path) == ("a.x", "a.y", "b.z")
    read = list(read_rows(path))
    assert len(read) > 1, "in blocks"
    assert np.vstack(read).tobytes() == rows.tobytes()


def test_parquet_of_the_same_rows_is_the_same_file(tmp_path: Path):
    """However long its observer had to wait for them."""
    pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    rows = np.random.default_rng(1).normal(size=(20_000, 2))
    files = []
    for i, block in enumerate((512, 700, 20_000)):
        path = tmp_path / f"{i}.parquet"
        file = TABLE_FORMATS["parquet"](path)
        file.begin(Header(("a.x",), Experiment(1.0, 0.1)))
        for start in range(0, len(rows), block):
            file.take(rows[start : start + block])
        file.end(Ending())
        files.append(path.read_bytes())
    assert files[0] == files[1] == files[2]
