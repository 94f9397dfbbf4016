"""Pages of the site in addition to docs/: a hook of `mkdocs build`.

- Pages of the repository's root, under `contributing` and `explanation`, and of the components.
- The notebook as a page, with the output of its cells.
- The live page, or a page with the reason if npm or a compiler is missing.

Links in the sources name files of the repository, so that they also work in a checkout. Here they
become links to the site's pages; a link to a file that is not in the site becomes plain text.
"""

from __future__ import annotations

import logging
import posixpath
import re
from base64 import b64decode
from collections.abc import Callable
from html import escape
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbclient import NotebookClient

from fmus.discovery import components
from orchestrator.live import presets
from orchestrator.machine.errors import InputError
from orchestrator.machine.mathematics import typeset

ROOT = Path(__file__).parents[1]

#: Places in the site of pages from outside docs/; its home is another page than the README.
PAGES = {
    **{
        "/".join((*module.split(".")[:-1], "page.md")): f"reference/components/{name}.md"
        for name, module in components().items()
    },
    "CONTRIBUTING.md": "contributing/README.md",
    "CHANGELOG.md": "contributing/changelog.md",
    "LICENSE": "contributing/licence.md",
    "SECURITY.md": "explanation/security.md",
}

LIVE = "live.html"

#: The name of a node in the graph of words of lunr, and one without mistakes: a letter that is a
#: digit would be part of the number before it.
_MISTAKEN, _MENDED = "e=e+s+o.id}", 'e=e+s+o.id+","}'

#: Weights of pages in the search, by the beginning of their place; the first that fits.
BOOSTS = {
    # These name every guide.
    "index.md": 0.3,
    "how-to/README.md": 0.3,
    "explanation/README.md": 0.3,
    "tutorials/": 2.0,
    "how-to/": 2.0,
    "explanation/kinds.md": 2.0,
    "explanation/component.md": 2.0,
    "contributing/testing.md": 0.5,
    "contributing/": 0.2,
    "explanation/architecture.md": 0.5,
    "reference/fmi-answers.md": 0.5,
    "reference/promises.md": 0.5,
}

#: Pages that need the width of the window, and the parts left out for it.
WIDE = {
    "index.md": ["navigation", "toc"],
    "gallery.md": ["toc"],
    "how-to/README.md": ["navigation"],
}

_LINK = re.compile(r"(?<!!)\[((?:[^][]|\[[^][]*\])*)\]\(([^)#\s]*)(#[^)\s]*)?\)")
_PRESET = re.compile(r"<!-- live: (([\w-]+)\S*) -->")
_ROW, _CODE = re.compile(r"^\|.*$", re.MULTILINE), re.compile(r"`[^`]+`")
_TABLE = re.compile(r"(<table[^>]*>\s*<thead>.*?</thead>)(.*?</table>)", re.DOTALL)
_CELL = re.compile(r"<th\b[^>]*>(.*?)</th>", re.DOTALL)
_LONG_CODE = re.compile(r"(?<=<code>)[^<]{40,}(?=</code>)")
_BREAK = re.compile(r"(?<=[/:,+|_ ])(?=\w)")
_DATA = re.compile(r"<t[dh](?=[ >])")
_DISPLAYED = '<div class="math"'
_ROLE = re.compile(r":(class|data|func|mod):(?=<code>)")

log = logging.getLogger(f"mkdocs.hooks.{__name__}")
_why_not = ""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add pages from outside docs/."""
    for source, place in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        if source == "LICENSE":
            cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
            text = f"# Licence and citation\n\n{text}\n\n## How to cite\n\n```yaml\n{cited}```\n"
        files.append(File.generated(config, place, content=text))
    for notebook in [file for file in files if file.src_uri.endswith(".ipynb")]:
        files.remove(notebook)
        page = page_of(notebook.src_uri)
        text, pictures = run_notebook(Path(str(notebook.abs_src_path)))
        files.append(File.generated(config, page, content=text))
        for name, content in pictures.items():
            place = posixpath.join(posixpath.dirname(page), name)
            files.append(File.generated(config, place, content=content))
    global _why_not
    page, _why_not = live_page()
    files.append(File.generated(config, LIVE, content=page))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links to the site's pages and to the live page."""
    place = page.file.src_uri
    boosts = (n for beginning, n in BOOSTS.items() if place.startswith(beginning))
    page.meta["search"] = {"boost": next(boosts, 1.0)}
    page.meta["hide"] = WIDE.get(place, [])
    markdown = linked(markdown, place, files)
    up = posixpath.relpath(LIVE, posixpath.dirname(place) or ".")
    if _why_not:
        note = f"This site was built without it: {_why_not}."
    else:
        note = f'<iframe class="live" src="{up}" title="The live page"></iframe>'
    markdown = markdown.replace("<!-- the live page -->", note)
    markdown = _ROW.sub(_with_plain_bars, markdown)
    link = "" if _why_not else rf"[Run `\2` live]({up}#preset=\1)"
    return _PRESET.sub(link, markdown)


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Typeset mathematics, remove roles, name columns in cells of tables, let long code break."""
    content = typeset(content).replace(_DISPLAYED, f"{_DISPLAYED} data-search-exclude")
    content = _TABLE.sub(_with_columns, _ROLE.sub("", content))
    return _LONG_CODE.sub(lambda code: _BREAK.sub("<wbr>", code[0]), content)


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Name the search for screen readers, which the theme does not."""
    return output.replace('role="dialog"', 'role="dialog" aria-label="Search"', 1)


