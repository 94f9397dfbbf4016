"""An FMU holds the modules that its script imports from its folder, and no other packages."""

from __future__ import annotations

from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.python.modules import modules_of, with_other_imports


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a script, on the path."""
    folder = tmp_path / "own"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    return folder


#: Modules in the folder of a script, and what they say.
FILES = {
    "plain.py": "",
    "package/__init__.py": "from . import near\nfrom .near import x\n",
    "package/near.py": "x = 1\n",
    "package/far.py": "from .below.deep import y\n",
    "package/below/deep.py": "from ..near import x\ny = 2\n",
    "folder/inner.py": "from plain import *\n",
    "numpy/mine.py": "",
    "sys.py": "",
}

#: Imports, and the files that they need.
NEEDED = {
    "import plain": ["plain.py"],
    "import os, \\\n  plain": ["plain.py"],
    "if True: import plain": ["plain.py"],
    "def f():\n    from plain import x": ["plain.py"],
    "try:\n    import plain\nexcept ImportError: pass": ["plain.py"],
    "if TYPE_CHECKING: import package": [],
    "if typing.TYPE_CHECKING: import package\nelse: import plain": ["plain.py"],
    "import package": ["package/__init__.py", "package/near.py"],
    "from package import near": ["package/__init__.py", "package/near.py"],
    "from package import far": [
        "package/__init__.py", "package/below/deep.py", "package/far.py", "package/near.py",
    ],
    "from package import *": [
        "package/__init__.py", "package/below/deep.py", "package/far.py", "package/near.py",
    ],
    "import folder.inner": ["folder/inner.py", "plain.py"],
    "from folder import inner, nothing": ["folder/inner.py", "plain.py"],
    "import folder": [],
    "text = '''\nimport plain\n'''": [],
    "# import plain": [],
    "import sys": [],
    "import numpy.mine, scipy.linalg, scipy, matplotlib.pyplot": [],
    "import nowhere.at.all": [],
}  # fmt: skip


@pytest.mark.parametrize("text", NEEDED)
def test_modules_of_the_folder_are_found(own: Path, text: str):
    for name, content in FILES.items():
        (own / name).parent.mkdir(parents=True, exist_ok=True)
        (own / name).write_text(content)
    found = modules_of(text, {}, own)
    assert sorted(found) == NEEDED[text]
    assert all(path == own / name for name, path in found.items())


def test_modules_of_packages_are_found_wherever_these_are(own: Path):
    package = own.parent / "other" / "pack"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "one.py").write_text("import plain\n")
    (own / "plain.py").touch()
    found = modules_of("from pack.one import z\nimport plain\n", {"pack": package}, own)
    assert sorted(found) == ["pack/__init__.py", "pack/one.py", "plain.py"]
    assert sorted(modules_of("import pack, plain", {"pack": package}, None)) == ["pack/__init__.py"]


#: A script, and the same script when `a` and `b` have names that end in `_x`.
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
    "from . import a": "from . import a",
    "important = a": "important = a",
    "import a, \\\n    b": "import a_x as a, \\\n    b_x as b",
    "if a: import a; from b import (a,\n b)": "if a: import a_x as a; from b_x import (a,\n b)",
    "from \\\n a . c import z": "from \\\n a_x . c import z",
    "x = '''\nimport a\nfrom a import b'''": "x = '''\nimport a\nfrom a import b'''",
    "ü = 'ü'; import a": "ü = 'ü'; import a_x as a",
    "x = '\x0c\u2028'\nimport a": "x = '\x0c\u2028'\nimport a_x as a",
}


@pytest.mark.parametrize("text", IMPORTS)
def test_modules_are_imported_under_their_names(text: str):
    assert with_other_imports(text.encode(), {"a", "b"}, "_x").decode() == IMPORTS[text]


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-8-sig", "cp1252"])
def test_texts_keep_their_encoding(encoding: str):
    text = f"# coding: {encoding}\nx = 'é'\nimport a\n"
    changed = with_other_imports(text.encode(encoding), {"a"}, "_x")
    assert changed.decode(encoding) == text.replace("import a", "import a_x as a")


class Imported:
    """A module that does not exist, or a name in one."""

    def __init__(self, path: str) -> None:
        self.path = path

    def __getattr__(self, name: str) -> Imported:
        return Imported(f"{self.path}.{name}")


def bound(text: str) -> dict[str, str]:
    """The objects that a text imports, by their names."""

    def load(name: str, *arguments: object) -> Imported:
        return Imported(name if arguments[2] else name.partition(".")[0])

    names = {"__builtins__": {"__import__": load}}
    exec(text, names)
    return {name: target.path for name, target in names.items() if isinstance(target, Imported)}


NAMES = st.sampled_from(["a", "b", "a.c", "b.d", "os", "os.path"])
ITEMS = st.lists(
    st.tuples(NAMES, st.sampled_from(["", " as e", "  as  f"])).map("".join), min_size=1, max_size=3
)
SEPARATORS = st.sampled_from([", ", ",", " , ", ", \\\n  "])
BEFORE = st.sampled_from(["", "if 1: ", "x = 'import a'; ", "import os; "])
SINGLE = st.builds("{}import {}".format, BEFORE, st.builds(str.join, SEPARATORS, ITEMS))
FROM = st.builds("{}from  {} import (x,\n y as z)".format, BEFORE, NAMES)


@given(st.lists(SINGLE | FROM, min_size=1, max_size=4).map("\n".join))
def test_all_names_are_the_same_modules_with_other_names(text: str):
    changed = with_other_imports(text.encode(), {"a", "b"}, "_x").decode()
    parts = {name: path.partition(".") for name, path in bound(text).items()}
    found = {name: path for name, path in bound(changed).items() if not name.endswith("_x")}
    assert found == {
        name: f"{top}_x{dot}{rest}" if top in ("a", "b") else f"{top}{dot}{rest}"
        for name, (top, dot, rest) in parts.items()
    }


def test_extension_modules_are_taken_as_they_are(own: Path):
    (own / f"fast{EXTENSION_SUFFIXES[0]}").write_bytes(b"\0")
    assert sorted(modules_of("import fast", {}, own)) == [f"fast{EXTENSION_SUFFIXES[0]}"]


def test_a_module_with_invalid_python_is_named(own: Path):
    (own / "plain.py").write_text("def (\n")
    with pytest.raises(SyntaxError) as caught:
        modules_of("import plain", {}, own)
    assert caught.value.filename == str(own / "plain.py")
