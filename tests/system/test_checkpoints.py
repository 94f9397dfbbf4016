"""Runs that are killed and resumed write the same files as runs without interruption."""

from __future__ import annotations

import json
import os
import signal
from itertools import count
from pathlib import Path
from shutil import copytree

import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.cosim import Checkpoints, Ending, Run, System, checkpoint
from orchestrator.runs.bundle import current_fmus
from support import others, typed
from support.machine import contents, ended, eventually, forked, killed_at, start
from support.texts import mentions
from support.tiers import slow

pytestmark = pytest.mark.usefixtures("workplace")

#: Contains time, duration and command, which differ between runs.
_RECORD = "run.json"


@pytest.fixture(scope="module", autouse=True)
def fmus() -> None:
    current_fmus()


def run(*arguments: str, out: str) -> int:
    return main(["run", *arguments, "--out", out])


def result(folder: str) -> dict[str, bytes]:
    """All files of a result except the records."""
    files = contents(Path(folder))
    return {name: files[name] for name in files if Path(name).name != _RECORD}


def killed_after(checkpoints: int, *arguments: str, out: str) -> None:
    """Run, and be killed when so many checkpoints have been written."""

    def doomed() -> None:
        written, left = Checkpoints._write, [checkpoints]

        def counted(self: Checkpoints, run: Run) -> None:
            written(self, run)
            left[0] -= 1
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)

        Checkpoints._write = counted
        run(*arguments, out=out)

    assert ended(forked(doomed)) == -signal.SIGKILL


def states(out: str) -> dict[str, object]:
    """Content of a checkpoint, empty until there is one."""
    path = Path(out, "checkpoint/state.json")
    return json.loads(path.read_text()) if path.exists() else {}


CHECKPOINTS = ["--checkpoint-every", "0.3"]

LEFT = ["fig4", "--stop-time", "1", "--no-figures"]


