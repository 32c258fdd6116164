# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The port on which a simulated autopilot takes faults; polled by its loop."""

from __future__ import annotations

import json
import socket
from typing import TYPE_CHECKING, Any

from peace_ros.core.domain.errors import VehicleError
from peace_ros.simulation.autopilot.fault_client import LOOPBACK, MAX_BYTES
from peace_ros.simulation.autopilot.faults import inject

if TYPE_CHECKING:
    from peace_ros.simulation.autopilot.autopilot import AutopilotSim

MAX_REQUESTS = 16
"""Requests taken in one turn."""


class FaultServer:
    """Takes requests on the loopback address; polled by the loop of the simulation."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._done: tuple[tuple[str, int] | None, Any, bytes] = (None, None, b'')
        try:
            self._socket.bind((LOOPBACK, port))
        except OSError as error:
            self._socket.close()
            raise VehicleError(
                f'fault_port {port}: {error.strerror}; choose another or end who holds it'
            ) from error
        self._socket.setblocking(False)

    def poll(self, sim: AutopilotSim) -> None:
        """Carry out what has arrived."""
        for _ in range(MAX_REQUESTS):
            try:
                data, address = self._socket.recvfrom(MAX_BYTES)
            except (BlockingIOError, ConnectionError):
                return
            self._send(self._carry_out(sim, data, address), address)

    def close(self) -> None:
        """Release the port."""
        self._socket.close()

    def _carry_out(self, sim: AutopilotSim, data: bytes, address: tuple[str, int]) -> bytes:
        number: Any = None
        try:
            request = dict(json.loads(data))
            number = request.pop('id', None)
            if number is not None and self._done[:2] == (address, number):
                return self._done[2]  # asked again because the answer was late
            answer = {'ok': True, **inject(sim, str(request.pop('fault', '')), **request)}
        except (VehicleError, TypeError, ValueError) as error:
            answer = {'ok': False, 'error': str(error)}
        reply = json.dumps({**answer, 'id': number}).encode()
        self._done = (address, number, reply)
        return reply

    def _send(self, reply: bytes, address: tuple[str, int]) -> None:
        try:
            self._socket.sendto(reply, address)
        except OSError:
            return  # the asker is gone or asks again
