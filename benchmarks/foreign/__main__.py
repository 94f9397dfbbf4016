"""Public FMUs and SSP archives in our master: `python benchmarks/foreign FOLDER`.

Collects public FMUs and SSP archives into FOLDER, runs each of them, compares those that run with
libcosim, ecos and a plain host, and writes tested-fmus.md. FMUs are third-party programs, and run
with your rights. `pip install libcosimpy ecospy tbb` installs the other masters.
"""

from __future__ import annotations

import argparse
import json
import os
import re
from pathlib import Path

from collect import collect, collected
from compare import compared
from page import listed, page

#: The page that is written, with its table beside it.
PAGE = Path(__file__).parents[2] / "docs" / "reference" / "tested-fmus.md"


def main() -> None:
    """Collect, compare and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of the clones, the files and what came of them")
    parser.add_argument("--again", action="store_true", help="without collecting anew")
    parser.add_argument(
        "--only", default="", metavar="PATTERN", help="run what matches; of the rest, what came"
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes at a time")
    options = parser.parse_args()
    items = collected(options.folder) if options.again else collect(options.folder)
    chosen = [item for item in items if re.search(options.only, item.name)]
    kept = options.folder / "compared.json"
    found = json.loads(kept.read_text(encoding="utf-8")) if options.only and kept.exists() else {}
    found |= compared(chosen, options.folder, options.workers)
    kept.write_text(json.dumps(found, indent=1), encoding="utf-8")
    host = Path(__file__).with_name("host.py").read_text(encoding="utf-8")
    known = [
        {**found[item.name], "fmi": item.fmi(options.folder)}
        for item in items
        if item.name in found
    ]
    PAGE.write_text(page(known, len(host.splitlines())), encoding="utf-8")
    PAGE.with_suffix(".csv").write_text(listed(known), encoding="utf-8")


if __name__ == "__main__":
    main()
