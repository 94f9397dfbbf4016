"""Thousands of random systems: `python tests/random_systems --systems 2000 --seed 0`."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from multiprocessing import Pool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from random_systems.comparison import DIFFERS, EQUAL, REFUSED, UNDECIDED, Outcome, outcomes

#: Of outcomes that are not equal, so many are told in words.
_MOST = 40


def _all(seed: int) -> list[Outcome]:
    return list(outcomes(seed))


def main() -> int:
    """Run, and print a table; 1: something differs, or is refused."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", type=int, default=200, metavar="N")
    parser.add_argument("--seed", type=int, default=0, help="of the first system")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    seeds = range(given.seed, given.seed + given.systems)
    counts: Counter[str] = Counter()
    found: list[Outcome] = []
    with Pool(given.workers) as pool:
        for runs in pool.imap(_all, seeds):
            counts.update(run.what for run in runs)
            found += [run for run in runs if run.what != EQUAL]
    for run in found[:_MOST]:
        print(f"seed {run.seed}, {run.how}: {run.what}: {run.why}")
    columns = (EQUAL, DIFFERS, REFUSED, UNDECIDED)
    print(f"{'systems':>9}{'runs':>9}" + "".join(f"{column:>11}" for column in columns))
    numbers = "".join(f"{counts[column]:11,}" for column in columns)
    print(f"{len(seeds):9,}{sum(counts.values()):9,}{numbers}")
    for what in columns[1:]:
        if listed := dict.fromkeys(str(run.seed) for run in found if run.what == what):
            print(f"{what}: seeds {' '.join(listed)}")
    return 1 if counts[DIFFERS] or counts[REFUSED] else 0


if __name__ == "__main__":
    sys.exit(main())
