"""Chromium without a window, asked over two pipes: the protocol of its developer tools."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

BROWSER = which("chromium") or which("chromium-browser") or which("google-chrome")

#: How long an answer, or something that is waited for, may take [s].
_PATIENCE = 90.0

#: Free numbers of files are looked for from here on: the browser wants 3 and 4.
_FREE = 10

_KEYS = {"ArrowRight": 39, "ArrowLeft": 37, "Tab": 9, "Enter": 13, " ": 32, "End": 35}

_BAD = ("error", "warning", "assert")

_SOFTWARE_GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")


class Browser:
    """A browser, and what it has said."""

    def __init__(self, process: subprocess.Popen[bytes], to: int, back: int) -> None:
        """Take a started browser with the two ends of its pipes."""
        self._process, self._to, self._back = process, to, back
        self._number, self._rest = 0, b""
        self.events: list[dict[str, Any]] = []

    def ask(self, method: str, session: str = "", **parameters: Any) -> dict[str, Any]:
        """The answer to a command."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            found = self._next()
            if found.get("id") == self._number:
                if "error" in found:
                    raise AssertionError(f"{method}: {found['error']['message']}")
                answer: dict[str, Any] = found["result"]
                return answer
            self.events.append(found)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            read = os.read(self._back, 1 << 20)
            if not read:
                raise AssertionError("the browser has ended")
            self._rest += read
        first, _, self._rest = self._rest.partition(b"\0")
        found: dict[str, Any] = json.loads(first)
        return found

    def open(self, address: str, width: int = 1280, height: int = 900) -> Tab:
        """A new tab that shows a page."""
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        tab = Tab(self, session)
        for domain in ("Page", "Runtime", "Log", "Network"):
            tab.ask(f"{domain}.enable")
        tab.resize(width, height)
        tab.ask("Page.navigate", url=address)
        tab.wait("document.readyState === 'complete'")
        return tab


class Tab:
    """A page in a browser."""

    def __init__(self, browser: Browser, session: str) -> None:
        """Take a session of a browser."""
        self._browser, self._session = browser, session

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The answer to a command for this page."""
        return self._browser.ask(method, self._session, **parameters)

    def run(self, script: str) -> Any:
        """The value of an expression in the page; promises are waited for."""
        found = self.ask(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in found:
            raise AssertionError(found["exceptionDetails"]["exception"]["description"])
        return found["result"].get("value")

    def wait(self, script: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + _PATIENCE
        while not self.run(script):
            if time.monotonic() > end:
                raise AssertionError(f"never true: {script}")
            time.sleep(0.05)

    def press(self, key: str) -> None:
        """Press and release a key."""
        code = {"key": key, "code": "Space" if key == " " else key}
        number = {"windowsVirtualKeyCode": _KEYS[key]}
        text = {"text": key} if key == " " else {}
        self.ask("Input.dispatchKeyEvent", type="keyDown", **code, **number, **text)
        self.ask("Input.dispatchKeyEvent", type="keyUp", **code, **number)

    def type(self, text: str) -> None:
        """Replace what is in the field that has the focus."""
        self.run("document.activeElement.select()")
        self.ask("Input.insertText", text=text)
        self.press("Enter")

    def resize(self, width: int, height: int) -> None:
        """Give the page another size, in pixels of its style sheet."""
        self.ask(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 500,
        )  # fmt: skip

    def prefer(self, scheme: str) -> None:
        """Let the system ask for `light` or `dark`."""
        feature = {"name": "prefers-color-scheme", "value": scheme}
        self.ask("Emulation.setEmulatedMedia", features=[feature])

    def complaints(self) -> list[str]:
        """Errors of the page, and addresses that it has asked for over the network."""
        self.run("0")
        return list(self._complaints())

    def _complaints(self) -> Iterator[str]:
        for event in self._browser.events:
            if event.get("sessionId") != self._session:
                continue
            method, parameters = event["method"], event["params"]
            if method == "Runtime.exceptionThrown":
                yield str(parameters["exceptionDetails"])
            elif method == "Runtime.consoleAPICalled" and parameters["type"] in (
                "error",
                "warning",
            ):
                yield str(parameters["args"])
            elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
                yield str(parameters["entry"])
            elif method == "Network.requestWillBeSent":
                address = parameters["request"]["url"]
                if not address.startswith(("file:", "blob:", "data:")):
                    yield address


@contextmanager
def browsing(profile: Path, options: tuple[str, ...] = _SOFTWARE_GL) -> Iterator[Browser]:
    """A browser with an empty profile."""
    theirs_in, to = os.pipe()
    back, theirs_out = os.pipe()
    ends = [fcntl.fcntl(one, fcntl.F_DUPFD, _FREE) for one in (theirs_in, theirs_out)]
    process = subprocess.Popen(
        [
            "bash", "-c", f'exec "$@" 3<&{ends[0]} 4>&{ends[1]}', "-", str(BROWSER),
            "--headless", "--no-sandbox", "--no-first-run", "--remote-debugging-pipe",
            f"--user-data-dir={profile}", *options,
        ],
        pass_fds=ends, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    for one in (theirs_in, theirs_out, *ends):
        os.close(one)
    try:
        yield Browser(process, to, back)
    finally:
        process.kill()
        process.wait()
        os.close(to)
        os.close(back)
