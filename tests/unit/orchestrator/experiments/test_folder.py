"""A folder of results changes all at once, or not at all."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.errors import InputError
from orchestrator.experiments.folder import RECORD, replaced, whole


def write(folder: Path, *names: str, text: str = "new", failure: str | None = None) -> None:
    with replaced(folder) as unfinished:
        for name in names:
            (unfinished / name).parent.mkdir(exist_ok=True)
            (unfinished / name).write_text(text)
        (unfinished / RECORD).write_text(
            json.dumps({"files": [*names, RECORD], "failure": failure})
        )


def write_half(folder: Path, error: BaseException) -> None:
    with replaced(folder) as unfinished:
        (unfinished / "a.csv").write_text("rows so far")
        raise error


def write_half_a_file(path: Path) -> None:
    with whole(path) as partial:
        partial.write_text("half")
        raise RuntimeError


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_earlier_files_go_and_those_of_others_stay(tmp_path: Path):
    write(tmp_path / "r", "a.csv", "old.png", "below/b.csv", text="old")
    (tmp_path / "r" / "notes.txt").write_text("mine")
    write(tmp_path / "r", "a.csv", "new.png")
    assert files(tmp_path / "r") == {"a.csv", "new.png", RECORD, "notes.txt"}
    assert (tmp_path / "r" / "a.csv").read_text() == "new"
    assert not (tmp_path / "r" / "below").exists()


def test_after_an_exception_everything_is_as_it_was(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="old")
    with pytest.raises(RuntimeError):
        write_half(tmp_path / "r", RuntimeError())
    assert files(tmp_path / "r") == {"a.csv", RECORD}
    assert (tmp_path / "r" / "a.csv").read_text() == "old"


def test_a_folder_that_was_made_for_nothing_goes(tmp_path: Path):
    with pytest.raises(InputError, match="no scenario"), replaced(tmp_path / "r"):
        raise InputError("no scenario")
    assert not (tmp_path / "r").exists()


def test_what_a_killed_run_has_left_goes_with_the_next(tmp_path: Path):
    left = tmp_path / "r" / ".unfinished-abc"
    left.mkdir(parents=True)
    (left / "result.csv").write_text("half")
    write(tmp_path / "r", "a.csv")
    assert files(tmp_path / "r") == {"a.csv", RECORD}
    assert not left.exists()


def test_second_run_into_the_same_folder_is_refused(tmp_path: Path):
    other = (
        "from pathlib import Path\n"
        "from orchestrator.experiments.folder import replaced\n"
        f"with replaced(Path({str(tmp_path / 'r')!r})): print('in', flush=True); input()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-P", "-c", other],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "in\n"
        with pytest.raises(InputError, match="another run is writing into"):
            write(tmp_path / "r", "a.csv")
        process.stdin.write("\n")
    write(tmp_path / "r", "a.csv")


def test_a_failing_disk_keeps_what_was_there_and_says_where_the_rest_is(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="old")
    with pytest.raises(InputError, match=r"No space left.*\.unfinished-"):
        write_half(tmp_path / "r", OSError(28, "No space left on device"))
    assert (tmp_path / "r" / "a.csv").read_text() == "old"
    [left] = (tmp_path / "r").glob(".unfinished-*/a.csv")
    assert left.read_text() == "rows so far"


def test_an_edited_record_does_not_lead_out_of_the_folder(tmp_path: Path):
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / RECORD).write_text(json.dumps({"files": ["../precious", "/etc/hostname"]}))
    write(tmp_path / "r", "a.csv")
    assert (tmp_path / "precious").is_file()


def test_a_run_that_came_to_no_end_stands_beside_a_whole_one_until_the_next(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="whole")
    write(tmp_path / "r", "a.csv", "below/b.csv", text="half", failure="interrupted")
    assert (tmp_path / "r" / "a.csv").read_text() == "whole"
    assert (tmp_path / "r" / "incomplete" / "a.csv").read_text() == "half"
    write(tmp_path / "r", "a.csv")
    assert files(tmp_path / "r") == {"a.csv", RECORD}
    assert not (tmp_path / "r" / "incomplete").exists()


def test_a_run_that_came_to_no_end_takes_the_place_of_another_such(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="half", failure="interrupted")
    write(tmp_path / "r", "a.csv", failure="stopped")
    assert (tmp_path / "r" / "a.csv").read_text() == "new"


def test_a_folder_in_the_way_changes_nothing(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="old")
    (tmp_path / "r" / "z.csv").mkdir()
    with pytest.raises(InputError, match=r"z\.csv is a folder"):
        write(tmp_path / "r", "a.csv", "z.csv")
    assert (tmp_path / "r" / "a.csv").read_text() == "old"
    assert (tmp_path / "r" / RECORD).is_file()


def test_what_is_no_result_takes_the_place_of_none(tmp_path: Path):
    """An export into the folder of a run."""
    write(tmp_path / "r", "a.csv", text="whole")
    with replaced(tmp_path / "r") as unfinished:
        (unfinished / "fig4.ssp").write_text("exported")
    assert files(tmp_path / "r") == {"a.csv", RECORD, "fig4.ssp"}


def test_a_file_changes_whole_or_not_at_all(tmp_path: Path):
    path = tmp_path / "view.html"
    with whole(path) as partial:
        partial.write_text("old")
    with pytest.raises(RuntimeError):
        write_half_a_file(path)
    assert path.read_text() == "old"
    assert files(tmp_path) == {"view.html"}
