# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The only kind of thread that core and nodes start: its defects reach the owner of the thread."""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable

OnDefect = Callable[[BaseException], None]
"""Takes the exception that ended a thread; called in that thread, once."""


class GuardedThread(threading.Thread):
    """A daemon thread whose unhandled exception is recorded and handed to its owner.

    Also SystemExit and KeyboardInterrupt, which Python itself drops without a word in a thread.

    Args:
        target: The work.
        name: Shown in logs and in the status of a node that failed.
        on_defect: The owner; None: the traceback goes to standard error.
    """

    def __init__(
        self, target: Callable[[], object], name: str, on_defect: OnDefect | None = None
    ) -> None:
        super().__init__(name=name, daemon=True)
        self._work = target
        self._on_defect = on_defect or print_defect
        self.defect: BaseException | None = None
        """What ended the thread, None while nothing did."""

    def run(self) -> None:
        """Do the work; :meth:`start` calls it."""
        try:
            self._work()
        except BaseException as error:
            self.defect = error
            self._on_defect(error)


def print_defect(error: BaseException) -> None:
    """Print the name of the thread that calls this, and the traceback, to standard error."""
    print(f'a defect ended thread {threading.current_thread().name}:', file=sys.stderr)
    traceback.print_exception(error)
    sys.stderr.flush()
