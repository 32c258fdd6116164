# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Opens the link to the vehicle in the background; while nothing is heard, it says so."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from math import inf

from peace_ros.core.domain import Telemetry, VehicleError
from peace_ros.core.threads import GuardedThread, OnDefect
from peace_ros.core.vehicle import VehicleLink

_RETRY_S = 1.0
_JOIN_S = 0.2
"""For one that waits for a HEARTBEAT, which it may do for seconds: it ends with the process."""


def newest_telemetry(link: VehicleLink | None) -> tuple[Telemetry | None, float]:
    """Return what the vehicle last said and how old (s) it is; None and infinite before."""
    told = None if link is None else link.telemetry()
    if told is None or told.received_ns == 0:
        return None, inf
    return told, (time.monotonic_ns() - told.received_ns) / 1e9


class Connection:
    """Opens a link in a thread, and tries again until it is open."""

    def __init__(
        self, open_link: Callable[[], VehicleLink], say: Callable[[str], None], on_defect: OnDefect
    ) -> None:
        """Begin to open.

        Args:
            open_link: Returns the link or raises VehicleError; may block for seconds.
            say: Takes the sentence of each failure; it limits how often it repeats itself.
            on_defect: Takes what ended the thread, other than VehicleError.

        """
        self._open, self._say = open_link, say
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._link: VehicleLink | None = None
        self._problem = 'the autopilot has not been heard yet'
        self._thread = GuardedThread(self._run, 'connection', on_defect)
        self._thread.start()

    @property
    def link(self) -> VehicleLink | None:
        """The link once it is open."""
        with self._lock:
            return self._link

    @property
    def problem(self) -> str:
        """Why there is no link, empty when there is one."""
        with self._lock:
            return self._problem

    def close(self) -> None:
        """Stop trying and close the link."""
        with self._lock:
            self._stop.set()
            link, self._link = self._link, None
        if link is not None:
            link.close()
        self._thread.join(timeout=_JOIN_S)

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                link = self._open()
            except VehicleError as error:
                with self._lock:
                    self._problem = str(error)
                self._say(str(error))
                self._stop.wait(_RETRY_S)
                continue
            with self._lock:
                self._problem = ''
                if not self._stop.is_set():
                    self._link = link
                    return
            link.close()
