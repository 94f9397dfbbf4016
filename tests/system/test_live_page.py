"""The page of `auv-fmu live` in a browser: keys, links, commands, a phone's width, the dark."""

from __future__ import annotations

import csv
import io
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from orchestrator.commands.main import main
from support.browser import BROWSER, Browser, browser
from support.live import TOLERANCE, needs_npm, needs_zig

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed"),
    needs_npm,
    needs_zig,
]

CSV = "auvfmu.csv()"
EVENT = "document.querySelector('#event-list input')"
CHOSEN = "document.getElementById('vehicle')"
COLOR = "getComputedStyle(document.documentElement).getPropertyValue('--first')"
SLIDERS = "[...document.querySelectorAll('#groups input[type=range]')].map((one) => one.ariaLabel)"

#: Copies and downloads stay in the page.
CATCH = (
    "navigator.clipboard.writeText = async (text) => { globalThis.copied = text; };"
    "URL.createObjectURL = (blob) => { globalThis.saved = blob; return 'blob:'; };"
    "HTMLAnchorElement.prototype.click = () => {};"
)

#: Numbers of keys, and what they write.
KEYS = {"ArrowRight": (39, ""), "Enter": (13, "\r"), " ": (32, " ")}


def field_of(name: str) -> str:
    """The field of a parameter."""
    return f"document.querySelector('#groups input[data-name=\"{name}\"]')"


