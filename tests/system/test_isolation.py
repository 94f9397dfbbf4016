"""Misbehaving FMUs, in processes of their own and in the master's."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

import numpy as np
import pytest

from orchestrator.cosim import (
    Experiment,
    Header,
    Isolation,
    System,
    Table,
    make_plan,
    read_component,
    simulate_plan,
    write_ssp,
)
from orchestrator.machine.errors import InputError, StartError
from orchestrator.runs.tables import read_rows
from orchestrator.runs.wiring import closed_loop
from support.foreign import build_c_fmu, build_raising_fmu, build_slave, foreign_system
from support.machine import LOOPS, contents, eventually, start
from support.runs import run_table, whole
from support.texts import mentions
from support.tiers import slow

STEP = 0.02
SHORT = Experiment(0.5, STEP)


@pytest.fixture(scope="module")
def c_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_c_fmu(tmp_path_factory.mktemp("foreign"))


@pytest.fixture(scope="module")
def raising(tmp_path_factory: pytest.TempPathFactory) -> System:
    fmu = build_raising_fmu(tmp_path_factory.mktemp("raising"))
    components = {name: read_component(name, fmu) for name in ("first", "second")}
    return System("raising", components, ())


@pytest.fixture
def mark(monkeypatch: pytest.MonkeyPatch) -> str:
    """An environment variable that marks the processes of a test."""
    mark = f"FOREIGN_TEST={uuid4()}"
    monkeypatch.setenv(*mark.split("="))
    return mark


def left_over(mark: str) -> list[Path]:
    """Processes with a mark that are still there some seconds later, by their folders in /proc."""

    def marked() -> Iterator[Path]:
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if mark.encode() in (process / "environ").read_bytes():
                    yield process

    eventually(lambda: not list(marked()))
    return list(marked())


def run_isolated(system: System, timeout: float = 20.0) -> Table:
    return run_table(system, SHORT, isolation=Isolation(timeout))


def rows_until(table: Table, t: float) -> bool:
    """True if there is a row for every step until a time, and none after it."""
    return np.array_equal(table.time, np.arange(round(t / STEP) + 1) * STEP)


def test_rows_equal_a_run_in_one_process(dist: Path):
    system, experiment = closed_loop(dist), Experiment(1.0, 0.03)
    here, there = whole(system, experiment), whole(system, experiment, isolation=Isolation())
    assert here.header == there.header
    assert here.rows.tobytes() == there.rows.tobytes()


@pytest.mark.parametrize(
    ("act", "words"),
    [
        ("SILENT_ERROR", "doStep 3"),
        ("EXITS", "3 doStep"),
        ("CRASHES", "SIGSEGV doStep"),
        ("KILLED", "SIGKILL memory"),
        ("LEAVES_A_PROCESS", "SIGABRT doStep"),
        ("HANGS", "doStep 0.5"),
        *slow(
            ("FATAL", "beyond repair"),
            ("SIGNALS", "40 doStep"),
            ("CLOSES_ALL", "0 doStep"),
            ("ANSWERS_ITSELF", "process"),
            ("SPINS", "doStep 0.5"),
        ),
    ],
)
def test_failures_of_an_isolated_fmu_end_the_run_in_one_line(c_fmu, mark, act, words):
    """An FMU that does not return is ended after a time limit."""
    waits = 0.5 if act in ("HANGS", "SPINS") else 20.0
    table = run_isolated(foreign_system(c_fmu, act, at=0.1), waits)
    assert table.failure is not None
    assert table.failure.startswith("stopped at t = 0.1 s: bad: ")
    assert mentions(table.failure, words)
    assert "\n" not in table.failure
    assert rows_until(table, 0.1)
    assert left_over(mark) == []


@pytest.mark.parametrize("isolation", [None, Isolation(20.0)])
def test_an_fmu_that_cannot_be_instantiated_is_bad_input(c_fmu, monkeypatch, isolation):
    monkeypatch.setenv("FOREIGN_INSTANTIATE", "refuses")
    with pytest.raises(InputError, match=r"bad: foreign\.fmu") as error:
        run_table(foreign_system(c_fmu), SHORT, isolation=isolation)
    assert not isinstance(error.value, StartError)


@pytest.mark.parametrize(
    ("instantiate", "act", "phase", "words"),
    [
        ("crashes", "BEHAVE", "STEP", "SIGABRT"),
        ("", "CRASHES", "ENTER", "SIGSEGV .* in enter_initialization"),
        *slow(
            ("hangs", "BEHAVE", "STEP", "instantiate .* 1 s"),
            ("", "HANGS", "EXIT", "exit_initialization has not ended"),
            ("", "FATAL", "ENTER", "beyond"),
        ),
    ],
)
def test_an_isolated_fmu_that_fails_before_its_first_step(
    c_fmu, mark, monkeypatch, instantiate, act, phase, words
):
    if instantiate:
        monkeypatch.setenv("FOREIGN_INSTANTIATE", instantiate)
    with pytest.raises(StartError, match=f"bad: .*{words}"):
        run_isolated(foreign_system(c_fmu, act, phase), timeout=1.0)
    assert left_over(mark) == []


@pytest.mark.parametrize(("phase", "act"), [("FREE", "CRASHES"), *slow(("TERMINATE", "HANGS"))])
def test_an_isolated_fmu_that_fails_at_the_end_loses_nothing(c_fmu, mark, phase, act):
    table = run_isolated(foreign_system(c_fmu, act, phase), timeout=1.0)
    assert table.failure is None
    assert rows_until(table, 0.5)
    [message] = table.ending.messages
    assert message.startswith("bad: ")
    assert {"TERMINATE": "terminate", "FREE": "freeInstance"}[phase] in message
    assert left_over(mark) == []


@pytest.mark.parametrize(
    ("isolation", "loop"), [(None, "python"), (None, "compiled"), (Isolation(20.0), "auto")]
)
@pytest.mark.parametrize(("act", "value"), [("NOT_A_NUMBER", "nan"), ("INFINITE", "-inf")])
def test_a_value_that_is_not_finite_is_named_with_its_time(c_fmu, act, value, isolation, loop):
    table = run_table(foreign_system(c_fmu, act), SHORT, loop, isolation)
    assert table.failure == f"stopped at t = 0.12 s: bad.y is {value}"
    assert rows_until(table, 0.1)
    assert np.isfinite(table.rows).all()
    with pytest.raises(StartError, match=f"t = 0 s: bad.y is {value}"):
        run_table(foreign_system(c_fmu, act, "ENTER"), SHORT, isolation=isolation)


@pytest.mark.slow
def test_output_is_shown_and_messages_are_bounded(c_fmu, capfd):
    """Control characters are escaped."""
    assert run_isolated(foreign_system(c_fmu, "WRITES", at=0.46)).failure is None
    shown = capfd.readouterr().err
    assert shown == 2 * 100_000 * "to be or not to be, that is the question\n"
    table = run_isolated(foreign_system(c_fmu, "LOGS", at=0.46))
    assert table.failure is None
    assert len(table.ending.messages) == 101
    assert table.ending.messages[0] == "bad: 0: " + 500 * "0"
    capfd.readouterr()
    assert run_isolated(foreign_system(c_fmu, "ESCAPES", at=0.46)).failure is None
    first, second, *_ = capfd.readouterr().err.split("\n")
    assert first == r"\x1b]0;owned\x07 grün"
    assert second.startswith(r"\r\x9b")


def test_isolated_runs_in_several_threads(c_fmu: Path):
    with ThreadPoolExecutor(3) as pool:
        tables = [*pool.map(lambda _: run_isolated(foreign_system(c_fmu)), range(3))]
    assert [table.failure for table in tables] == [None] * 3
    assert len({table.rows.tobytes() for table in tables}) == 1


@pytest.mark.parametrize("loop", LOOPS)
def test_runs_in_threads_of_one_process_hear_their_own_fmus(c_fmu: Path, loop: str):
    """A run that ends during another one takes neither its messages nor the process."""
    begun, go_on = threading.Event(), threading.Event()

    class Waits(Table):
        def begin(self, header: Header) -> None:
            super().begin(header)
            begun.set()
            go_on.wait()

    table = Waits()
    plan = make_plan(foreign_system(c_fmu, "SILENT_ERROR"), SHORT, loop=loop)
    talkative = foreign_system(c_fmu, "LOGS", at=0.0)
    other = make_plan(talkative, Experiment(STEP, STEP), loop=loop)
    thread = threading.Thread(target=simulate_plan, args=(plan, [table]))
    thread.start()
    assert begun.wait(60.0)
    assert len(simulate_plan(other).messages) == 101
    gc.collect()
    go_on.set()
    thread.join()
    assert table.ending.messages == ()
    assert table.failure is not None
    assert mentions(table.failure, "bad: doStep 3")


@pytest.fixture(scope="module")
def archives(c_fmu: Path, raising: System, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The systems as SSPs, each in a folder named by what happens in it."""
    folder = tmp_path_factory.mktemp("archives")
    acts = ("FATAL", "HANGS", "CRASHES", "FORKS", "MOVES", "CLOSES_FILES", "ALARMS")
    systems = {act: foreign_system(c_fmu, act) for act in acts}
    for name, system in {**systems, "raises": raising}.items():
        (folder / name).mkdir()
        write_ssp(system, folder / name)
    return folder


