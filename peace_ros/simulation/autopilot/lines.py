# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sockets of a simulated autopilot: UDP, TCP, and its serial ports.

A serial port is a TCP port that serves one client at a time, as those of ArduPilot's own
simulation (5760, 5762, 5763): a second client is connected, and hears nothing, until the first has
gone. The boot waits for the client of the first serial port, and the others open only then.
"""

from __future__ import annotations

import select
import socket
from contextlib import suppress

from peace_ros.core.domain.errors import VehicleError

Address = tuple[str, int]
MAX_DATAGRAMS = 256
"""Datagrams taken in one turn, so that a flood cannot stop the physics."""
SERIAL_STEPS = (0, 2, 3)
"""Added to the first serial port: 5760, 5762, 5763."""
RECEIVE_BYTES = 65535
_SERIAL = 'serial'
"""In place of the host in the address of whoever is at a serial port."""


class TcpPort:
    """A listening port and its clients.

    Raises:
        VehicleError: The port is taken.
    """

    def __init__(self, host: str, port: int, *, is_serial: bool) -> None:
        self._serial: Address | None = (_SERIAL, port) if is_serial else None
        try:
            self._listener = socket.create_server((host, port), reuse_port=False)
        except OSError as error:
            raise VehicleError(_taken('TCP', host, port, error)) from error
        self._listener.setblocking(False)
        self.clients: dict[Address, socket.socket] = {}

    @property
    def sockets(self) -> list[socket.socket]:
        """What to wait for."""
        listening = [self._listener] if self._accepts else []
        return [*listening, *self.clients.values()]

    @property
    def _accepts(self) -> bool:
        return self._serial is None or not self.clients

    def hear(self) -> list[tuple[Address, bytes]]:
        """Return what has arrived; empty bytes tell of a new client of a serial port."""
        heard: list[tuple[Address, bytes]] = []
        if self._accepts and self._accept() and self._serial is not None:
            heard.append((self._serial, b''))
        for address, client in list(self.clients.items()):
            try:
                data = client.recv(RECEIVE_BYTES)
            except BlockingIOError:
                continue
            except OSError:
                data = b''
            if data:
                heard.append((address, data))
            else:
                self.hang_up(address)
        return heard

    def tell(self, address: Address, data: bytes) -> bool:
        """Send to a client; False when it was lost."""
        try:
            self.clients[address].sendall(data)
        except OSError:
            self.hang_up(address)  # half a message may have left: only a new line is clean
            return False
        return True

    def hang_up(self, address: Address) -> None:
        """Close the connection of a client, if there is one."""
        client = self.clients.pop(address, None)
        if client is not None:
            client.close()

    def close(self) -> None:
        """Release the port."""
        for address in list(self.clients):
            self.hang_up(address)
        self._listener.close()

    def _accept(self) -> bool:
        with suppress(BlockingIOError, ConnectionError):
            client, address = self._listener.accept()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.clients[self._serial or (address[0], address[1])] = client
            return True
        return False


class Lines:
    """Hears and tells peers by their address; TCP addresses and UDP addresses never meet.

    Args:
        host: Address on which it listens.
        port: UDP port.
        tcp_port: TCP port for any number of peers; 0: none.
        serial_port: First of the TCP ports that serve one peer each; 0: none.

    Raises:
        VehicleError: A port is taken.
    """

    def __init__(self, host: str, port: int, tcp_port: int = 0, serial_port: int = 0) -> None:
        self._host, self._serial_port = host, serial_port
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._ports: list[TcpPort] = []
        self.waits_for_client = bool(serial_port)
        """The first serial port has had no client yet, and the boot waits for one."""
        try:
            self._udp.bind((host, port))
            self._udp.setblocking(False)
            if tcp_port:
                self._ports.append(TcpPort(host, tcp_port, is_serial=False))
            if serial_port:
                self._open_serial(0)
        except OSError as error:
            self.close()
            raise VehicleError(_taken('UDP', host, port, error)) from error
        except VehicleError:
            self.close()
            raise

    @property
    def port(self) -> int:
        """UDP port."""
        return int(self._udp.getsockname()[1])

    def wait(self, seconds: float) -> None:
        """Sleep until something arrives, at most so long."""
        sockets = [self._udp, *(each for port in self._ports for each in port.sockets)]
        select.select(sockets, [], [], max(0.0, seconds))

    def hear(self) -> list[tuple[Address, bytes, bool]]:
        """Return what has arrived: address, bytes, whether they are a whole datagram."""
        heard: list[tuple[Address, bytes, bool]] = []
        for _ in range(MAX_DATAGRAMS):
            try:
                data, address = self._udp.recvfrom(RECEIVE_BYTES)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # a peer that went away answers with an ICMP error
            heard.append((address, data, True))
        for port in self._ports:
            heard += [(address, data, False) for address, data in port.hear()]
        if self.waits_for_client and any(address[0] == _SERIAL for address, _, _ in heard):
            self.waits_for_client = False
            for step in SERIAL_STEPS[1:]:
                self._open_serial(step)
        return heard

    def tell(self, address: Address, data: bytes) -> bool:
        """Send; False when it was lost."""
        for port in self._ports:
            if address in port.clients:
                return port.tell(address, data)
        if address[0] == _SERIAL:
            return False
        try:
            self._udp.sendto(data, address)
        except OSError:
            return False
        return True

    def hang_up(self, address: Address) -> None:
        """Close a TCP connection."""
        for port in self._ports:
            port.hang_up(address)

    def close(self) -> None:
        """Release the ports."""
        for port in self._ports:
            port.close()
        self._udp.close()

    def _open_serial(self, step: int) -> None:
        self._ports.append(TcpPort(self._host, self._serial_port + step, is_serial=True))


def _taken(kind: str, host: str, port: int, error: OSError) -> str:
    return (
        f'simulated autopilot on {kind} {host}:{port}: {error.strerror};'
        ' end the process that holds the port or choose another'
    )
