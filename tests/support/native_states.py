"""Serialised states of FMUs in C, read as what the JSON of the Python kind says, and written."""

from __future__ import annotations

import struct
from binascii import crc32
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

from fmus.ports.groups import hints_of, parts_of, reals_first
from fmus.ports.port import Port
from support.settings import behaviour_of, ports_of
from support.status_table import MODES

CHECKSUM = "checksum"

MAGIC = "FMU state 3"

#: What outputs are: outdated, those of the last step, up to date.
_FRESHNESS = ((False, False), (True, True), (True, False))

#: A generator of noise: words of its state and the place of the next, and its kind.
_WORDS, _VERSION = 625, 3


class NativeState(dict[str, Any]):
    """What a state of an FMU in C says."""


class Unwritable(ValueError):
    """What a state of this kind has no place for."""


class _Layout(NamedTuple):
    #: Types of the parts of a state.
    state: Sequence[Any]
    draws: int
    parameters: Sequence[Port]
    inputs: Sequence[Any]
    #: None are kept of a component that is not sampled.
    outputs: Sequence[Any]


@cache
def _layout(name: str) -> _Layout:
    ports: Sequence[Port] = ports_of(name)
    of = {
        causality: [port for port in ports if port.causality == causality]
        for causality in ("input", "output", "parameter")
    }
    behaviour = behaviour_of(name)
    kinds = {"Real": float, "Integer": int, "Boolean": bool}
    inputs, outputs = (
        [kinds[port.type] for port in reals_first(of[causality])]
        for causality in ("input", "output")
    )
    state = [*hints_of(behaviour.state).values()]
    kept = outputs if behaviour.is_sampled else []
    return _Layout(state, behaviour.draws, of["parameter"], inputs, kept)


class _Reader:
    def __init__(self, content: bytes) -> None:
        self.content, self.place = content, 0

    def bytes(self, n: int) -> bytes:
        found = self.content[self.place : self.place + n]
        if len(found) != n:
            raise ValueError("too short")
        self.place += n
        return found

    def words(self, n: int) -> list[int]:
        return [*struct.unpack(f"<{n}I", self.bytes(4 * n))]

    def word(self) -> int:
        return self.words(1)[0]

    def reals(self, n: int) -> list[float]:
        return [*struct.unpack(f"<{n}d", self.bytes(8 * n))]

    def real(self) -> float:
        return self.reals(1)[0]

    def value(self, kind: Any) -> Any:
        """A number of a type, or the list of its parts."""
        parts = parts_of(kind)
        if parts is not None:
            return [self.value(part) for part in parts]
        if kind is float:
            return self.real()
        [number] = struct.unpack("<i", self.bytes(4))
        return bool(number) if kind is bool else number

    def text(self) -> str:
        return self.bytes(self.word()).decode()


def read(content: bytes) -> NativeState | None:
    """What a state says, if these are the bytes of one; the checksum is not held against them."""
    try:
        return _read(_Reader(content))
    except (ValueError, LookupError):
        return None


def _read(source: _Reader) -> NativeState | None:
    if source.text() != MAGIC:
        return None
    identity = source.text()
    layout = _layout(identity.split()[0])
    mode, [start_time, stop_time, time] = source.word(), source.reals(3)
    parameters = {port.name: _parameter(source, port) for port in layout.parameters}
    said = NativeState(
        identity=identity,
        mode=MODES[mode],
        start_time=start_time,
        stop_time=stop_time,
        time=time,
        parameters=parameters,
        inputs=[source.value(kind) for kind in layout.inputs],
        outputs=[],
        fresh=False,
        held=False,
        state=None,
        draws=[],
        generator=None,
    )
    if source.word():
        said["state"] = [source.value(kind) for kind in layout.state]
        if layout.draws:
            words, has_next, following = source.words(_WORDS), source.word(), source.real()
            said["generator"] = [_VERSION, words, following if has_next else None]
            said["draws"] = source.reals(layout.draws)
        if layout.outputs:
            said["outputs"] = [source.value(kind) for kind in layout.outputs]
            said["fresh"], said["held"] = _FRESHNESS[source.word()]
    said["fault"] = bool(source.word())
    said[CHECKSUM] = source.word()
    return said


def _parameter(source: _Reader, port: Port) -> Any:
    if port.type == "Real":
        return source.real()
    [number] = struct.unpack("<i", source.bytes(4))
    if port.type == "String":
        return [*port.choices][number]
    return bool(number) if port.type == "Boolean" else number


def resealed(content: bytes) -> bytes:
    """Bytes with a checksum that fits in the place of the one that they have."""
    rest = content[:-4]
    return rest + struct.pack("<I", crc32(rest))


def written(said: NativeState) -> bytes:
    """Bytes that say something.

    Raises:
        Unwritable: there is no place for it.

    """
    try:
        return _written(said)
    except (
        struct.error,
        ArithmeticError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
    ) as error:
        raise Unwritable(str(error)) from error


def _written(said: NativeState) -> bytes:
    identity = said["identity"]
    layout = _layout(identity.split()[0])
    parts = [
        _text(MAGIC),
        _text(identity),
        _words(MODES.index(said["mode"])),
        _reals(said["start_time"], said["stop_time"], said["time"]),
    ]
    for port in layout.parameters:
        value = said["parameters"][port.name]
        if port.type == "String":
            value = [*port.choices].index(value)
        parts.append(_reals(value) if port.type == "Real" else struct.pack("<i", value))
    parts += _values(layout.inputs, said["inputs"])
    parts.append(_words(said["state"] is not None))
    if said["state"] is not None:
        parts += _values(layout.state, said["state"])
        if layout.draws:
            _, words, following = said["generator"]
            parts += [_words(*words, following is not None), _reals(following or 0.0)]
            parts += _values([float] * layout.draws, said["draws"])
        if layout.outputs:
            parts += _values(layout.outputs, said["outputs"])
            parts.append(_words(_FRESHNESS.index((said["fresh"], said["held"]))))
    return b"".join(parts) + _words(said["fault"], said[CHECKSUM])


def _values(kinds: Sequence[Any], values: Sequence[Any]) -> list[bytes]:
    return [_value(kind, value) for kind, value in zip(kinds, values, strict=True)]


def _value(kind: Any, value: Any) -> bytes:
    parts = parts_of(kind)
    if parts is not None:
        return b"".join(_value(part, one) for part, one in zip(parts, value, strict=True))
    return _reals(value) if kind is float else struct.pack("<i", value)


def _text(text: str) -> bytes:
    content = text.encode()
    return _words(len(content)) + content


def _words(*words: int) -> bytes:
    return struct.pack(f"<{len(words)}I", *words)


def _reals(*reals: float) -> bytes:
    return struct.pack(f"<{len(reals)}d", *reals)
