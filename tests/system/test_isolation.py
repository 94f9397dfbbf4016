"""FMUs that are not ours and misbehave, in processes of their own and in the master's."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

import numpy as np
import pytest

from orchestrator.formats.ssp.writer import write_ssp
from orchestrator.formats.tables import read_rows
from orchestrator.machine.errors import InputError, StartError
from orchestrator.master.experiment import Experiment
from orchestrator.master.fmi.isolated import Isolation
from orchestrator.master.loop import chosen
from orchestrator.master.observers.observer import Header
from orchestrator.master.observers.table import Table
from orchestrator.master.plan import planned
from orchestrator.master.simulation import simulate
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.component import read_component
from orchestrator.system.structure import System
from support.foreign import build_c_fmu, build_raising_fmu, build_slave, foreign_system
from support.machine import LOOPS, contents
from support.texts import mentions
from support.tiers import slow

STEP = 0.02

#: What FMUs do to the process that they are in, and the run survives.
DOES_TO_THE_PROCESS = ("FORKS", "MOVES", "CLOSES_FILES", "ALARMS")


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
    """Something by which processes that a test has started are found again."""
    mark = f"FOREIGN_TEST={uuid4()}"
    monkeypatch.setenv(*mark.split("="))
    return mark


def marked(mark: str) -> Iterator[Path]:
    """Processes with a mark, by their folders in /proc."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if mark.encode() in (process / "environ").read_bytes():
                yield process


def left_over(mark: str) -> list[Path]:
    """Processes that are still there some seconds later."""
    for _ in range(100):
        if not (found := list(marked(mark))):
            break
        time.sleep(0.1)
    return found


def run_isolated(system: System, timeout: float = 20.0) -> Table:
    table = Table()
    simulate(planned(system, Experiment(0.5, STEP)), [table], Isolation(timeout))
    return table


def rows_until(table: Table, t: float) -> bool:
    """Whether there is a row for every step until a time, and none after it."""
    return np.array_equal(table.time, np.arange(round(t / STEP) + 1) * STEP)


@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi"])
def test_rows_are_those_of_a_run_in_one_process(dist: Path, order: str):
    system = closed_loop(dist)
    here, there = Table(), Table()
    for table, isolation in ((here, None), (there, Isolation())):
        simulate(planned(system, Experiment(3.0, 0.03, order)), [table], isolation)
    assert here.header == there.header
    assert here.rows.tobytes() == there.rows.tobytes()
    assert there.failure is None


def test_a_foreign_fmu_that_behaves_runs_to_the_end(c_fmu: Path):
    """y = t + u, and the second takes the first one's output of the step before."""
    table = run_isolated(foreign_system(c_fmu))
    assert rows_until(table, 0.5)
    assert np.allclose(table["bad.y"], table.time)
    assert np.allclose(table["good.y"][1:], table.time[1:] + table.time[:-1])


@pytest.mark.parametrize(
    ("act", "words"),
    [
        ("SILENT_ERROR", "fmi2DoStep 3"),
        ("FATAL", "beyond repair"),
        ("EXITS", "3 doStep"),
        ("CRASHES", "SIGSEGV doStep"),
        ("ABORTS", "SIGABRT doStep"),
        ("KILLED", "SIGKILL memory"),
        ("SIGNALS", "40 doStep"),
        ("LEAVES_A_PROCESS", "SIGABRT doStep"),
        ("CLOSES_ALL", "0 doStep"),
        ("ANSWERS_ITSELF", "process"),
    ],
)
def test_what_an_isolated_fmu_does_ends_the_run_in_one_line(c_fmu, mark, act, words):
    table = run_isolated(foreign_system(c_fmu, act, at=0.1))
    assert table.failure is not None
    assert table.failure.startswith("stopped at t = 0.1 s: bad: ")
    assert mentions(table.failure, words)
    assert "\n" not in table.failure
    assert rows_until(table, 0.1)
    assert left_over(mark) == []


@pytest.mark.parametrize("act", ["HANGS", "SPINS"])
def test_an_isolated_fmu_that_hangs_is_ended(c_fmu, mark, act):
    table = run_isolated(foreign_system(c_fmu, act, at=0.1), timeout=1.0)
    assert mentions(table.failure, "0.1 bad: doStep 1")
    assert rows_until(table, 0.1)
    assert left_over(mark) == []


