# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The serial ports of an autopilot in software, as ArduPilot's own simulation has them over TCP.

Each port serves one client at a time; a second one is let in, and hears nothing, until the first
has gone. The boot waits for the client of the first port, and the other ports open only then.
"""

from __future__ import annotations

import socket
from contextlib import suppress

Address = tuple[str, int]
PORT_STEPS = (0, 2, 3)
"""Added to the first port: 5760, 5762, 5763."""
RECEIVE_BYTES = 65535


class SerialPort:
    """One port and its client; what is told while there is none is lost.

    Raises:
        OSError: The port is taken.
    """

    def __init__(self, host: str, port: int) -> None:
        self.address: Address = ('serial', port)
        self._listener = socket.create_server((host, port), reuse_port=False)
        self._listener.setblocking(False)
        self._client: socket.socket | None = None

    @property
    def sockets(self) -> list[socket.socket]:
        """What to wait for."""
        return [self._listener] if self._client is None else [self._client]

    @property
    def has_client(self) -> bool:
        """Somebody is being served."""
        return self._client is not None

    def hear(self) -> bytes | None:
        """Return what the client sent, empty bytes for a client that has just come."""
        if self._client is None:
            return self._accept()
        try:
            data = self._client.recv(RECEIVE_BYTES)
        except BlockingIOError:
            return None
        except OSError:
            data = b''
        if not data:
            self.hang_up()
            return None
        return data

    def tell(self, data: bytes) -> bool:
        """Send; False when it was lost."""
        if self._client is None:
            return False
        try:
            self._client.sendall(data)
        except OSError:
            self.hang_up()  # half a message may have left: only a new line is clean
            return False
        return True

    def hang_up(self) -> None:
        """Let the client go."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def close(self) -> None:
        """Release the port."""
        self.hang_up()
        self._listener.close()

    def _accept(self) -> bytes | None:
        with suppress(BlockingIOError, ConnectionError):
            self._client, _ = self._listener.accept()
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b''
        return None


class SerialPorts:
    """The ports of one autopilot.

    Args:
        host: Address on which they listen.
        first_port: 0: there are none.

    Raises:
        OSError: A port is taken.
    """

    def __init__(self, host: str, first_port: int) -> None:
        self._host, self._first_port = host, first_port
        self._ports: dict[Address, SerialPort] = {}
        self.waits_for_client = False
        """The autopilot does not boot before somebody is there."""
        if first_port:
            self._open(0)
            self.waits_for_client = True

    @property
    def sockets(self) -> list[socket.socket]:
        """What to wait for."""
        return [each for port in self._ports.values() for each in port.sockets]

    def hear(self) -> list[tuple[Address, bytes]]:
        """Return what has arrived, by port; empty bytes tell of a new client."""
        heard = [(port.address, port.hear()) for port in self._ports.values()]
        if self.waits_for_client and any(port.has_client for port in self._ports.values()):
            self.waits_for_client = False
            for step in PORT_STEPS[1:]:
                self._open(step)
        return [(address, data) for address, data in heard if data is not None]

    def find(self, address: Address) -> SerialPort | None:
        """Return the port of an address, None when it is another line."""
        return self._ports.get(address)

    def close(self) -> None:
        """Release the ports."""
        for port in self._ports.values():
            port.close()

    def _open(self, step: int) -> None:
        port = SerialPort(self._host, self._first_port + step)
        self._ports[port.address] = port
