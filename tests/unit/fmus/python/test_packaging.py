"""Modules of an FMU get names of their own, and its scripts still find them."""

from __future__ import annotations

import zipfile
from pathlib import Path

from fmus.python.packaging import seal


def test_sealed_modules_are_imported_under_their_names(tmp_path: Path):
    entries = {
        "modelDescription.xml": b'<x guid="1"/>',
        "resources/script.py": b"import a, os\nfrom b import z\n",
        "resources/a/__init__.py": b"",
        "resources/a/data.csv": b"1\n",
        "resources/b.py": b"",
        "resources/data/other.csv": b"2\n",
    }
    seal(entries, tmp_path / "it.fmu")
    with zipfile.ZipFile(tmp_path / "it.fmu") as archive:
        names = archive.namelist()
        [name] = [name for name in names if name.startswith("resources/script")]
        x = name.removeprefix("resources/script").removesuffix(".py")
        assert archive.read(name).decode() == f"import a{x} as a, os\nfrom b{x} import z\n"
    assert {
        f"resources/a{x}/__init__.py", f"resources/a{x}/data.csv", f"resources/b{x}.py",
        "resources/data/other.csv",
    } < {*names}  # fmt: skip
