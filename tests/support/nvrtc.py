"""NVIDIA's compiler of CUDA, from its wheel: it needs no card."""

from __future__ import annotations

from ctypes import CDLL, byref, c_char_p, c_size_t, c_void_p, create_string_buffer
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from orchestrator.program.cuda import OPTIONS


@cache
def library() -> CDLL | None:
    """The compiler, or None if it is not installed."""
    spec = find_spec("nvidia")
    folders = spec.submodule_search_locations if spec else None
    for folder in folders or ():
        for place in sorted(Path(folder).rglob("libnvrtc.so*")):
            return CDLL(str(place))
    return None


def compiled(text: str, *options: str) -> bytes:
    """The code of a text, or an AssertionError with the compiler's complaints."""
    nvrtc, program, size = library(), c_void_p(), c_size_t()
    assert nvrtc is not None
    assert not nvrtc.nvrtcCreateProgram(byref(program), text.encode(), b"it.cu", 0, None, None)
    given = [option.encode() for option in (*OPTIONS, *options)]
    failed = nvrtc.nvrtcCompileProgram(program, len(given), (c_char_p * len(given))(*given))
    nvrtc.nvrtcGetProgramLogSize(program, byref(size))
    log = create_string_buffer(size.value)
    nvrtc.nvrtcGetProgramLog(program, log)
    assert not failed, log.value.decode()
    nvrtc.nvrtcGetPTXSize(program, byref(size))
    code = create_string_buffer(size.value)
    nvrtc.nvrtcGetPTX(program, code)
    nvrtc.nvrtcDestroyProgram(byref(program))
    return code.value
