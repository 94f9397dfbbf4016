"""Helpers for tests of the live page and of its parts."""

from __future__ import annotations

from importlib.util import find_spec
from shutil import which

import pytest

needs_npm = pytest.mark.skipif(which("npm") is None, reason="npm is not installed")
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")

#: Tolerance of rows, relative to the larger of 1 and the value: C libraries differ in the
#: last bit of functions such as sine.
TOLERANCE = 1e-9
