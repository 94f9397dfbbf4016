"""The notebooks: committed without outputs, and run to the end."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.markdown import DOCS

nbformat = pytest.importorskip("nbformat", reason="needs the extra `docs`")
nbclient = pytest.importorskip("nbclient", reason="needs the extra `docs`")
pytest.importorskip("ipykernel", reason="needs the extra `docs`")
pytest.importorskip("pandas", reason="needs the extra `docs`")

NOTEBOOKS = sorted((DOCS / "tutorials").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_without_outputs_and_runs(path: Path, tmp_path: Path):
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code)
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": str(tmp_path)}}).execute()
    pictures = [output for cell in code for output in cell.outputs if "image/png" in
                output.get("data", {})]  # fmt: skip
    assert len(pictures) >= 2


def test_there_are_notebooks():
    assert "first-steps" in {path.stem for path in NOTEBOOKS}
