# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Injects faults into a simulated autopilot of another process."""

from __future__ import annotations

import json
import socket
import time
from typing import Any

from peace_ros.core.domain.errors import VehicleError

LOOPBACK = '127.0.0.1'
MAX_BYTES = 8192
RESEND_S = 0.5


class FaultClient:
    """Injects faults into an ``autopilot_sim`` of another process.

    Args:
        port: Its ``fault_port``.
        timeout_s: Longest wait for an answer.
    """

    def __init__(self, port: int, timeout_s: float = 3.0) -> None:
        self._timeout_s = timeout_s
        self._number = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((LOOPBACK, port))

    def inject(self, fault: str, /, **arguments: Any) -> dict[str, Any]:
        """Put one fault in; as :func:`peace_ros.simulation.autopilot.faults.inject`.

        Raises:
            VehicleError: As there, or no answer comes.
        """
        self._number += 1
        request = json.dumps({'fault': fault, 'id': self._number, **arguments}).encode()
        deadline = time.monotonic() + self._timeout_s
        while (left_s := deadline - time.monotonic()) > 0.0:
            reply = self._ask(request, min(RESEND_S, left_s))
            if reply is None:
                continue
            if not reply.pop('ok'):
                raise VehicleError(str(reply['error']))
            return reply
        raise VehicleError(
            f'fault {fault}: no answer within {self._timeout_s} s; '
            'is the autopilot started with fault_port?'
        )

    def state(self) -> dict[str, Any]:
        """Return where the vehicle truly is."""
        return self.inject('state')

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()

    def _ask(self, request: bytes, wait_s: float) -> dict[str, Any] | None:
        """Send and wait for the answer that carries our number."""
        until = time.monotonic() + wait_s
        try:
            self._socket.send(request)
            while (left_s := until - time.monotonic()) > 0.0:
                self._socket.settimeout(left_s)
                reply: dict[str, Any] = json.loads(self._socket.recv(MAX_BYTES))
                if reply.pop('id', None) == self._number:
                    return reply
        except TimeoutError:
            return None
        except ConnectionError:
            time.sleep(max(0.0, until - time.monotonic()))  # not there yet
        return None
