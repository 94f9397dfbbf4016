"""One run: scenarios, the wiring of the closed loop, the bundle, result folders.

A scenario becomes a system in `wiring`, is checked in `preparation`, and run by `run`, in memory or
into a folder. A `result` is what comes of it.
"""

from pathlib import Path

#: Scenarios that come with the bundle.
SCENARIOS_FOLDER = Path(__file__).parent / "scenarios"
