"""Self-contained pages in one file: script, style, data, and modules or rows.

Script and style are bundled by esbuild, which npm installs, and cached like the modules.
"""

from __future__ import annotations

import gzip
import html
import json
import re
import shutil
import subprocess
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any

from auv_fmu.language.quantities import POSITION, TAU, THETA, VELOCITY
from fmus.discovery import licences
from fmus.kinds import NATIVE
from orchestrator.figures.style import FIN, RINGS, printed_unit
from orchestrator.machine.cache import made_once
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.vehicle.indices import SMALLEST_DISTANCE, SMALLEST_DISTANCE_LABEL, metrics
from orchestrator.vehicle.signals import Loop

Plain = dict[str, Any]

#: Category in the cache.
CATEGORY = "live-script"

#: Scripts by the kind of page: of a loop that runs, and of stored runs.
SCRIPTS = {"live": "live.js", "view": "view.js"}

#: Style of all pages, engine for Node.js, and licences of the packages in them.
STYLE, ENGINE, LICENCES = "page.css", "engine.mjs", "licences.txt"
FILES = (*SCRIPTS.values(), STYLE, ENGINE, LICENCES)

WEB = Path(__file__).with_name("web")

#: Template of the page, with `{{NAME}}` for each part. Parts for one kind of page are between
#: `<!--KIND-->` and `<!--/KIND-->`.
_PAGE = WEB / "page.html"

#: Sources of the bundle.
_SOURCES = ("package.json", "package-lock.json", ".npmrc", "build.mjs", "src")

#: Options of `npm ci`. No package needs its install script, as each has a program per machine.
#: Without a network, npm's default of two retries would take more than a minute.
_OPTIONS = ("--omit=dev", "--ignore-scripts", "--prefer-offline", "--fetch-retries=1")

#: Groups of signals that have charts, with the units of their members.
_CHARTS = {"e": POSITION, "tau": TAU, "dy": VELOCITY, "theta_hat": THETA}

#: A line with the reason of an error of npm, esbuild or Node.js.
_COMPLAINT = re.compile(
    r"npm (?:error|ERR!) (?!code|syscall|errno|engine|notsup Not)\S|.*\bERROR\b|Error: "
)

#: Time limit of npm and of esbuild [s].
_LIMIT = 600.0


def assemble(
    kind: str,
    data: Mapping[str, Any],
    binary: Sequence[bytes],
    fields: Mapping[str, str],
    hear: Callable[[str], None] = lambda line: None,
) -> str:
    """Put a page together.

    Args:
        kind: key of :data:`SCRIPTS`.
        data: data for the script, in addition to that of all pages.
        binary: modules or rows.
        fields: texts of the page by name, not escaped.
        hear: called with a line before a part is made, which may take minutes.

    Raises:
        InputError: a part cannot be made.

    """
    parts = {name: path.read_text(encoding="utf-8") for name, path in live_script(hear).items()}
    script = parts[SCRIPTS[kind]]
    content = json.dumps({**_common(), **data}, separators=(",", ":"), allow_nan=False)
    texts = (licences(NATIVE), fields.get("licences"), parts[LICENCES])
    filled = {
        "kind": kind,
        **{name: html.escape(text) for name, text in fields.items()},
        "licences": html.escape("\n\n".join(filter(None, texts))),
        "style": parts[STYLE],
        "style-hash": hash_source(parts[STYLE]),
        "script": script,
        "script-hash": hash_source(script),
        "data": packed(content.encode()),
        "binary": " ".join(map(packed, binary)),
    }
    others = "|".join(SCRIPTS.keys() - {kind})
    page = _PAGE.read_text(encoding="utf-8")
    page = re.sub(rf"<!--({others})-->.*?<!--/\1-->", "", page, flags=re.DOTALL)
    before, *rest = re.sub(rf"<!--/?{kind}-->", "", page).split("{{")
    return before + "".join(
        filled[name] + text for name, _, text in (part.partition("}}") for part in rest)
    )


def _common() -> Plain:
    """Return the data of all pages, with the names in `web/src/types.ts`."""
    indices = [(index.name, index.label, index.meaning, index.units) for index in metrics()]
    meaning = "smallest distance between the centres of mass of any two vehicles"
    indices.append((SMALLEST_DISTANCE, SMALLEST_DISTANCE_LABEL, meaning, {"": "m"}))
    return {
        "units": {group: _printed(units) for group, units in _CHARTS.items()},
        "indices": [
            {"name": name, "label": label, "meaning": meaning, "units": _printed(units)}
            for name, label, meaning, units in indices
        ],
        "hull": {"rings": RINGS, "fin": FIN},
    }


def vehicle_data(loop: Loop) -> dict[str, str]:
    """Return the components of a vehicle by role."""
    return {"name": loop.name, "allocation": "", **asdict(loop)}


def _printed(units: Mapping[Any, str]) -> dict[str, str]:
    return {str(member): printed_unit(unit) for member, unit in units.items()}


def hash_source(text: str) -> str:
    """Return the digest of an element's text, by which a content security policy allows it."""
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"


def packed(content: bytes) -> str:
    """Compress bytes for the page: gzip without a date, in base64."""
    return b64encode(gzip.compress(content, mtime=0)).decode()


def live_script(hear: Callable[[str], None] = lambda line: None) -> dict[str, Path]:
    """Return the paths of the files by name; bundle them unless they are in the cache.

    Args:
        hear: called with a line before they are bundled.

    Raises:
        InputError: they cannot be bundled.

    """
    try:
        return made_once(CATEGORY, key_of(), lambda: bundled(hear))
    except OSError as error:
        raise InputError(f"the script of the page cannot be built: {reason(error)}") from error


def key_of() -> str:
    """Return the key in the cache: digest of the sources."""
    digest = sha256()
    for path in _sources():
        digest.update(f"{path.relative_to(WEB).as_posix()}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _sources() -> list[Path]:
    places = [WEB / name for name in _SOURCES]
    below = (sorted(place.rglob("*")) if place.is_dir() else [place] for place in places)
    return [path for paths in below for path in paths if path.is_file()]


def bundled(hear: Callable[[str], None] = lambda line: None) -> dict[str, bytes]:
    """Bundle the files, and return their contents by name.

    Args:
        hear: called with a line before they are bundled.

    Raises:
        InputError: npm is not installed, or it or esbuild fails.
        OSError: a file cannot be written, or a program cannot be started.

    """
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        raise InputError(
            "the page needs Node.js 20 or later with npm to bundle its script: https://nodejs.org"
        )
    hear("bundling the script of the page with npm (only once): this may take a minute")
    with temporary_folder() as temporary:
        folder = temporary / WEB.name
        for path in _sources():
            target = folder / path.relative_to(WEB)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
        _run(folder, npm, "ci", *_OPTIONS)
        _run(folder, "node", "build.mjs", "build")
        return {name: (folder / "build" / name).read_bytes() for name in FILES}


def _run(folder: Path, *command: str) -> None:
    try:
        process = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace",
            timeout=_LIMIT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise InputError(f"{' '.join(command[:2])} did not finish within {_LIMIT:g} s") from None
    if process.returncode != 0:
        complaints = [line for line in process.stderr.splitlines() if _COMPLAINT.match(line)]
        why = (complaints or [last_line(process.stderr)])[0]
        raise InputError(f"the script of the page cannot be built: {' '.join(command[:2])}: {why}")
