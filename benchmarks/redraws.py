"""Time of a redraw of the live page: `python benchmarks/redraws.py`.

Moves the slider of eps_t on the page of Fig. 4 once for each picture of the screen, in Chromium
without a window or a graphics card. Each move runs both controllers and draws.
"""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from orchestrator.live.presets import live_page

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.browser import BROWSER, browser

#: Moves that are timed.
_MOVES = 60

#: All work of the page for a picture is done in callbacks of requestAnimationFrame.
_MEASURE = """(async (moves) => {
    await auvfmu.csv();
    const slider = document.querySelector('input[data-names="controller.eps_t"]');
    const real = requestAnimationFrame.bind(window);
    let busy = 0;
    globalThis.requestAnimationFrame = (draw) =>
        real((now) => {
            const begin = performance.now();
            draw(now);
            busy += performance.now() - begin;
        });
    const next = () => new Promise(real);
    await next();
    const found = [];
    // The first moves let the browser compile.
    for (let i = -10; i < moves; i++) {
        const begin = performance.now();
        busy = 0;
        slider.value = String(300 + ((10 * i) % 400));
        slider.dispatchEvent(new Event("input", { bubbles: true }));
        await next();
        if (i >= 0) found.push([busy, performance.now() - begin]);
    }
    return found;
})"""


def main() -> None:
    """Print the times."""
    if BROWSER is None:
        sys.exit("Chromium is not installed")
    with TemporaryDirectory(ignore_cleanup_errors=True) as temporary:
        page = Path(temporary, "live.html")
        page.write_text(live_page("fig4"), encoding="utf-8")
        with browser(Path(temporary, "profile"), "--enable-unsafe-swiftshader") as shown:
            size = {"width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": False}
            shown.call("Emulation.setDeviceMetricsOverride", **size)
            shown.open(page)
            found = shown.evaluate(f"{_MEASURE}({_MOVES})")
    print(f"{_MOVES} moves of a slider")
    names = ("run and draw, in the script", "from one picture to the next")
    for name, times in zip(names, zip(*found, strict=True), strict=True):
        print(f"{name:32} median {median(times):.1f} ms, max {max(times):.1f} ms")


if __name__ == "__main__":
    main()
