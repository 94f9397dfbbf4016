"""Long runs of the fuzzers: `PYTHONPATH=tests python -m fuzz NAME --runs 1000`.

Each finding is printed with its seed; `--seed SEED --runs 1` repeats it.
"""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from multiprocessing import Pool

#: Modules with a function `findings` of a seed.
FUZZERS = {
    "components": "fuzz.components",
    "files": "fuzz.files",
    "systems": "fuzz.systems",
    "random_systems": "random_systems.comparison",
}


def _findings(name: str, seed: int) -> tuple[int, list[str]]:
    return seed, [*import_module(FUZZERS[name]).findings(seed)]


def main() -> int:
    """Run a fuzzer; 1: it has found something."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("name", choices=FUZZERS)
    parser.add_argument("--runs", type=int, default=100, help="seeds (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--workers", type=int, default=1, help="processes (default: %(default)s)")
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.runs)
    count = 0
    with Pool(options.workers) as pool:
        for seed, found in pool.starmap(_findings, [(options.name, seed) for seed in seeds], 1):
            count += len(found)
            for line in found:
                print(f"seed {seed}: {line:.1000}", flush=True)
    print(f"{options.runs} seeds, {count} findings")
    return min(count, 1)


if __name__ == "__main__":
    sys.exit(main())
