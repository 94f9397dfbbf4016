"""The page of `auv-fmu live` in a browser: keys, links, commands, a phone's width, the dark."""

from __future__ import annotations

import csv
import io
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np
import pytest

from orchestrator.commands.main import main
from support.browser import BROWSER, Browser, Tab, browsing

#: Rows of the page and of the native FMUs: different machines add with different roundings.
TOLERANCE = 1e-9

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed"),
    pytest.mark.skipif(which("npm") is None, reason="Node.js is not installed"),
    pytest.mark.skipif(find_spec("ziglang") is None, reason="needs the extra `native`"),
]

SLIDER = "document.querySelector('input[data-names=\"controller.eps_t\"]')"
TABLE = "document.getElementById('indices').innerText"
CSV = "auvfmu.csv()"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of Fig. 4."""
    out = tmp_path_factory.mktemp("live") / "page.html"
    assert main(["live", "fig4", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One browser for all tests."""
    with browsing(tmp_path_factory.mktemp("profile")) as started:
        yield started


@pytest.fixture
def opened(page, browser) -> Iterator[Tab]:
    """A fresh page, with nothing to complain of at the end."""
    tab = opened_at(browser, page.as_uri())
    yield tab
    assert tab.complaints() == []


def opened_at(browser: Browser, address: str) -> Tab:
    """A page whose first run has been made."""
    tab = browser.open(address)
    tab.wait("'auvfmu' in globalThis")
    return tab


def rows(text: str) -> tuple[list[str], np.ndarray]:
    """Columns and numbers of a table."""
    header, *lines = csv.reader(io.StringIO(text))
    return header, np.array(lines, dtype=float)


def test_page_is_one_small_file(page):
    text = page.read_text(encoding="utf-8")
    assert page.stat().st_size < 700_000
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text)
    assert "default-src 'none'" in text


def test_arrow_keys_move_a_slider_and_the_numbers(opened):
    before, table = opened.run(CSV), opened.run(TABLE)
    opened.run(f"{SLIDER}.focus()")
    for _ in range(5):
        opened.press("ArrowRight")
    opened.wait(f"{TABLE} !== {table!r}")
    # One run for all of them: a fifth of the decade from 1 to 10 would be a press further.
    opened.wait("/controller\\.eps_t=/.test(location.hash)")
    value = float(re.search(r"eps_t=([0-9.]+)", opened.run("location.hash"))[1])
    # Four decades in a hundred presses.
    assert value == pytest.approx(10 ** (5 * 4 / 100), rel=5e-3)
    header, changed = rows(opened.run(CSV))
    _, unchanged = rows(before)
    assert np.abs(changed - unchanged)[:, header.index("plant.tau.u")].max() > 0.1


def test_link_opens_the_same_run(opened, browser):
    opened.run('auvfmu.set({preset: "fault-sensor", "controller.eps_t": 4, stop_time: 60})')
    opened.run("document.getElementById('event-list').closest('details').open = true")
    opened.run("document.querySelector('#event-list input').focus()")
    opened.type("20")
    opened.wait("/events\\.1\\.at=20/.test(location.hash)")
    other = opened_at(browser, opened.run("location.href"))
    assert other.run(CSV) == opened.run(CSV)
    assert other.run("document.getElementById('stop-time').value") == "60"
    assert other.complaints() == []


@pytest.mark.parametrize("hidden", ["PD", "proposed"])
def test_command_makes_the_same_rows(opened, tmp_path, hidden):
    """What is copied, typed into a shell, with either controller."""
    values = '"controller.eps_t": 4, "plant.noise.std": 0.002, "plant.noise.seed": 7'
    opened.run(f'auvfmu.set({{preset: "fault-thruster", {values}, stop_time: 30}})')
    opened.run("document.getElementById('event-list').closest('details').open = true")
    opened.run("document.querySelector('#event-list input').focus()")
    opened.type("15")
    opened.wait("/events\\.1\\.at=15/.test(location.hash)")
    opened.run(f"document.querySelector('#loops input[value={hidden}]').click()")
    opened.wait("/hide=/.test(location.hash)")
    opened.run(
        "navigator.clipboard.writeText = async (text) => { globalThis.copied = text; };"
        "URL.createObjectURL = (blob) => { globalThis.saved = blob; return 'blob:'; };"
        "HTMLAnchorElement.prototype.click = () => {};"
    )
    opened.run("document.getElementById('copy-command').click()")
    opened.run("document.getElementById('download').click()")
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = f"{opened.run('copied')} --kind native --columns all --no-figures --out run"
    subprocess.run(
        ["bash", "-c", command],
        cwd=tmp_path, env={**os.environ, "PATH": programs}, check=True, timeout=300,
    )  # fmt: skip
    header, found = rows(opened.run("saved.text()"))
    wanted, numbers = rows((tmp_path / "run" / "result.csv").read_text())
    assert header == wanted
    assert np.abs(found - numbers).max() <= TOLERANCE


def test_value_that_is_refused_is_marked_and_nothing_else_changes(opened):
    table = opened.run(TABLE)
    field = "document.querySelector('#groups input[data-name=\"controller.K1[1]\"]')"
    opened.run(f"{field}.focus()")
    opened.type("-3")
    opened.wait(f"{field}.getAttribute('aria-invalid') === 'true'")
    said = opened.run(f"{field}.closest('.row').innerText")
    assert "K1[1] = -3" in said
    assert opened.run(TABLE) == table
    opened.run(f"{field}.focus()")
    opened.type("10")
    opened.wait(f"{field}.getAttribute('aria-invalid') === 'false'")
    assert "-3" not in opened.run(f"{field}.closest('.row').innerText")
    assert opened.run(TABLE) == table


def test_space_plays_and_stops(opened):
    opened.run("document.activeElement.blur()")
    opened.press(" ")
    now = "parseFloat(document.getElementById('now').textContent)"
    opened.wait(f"{now} > 0.5 && {now} < 99")
    opened.press(" ")
    assert opened.run("document.getElementById('play').dataset.playing") == "false"


def test_phone_needs_no_sideways_scrolling(opened):
    opened.resize(390, 844)
    opened.run("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    for preset in ("fig4", "fault-sensor", "path", "fig3a"):
        opened.run(f'auvfmu.set({{preset: "{preset}"}})')
        assert opened.run("document.documentElement.scrollWidth") == 390
        too_wide = (
            "[...document.querySelectorAll('button, input, select, canvas, td')]"
            ".filter((one) => one.getBoundingClientRect().right > 390.5).length"
        )
        assert opened.run(too_wide) == 0


def test_dark_follows_the_system_until_the_button_is_pressed(opened):
    light = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).every((c) => c > 200)"
    assert opened.run(light)
    opened.prefer("dark")
    opened.wait(f"!({light})")
    opened.run("document.getElementById('theme').click()")
    assert opened.run(light)


def test_without_webgl_only_the_path_in_space_is_missing(page, tmp_path):
    with browsing(tmp_path, ("--disable-gpu", "--disable-3d-apis")) as browser:
        tab = opened_at(browser, page.as_uri())
        assert "WebGL" in tab.run("document.querySelector('.scene').innerText")
        assert tab.run(CSV).count("\n") == 5002
        assert tab.run(f"{TABLE}.length") > 100
