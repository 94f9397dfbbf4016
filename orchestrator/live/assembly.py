"""One page in which a loop runs: script, modules and data in one file that needs no other.

Script and style are bundled by esbuild, which npm installs, and cached like the module.
"""

from __future__ import annotations

import gzip
import html
import json
import re
import shutil
import subprocess
from base64 import b64encode
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

from fmus.discovery import licences
from fmus.kinds import NATIVE
from orchestrator.live.module import LICENCES as MODULE_LICENCES
from orchestrator.live.module import MODULE, live_module
from orchestrator.live.presets import page_data
from orchestrator.machine.cache import made_once
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError, last_line, reason

#: Category in the cache.
CATEGORY = "live-script"

#: The page's script and style, the engine for Node.js, and the licences of packages in them.
SCRIPT, STYLE, ENGINE, LICENCES = FILES = "page.js", "page.css", "engine.mjs", "licences.txt"

WEB = Path(__file__).with_name("web")

#: The page, with `{{NAME}}` in the place of each part.
_PAGE = WEB / "page.html"

#: Sources that decide the bundle.
_SOURCES = ("package.json", "package-lock.json", ".npmrc", "build.mjs", "src")

#: Options of `npm ci`. The packages bring programs for each machine: none needs a script. Without a
#: network, npm's own two retries would take more than a minute.
_OPTIONS = ("--omit=dev", "--ignore-scripts", "--prefer-offline", "--fetch-retries=1")

#: A line in which npm, esbuild or Node.js says what is wrong, not only that something is.
_COMPLAINT = re.compile(
    r"npm (?:error|ERR!) (?!code|syscall|errno|engine|notsup Not)\S|.*\bERROR\b|Error: "
)

#: How long npm or esbuild may take [s].
_LIMIT = 600.0


def live_page(opened: str, hear: Callable[[str], None] = lambda line: None) -> str:
    """The page.

    Args:
        opened: the scenario that it shows first.
        hear: called with a line before a part is made, which may take minutes.

    Raises:
        InputError: there is no such scenario, the page cannot run it, or a part cannot be made.

    """
    data, programs = page_data(opened)
    parts = {name: path.read_text(encoding="utf-8") for name, path in live_script(hear).items()}
    modules = [live_module(one.sources, hear) for one in programs]
    linked = modules[0][MODULE_LICENCES].read_text(encoding="utf-8")
    titles = {one["name"]: one["title"] for one in data["presets"]}
    fields = {
        "title": html.escape(titles[data["opened"]]),
        "style": parts[STYLE],
        "style-hash": hash_source(parts[STYLE]),
        "script": parts[SCRIPT],
        "script-hash": hash_source(parts[SCRIPT]),
        "licences": html.escape("\n\n".join((licences(NATIVE), linked, parts[LICENCES]))),
        "data": packed(json.dumps(data, separators=(",", ":"), allow_nan=False).encode()),
        "modules": " ".join(packed(module[MODULE].read_bytes()) for module in modules),
    }
    before, *rest = _PAGE.read_text(encoding="utf-8").split("{{")
    return before + "".join(
        fields[name] + text for name, _, text in (part.partition("}}") for part in rest)
    )


def hash_source(text: str) -> str:
    """What a content security policy allows an element of the page by: the digest of its text."""
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"


def packed(content: bytes) -> str:
    """Bytes in the form that the page unpacks: gzip in base64, without a date."""
    return b64encode(gzip.compress(content, mtime=0)).decode()


def live_script(hear: Callable[[str], None] = lambda line: None) -> dict[str, Path]:
    """The files by their names, bundled unless they are in the cache.

    Args:
        hear: called with a line before they are bundled.

    Raises:
        InputError: they cannot be bundled.

    """
    try:
        return made_once(CATEGORY, key_of(), lambda: bundled(hear))
    except OSError as error:
        raise InputError(f"the script of the live page cannot be built: {reason(error)}") from error


def key_of() -> str:
    """Key in the cache: digest of the sources."""
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
    """The contents of the files by their names, bundled now.

    Args:
        hear: called with a line before they are bundled.

    Raises:
        InputError: npm is not installed, or it or esbuild fails.
        OSError: a file cannot be written, or a program not started.

    """
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        raise InputError(
            "the live page needs Node.js 20 or later with npm to bundle its script: "
            "https://nodejs.org"
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
        said = (complaints or [last_line(process.stderr)])[0]
        raise InputError(
            f"the script of the live page cannot be built: {' '.join(command[:2])}: {said}"
        )