def run(
    archives: Path, name: str, *options: str, out: object = "out", folder: Path
) -> subprocess.Popen[str]:
    """`auv-fmu run` in a process whose temporary files go into a folder."""
    [archive] = (archives / name).glob("*.ssp")
    how = ("--stop-time", "0.5", "--no-figures", "--out", str(out), *options)
    folder.mkdir(exist_ok=True)
    return start("run", str(archive), *how, environment={"TMPDIR": str(folder)})


def rows_of(out: Path | str, form: str = "csv") -> np.ndarray:
    return np.vstack(list(read_rows(Path(out, f"result.{form}"))))


@pytest.mark.parametrize(
    ("name", "options", "last_time", "words"),
    [
        ("CRASHES", ["--isolate"], 0.1, "bad: SIGSEGV"),
        *slow(
            ("FATAL", ["--loop", "compiled"], 0.1, "bad: beyond repair"),
            ("raises", ["--loop", "python"], 0.12, "first: no water left"),
            ("raises", ["--isolate"], 0.12, "first: no water left"),
            ("HANGS", ["--isolate", "--step-timeout", "0.5"], 0.1, "bad: doStep"),
        ),
    ],
)
def test_command_line_says_what_happened_and_keeps_the_rows(
    archives, tmp_path, name, options, last_time, words
):
    """After fmi2Fatal nothing is called: the FMU in C would abort."""
    temporary = tmp_path / "temporary"
    process = run(archives, name, *options, out=tmp_path / "out", folder=temporary)
    *_, last = process.communicate()[1].splitlines()
    assert process.returncode == 1
    assert mentions(last, f"auv-fmu: {last_time} {words}")
    assert rows_of(tmp_path / "out")[-1, 0] == pytest.approx(last_time)
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize(
    ("act", "options", "form"),
    [
        ("CLOSES_FILES", ["--loop", "compiled"], "csv"),
        *slow(
            ("CLOSES_FILES", ["--isolate"], "csv"),
            ("FORKS", ["--loop", "python"], "csv"),
            ("FORKS", ["--isolate"], "csv"),
            ("MOVES", ["--loop", "compiled"], "parquet"),
            ("MOVES", ["--isolate"], "csv"),
        ),
    ],
)
def test_rows_are_kept_whatever_an_fmu_does_to_the_process(
    archives, workplace, mark, act, form, options
):
    """Into a folder that is named from the current one."""
    if form == "parquet":
        pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    process = run(archives, act, "--format", form, *options, folder=workplace / "temporary")
    assert len(process.communicate()[1].splitlines()) <= 1
    closed = act == "CLOSES_FILES" and options == ["--isolate"]
    assert len(rows_of("out", form)) == (6 if closed else 26)
    assert process.returncode == int(closed)
    assert contents(Path("out")).keys() == {f"result.{form}", "metrics.json", "run.json"}
    assert left_over(mark) == []


