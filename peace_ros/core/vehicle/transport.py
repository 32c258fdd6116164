# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bytes to and from the autopilot: UDP, TCP or a serial line, chosen by a URL."""

from __future__ import annotations

import importlib
import importlib.util
import select
import socket
from typing import Any, Protocol

from peace_ros.core.domain.errors import VehicleError

URL_HELP = (
    'write udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, serial:/dev/NAME:BAUD '
    'or /dev/NAME:BAUD'
)
DEFAULT_BAUD = 921_600
CONNECT_S = 5.0
WRITE_S = 0.5
Source = tuple[str, int] | None
Chunk = tuple[bytes, Source]


class Transport(Protocol):
    """A line to the autopilot."""

    datagrams: bool
    """Chunks are whole datagrams, each with its sender's address."""

    def read(self, timeout_s: float) -> list[Chunk]:
        """Return what arrives within the time, or nothing; VehicleError when the line broke."""

    def write(self, data: bytes, to: Source, /) -> None:
        """Send; VehicleError when the line broke."""

    def close(self) -> None:
        """Release the line."""


class _Udp:
    datagrams = True

    def __init__(self, host: str, port: int, *, listen: bool) -> None:
        self._peer: Source = None if listen else (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        where = f'udp{"in" if listen else "out"}:{host}:{port}'
        try:
            if listen:
                self._socket.bind((host, port))
            else:
                self._socket.connect((host, port))
        except OSError as error:
            self._socket.close()
            raise VehicleError(
                f'{where}: {error.strerror or error}; end the process that holds the port, '
                'or choose another address'
            ) from error
        self._socket.setblocking(False)

    def read(self, timeout_s: float) -> list[Chunk]:
        select.select([self._socket], [], [], timeout_s)
        chunks: list[Chunk] = []
        while len(chunks) < 64:
            try:
                data, source = self._socket.recvfrom(65535)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # nobody listens there yet: the autopilot may still be starting
            except OSError:
                break  # the network is away for a moment
            chunks.append((data, source))
        return chunks

    def write(self, data: bytes, to: Source, /) -> None:
        try:
            if self._peer is not None:
                self._socket.send(data)
            elif to is not None:
                self._socket.sendto(data, to)
        except OSError:
            return  # UDP may lose a datagram; silence is noticed by its own limit

    def close(self) -> None:
        self._socket.close()


class _Tcp:
    datagrams = False

    def __init__(self, host: str, port: int, connect_s: float) -> None:
        try:
            self._socket = socket.create_connection((host, port), timeout=connect_s)
        except OSError as error:
            raise VehicleError(
                f'tcp:{host}:{port}: {error.strerror or error} within {connect_s} s; '
                'start the autopilot or its router first'
            ) from error
        self._socket.settimeout(WRITE_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._name = f'tcp:{host}:{port}'

    def read(self, timeout_s: float) -> list[Chunk]:
        try:
            if not select.select([self._socket], [], [], timeout_s)[0]:
                return []
            data = self._socket.recv(65535)
        except (OSError, ValueError) as error:
            raise VehicleError(f'{self._name}: {error}') from error
        if not data:
            raise VehicleError(f'{self._name}: the other side closed the connection')
        return [(data, None)]

    def write(self, data: bytes, _to: Source, /) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise VehicleError(f'{self._name}: {error.strerror or error}') from error

    def close(self) -> None:
        self._socket.close()


class _Serial:
    datagrams = False

    def __init__(self, device: str, baud: int) -> None:
        serial: Any = importlib.import_module('serial')
        try:
            self._line: Any = serial.Serial(device, baud, timeout=0, write_timeout=WRITE_S)
        except (OSError, ValueError) as error:
            raise VehicleError(
                f'{device} at {baud} baud: {error}; check the name, the speed and that the user '
                'is in group dialout'
            ) from error
        self._name = device

    def read(self, timeout_s: float) -> list[Chunk]:
        try:
            select.select([self._line], [], [], timeout_s)
            data = bytes(self._line.read(4096))
        except (OSError, ValueError) as error:
            raise VehicleError(f'{self._name}: {error}; check the cable') from error
        return [(data, None)] if data else []

    def write(self, data: bytes, _to: Source, /) -> None:
        try:
            self._line.write(data)
        except OSError as error:
            raise VehicleError(f'{self._name}: {error}; check the cable') from error

    def close(self) -> None:
        self._line.close()


def parse_url(url: str) -> tuple[str, str, int]:
    """Return scheme, host and port of a URL (see ``URL_HELP``), of a serial line device and baud.

    Raises:
        VehicleError: It is not understood, or needs a package that is not installed.
    """
    scheme, _, rest = url.partition(':')
    if url.startswith('/dev/') or scheme == 'serial':
        device, _, baud = (url if url.startswith('/dev/') else rest).partition(':')
        if not device.startswith('/') or not (baud == '' or baud.isdecimal()):
            raise VehicleError(f'connection {url!r} is not understood: {URL_HELP}')
        if importlib.util.find_spec('serial') is None:
            raise VehicleError(
                f'{device}: serial lines need pyserial; install python3-serial (apt) or pyserial'
            )
        return 'serial', device, int(baud) if baud else DEFAULT_BAUD
    host, _, port_text = rest.rpartition(':')
    port = int(port_text) if port_text.isdecimal() else -1
    if scheme not in {'udpin', 'udpout', 'tcp'} or not host or not 0 <= port <= 65535:
        raise VehicleError(f'connection {url!r} is not understood: {URL_HELP}')
    return scheme, host, port


def open_transport(url: str, connect_s: float | None = None) -> Transport:
    """Open the line that a URL names.

    Args:
        url: See ``URL_HELP``.
        connect_s: Longest wait for a TCP server; None: 5 s.

    Raises:
        VehicleError: The URL is not understood, the port is taken, the device is missing.
    """
    scheme, host, port = parse_url(url)
    if scheme == 'serial':
        return _Serial(host, port)
    if scheme == 'tcp':
        return _Tcp(host, port, CONNECT_S if connect_s is None else connect_s)
    return _Udp(host, port, listen=scheme == 'udpin')