@pytest.fixture(scope="module")
def one_left(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of a run that was killed after its first checkpoint."""
    folder = tmp_path_factory.mktemp("left")
    killed_after(1, *LEFT, *CHECKPOINTS, out=str(folder))
    return folder


@pytest.fixture
def left(one_left: Path) -> None:
    copytree(one_left, "r")


@pytest.mark.parametrize(
    ("options", "then"),
    [
        (["--loop", "python", "--interval", "0.1"], ["--isolate"]),
        (["--kind", "native", "--loop", "compiled", "--format", "parquet"], []),
    ],
    ids=["csv", "parquet"],
)
def test_a_run_that_is_killed_and_resumed_is_one_that_was_not(options, then):
    """It is killed after its second checkpoint, and again two checkpoints later."""
    if "parquet" in options:
        pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    arguments = ["fig4", "--stop-time", "2", "--no-figures", *options]
    assert run(*arguments, out="whole") == 0
    killed_after(2, *arguments, *CHECKPOINTS, out="killed")
    killed_after(2, *arguments, "--resume", out="killed")
    assert run(*arguments, *then, "--loop", "auto", "--resume", out="killed") == 0
    assert result("killed") == result("whole")
    record = json.loads(Path("killed", _RECORD).read_text())
    assert record["resumed_at"] == pytest.approx(1.2)


EVENTS = """
stop_time = 2.0

[steps]
disturbance = 0.04
planner = 0.14

[inputs]
file = "inputs.csv"

[wires]
"plant.tau_w" = false

[[events]]
at = 0.25
for = 0.6
bias = { "plant.y.x" = 0.01 }

[[events]]
when = "controller.tau.u > -17.5"
repeat = true
for = 0.2
set = { "plant.current.y" = 0.3 }

[[events]]
at = 1.0
for = 0.7
drop = "plant.nu_r"

[[events]]
at = 1.1
for = 0.5
override = { "plant.tau_w.v" = 5.0 }

[[events]]
at = 1.5
reset = "controller"
"""


@pytest.mark.parametrize("options", [["--loop", "python"], ["--order", "jacobi", "--isolate"]])
def test_a_run_in_which_things_happen(options):
    """Killed while some events last, others wait, and slow components hold inputs."""
    Path("inputs.csv").write_text(
        "time,plant.tau_w.u,plant.tau_w.v\n" + "".join(f"{t},{t},{-t}\n" for t in range(4))
    )
    Path("events.toml").write_text(EVENTS)
    arguments = ["events.toml", "--no-figures", *options]
    assert run(*arguments, out="whole") == 0
    plain = [option for option in arguments if option != "--isolate"]
    killed_after(2, *plain, *CHECKPOINTS, out="killed")
    killed_after(2, *plain, "--resume", out="killed")
    assert run(*arguments, "--resume", out="killed") == 0
    assert result("killed") == result("whole")
    whole, killed = (json.loads(Path(out, _RECORD).read_text()) for out in ("whole", "killed"))
    assert len(whole["events"]) > 6
    assert killed["events"] == whole["events"]


def test_a_run_with_a_companion_and_figures(capsys):
    """Killed in the first run, and in its companion."""
    arguments = ["fig5", "--stop-time", "1"]
    assert run(*arguments, out="whole") == 0
    killed_after(2, *arguments, *CHECKPOINTS, out="killed")
    killed_after(3, *arguments, "--resume", out="killed")
    capsys.readouterr()
    assert run(*arguments, "--resume", out="killed") == 0
    assert capsys.readouterr().err.splitlines() == [
        "auv-fmu: fig5: continues at t = 0.9 s",
        "auv-fmu: fig5-pd: continues at t = 0.6 s",
    ]
    assert result("killed") == result("whole")


@pytest.mark.slow
def test_killed_before_any_call_that_changes_the_disk():
    """Killed before every fifth call."""
    arguments = ["fig4", "--no-figures", "--stop-time", "0.16", "--checkpoint-every", "0.08"]
    assert run(*arguments, out="whole") == 0
    for n in count(0, 5):
        out = f"killed{n}"
        if not killed_at(n, lambda out=out: run(*arguments, out=out)):
            break
        assert run(*arguments, "--resume", out=out) == 0
        assert result(out) == result("whole"), n
    assert n > 20


@pytest.mark.slow
def test_killed_at_any_time_by_the_kernel():
    """It also continues with another loop and without isolation."""
    arguments = ["fig4", "--stop-time", "5", "--no-figures", *CHECKPOINTS]
    assert run(*arguments, out="whole") == 0
    process = start("run", *arguments, "--isolate", "--out", "killed")
    assert eventually(lambda: states("killed").get("row"))
    process.kill()
    process.communicate()
    assert run(*arguments, "--resume", "--loop", "compiled", out="killed") == 0
    assert result("killed") == result("whole")


def test_killed_before_a_byte_of_the_rows_is_on_the_disk():
    def doomed() -> None:
        def opened(path: Path, *_: object) -> None:
            path.touch()
            os.kill(os.getpid(), signal.SIGKILL)

        checkpoint.RowLog = opened
        run(*LEFT, *CHECKPOINTS, out="killed")

    assert ended(forked(doomed)) == -signal.SIGKILL
    assert run(*LEFT, *CHECKPOINTS, "--resume", out="killed") == 0
    assert run(*LEFT, out="whole") == 0
    assert result("killed") == result("whole")


@pytest.mark.parametrize("loop", ["compiled", *slow("python")])
def test_a_signal_leaves_the_rows_and_the_checkpoint(loop, capsys):
    arguments = ["fig4", "--no-figures", "--stop-time", "3", *CHECKPOINTS, "--loop", loop]
    assert run(*arguments, out="whole") == 0
    process = start("run", *arguments, "--real-time", "1", "--out", "stopped")
    assert eventually(lambda: states("stopped").get("row"))
    process.send_signal(signal.SIGINT)
    lines = process.communicate()[1].splitlines()
    assert process.returncode == 1
    assert lines[-2].endswith(", from stopped/checkpoint")
    assert "interrupted at t = " in lines[-1]
    assert run(*arguments, "--resume", out="stopped") == 0
    assert result("stopped") == result("whole")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--set", "plant.m44=26"], "plant.m44 differ"),
        (["--stop-time", "3", "--order", "jacobi"], "order, stop_time differ"),
        (["--kind", "python"], "controller, disturbance, planner"),
    ],
)
def test_another_run_is_refused(left, capsys, change, words):
    before = contents(Path("r/checkpoint"))
    assert run(*LEFT, *change, "--resume", out="r") == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("auv-fmu: r/checkpoint belongs to another run: ")
    assert mentions(line, words)
    assert contents(Path("r/checkpoint")) == before


WITH_STATES = (
    'canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true" '
    'canSerializeFMUstate="true"'
)


def stopped(system: System) -> None:
    """Run a system in a process that is killed when it has made its last step."""

    def doomed() -> None:
        def kill(self: Checkpoints, ending: Ending) -> None:
            self._row_log.to_disk()
            os.kill(os.getpid(), signal.SIGKILL)

        Checkpoints.end = kill
        simulate(system, stop_time=2.0, step=0.1, checkpoint="kept", checkpoint_every=0.6)

    assert ended(forked(doomed)) == -signal.SIGKILL


@pytest.mark.parametrize("isolate", [False, True])
def test_texts_keep_their_numbers(tmp_path, isolate):
    """Each of two FMUs has a new text in every step, and takes the other's."""
    fmu = others.build(tmp_path, "SPEAKS", WITH_STATES)
    system = others.system_of(fmu, "ab", {"a.said": "b.heard", "b.said": "a.heard"})
    stopped(system)
    resumed = simulate(
        system, stop_time=2.0, step=0.1, checkpoint="kept", resume=True, isolate=isolate
    )
    assert resumed.resumed_at == pytest.approx(1.8)
    whole = simulate(system, stop_time=2.0, step=0.1)
    assert resumed["a.heard"][-1].startswith("a20 b19 a18 ")
    assert resumed["a.heard"].tolist() == whole["a.heard"].tolist()
    assert resumed.rows.tobytes() == whole.rows.tobytes()
    assert resumed.ending.messages == ()


def test_an_fmu_that_does_not_restore_its_whole_state_is_reported(tmp_path):
    """Its own process has come two steps beyond the checkpoint."""
    system = others.system_of(others.build(tmp_path, "FORGETS", WITH_STATES))
    stopped(system)
    resumed = simulate(system, stop_time=2.0, step=0.1, checkpoint="kept", resume=True)
    [message] = resumed.ending.messages
    assert mentions(message, "a.heard 1.9 s resumed")
    assert len(resumed) == 21


def test_an_interval_longer_than_any_run():
    arguments = ["fig4", "--stop-time", "0.1", "--no-figures", "--checkpoint-every", "1e300"]
    assert run(*arguments, out="r") == 0
    assert not Path("r/checkpoint").exists()


def test_from_python(left):
    whole = simulate("fig4", stop_time=1.0)
    resumed = simulate("fig4", stop_time=1.0, checkpoint="r/checkpoint", resume=True)
    assert resumed.rows.tobytes() == whole.rows.tobytes()
    assert (whole.resumed_at, resumed.resumed_at) == (None, 0.3)
    assert not Path("r/checkpoint").exists()
    with pytest.raises(ValueError, match="nothing to resume in r/checkpoint"):
        simulate("fig4", checkpoint="r/checkpoint", resume=True)
    assert not Path("r/checkpoint").exists()
    with pytest.raises(ValueError, match="checkpoints need checkpoint="):
        simulate("fig4", checkpoint_every=1.0)


@pytest.mark.parametrize("loop", ["python", "compiled"])
def test_an_fmu_of_fmi_3_continues_with_an_integer_beyond_doubles(loop):
    begin = 2**53 + 1
    arguments = [str(typed.build(Path())), "--stop-time", "2", "--step", "0.125", "--loop", loop]
    arguments += ["--set", f"typed.counts_from={begin}", "--no-figures"]
    assert run(*arguments, out="whole") == 0
    killed_after(2, *arguments, *CHECKPOINTS, out="killed")
    assert run(*arguments, "--resume", out="killed") == 0
    assert result("killed") == result("whole")
    names, *lines = Path("killed/result.csv").read_text().splitlines()
    place = names.split(",").index("typed.counter")
    assert [int(line.split(",")[place]) for line in lines] == [begin + k for k in range(17)]
