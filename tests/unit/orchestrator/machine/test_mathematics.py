"""Mathematics on pages: LaTeX between dollar signs and in fences, and nothing else."""

import re

import pytest
from lxml import html
from markdown_it import MarkdownIt

from orchestrator.machine.errors import InputError
from orchestrator.machine.mathematics import typeset


def page(text):
    return html.fromstring(typeset(f"<main>{MarkdownIt().render(text)}</main>"))


def test_code_between_dollar_signs_is_mathematics_and_other_code_is_not():
    [paragraph] = page(r"So $`a_1 < \hat{b}`$, but `$c$` costs $5.")
    assert [part.tag for part in paragraph] == ["math", "code"]
    symbols = [symbol.text for symbol in paragraph.iter("mi", "mn")]
    assert symbols == ["a", "1", "b"] and paragraph.find(".//mover/mi").text == "b"
    assert paragraph[0].tail == ", but " and paragraph[1].text == "$c$"


@pytest.mark.parametrize("form", ["{}", '<pre class="language-math"><code>{}</code></pre>'])
def test_a_fence_of_mathematics_is_displayed_by_lines(form):
    latex = r"\begin{aligned} a &= b && \text{(1)} \\ c &\ge d \end{aligned}"
    text = f"```math\n{latex}\n```" if form == "{}" else form.format(latex.replace("&", "&amp;"))
    [box] = page(text)
    assert [row.text_content() for row in box.iter("mtr")] == ["a=b(1)", "c≥d"]
    assert box[0].get("display") == "block"


def test_a_fence_of_another_language_is_code():
    [code] = page("```text\n$a$\n```")
    assert code.tag == "pre" and code.text_content() == "$a$\n"


def test_text_that_is_not_latex_is_refused_in_one_line():
    with pytest.raises(InputError, match=re.escape(r"not LaTeX: \alhpa + 1: ")) as refused:
        page("$`\\alhpa +\n1`$")
    assert "\n" not in str(refused.value)
