"""ROS 2 in tests: a controller in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


def environment() -> dict[str, str]:
    """Variables for nodes that hear no others of this machine."""
    domain = str(1 + os.getpid() % 100)
    return {**os.environ, "ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def run_node(*arguments: str) -> None:
    """Run the node to its end."""
    command = [sys.executable, "-m", "orchestrator.bridges.ros", *arguments]
    subprocess.run(command, env=environment(), check=True, timeout=120)


@contextmanager
def beside(script: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a script in Python meanwhile."""
    process = subprocess.Popen(
        [sys.executable, script, *arguments],
        env=environment(), stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()