class Live:
    """The page, and what a user does with it."""

    def __init__(self, shown: Browser) -> None:
        self._shown = shown
        self.run = shown.evaluate
        self.call = shown.call

    def wait(self, script: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + 90.0
        while not self.run(script):
            assert time.monotonic() < end, f"never true: {script}"
            time.sleep(0.05)

    def start(self) -> Live:
        """Wait for the first run."""
        self.wait("document.querySelector('#indices td') !== null")
        return self

    def text(self, name: str) -> str:
        """The text of an element, by its id."""
        return str(self.run(f"document.getElementById('{name}').innerText"))

    def click(self, selector: str) -> None:
        """Click on an element."""
        self.run(f"document.querySelector('{selector}').click()")

    def set(self, settings: str) -> None:
        """Change settings by the page's function for scripts."""
        self.run(f"auvfmu.set({settings})")

    def unfold(self) -> None:
        """Open all parts of the page."""
        self.run("document.querySelectorAll('details').forEach((one) => { one.open = true; })")

    def rows(self) -> tuple[list[str], np.ndarray]:
        """Columns and numbers of the table."""
        return rows(self.run(CSV))

    def press(self, key: str) -> None:
        """Press and release a key."""
        number, text = KEYS[key]
        code = {"key": key, "windowsVirtualKeyCode": number}
        self.call("Input.dispatchKeyEvent", type="keyDown", **code, text=text)
        self.call("Input.dispatchKeyEvent", type="keyUp", **code)

    def type(self, field: str, text: str) -> None:
        """Replace the content of a field."""
        self.run(f"{field}.focus(), {field}.select()")
        self.call("Input.insertText", text=text)
        self.press("Enter")

    def resize(self, width: int, height: int) -> None:
        """Give the page another size, in pixels of its style sheet."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1}
        self.call("Emulation.setDeviceMetricsOverride", **size, mobile=width < 500)

    def prefer(self, scheme: str) -> None:
        """Let the system ask for `light` or `dark`, and for no motion, so that nothing plays."""
        wishes = {"prefers-color-scheme": scheme, "prefers-reduced-motion": "reduce"}
        features = [{"name": name, "value": value} for name, value in wishes.items()]
        self.call("Emulation.setEmulatedMedia", features=features)

    def complaints(self) -> list[str]:
        """Errors of the page, and its requests to the network."""
        fetched = [
            request
            for request in self._shown.requests
            if not request.startswith(("file:", "blob:"))
        ]
        return [*self._shown.said, *fetched]


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One browser for all tests, with WebGL without a graphics card."""
    software = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    with browser(tmp_path_factory.mktemp("profile"), *software) as started:
        yield started


@pytest.fixture
def opened(page, chromium) -> Iterator[Live]:
    """A fresh page, without complaints at the end."""
    live = Live(chromium)
    live.prefer("light")
    chromium.open(page)
    live.resize(1280, 900)
    yield live.start()
    assert live.complaints() == []


def live_of(chromium, folder, text) -> Live:
    """The page of a user's scenario file."""
    (folder / "mine.toml").write_text(text)
    out = folder / "page.html"
    assert main(["live", str(folder / "mine.toml"), "--out", str(out)]) == 0
    chromium.open(out)
    return Live(chromium).start()


def rows(text: str) -> tuple[list[str], np.ndarray]:
    """Columns and numbers of a table."""
    header, *lines = csv.reader(io.StringIO(text))
    return header, np.array(lines, dtype=float)


def test_arrow_keys_move_a_slider_and_the_numbers(opened):
    slider = "document.querySelector('input[data-names=\"controller.eps_t\"]')"
    (header, before), table = opened.rows(), opened.text("indices")
    opened.run(f"{slider}.focus()")
    for _ in range(5):
        opened.press("ArrowRight")
    opened.wait(f"document.getElementById('indices').innerText !== {table!r}")
    opened.wait("/controller\\.eps_t=/.test(location.hash)")
    value = float(re.search(r"eps_t=([0-9.]+)", opened.run("location.hash"))[1])
    # Four decades in a hundred presses.
    assert value == pytest.approx(10 ** (5 * 4 / 100), rel=5e-3)
    changed = np.abs(opened.rows()[1] - before)
    assert changed[:, header.index("plant.tau.u")].max() > 0.1
    # A download has the settings of now.
    opened.run(CATCH)
    before = opened.run(CSV)
    opened.run(f"{slider}.valueAsNumber = 700; {slider}.dispatchEvent(new Event('input'))")
    opened.click("#download")
    opened.wait("'saved' in globalThis")
    assert opened.run("saved.text()") == opened.run(CSV) != before


def test_link_opens_the_same_run(opened):
    opened.set('{preset: "fault-sensor", "controller.eps_t": 4, stop_time: 60}')
    opened.unfold()
    opened.type(EVENT, "20")
    opened.wait("/events\\.1\\.at=20/.test(location.hash)")
    before = opened.run(CSV)
    opened.call("Page.reload")
    opened.wait("performance.getEntriesByType('navigation')[0].type === 'reload'")
    opened.start()
    assert opened.run(CSV) == before
    assert opened.run("document.getElementById('stop-time').value") == "60"
    assert opened.run(f"{EVENT}.value") == "20"


def test_command_makes_the_same_rows(opened, tmp_path):
    """The copied command, typed into a shell."""
    values = '"controller.eps_t": 4, "plant.noise.std": 0.002, "plant.noise.seed": 7'
    opened.set(f'{{preset: "fault-thruster", {values}, stop_time: 30}}')
    opened.unfold()
    opened.type(EVENT, "15")
    opened.click("#loops input[value=proposed]")
    opened.wait("/at=15&hide=proposed/.test(location.hash)")
    compare_rows(opened, tmp_path)


def test_command_makes_the_same_rows_of_several_vehicles(opened, tmp_path):
    """The comparison has no scenario of its own and one link fewer than vehicles."""
    opened.set('{preset: "formation-lost-link", stop_time: 5, hide: "proposed"}')
    compare_rows(opened, tmp_path)


def test_command_of_a_comparison_has_order_wires_and_components(chromium, tmp_path):
    parts = '["planner", "plant", "controller"]'
    text = f'order = {parts}\nonly = {parts}\n[wires]\n"plant.tau_w" = false\n'
    live = live_of(chromium, tmp_path, f"stop_time = 5.0\n{text}")
    live.set("{hide: 'proposed'}")
    compare_rows(live, tmp_path)


def compare_rows(opened, tmp_path):
    """Copy the command, type it into a shell, and compare its rows with the download."""
    opened.run(CATCH)
    opened.click("#copy-command")
    opened.click("#download")
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
    table, field = opened.text("indices"), field_of("controller.K1[1]")
    opened.type(field, "-3")
    opened.wait(f"{field}.getAttribute('aria-invalid') === 'true'")
    assert "K1[1] = -3" in opened.run(f"{field}.closest('.row').innerText")
    assert opened.text("indices") == table
    opened.type(field, "10")
    opened.wait(f"!{field}.closest('.row').innerText.includes('-3')")
    assert opened.run(f"{field}.getAttribute('aria-invalid')") == "false"
    assert opened.text("indices") == table


def test_a_text_that_is_not_a_number_is_refused_where_it_was_typed(opened):
    opened.run(CATCH)
    field = field_of("controller.k_d")
    opened.type(field, "1,000,5")
    opened.wait(f"{field}.closest('.row').innerText.includes('controller.k_d: not a number')")
    assert opened.run(f"{field}.value") == "1,000,5"
    opened.click("#copy-command")
    opened.wait("document.getElementById('said').textContent.includes('not a number')")
    assert opened.run("globalThis.copied === undefined")
    opened.type(field, "0,5")
    opened.wait("/controller\\.k_d=0\\.5/.test(location.hash)")
    assert opened.run(f"{field}.getAttribute('aria-invalid')") == "false"


def test_value_of_one_loop_can_be_set_in_both_and_taken_back(chromium, tmp_path):
    other = (
        '[compare]\nname = "other"\ncomponents.controller = "PdController"\n'
        'wires."controller.dy" = "plant.dy"\nparameters.plant.noise.std = 0.01\n'
    )
    live = live_of(chromium, tmp_path, f"stop_time = 5.0\n{other}")
    live.unfold()
    before, field = live.text("indices"), field_of("plant.noise.std")
    own = live.run(f"{field}.value")
    live.type(field, "0.5")
    live.wait("/plant\\.noise\\.std=0\\.5/.test(location.hash)")
    live.type(field, own)
    live.wait(f"location.hash.includes('plant.noise.std={own}')")
    assert live.run(f"{field}.classList.contains('changed')")
    assert live.text("indices") != before
    live.run(f"{field}.closest('.row').querySelector('.reset').click()")
    live.wait("!location.hash.includes('plant.noise.std')")
    assert not live.run(f"{field}.classList.contains('changed')")
    assert live.text("indices") == before


def test_messages_and_ends_are_shown_without_an_alarm(opened, chromium, tmp_path):
    assert opened.text("messages") == ""
    opened.set('{"controller.innovation_gate": 1e-6}')
    messages = opened.text("messages")
    assert messages.startswith("proposed: controller: observer restarted at t = ")
    assert messages.count("\n") == 0
    live = live_of(chromium, tmp_path, "[[events]]\nat = 2.0\nstop = true\n")
    assert live.text("messages").splitlines() == [
        "proposed: ended at t = 2 s: stop",
        "PD: ended at t = 2 s: stop",
    ]
    assert live.run("document.getElementById('error').hidden")
    assert not live.run("document.body.classList.contains('refused')")


def test_a_chart_that_comes_into_sight_shows_the_time_that_the_others_show(opened):
    """Also if it was drawn at another time."""
    opened.resize(1280, 500)
    last = "[...document.querySelectorAll('#series .chart')].filter((it) => !it.hidden).at(-1)"
    value, scroll = f"{last}.querySelector('.value').textContent", f"{last}.scrollIntoView()"
    opened.run(scroll)
    opened.wait(f"{value} !== ''")
    at_end = opened.run(value)
    opened.run("scrollTo(0, 0)")
    opened.wait("scrollY === 0")
    time = "document.getElementById('time')"
    opened.run(f"{time}.value = 200; {time}.dispatchEvent(new Event('input'))")
    opened.wait("document.getElementById('now').textContent === '20.0 s'")
    opened.run(scroll)
    opened.wait(f"{value} !== {at_end!r}")
    header, table = opened.rows()
    known = table[np.isclose(table[:, 0], 20.0), header.index("controller.theta_hat[4]")]
    assert float(opened.run(value)) == pytest.approx(known[0], rel=5e-3)
    for part, shift in ((".u-cursor-x", 0.0), (".u-cursor-pt", 3.0)):
        box = f"{last}.querySelector('{part}').getBoundingClientRect()"
        plot = f"{last}.querySelector('.u-over').getBoundingClientRect()"
        share = opened.run(f"({box}.left + {shift} - {plot}.left) / {plot}.width")
        assert share == pytest.approx(20.0 / table[-1, 0], abs=0.02), part


def test_remark_says_that_its_numbers_belong_to_the_preset(opened):
    head = "document.getElementById('remark-head').hidden"
    faded = "document.querySelector('.outdated') !== null"
    assert opened.run(f"[{head}, {faded}]") == [True, False]
    for change in ('{"controller.k_d": 60}', '{preset: "fault-sensor", "events.1.at": 20.3}'):
        opened.set(change)
        opened.wait(f"!{head} && {faded}")
        marks = opened.run("[...document.querySelectorAll('#marks span')].map((it) => it.title)")
        assert all(title.endswith(", at 20.3 s") for title in marks)
        opened.click("#reset-all")
        opened.wait(f"{head} && !{faded}")
    # Events that a script leaves out begin without edits.
    opened.set('{preset: "fault-thruster", "events.1.at": 20}')
    opened.set('{events: ""}')
    opened.wait("/events=$/.test(location.hash)")


def test_wrong_time_of_an_event_stays_marked_until_it_is_reset(opened):
    opened.set('{preset: "fault-thruster"}')
    opened.unfold()
    opened.type(EVENT, "-5")
    error = "document.getElementById('error').textContent"
    opened.wait(f"{error}.includes('no yaw moment')")
    assert opened.run(f"{EVENT}.getAttribute('aria-invalid')") == "true"
    opened.run("document.activeElement.blur()")
    opened.click("#reset-all")
    opened.wait(f"{error} === ''")
    assert opened.run(f"[{EVENT}.value, {EVENT}.getAttribute('aria-invalid')]") == ["50", "false"]


def test_nothing_is_downloaded_while_no_controller_is_shown(opened):
    opened.run(CATCH)
    for box in ("PD", "proposed"):
        opened.click(f"#loops input[value={box}]")
    opened.wait("/hide=PD&hide=proposed|hide=proposed&hide=PD/.test(location.hash)")
    opened.click("#download")
    assert opened.run("document.getElementById('said').textContent") == "Show a controller first"
    assert opened.run("globalThis.saved === undefined")
    opened.set("{hide: ''}")
    assert opened.run("document.querySelectorAll('#loops input:checked').length") == 2


def test_script_is_refused_what_only_the_other_loop_refuses(opened):
    opened.set('{preset: "fig5-pd"}')
    # The link is written a moment later.
    opened.wait("/preset=fig5-pd/.test(location.hash)")
    before = opened.run("location.hash")
    why = opened.run('auvfmu.set({"controller.k_d": -1}).then(() => "", (error) => error.message)')
    assert "k_d = -1" in why
    assert opened.run("location.hash") == before


def test_refused_link_shows_the_preset_without_what_is_hidden(page, chromium):
    chromium.open(page)
    live = Live(chromium)
    live.run("location.hash = '#preset=fault-thruster&controller.K1[1]=-3&hide=PD'")
    live.start()
    live.wait("document.body.classList.contains('refused')")
    assert "PD" not in live.text("indices")


def test_presets_leave_no_listeners(opened):
    def listeners() -> int:
        found = opened.call(
            "Runtime.evaluate",
            expression="Object.values(getEventListeners(window)).flat().length",
            includeCommandLineAPI=True,
            returnByValue=True,
        )
        return int(found["result"]["value"])

    opened.set('{preset: "fig5"}')
    before = listeners()
    opened.set('{preset: "fig3a"}')
    opened.set('{preset: "path"}')
    assert "waypoints" in opened.text("legend")
    assert opened.run("document.title") == "A survey through waypoints: proposed and PD controller"
    opened.set('{preset: "fig5"}')
    assert listeners() == before


def test_all_vehicles_are_shown_and_one_is_chosen(opened):
    assert opened.run(f"{CHOSEN}.parentElement.hidden")
    own = opened.run(COLOR)
    opened.set('{preset: "formation-v", stop_time: 30, "auv3.plant.eta0.z": 4}')
    legend = opened.text("legend").split()
    assert legend == ["auv1", "auv2", "auv3", "proposed", "PD", "reference", "waypoints"]
    header, found = opened.rows()
    for vehicle, other in (("auv1", "auv2"), ("auv3", "auv1")):
        opened.run(f"{CHOSEN}.value = '{vehicle}'; {CHOSEN}.dispatchEvent(new Event('change'))")
        sliders = opened.run(SLIDERS)
        assert any(slider.endswith(f": {vehicle}.controller.eps_t") for slider in sliders)
        assert not any(other in slider for slider in sliders)
        # Its indices, and the one of all vehicles.
        applied = found[:-1, header.index(f"{vehicle}.plant.tau_applied.u")]
        effort = np.sqrt(np.sum(applied**2 * np.diff(found[:, 0])))
        assert f"{effort:.4g}".rstrip("0") in opened.text("indices")
    places = [
        found[:, [header.index(f"auv{k}.plant.eta.{axis}") for axis in "xyz"]] for k in (1, 2, 3)
    ]
    apart = min(np.linalg.norm(a - b, axis=1).min() for a, b in combinations(places, 2))
    assert f"{apart:.4g}".rstrip("0") in opened.text("indices")
    opened.wait("/auv3\\.plant\\.eta0\\.z=4.*&vehicle=auv3/.test(location.hash)")
    assert opened.rows()[1].tobytes() == found.tobytes()
    opened.set('{preset: "fig4"}')
    assert opened.run(f"{CHOSEN}.parentElement.hidden")
    assert opened.run(COLOR) == own


def test_space_plays_and_stops(opened):
    assert opened.run("document.querySelector('.scene canvas') !== null")
    opened.run("document.activeElement.blur()")
    opened.press(" ")
    now = "parseFloat(document.getElementById('now').textContent)"
    opened.wait(f"{now} > 0.5 && {now} < 99")
    opened.press(" ")
    assert opened.run("document.getElementById('play').dataset.playing") == "false"


def test_lost_graphics_are_said(opened):
    opened.run(
        "document.querySelector('.scene canvas').getContext('webgl2')"
        ".getExtension('WEBGL_lose_context').loseContext()"
    )
    opened.wait("document.querySelector('.scene').innerText.includes('Reload the page')")
    opened.set('{"controller.k_d": 20}')


def test_phone_needs_no_sideways_scrolling(opened):
    """And all sliders have names of their own."""
    opened.resize(390, 844)
    opened.unfold()
    names = opened.run(SLIDERS)
    assert len(names) == len(set(names)) > 20
    for preset in ("fig4", "fault-sensor", "fig3a", "formation-v"):
        opened.set(f'{{preset: "{preset}"}}')
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
    opened.click("#theme")
    assert opened.run(light)


def test_without_webgl_only_the_path_in_space_is_missing(page, tmp_path):
    with browser(tmp_path, "--disable-3d-apis") as without:
        without.open(page)
        live = Live(without).start()
        assert "WebGL" in live.run("document.querySelector('.scene').innerText")
        assert live.run(CSV).count("\n") == 5002
        assert len(live.text("indices")) > 100
