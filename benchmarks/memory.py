"""Memory of a process that runs many simulations: `python benchmarks/memory.py [N]`.

Runs the first second of Fig. 4 N times, 10,000 if no number is given, and prints the resident
memory of the process after 1,000 runs and after every further thousand.
"""

from __future__ import annotations

import argparse
import time

from measuring import resident

from orchestrator import simulate

_EVERY = 1000


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, nargs="?", default=10 * _EVERY, help="default: %(default)s")
    n = parser.parse_args().n
    start = time.perf_counter()
    print(f"{'runs':>6} {'resident [MB]':>14}")
    for i in range(1, n + 1):
        simulate("fig4", stop_time=1.0)
        if i % _EVERY == 0 or i == n:
            print(f"{i:6} {resident():14.1f}", flush=True)
    print(f"{1e3 * (time.perf_counter() - start) / n:.1f} ms a run")


if __name__ == "__main__":
    main()
