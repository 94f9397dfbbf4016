"""What the built bundle consists of: checksums, and a CycloneDX bill of materials."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from orchestrator.machine.ledger import digest_of

CHECKSUMS, BILL = "SHA256SUMS", "bom.cdx.json"


def checksums(files: Sequence[Path]) -> bytes:
    """Checksums as `sha256sum --check` reads them."""
    return "".join(f"{digest_of(path)}  {path.name}\n" for path in files).encode()


def bill(files: Sequence[Path], contained: Sequence[str]) -> bytes:
    """CycloneDX 1.5: the files of the bundle and the packages whose code they contain.

    Without time and serial number: the same bundle has the same bill.

    Args:
        files: of the bundle.
        contained: the packages, besides ours.

    """
    ours, *others = map(_package, ("auv-fmu", *contained))
    content = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": ours},
        "components": [
            *others,
            *(
                {
                    "type": "file",
                    "name": path.name,
                    "hashes": [{"alg": "SHA-256", "content": digest_of(path)}],
                }
                for path in files
            ),
        ],
        "dependencies": [
            {"ref": ours["bom-ref"], "dependsOn": [package["bom-ref"] for package in others]}
        ],
    }
    return (json.dumps(content, indent=2) + "\n").encode()


def _package(name: str) -> dict[str, Any]:
    reference = f"pkg:pypi/{name}@{version(name)}"
    return {
        "type": "library",
        "bom-ref": reference,
        "name": name,
        "version": version(name),
        "licenses": [{"license": {"id": "MIT"}}],
        "purl": reference,
    }
