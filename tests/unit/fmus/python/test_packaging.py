"""Modules of an FMU get names of their own, and its scripts still find them."""

from __future__ import annotations

import zipfile

import pytest

from fmus.python.packaging import seal

#: What a script says, and what it says when `a` and `b` of the FMU are sealed with `_x`.
IMPORTS = {
    "from a import z": "from a_x import z",
    "from a.c import z": "from a_x.c import z",
    "import a": "import a_x as a",
    "import a as d": "import a_x as d",
    "import a.c": "import a_x.c, a_x as a",
    "import a.c as d": "import a_x.c as d",
    "import os, a, b  # both": "import os, a_x as a, b_x as b  # both",
    "import ab, os.a": "import ab, os.a",
    "from os import a": "from os import a",
    "important = a": "important = a",
}


@pytest.mark.parametrize("text", IMPORTS)
def test_sealed_modules_are_imported_under_their_names(text, tmp_path):
    entries = {
        "modelDescription.xml": b'<x guid="1"/>',
        "resources/script.py": text.encode(),
        "resources/a/__init__.py": b"",
        "resources/b.py": b"",
    }
    seal(entries, tmp_path / "it.fmu")
    with zipfile.ZipFile(tmp_path / "it.fmu") as archive:
        [name] = [name for name in archive.namelist() if name.startswith("resources/script")]
        suffix = name.removeprefix("resources/script").removesuffix(".py")
        assert archive.read(name).decode() == IMPORTS[text].replace("_x", suffix)