@pytest.mark.parametrize(
    ("variable", "words"),
    [
        ("hangs", "instantiate .* 1 s"),
        ("crashes", "SIGABRT"),
    ],
)
def test_an_isolated_fmu_that_fails_while_it_is_instantiated(
    c_fmu, mark, monkeypatch, variable, words
):
    monkeypatch.setenv("FOREIGN_INSTANTIATE", variable)
    with pytest.raises(StartError, match=words):
        run_isolated(foreign_system(c_fmu), timeout=1.0)
    assert left_over(mark) == []


@pytest.mark.parametrize("isolation", [None, Isolation(20.0)])
def test_an_fmu_that_cannot_be_instantiated_is_bad_input(c_fmu, monkeypatch, isolation):
    monkeypatch.setenv("FOREIGN_INSTANTIATE", "refuses")
    with pytest.raises(InputError, match=r"bad: foreign\.fmu cannot be") as error:
        simulate(planned(foreign_system(c_fmu), Experiment(0.5, STEP)), (), isolation)
    assert not isinstance(error.value, StartError)


@pytest.mark.parametrize("phase", ["ENTER", "EXIT"])
@pytest.mark.parametrize(
    ("act", "words"),
    [("CRASHES", "SIGSEGV .* in {call}"), ("HANGS", "{call} has not ended"), ("FATAL", "beyond")],
)
def test_an_isolated_fmu_that_fails_before_its_first_step(c_fmu, mark, phase, act, words):
    call = f"{phase.lower()}_initialization"
    with pytest.raises(StartError, match="bad: .*" + words.format(call=call)):
        run_isolated(foreign_system(c_fmu, act, phase), timeout=1.0)
    assert left_over(mark) == []


@pytest.mark.parametrize("phase", ["TERMINATE", "FREE"])
@pytest.mark.parametrize("act", ["CRASHES", "HANGS"])
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
    table, experiment = Table(), Experiment(0.5, STEP)
    steps = chosen(loop, experiment, isolation)
    simulate(planned(foreign_system(c_fmu, act), experiment), [table], isolation, steps)
    assert table.failure == f"stopped at t = 0.12 s: bad.y is {value}"
    assert rows_until(table, 0.1)
    assert np.isfinite(table.rows).all()
    with pytest.raises(StartError, match=f"stopped at t = 0 s: bad.y is {value}"):
        simulate(planned(foreign_system(c_fmu, act, "ENTER"), Experiment(0.5, STEP)), (), isolation)


def test_a_flood_of_output_and_messages_is_kept_within_bounds(c_fmu, capfd):
    table = run_isolated(foreign_system(c_fmu, "WRITES", at=0.46))
    assert table.failure is None
    shown = capfd.readouterr().err
    assert "auv-fmu: bad: writes more than is shown" in shown
    assert len(shown) < 100_000
    table = run_isolated(foreign_system(c_fmu, "LOGS", at=0.46))
    assert table.failure is None
    assert len(table.ending.messages) == 101
    assert table.ending.messages[0] == "bad: 0: " + 500 * "0"


def test_a_python_slave_that_raises(raising: System, mark: str):
    table = run_isolated(raising)
    assert table.failure is not None
    assert "first: Fatal py exception encountered: [doStep]" in table.failure
    assert "no water left" in table.failure
    assert "\n" not in table.failure
    assert rows_until(table, 0.12)
    assert left_over(mark) == []


def test_nothing_hangs_where_the_supervisor_is_killed(c_fmu: Path, mark: str):
    class Kills(Table):
        def begin(self, header: Header) -> None:
            super().begin(header)
            for process in marked(mark):
                if f"PPid:\t{os.getpid()}\n" in (process / "status").read_text():
                    os.kill(int(process.name), signal.SIGKILL)

    table = Kills()
    simulate(planned(foreign_system(c_fmu), Experiment(50.0, STEP)), [table], Isolation(20.0))
    assert table.failure is not None
    assert "its process was ended by SIGKILL" in table.failure
    assert left_over(mark) == []


