"""Runs made by real schedulers and their workers, some of which die."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path

import pytest

from support.toy_engine import Toy, expected, many, numbers_and_squares, run

pytest.importorskip("distributed", reason="needs the extra `cluster`")

from dask import config

from orchestrator.machine.errors import InputError
from orchestrator.studies.sweep import making_runs

TESTS = Path(__file__).parents[3]

#: Less than the minute that a client waits that could not connect [s].
PATIENCE = 45.0


def gives_up_after(seconds):
    """Timeout of connections to a scheduler [s]."""
    return config.set({"distributed.comm.timeouts.connect": seconds})


@contextmanager
def started(*arguments):
    """A process of Dask with only the packages of this process, as on another machine."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def scheduler(tmp_path):
    """A scheduler's address and process."""
    file = tmp_path / "scheduler.json"
    local = ("--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0")
    with started("scheduler", *local, "--scheduler-file", file) as process:
        while not (file.exists() and file.stat().st_size):
            assert process.poll() is None
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], process


def worker(address, folder):
    options = ("--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
    return started("worker", address, *options, "--local-directory", folder)


@pytest.mark.slow
def test_a_scheduler_s_workers_come_and_go_while_a_study_is_under_way(scheduler, tmp_path):
    address, _ = scheduler
    runs = [run(number) for number in range(100)]
    with worker(address, tmp_path) as lost, ExitStack() as stack:
        blocks = stack.enter_context(making_runs(Toy(0.05), many(runs), scheduler=address))
        first = next(blocks)
        lost.kill()
        stack.enter_context(worker(address, tmp_path))
        rest = list(blocks)
    assert numbers_and_squares([first, *rest]) == expected(runs)
    made_by = {made.indices["process"] for block in rest for made in block}
    assert made_by - {lost.pid}


@pytest.mark.slow
def test_a_scheduler_that_ends_is_reported(scheduler, tmp_path):
    address, process = scheduler
    with (
        gives_up_after(5.0),
        worker(address, tmp_path),
        making_runs(Toy(0.05), many(map(run, count())), scheduler=address) as blocks,
    ):
        next(blocks)
        process.kill()
        with pytest.raises(InputError, match=r"gone.*start the study again"):
            list(blocks)


@pytest.mark.parametrize("scheduler", ["tcp://127.0.0.1:1", "nowhere"])
def test_no_scheduler_is_one_line(scheduler):
    with (
        gives_up_after(0.5),
        pytest.raises(InputError, match=f"^no scheduler answers at {re.escape(scheduler)}"),
        making_runs(Toy(), [], scheduler=scheduler),
    ):
        pass


@pytest.mark.slow
def test_a_wrong_address_is_refused_at_once():
    """With the usual timeout: each address is refused at once, and the process ends."""
    addresses = [
        "", "localhost", "tcp://", "tcp://:1", "tcp://a b:1", "tcp://a/b:1", "tcp://[::1",
        "tcp://127.0.0.1:x", "tcp://127.0.0.1:0", "tcp://127.0.0.1:99999", "foo://a:1", "a://b://c",
        "inproc://a", "tls://127.0.0.1:1", "wss://127.0.0.1:1",
    ]  # fmt: skip
    code = (
        "from orchestrator.machine.errors import InputError\n"
        "from orchestrator.studies.sweep import making_runs\n"
        "from support.toy_engine import Toy\n"
        f"for address in {addresses}:\n"
        "    try:\n"
        "        with making_runs(Toy(), [], scheduler=address): pass\n"
        "    except InputError as error: print(error)\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(TESTS)}, capture_output=True, text=True,
        timeout=PATIENCE, check=True,
    )  # fmt: skip
    beginnings = [line.split(": ")[0] for line in process.stdout.splitlines()]
    assert beginnings == [
        f"no scheduler answers at {address or repr(address)}" for address in addresses
    ]
    assert process.stderr == ""


def test_a_server_that_never_answers_is_refused():
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with (
            gives_up_after(0.5),
            pytest.raises(InputError, match=r"^no scheduler answers"),
            making_runs(Toy(), [], scheduler=address),
        ):
            pass
