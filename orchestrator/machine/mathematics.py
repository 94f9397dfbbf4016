"""Mathematics of pages as MathML, which browsers draw without scripts or fonts from a network."""

from __future__ import annotations

import re
from html import unescape

try:
    import math_core
except ImportError:  # not every machine can have it
    math_core = None  # type: ignore[assignment]

from orchestrator.machine.errors import InputError

_INLINE = re.compile(r"\$<code>([^<]*)</code>\$")

#: As MarkdownIt and as the site's Markdown write a fence.
_DISPLAYED = re.compile(
    r'<pre(?:><code class="language-math"| class="language-math"><code)>([^<]*)</code></pre>'
)

#: A wide formula scrolls in it, also by keys.
_BOX = '<div class="math" tabindex="0">{}</div>'

_CONVERTER = math_core and math_core.LatexToMathML(fancy_error=False)


def typeset(page: str) -> str:
    """Typeset the LaTeX on a page in HTML.

    In Markdown it is written as GitHub reads it: in code between dollar signs, or displayed in a
    fence whose language is `math`. Where math-core cannot be had it stays LaTeX.

    Raises:
        InputError: some of it is not LaTeX.

    """
    if math_core is None:
        return page
    page = _DISPLAYED.sub(lambda code: _BOX.format(_mathml(code[1], True)), page)
    return _INLINE.sub(lambda code: _mathml(code[1], False), page)


def _mathml(code: str, is_displayed: bool) -> str:
    latex = unescape(code)
    try:
        return _CONVERTER.convert_with_local_state(latex, displaystyle=is_displayed)
    except math_core.LatexError as error:
        raise InputError(f"not LaTeX: {' '.join(latex.split())}: {error}") from None