def _with_columns(table: re.Match[str]) -> str:
    """Table whose cells name their column, for windows in which each row is a card."""
    head, body = table.groups()
    columns = cycle(re.sub("<[^>]+>", "", cell) for cell in _CELL.findall(head))
    return head + _DATA.sub(lambda cell: f'{cell[0]} data-column="{next(columns)}"', body)


def _with_plain_bars(row: re.Match[str]) -> str:
    """Row of a table without the backslashes that GitHub needs before bars in code."""
    return _CODE.sub(lambda code: code.group().replace(r"\|", "|"), row.group())


def linked(text: str, place: str, files: Files) -> str:
    """Text of a page with the links of the site.

    Args:
        text: in Markdown, with links relative to its source in the repository.
        place: of the page in the site.
        files: of the site.

    """
    [source] = [source for source, page in PAGES.items() if page == place] or [f"docs/{place}"]
    folder = posixpath.dirname(source)
    here = posixpath.dirname(place) or "."

    def found(link: re.Match[str]) -> str:
        label, target, anchor = link.group(1), link.group(2), link.group(3) or ""
        if not target or ":" in target:
            return link.group()
        file = posixpath.normpath(posixpath.join(folder, target))
        inside = "index.md" if file == "README.md" else file.removeprefix("docs/")
        wanted = PAGES.get(file) or page_of(inside)
        if (ROOT / file).is_dir():
            wanted += "/README.md"
        if files.get_file_from_path(wanted):
            return f"[{label}]({posixpath.relpath(wanted, here)}{anchor})"
        if (ROOT / file).exists() and not file.startswith("docs/"):
            return label if label.startswith("`") else f"{label} (`{file}`)"
        return link.group()

    return _outside_code(lambda part: _LINK.sub(found, part), text)


def page_of(name: str) -> str:
    """Page of a file of docs/."""
    return name.removesuffix(".ipynb") + ".md" if name.endswith(".ipynb") else name


def run_notebook(path: Path) -> tuple[str, dict[str, bytes]]:
    """Run a notebook, and return it as a page with all output, and its pictures by name."""
    notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    with TemporaryDirectory() as folder:
        NotebookClient(notebook, resources={"metadata": {"path": folder}}).execute()
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(re.sub(r"\$(\w+)\$", r"`\1`", cell.source))
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            data = output.get("data", {"text/plain": output.get("text", "")})
            if "image/png" in data:
                name = f"{path.stem}-{len(pictures) + 1}.png"
                pictures[name] = b64decode(data["image/png"])
                parts.append(f"![The figure that this code draws]({name})")
            elif "text/html" in data:
                plain = data["text/html"].replace(' border="1" class="dataframe"', "")
                parts.append(f"<div>\n{plain}\n</div>")
            else:
                parts.append(f"```text\n{data['text/plain'].rstrip()}\n```")
    return "\n\n".join(parts), pictures


def live_page() -> tuple[str, str]:
    """Return the live page and "", or a page with the reason why it is missing, and the reason."""
    try:
        return presets.live_page("fig4"), ""
    except InputError as error:
        log.info("no live page: %s", error)
        why = escape(str(error))
        return f"<!doctype html><title>auv-fmu</title><p>{why}", why


def _outside_code(change: Callable[[str], str], text: str) -> str:
    """Change the text outside fenced code."""
    parts = re.split(r"(^```.*?^```$)", text, flags=re.DOTALL | re.MULTILINE)
    return "".join(part if part.startswith("```") else change(part) for part in parts)


def on_post_build(config: MkDocsConfig) -> None:
    """Mend the search, which mistakes words with digits for others.

    Raises:
        PluginError: its worker is another one.

    """
    [worker] = Path(config.site_dir, "assets/javascripts/workers").glob("search.*.js")
    before, mistaken, after = worker.read_text(encoding="utf-8").partition(_MISTAKEN)
    if not mistaken:
        raise PluginError(f"{worker.name}: the search has changed; see whether it is right now")
    worker.write_text(f"{before}{_MENDED}{after}", encoding="utf-8")
