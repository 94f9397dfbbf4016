"""The tools have help, and refuse unknown options."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

FILES = sorted((Path(__file__).parents[2] / "tools").glob("*.py"))

#: Other modules are parts of several tools.
TOOLS = [file for file in FILES if "__main__" in file.read_text(encoding="utf-8")]

#: Packages of the extras `dev`, `docs` and `studies`.
NEEDED = ("pandas", "PIL", "proselint", "pyarrow", "scipy")


@pytest.mark.parametrize("tool", TOOLS, ids=lambda tool: tool.stem)
@pytest.mark.parametrize(("option", "code"), [("--help", 0), ("--unknown", 2)])
def test_an_option_starts_nothing(tool: Path, option, code, tmp_path, monkeypatch, capsys):
    for package in NEEDED:
        pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [tool.name, option])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(tool), run_name="__main__")
    assert ended.value.code == code
    assert tool.name in "".join(capsys.readouterr())
    assert not any(tmp_path.iterdir())
