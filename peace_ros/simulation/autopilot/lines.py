# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sockets of the simulated autopilot: one UDP port, and TCP ports when they are wanted."""

from __future__ import annotations

import select
import socket

from peace_ros.core.domain.errors import VehicleError
from peace_ros.simulation.autopilot.serial_ports import RECEIVE_BYTES, Address, SerialPorts

MAX_DATAGRAMS = 256
"""Datagrams taken in one turn, so that a flood cannot stop the physics."""


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
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._listener: socket.socket | None = None
        self._connections: dict[Address, socket.socket] = {}
        try:
            self._udp.bind((host, port))
        except OSError as error:
            self._udp.close()
            raise VehicleError(_taken('UDP', host, port, error)) from error
        self._udp.setblocking(False)
        if tcp_port:
            try:
                self._listener = socket.create_server((host, tcp_port), reuse_port=False)
            except OSError as error:
                self._udp.close()
                raise VehicleError(_taken('TCP', host, tcp_port, error)) from error
            self._listener.setblocking(False)
        try:
            self._serial = SerialPorts(host, serial_port)
        except OSError as error:
            self._close_network()
            raise VehicleError(_taken('TCP', host, serial_port, error)) from error

    @property
    def waits_for_client(self) -> bool:
        """Nobody has come to the first serial port yet, and the boot waits for that."""
        return self._serial.waits_for_client

    @property
    def port(self) -> int:
        """UDP port."""
        return int(self._udp.getsockname()[1])

    def wait(self, seconds: float) -> None:
        """Sleep until something arrives, at most so long."""
        listening = [] if self._listener is None else [self._listener]
        sockets = [
            self._udp,
            *listening,
            *self._connections.values(),
            *self._serial.sockets,
        ]
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
        self._accept()
        for address, connection in list(self._connections.items()):
            try:
                data = connection.recv(RECEIVE_BYTES)
            except BlockingIOError:
                continue
            except OSError:
                data = b''
            if data:
                heard.append((address, data, False))
            else:
                self.hang_up(address)
        return heard + [(address, data, False) for address, data in self._serial.hear()]

    def tell(self, address: Address, data: bytes) -> bool:
        """Send; False when it was lost."""
        serial = self._serial.find(address)
        if serial is not None:
            return serial.tell(data)
        connection = self._connections.get(address)
        try:
            if connection is None:
                self._udp.sendto(data, address)
            else:
                connection.sendall(data)
        except BlockingIOError:
            if connection is not None:
                self.hang_up(address)  # half a message may have left: only a new line is clean
            return False
        except OSError:
            if connection is not None:
                self.hang_up(address)
            return False
        return True

    def hang_up(self, address: Address) -> None:
        """Close a TCP connection."""
        serial = self._serial.find(address)
        if serial is not None:
            serial.hang_up()
        connection = self._connections.pop(address, None)
        if connection is not None:
            connection.close()

    def close(self) -> None:
        """Release the ports."""
        self._serial.close()
        self._close_network()

    def _close_network(self) -> None:
        for address in list(self._connections):
            self.hang_up(address)
        if self._listener is not None:
            self._listener.close()
        self._udp.close()

    def _accept(self) -> None:
        if self._listener is None:
            return
        try:
            connection, address = self._listener.accept()
        except (BlockingIOError, ConnectionError):
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connections[address[0], address[1]] = connection


def _taken(kind: str, host: str, port: int, error: OSError) -> str:
    return (
        f'simulated autopilot on {kind} {host}:{port}: {error.strerror};'
        ' end the process that holds the port or choose another'
    )
