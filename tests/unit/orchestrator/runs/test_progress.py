"""The progress bar of a run."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from orchestrator.cosim import Experiment, Header
from orchestrator.runs.progress import Progress


@pytest.mark.parametrize("kernel", [False, True])
@pytest.mark.parametrize("widgets", [False, True])
def test_bar_is_a_widget_in_a_notebook_that_has_widgets(monkeypatch, kernel, widgets):
    made: list[str] = []

    def module(name: str) -> SimpleNamespace:
        return SimpleNamespace(tqdm=lambda **_: made.append(name))

    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    if kernel:
        monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    where = "orchestrator.machine.lazy"
    monkeypatch.setattr(f"{where}.import_module", module)
    monkeypatch.setattr(f"{where}.find_spec", lambda _: SimpleNamespace() if widgets else None)
    Progress("fig4").begin(Header((), Experiment(1.0, 0.1)))
    assert made == ["tqdm.notebook" if kernel and widgets else "tqdm"]
