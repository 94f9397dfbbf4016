"""Compare tables of two systems, to 1e-9: compare_tables.py THEIRS OURS NAME..."""

import sys
from pathlib import Path

import numpy as np
from pyarrow import Table, csv, parquet

#: Largest difference that C libraries of two systems may cause within 5,000 steps.
TOLERANCE = 1e-9


def read(path: Path) -> Table:
    """A table, of CSV or Parquet."""
    return parquet.read_table(path) if path.suffix == ".parquet" else csv.read_csv(path)


def deviation(theirs: Path, ours: Path) -> float:
    """The largest difference of numbers; infinite if anything else differs."""
    a, b = read(theirs), read(ours)
    if a.column_names != b.column_names or a.num_rows != b.num_rows:
        return np.inf
    largest = 0.0
    for name in a.column_names:
        x, y = a[name].to_numpy(), b[name].to_numpy()
        if x.dtype.kind in "fi":
            largest = max(largest, np.inf if (np.isnan(x) != np.isnan(y)).any() else 0.0)
            largest = max(largest, float(np.nanmax(np.abs(x - y), initial=0.0)))
        elif a[name] != b[name]:
            return np.inf
    return largest


def main() -> int:
    """Print a line for each table; 1 if one differs by more than rounding."""
    theirs, ours = map(Path, sys.argv[1:3])
    found = {name: deviation(theirs / name, ours / name) for name in sys.argv[3:]}
    for name, value in found.items():
        print(f"{name:40} deviation {value:.2e}{'' if value <= TOLERANCE else '  TOO LARGE'}")
    return int(max(found.values()) > TOLERANCE)


if __name__ == "__main__":
    sys.exit(main())