@pytest.mark.slow
def test_an_alarm_ends_a_run_with_its_rows(archives, workplace):
    process = run(archives, "ALARMS", folder=workplace)
    *_, last = process.communicate()[1].splitlines()
    assert process.returncode == 1
    assert mentions(last, "auv-fmu: foreign interrupted SIGALRM --isolate")
    assert len(rows_of("out")) >= 6


@pytest.mark.parametrize(
    "act",
    [
        "json.dumps = builtins.print = None",
        *slow(
            "os.fork()",
            "sys.stdout.close(); sys.stderr.close()",
            "[setattr(numpy, name, None) for name in list(vars(numpy))]",
            "os.chdir('/')",
        ),
    ],
)
def test_a_python_slave_that_damages_the_interpreter_costs_no_rows(workplace, act):
    """Although it does so in every step, the result and its messages are written."""
    (workplace / "slave").mkdir()
    system = System("slave", {"a": read_component("a", build_slave(workplace, act))}, ())
    write_ssp(system, workplace / "slave")
    process = run(workplace, "slave", folder=workplace)
    shown, errors = process.communicate()
    assert (process.returncode, errors) == (0, "")
    assert "written to out/\n" in shown
    rows = rows_of("out")
    assert np.allclose(rows[:, 0], rows[:, 1])
    assert len(rows) == 26


