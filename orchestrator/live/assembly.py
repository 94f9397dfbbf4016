"""One page in which a loop runs: script, module and data in one file that needs no other."""

from __future__ import annotations

import gzip
import html
import json
from base64 import b64encode

from fmus.discovery import licences
from fmus.kinds import NATIVE
from orchestrator.live.module import live_module
from orchestrator.live.presets import page_data
from orchestrator.live.script import LICENCES, SCRIPT, STYLE, WEB, live_script

_PAGE = WEB / "page.html"


def live_page(opened: str) -> str:
    """The page.

    Args:
        opened: the scenario that it shows first.

    Raises:
        InputError: there is no such scenario, the page cannot run it, or what makes its parts is
            not installed.

    """
    data = page_data(opened)
    parts = {name: path.read_text(encoding="utf-8") for name, path in live_script().items()}
    titles = {one["name"]: one["title"] for one in data["presets"]}
    fields = {
        "title": html.escape(titles[data["opened"]]),
        "style": parts[STYLE],
        # What ends the script's element must not occur in it.
        "script": parts[SCRIPT].replace("</script", "<\\/script"),
        "licences": html.escape("\n\n".join((licences(NATIVE), parts[LICENCES]))),
        "data": packed(json.dumps(data, separators=(",", ":"), allow_nan=False).encode()),
        "module": packed(live_module()),
    }
    before, *rest = _PAGE.read_text(encoding="utf-8").split("{{")
    return before + "".join(
        fields[name] + text for name, _, text in (part.partition("}}") for part in rest)
    )


def packed(content: bytes) -> str:
    """Bytes as the page has them: gzip, in base64; the same for the same bytes."""
    return b64encode(gzip.compress(content, mtime=0)).decode()