def test_runs_in_several_threads(c_fmu: Path):
    tables: list[Table] = []
    threads = [
        threading.Thread(target=lambda: tables.append(run_isolated(foreign_system(c_fmu))))
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [table.failure for table in tables] == [None] * 3
    assert len({table.rows.tobytes() for table in tables}) == 1


@pytest.mark.parametrize("loop", LOOPS)
def test_runs_in_threads_of_one_process_hear_their_own_fmus(c_fmu: Path, loop: str):
    """A run that ends while another one goes on takes no messages with it, nor the process."""
    begun, go_on = threading.Event(), threading.Event()

    class Waits(Table):
        def begin(self, header: Header) -> None:
            super().begin(header)
            begun.set()
            go_on.wait()

    table = Waits()
    plan = planned(foreign_system(c_fmu, "SILENT_ERROR"), Experiment(0.5, STEP))
    talkative = foreign_system(c_fmu, "LOGS", at=0.0)
    steps = chosen(loop, plan.experiment)
    thread = threading.Thread(target=simulate, args=(plan, [table], None, steps))
    thread.start()
    assert begun.wait(60.0)
    assert len(simulate(planned(talkative, Experiment(STEP, STEP)), loop=steps).messages) == 101
    gc.collect()
    go_on.set()
    thread.join()
    assert table.ending.messages == ()
    assert table.failure is not None
    assert "bad: fmi2DoStep failed with status 3" in table.failure


@pytest.fixture(scope="module")
def archives(c_fmu: Path, raising: System, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The systems as SSPs, each in a folder named by what happens in it."""
    folder = tmp_path_factory.mktemp("archives")
    acts = ("FATAL", "HANGS", "CRASHES", *DOES_TO_THE_PROCESS)
    systems = {act: foreign_system(c_fmu, act) for act in acts}
    for name, system in {**systems, "raises": raising}.items():
        (folder / name).mkdir()
        write_ssp(system, folder / name)
    return folder


def command(*arguments: object, folder: Path) -> subprocess.Popen[str]:
    """`auv-fmu` in a process whose temporary files go into a folder."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "orchestrator", *map(str, arguments)],
        env={**os.environ, "TMPDIR": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize(
    ("name", "options", "last_time", "words"),
    [
        ("FATAL", ["--loop", "python"], 0.1, "bad: beyond repair"),
        ("CRASHES", ["--isolate"], 0.1, "bad: its process was ended by SIGSEGV"),
        *slow(
            ("FATAL", ["--loop", "compiled"], 0.1, "bad: beyond repair"),
            ("raises", ["--loop", "python"], 0.12, "first: Fatal py exception encountered: [doSt"),
            ("raises", ["--loop", "compiled"], 0.12, "first: Fatal py exception encountered: [do"),
            ("HANGS", ["--isolate", "--step-timeout", 1], 0.1, "bad: doStep has not ended within"),
        ),
    ],
)
def test_command_line_says_what_happened_and_keeps_the_rows(
    archives, tmp_path, name, options, last_time, words
):
    """Also where nothing more is called after fmi2Fatal: the FMU in C aborts then."""
    [archive] = (archives / name).iterdir()
    out, temporary = tmp_path / "out", tmp_path / "temporary"
    temporary.mkdir()
    process = command(
        "run", archive, "--stop-time", 0.5, "--no-figures", "--out", out, *options,
        folder=temporary,
    )  # fmt: skip
    _, errors = process.communicate()
    assert process.returncode == 1
    assert errors.splitlines()[-1].startswith(
        f"auv-fmu: {archive.stem} stopped at t = {last_time} s: {words}"
    )
    rows = np.vstack(list(read_rows(out / "result.csv")))
    assert rows[-1, 0] == pytest.approx(last_time)
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "form"),
    [
        (["--loop", "python"], "csv"),
        (["--loop", "compiled"], "parquet"),
        (["--isolate"], "csv"),
    ],
)
@pytest.mark.parametrize("act", ["CLOSES_FILES", *slow("FORKS", "MOVES")])
def test_rows_are_kept_whatever_an_fmu_does_to_the_process(
    archives, workplace, mark, act, form, options
):
    """Into a folder that is named from the current one."""
    if form == "parquet":
        pytest.importorskip("pyarrow")
    [archive] = (archives / act).iterdir()
    (workplace / "temporary").mkdir()
    process = command(
        "run", archive, "--stop-time", 0.5, "--no-figures", "--out", "out", "--format", form,
        *options, folder=workplace / "temporary",
    )  # fmt: skip
    _, errors = process.communicate()
    assert len(errors.splitlines()) <= 1
    rows = np.vstack(list(read_rows(Path("out", f"result.{form}"))))
    closed = act == "CLOSES_FILES" and options == ["--isolate"]
    assert len(rows) == (6 if closed else 26)
    assert process.returncode == int(closed)
    assert contents(Path("out")).keys() == {
        f"result.{form}", "metrics.json", "run.json",
    }  # fmt: skip
    assert left_over(mark) == []


@pytest.mark.parametrize("loop", LOOPS)
def test_an_alarm_ends_a_run_with_its_rows(archives, workplace, loop):
    [archive] = (archives / "ALARMS").iterdir()
    process = command(
        "run", archive, "--stop-time", 0.5, "--no-figures", "--loop", loop, "--out", "out",
        folder=workplace,
    )  # fmt: skip
    _, errors = process.communicate()
    assert process.returncode == 1
    last = errors.splitlines()[-1]
    assert last.startswith("auv-fmu: foreign interrupted at t = 0.")
    assert "by SIGALRM, which an FMU may have caused (--isolate" in last
    assert len(np.vstack(list(read_rows(Path("out", "result.csv"))))) >= 6


@pytest.mark.parametrize(
    "act",
    [
        "json.dumps = builtins.print = None",
        "os.fork()",
        *slow(
            "sys.stdout = sys.stderr = None",
            "sys.stdout.close(); sys.stderr.close()",
            "[setattr(numpy, name, None) for name in list(vars(numpy))]",
            "os.chdir('/')",
        ),
    ],
)
def test_what_a_python_slave_does_to_the_interpreter_costs_no_rows(workplace, act):
    """As often as it is told to do so; what is written and said is written and said."""
    system = System("slave", {"a": read_component("a", build_slave(workplace, act))}, ())
    [archive] = write_ssp(system, workplace)
    process = command("run", archive, "--stop-time", 0.5, "--out", "out", folder=workplace)
    shown, errors = process.communicate()
    assert errors == "auv-fmu: no figure: the run has no plant.eta.x\n"
    assert shown.endswith("written to out/\n")
    assert process.returncode == 0
    rows = np.vstack(list(read_rows(Path("out", "result.csv"))))
    assert np.allclose(rows[:, 0], rows[:, 1])
    assert len(rows) == 26


@pytest.mark.parametrize("loop", LOOPS)
def test_an_fmu_finds_the_current_folder_that_it_has_left(workplace, loop):
    """However often this program looks after its files; and the user finds that of before."""
    act = "(current_time < 0.13 and os.chdir('/')) or (os.getcwd() == '/') or 1 / 0"
    system = System("slave", {"a": read_component("a", build_slave(workplace, act))}, ())
    experiment, table = Experiment(0.02 * 2000, STEP), Table()
    assert (
        simulate(planned(system, experiment), [table], loop=chosen(loop, experiment)).failure
        is None
    )
    assert len(table) == 2001
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
    assert len(np.vstack(list(read_rows(tmp_path / "out" / "result.csv")))) == 6


def test_nothing_that_an_isolated_fmu_writes_speaks_to_the_terminal(c_fmu, capfd):
    assert run_isolated(foreign_system(c_fmu, "ESCAPES", at=0.46)).failure is None
    first, second, *_ = capfd.readouterr().err.split("\n")
    assert first == r"\x1b]0;owned\x07 grün"
    assert second.startswith(r"\r\x9b")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_nothing_is_left_of_a_run_that_hangs_and_is_ended(archives, tmp_path, mark, number):
    """Also not by KILL, which the process itself cannot answer."""
    [archive] = (archives / "HANGS").iterdir()
    out, temporary = tmp_path / "out", tmp_path / "temporary"
    temporary.mkdir()
    process = command(
        "run", archive, "--stop-time", 0.5, "--no-figures", "--out", out, "--isolate",
        folder=temporary,
    )  # fmt: skip
    assert process.stderr is not None
    assert process.stderr.readline() == "hangs\n"
    os.kill(process.pid, number)
    _, errors = process.communicate()
    if number == signal.SIGINT:
        assert process.returncode == 1
        assert errors.splitlines()[-1] == "auv-fmu: foreign interrupted at t = 0.1 s"
        assert np.vstack(list(read_rows(out / "result.csv")))[-1, 0] == pytest.approx(0.1)
    assert left_over(mark) == []
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize("loop", LOOPS)
def test_an_fmu_that_ended_fatally_is_loaded_anew(archives: Path, loop: str):
    """The C library remembers, as any may, that it must not be called."""
    [archive] = (archives / "FATAL").iterdir()
    code = (
        "from orchestrator import simulate\n"
        f"for parameters in ({{}}, {{'bad.at': 0.2}}, {{'bad.act': 0}}):\n"
        f"    print(simulate({str(archive)!r}, parameters, stop_time=0.5, loop={loop!r}).failure)\n"
    )
    process = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False
    )
    assert process.stdout.splitlines() == [
        "stopped at t = 0.1 s: bad: beyond repair",
        "stopped at t = 0.2 s: bad: beyond repair",
        "None",
    ], process.stderr


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
