"""Changes of files, as guides show them."""

from __future__ import annotations

from pathlib import Path


def patch(folder: Path, difference: str) -> None:
    """Apply a change that names its file in the first line."""
    first, *lines = difference.splitlines()
    file = folder / first.removeprefix("--- ")
    before, after = (
        "".join(f"{line[1:]}\n" for line in lines if not line.startswith(other)) for other in "+-"
    )
    text = file.read_text(encoding="utf-8")
    assert text.count(before) == 1, f"{file} holds {text.count(before)} times:\n{before}"
    file.write_text(text.replace(before, after), encoding="utf-8")
