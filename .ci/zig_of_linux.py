"""The package ziglang in wine, which runs Linux's zig, because zig.exe does not run there.

Its path is in LINUX_ZIG. Wine starts programs of Linux, but tells neither when they end nor how.
"""

import os
import re
import shlex
import sys
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory


def for_linux(argument: str) -> str:
    """An argument with the paths of Windows in it as Linux has them."""
    if not (found := re.search(r"[A-Za-z]:[\\/]", argument)):
        return argument
    drive = argument[found.start()].lower()
    before, path = argument[: found.start()], argument[found.end() - 1 :].replace("\\", "/")
    return f"{before}{os.environ['WINEPREFIX']}/dosdevices/{drive}:{path}"


command = shlex.join([os.environ["LINUX_ZIG"], *map(for_linux, sys.argv[1:])])
if sys.argv[1:2] == ["cc"] and "-target" not in sys.argv:
    command += " -target x86_64-windows-gnu"
with TemporaryDirectory() as temporary:
    status, said, script = (Path(temporary, name) for name in ("status", "said", "script"))
    there = shlex.quote(for_linux(temporary))
    lines = (
        f"export TMPDIR={there}",
        f"{command} >{there}/said 2>&1",
        f"echo $? >{there}/new",
        f"mv {there}/new {there}/status",
    )
    script.write_text("\n".join(lines), encoding="utf-8", newline="\n")
    with suppress(OSError):
        # It runs, and has no handle.
        os.spawnv(os.P_NOWAIT, "Z:\\bin\\sh", ["sh", f"{there}/script"])
    while not status.exists():
        time.sleep(0.05)
    sys.stderr.write(said.read_text(encoding="utf-8", errors="replace"))
    ended = int(status.read_text(encoding="utf-8"))
sys.exit(ended)
