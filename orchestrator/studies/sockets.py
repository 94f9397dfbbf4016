"""Dask between processes of one user: Unix sockets in a folder that nobody else can enter.

Dask's own transports listen at ports, which every user of the machine can connect to, and who
reaches a scheduler or a worker can have it run anything.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from secrets import randbelow
from typing import Any
from urllib.parse import quote, unquote

from distributed import Scheduler, Worker
from distributed.comm.addressing import parse_host_port
from distributed.comm.core import CommClosedError
from distributed.comm.registry import backends
from distributed.comm.tcp import (
    MAX_BUFFER_SIZE,
    TCP,
    BaseTCPConnector,
    BaseTCPListener,
    TCPBackend,
    convert_stream_closed_error,
)
from tornado.iostream import IOStream, StreamClosedError
from tornado.tcpserver import TCPServer

#: How addresses begin; a folder and the name of a socket in it, a number, follow.
_PROTOCOL = "unix"
_PREFIX = f"{_PROTOCOL}://"

#: Paths of sockets are not longer than this on every system.
_LONGEST = 100


def place_in(folder: Path) -> dict[str, str]:
    """Where Dask's servers are to listen: in a folder, or where that cannot be, to this machine."""
    if not hasattr(socket, "AF_UNIX"):
        return {"protocol": "tcp", "host": "127.0.0.1"}
    return {"protocol": _PROTOCOL, "host": quote(str(folder))}


@contextmanager
def _path(host: str, port: int) -> Iterator[str]:
    """The path of a socket, or another that is shorter."""
    folder = unquote(host)
    path = f"{folder}/{port}"
    if len(os.fsencode(path)) <= _LONGEST:
        yield path
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        yield f"/proc/self/fd/{descriptor}/{port}"
    finally:
        os.close(descriptor)


class _Comm(TCP):  # type: ignore[misc]
    """A connection."""


class _Connector(BaseTCPConnector):  # type: ignore[misc]
    prefix, comm_class, encrypted = _PREFIX, _Comm, False

    async def connect(self, address: str, deserialize: bool = True, **_: Any) -> _Comm:
        host, port = parse_host_port(address)
        stream = IOStream(socket.socket(socket.AF_UNIX), max_buffer_size=MAX_BUFFER_SIZE)
        try:
            with _path(host, port) as path:
                connected = stream.connect(path)
            await connected
        except StreamClosedError as error:
            convert_stream_closed_error(self, error)
        return _Comm(stream, f"{_PREFIX}{host}:0", _PREFIX + address, deserialize)


class _Listener(BaseTCPListener):  # type: ignore[misc]
    prefix, comm_class, encrypted = _PREFIX, _Comm, False

    def _get_server_args(self, **_: Any) -> dict[str, Any]:
        return {}

    async def start(self) -> None:
        listening = socket.socket(socket.AF_UNIX)
        listening.setblocking(False)
        self.bound_address = (self.ip, self.port or 1 + randbelow(2**31))
        with _path(*self.bound_address) as path:
            listening.bind(path)
        listening.listen(socket.SOMAXCONN)
        server: Any = TCPServer(max_buffer_size=MAX_BUFFER_SIZE)
        server.handle_stream = self._handle_stream
        server.add_socket(listening)
        self.tcp_server = server

    async def _handle_stream(self, stream: IOStream, _: Any) -> None:
        comm = _Comm(stream, self.contact_address, f"{_PREFIX}{self.ip}:0", self.deserialize)
        comm.allow_offload = self.allow_offload
        try:
            await self.on_connection(comm)
        except CommClosedError:
            return
        await self.comm_handler(comm)


class _Backend(TCPBackend):  # type: ignore[misc]
    _connector_class, _listener_class = _Connector, _Listener

    def resolve_address(self, loc: str) -> str:
        return loc

    def get_local_address_for(self, loc: str) -> str:
        return f"{parse_host_port(loc)[0]}:0"


backends[_PROTOCOL] = _Backend()


class LocalScheduler(Scheduler):  # type: ignore[misc]
    """A scheduler without a web server."""

    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Listen nowhere."""


class LocalWorker(Worker):  # type: ignore[misc]
    """A worker without a web server."""

    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Listen nowhere."""
