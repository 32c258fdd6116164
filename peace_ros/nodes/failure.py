# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a node with a defect ends: at once, with a few last steps, within a second."""

from __future__ import annotations

import os
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from typing import NoReturn

from peace_ros.core.threads import GuardedThread

EXIT_FAILED = 1
_LAST_S = 0.75
"""The process ends so long after the defect at the latest, whatever is still under way."""


class Failure:
    """The first defect of a node, and what must still be done about it."""

    def __init__(self) -> None:
        self.error: BaseException | None = None
        """What has failed, None while nothing has."""
        self._lock = threading.Lock()
        self._begun_s = 0.0
        self._threads: list[GuardedThread] = []

    def begin(
        self, error: BaseException, last_steps: Callable[[str], Sequence[Callable[[], None]]]
    ) -> None:
        """Begin the last steps and the log, each in a thread of its own: none waits for another.

        Args:
            error: What ended the thread that calls this.
            last_steps: Returns the steps, given the sentence that says what has failed.
        """
        name = threading.current_thread().name
        sentence = f'a defect ended thread {name}: {type(error).__name__}: {error}; see the log'
        with self._lock:
            if self.error is not None:
                return
            self.error, self._begun_s = error, time.monotonic()
            for work in (*last_steps(sentence), lambda: traceback.print_exception(error)):
                thread = GuardedThread(work, 'last_step')
                thread.start()
                self._threads.append(thread)

    def end_process(self) -> NoReturn:
        """End without cleaning up, which could block or meet again what is broken."""
        until_s = self._begun_s + _LAST_S
        self._lock.acquire(timeout=_LAST_S)
        for thread in self._threads:
            thread.join(timeout=max(0.0, until_s - time.monotonic()))
        os._exit(EXIT_FAILED)