@pytest.mark.parametrize("loop", LOOPS)
def test_an_fmu_finds_the_current_folder_that_it_has_left(workplace, loop):
    """The program may change the folder meanwhile; the user's own one is restored."""
    act = "(current_time < 0.13 and os.chdir('/')) or (os.getcwd() == '/') or 1 / 0"
    system = System("slave", {"a": read_component("a", build_slave(workplace, act))}, ())
    assert len(whole(system, Experiment(200 * STEP, STEP), loop)) == 201
    assert Path.cwd() == workplace


@pytest.mark.slow
@pytest.mark.parametrize("how", [["--loop", "python"], ["--isolate"]])
def test_a_current_folder_that_is_gone_is_not_needed(dist, tmp_path, how):
    gone = tmp_path / "gone"
    gone.mkdir()
    script = 'cd "$1" && rmdir "$1" && shift && exec "$@"'
    program = [sys.executable, "-P", "-m", "orchestrator", "run", "fig4", "--stop-time", "0.1"]
    end = ["--no-figures", "--out", tmp_path / "out", *how]
    process = subprocess.run(
        ["sh", "-c", script, "sh", gone, *program, *end],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (process.returncode, process.stderr) == (0, "")
    assert len(rows_of(tmp_path / "out")) == 6


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_nothing_is_left_of_a_run_that_hangs_and_is_ended(archives, tmp_path, mark, number):
    """Also after KILL, which the process cannot handle."""
    out, temporary = tmp_path / "out", tmp_path / "temporary"
    process = run(archives, "HANGS", "--isolate", out=out, folder=temporary)
    assert process.stderr is not None
    assert process.stderr.readline() == "hangs\n"
    os.kill(process.pid, number)
    _, errors = process.communicate()
    if number == signal.SIGINT:
        assert process.returncode == 1
        assert mentions(errors.splitlines()[-1], "auv-fmu: foreign interrupted 0.1")
        assert rows_of(out)[-1, 0] == pytest.approx(0.1)
    assert left_over(mark) == []
    assert list(temporary.iterdir()) == []


def test_an_fmu_that_ended_fatally_is_loaded_again(archives: Path):
    """The C library remembers its failure in a static variable."""
    [archive] = (archives / "FATAL").iterdir()
    code = (
        "from orchestrator import simulate\n"
        "for loop in ('python', 'compiled'):\n"
        "    for at in (0.1, 0.2):\n"
        f"        made = simulate({str(archive)!r}, {{'bad.at': at}}, stop_time=0.5, loop=loop)\n"
        "        print(made.failure)\n"
    )
    process = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False
    )
    assert (
        process.stdout.splitlines()
        == ["stopped at t = 0.1 s: bad: beyond repair", "stopped at t = 0.2 s: bad: beyond repair"]
        * 2
    ), process.stderr


def test_a_script_without_a_main_guard_is_run_once(c_fmu: Path, tmp_path: Path):
    archive = write_ssp(foreign_system(c_fmu), tmp_path)[0]
    script = tmp_path / "script.py"
    script.write_text(
        "from orchestrator import simulate\n"
        f"result = simulate({str(archive)!r}, stop_time=0.5, isolate=True, step_timeout=20)\n"
        "print(len(result), result.failure)\n",
        encoding="utf-8",
    )
    process = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert (process.stdout, process.stderr) == ("26 None\n", "")
