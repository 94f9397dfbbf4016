"""A worker that crashes; here, because its process cannot import what stands in a test."""

from __future__ import annotations

import os
from collections.abc import Callable

from fuzz.sequences import Finding, Task


def crashing(*_: object) -> Callable[[Task], list[Finding]]:
    def do(task: Task) -> list[Finding]:
        if 26 in task.seeds:
            if task.log:
                task.log.write_text("fmi2DoStep()")
            os.abort()
        return []

    return do
