"""Cost of events in the compiled loop: none, one at a time, and one that waits for its condition.

    python benchmarks/events.py [STEPS]

Rounds are alternated; times are processor times, with the start of a run.
"""

from __future__ import annotations

import sys
from statistics import median
from time import process_time

from orchestrator import simulate

STEP, ROUNDS = 0.02, 7

CASES = {
    "no events": [],
    "one at a time": [{"at": 1.0, "set": {"controller.eps_t": 1.0}}],
    "one that waits": [{"when": "plant.eta.z > 1e6", "stop": True}],
}


def cost(events: list[dict[str, object]], steps: int) -> float:
    """Time of a step [s]."""
    begin = process_time()
    simulate("fig4", stop_time=steps * STEP, kind="native", loop="compiled", events=events)
    return (process_time() - begin) / steps


def main(steps: int) -> None:
    """Print the medians."""
    cost([], steps)
    rounds = [{name: cost(events, steps) for name, events in CASES.items()} for _ in range(ROUNDS)]
    print(f"medians of {ROUNDS} rounds of {steps} steps, compiled loop, native kind")
    for name in CASES:
        print(f"{name:16} {1e6 * median(times[name] for times in rounds):6.2f} us a step")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50_000)
