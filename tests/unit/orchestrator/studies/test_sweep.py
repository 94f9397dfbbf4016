"""A study as a whole, if something is missing."""

from __future__ import annotations

import pytest

from orchestrator import sweep
from orchestrator.machine.errors import InputError
from orchestrator.studies import sweep as module

STUDY = {"scenario": "fig4", "vary": {"plant.ell": [0.3, 0.4]}}


def test_missing_packages_are_named_with_a_command_to_install_them(monkeypatch, tmp_path):
    monkeypatch.setattr(
        module, "find_spec", lambda name: None if name in ("scipy", "pyarrow") else 1
    )
    words = r"studies need pyarrow, scipy: pip install 'auv-fmu\[studies\]'"
    with pytest.raises(InputError, match=words):
        sweep(STUDY, out=tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_an_unknown_engine_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "find_spec", lambda name: 1)
    with pytest.raises(InputError, match="engine 'fpga': use one of fmu, batch, gpu"):
        sweep(STUDY, engine="fpga", out=tmp_path / "study")
    assert not (tmp_path / "study").exists()
