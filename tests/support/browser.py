"""Chromium without a window, controlled through a pipe."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

BROWSER = which("chromium") or which("chromium-browser") or which("google-chrome")

#: Options that keep it off the network.
_OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--remote-debugging-pipe",
)  # fmt: skip

#: File descriptors at which Chromium reads and writes its protocol.
_READS, _WRITES = 3, 4


class Browser:
    """A running browser, and one page in it.

    Attributes:
        said: errors of the page, what it has written on its console, and what the browser has
            refused it.
        requests: addresses of what it has fetched.

    """

    def __init__(self, commands: int, answers: int) -> None:
        self._commands, self._answers = commands, answers
        self._rest, self._n = b"", 0
        self._session: str | None = None
        self.said: list[str] = []
        self.requests: list[str] = []
        made = self.call("Target.createTarget", url="about:blank")
        found = self.call("Target.attachToTarget", targetId=made["targetId"], flatten=True)
        self._session = found["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol, and give its result."""
        self._n += 1
        message = {"id": self._n, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        content = json.dumps(message).encode() + b"\0"
        while content:
            content = content[os.write(self._commands, content) :]
        while True:
            answer = self._heard()
            if answer.get("id") == self._n:
                assert "error" not in answer, answer["error"]
                return answer["result"]

    def open(self, page: Path) -> None:
        """Open a file, and wait until all of it is there."""
        self.requests.clear()
        self.call("Page.navigate", url=page.as_uri())
        while self._heard().get("method") != "Page.loadEventFired":
            pass

    def evaluate(self, expression: str) -> Any:
        """The value of an expression, or what its promise comes to."""
        result = self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def _heard(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            content = os.read(self._answers, 1 << 20)
            assert content, "the browser has ended"
            self._rest += content
        text, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        match message.get("method"):
            case "Runtime.exceptionThrown" | "Runtime.consoleAPICalled" as method:
                self.said.append(f"{method}: {message['params']}")
            case "Log.entryAdded" as method if message["params"]["entry"]["level"] == "error":
                self.said.append(f"{method}: {message['params']}")
            case "Network.requestWillBeSent":
                self.requests.append(message["params"]["request"]["url"])
        return message


@contextmanager
def browser(profile: Path, *options: str) -> Iterator[Browser]:
    """Start a browser with a profile and options, and end it afterwards."""
    reads, commands = os.pipe()
    answers, writes = os.pipe()

    def take_places() -> None:
        # Neither may be where the other is to go.
        above = [fcntl.fcntl(end, fcntl.F_DUPFD, _WRITES + 1) for end in (reads, writes)]
        for end, place in zip(above, (_READS, _WRITES), strict=True):
            os.dup2(end, place)

    process = subprocess.Popen(
        [str(BROWSER), *_OPTIONS, *options, f"--user-data-dir={profile}"],
        stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, close_fds=False,
        preexec_fn=take_places,  # noqa: PLW1509
    )  # fmt: skip
    try:
        os.close(reads)
        os.close(writes)
        yield Browser(commands, answers)
    finally:
        process.terminate()
        process.wait(timeout=20)
        os.close(commands)
        os.close(answers)
