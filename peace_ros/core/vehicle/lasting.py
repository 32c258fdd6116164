# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A line that is opened again after it broke: TCP and serial, with growing pauses."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.vehicle.transport import Chunk, Source, Transport, open_transport

FIRST_PAUSE_S = 0.5
LONGEST_PAUSE_S = 5.0
RECONNECT_S = 1.0
"""Longest wait for a TCP server that does not answer, when opening again."""


class LastingTransport:
    """Behaves as the transport that it opens, and opens it again after a failure.

    Args:
        url: See :func:`peace_ros.core.vehicle.transport.open_transport`.
        steady_s: Steady clock.
        open_line: Opens the line; for tests.

    Raises:
        VehicleError: The line cannot be opened the first time.
    """

    def __init__(
        self,
        url: str,
        steady_s: Callable[[], float] = time.monotonic,
        open_line: Callable[[str, float | None], Transport] = open_transport,
    ) -> None:
        self._url, self._steady_s, self._open_line = url, steady_s, open_line
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._line: Transport | None = open_line(url, None)
        self.datagrams = self._line.datagrams
        self._problem = ''
        self._pause_s = FIRST_PAUSE_S
        self._again_s = 0.0
        self.openings = 1
        """Grows whenever the line was opened: partly read messages are invalid then."""

    @property
    def problem(self) -> str:
        """Why the line is broken now, empty when it is not."""
        return self._problem

    def read(self, timeout_s: float) -> list[Chunk]:
        """Return what arrives within the time; nothing while the line is broken."""
        line = self._line
        if line is None:
            self._open_again(timeout_s)
            return []
        try:
            chunks = line.read(timeout_s)
        except VehicleError as error:
            self._break(line, str(error))
            return []
        if chunks:
            self._pause_s = FIRST_PAUSE_S
        return chunks

    def write(self, data: bytes, to: Source, /) -> None:
        """Send; VehicleError while the line is broken."""
        line = self._line
        if line is None:
            raise VehicleError(f'{self._problem}; opening it again')
        try:
            line.write(data, to)
        except VehicleError as error:
            self._break(line, str(error))
            raise

    def close(self) -> None:
        """Release the line for good."""
        self._closed.set()
        with self._lock:
            line, self._line = self._line, None
        if line is not None:
            line.close()

    def _break(self, line: Transport, problem: str) -> None:
        with self._lock:
            if self._line is not line:
                return  # the other thread was first
            self._line = None
            self._problem = problem
            self._again_s = self._steady_s() + self._pause_s
        line.close()

    def _open_again(self, timeout_s: float) -> None:
        wait_s = self._again_s - self._steady_s()
        if wait_s > 0.0:
            self._closed.wait(min(wait_s, timeout_s))
            return
        if self._closed.is_set():
            return
        self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
        try:
            line = self._open_line(self._url, RECONNECT_S)
        except VehicleError as error:
            self._problem = str(error)
            self._again_s = self._steady_s() + self._pause_s
            return
        with self._lock:
            if not self._closed.is_set():
                self._line, self._problem = line, ''
                self.openings += 1
                return
        line.close()
