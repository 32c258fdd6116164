# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The thread that does the heavy work of a node, on the newest input only."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from peace_ros.core.domain import PeaceError
from peace_ros.core.threads import GuardedThread, OnDefect

_Item = TypeVar('_Item')
_JOIN_S = 2.0


class NewestWorker(Generic[_Item]):
    """A thread that works on the newest item; what comes while it works replaces what waits.

    So a slow model drops frames and never accumulates latency. A PeaceError of the work is handed
    to ``complain`` and the thread goes on; any other exception is a defect: it ends the process
    through ``fail``, because a node that silently stopped would be worse.
    """

    def __init__(
        self,
        work: Callable[[_Item], None],
        complain: Callable[[PeaceError], None],
        fail: OnDefect,
        name: str,
    ) -> None:
        self._work, self._complain = work, complain
        self._ready = threading.Condition()
        self._waiting: list[_Item] = []
        self._stopping = False
        self.dropped = 0
        """Items that were replaced before they were worked on."""
        self._thread = GuardedThread(self._loop, name, fail)
        self._thread.start()

    def offer(self, item: _Item) -> None:
        """Put an item in place of the one that waits."""
        with self._ready:
            self.dropped += len(self._waiting)
            self._waiting[:] = [item]
            self._ready.notify()

    def close(self) -> None:
        """Let the current work end and stop; waits two seconds at most."""
        with self._ready:
            self._stopping = True
            self._ready.notify()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=_JOIN_S)

    def _next(self) -> _Item | None:
        with self._ready:
            self._ready.wait_for(lambda: self._stopping or bool(self._waiting))
            return None if self._stopping else self._waiting.pop()

    def _loop(self) -> None:
        while (item := self._next()) is not None:
            self._do(item)

    def _do(self, item: _Item) -> None:
        try:
            self._work(item)
        except PeaceError as error:
            self._complain(error)
