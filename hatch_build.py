"""What a wheel carries besides the sources: FMUs and libraries of `tools/ready_wheel.py`."""

from __future__ import annotations

import os
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

#: The variable that names their folder.
READY = "AUV_FMU_READY"


class ReadyFiles(BuildHookInterface[Any]):
    """Takes the files into the wheel; without them, they are made where they are needed."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Name the folder, if there is one."""
        if version == "standard" and (folder := os.environ.get(READY)):
            build_data["force_include"][folder] = "orchestrator/ready"
