# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ``landing`` node with an executor that can be stalled, and threads that can be broken.

``fault/stall`` (Float64): a callback takes so many seconds. ``fault/defect`` (String): the name of
a thread, which raises an exception wherever it is, or as soon as it is started; ``timer`` for the
steps, ``callback`` for a subscription; ``stuck``: the thread of the sender stands still.
"""

from __future__ import annotations

import ctypes
import sys
import threading
import time
from typing import Any

from std_msgs.msg import Float64, String

from peace_ros.core.threads import GuardedThread
from peace_ros.core.vehicle import SetpointSender
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.qos import RESULT
from peace_ros.nodes.runtime import run


class InjectedDefectError(RuntimeError):
    """What no author expected."""


def break_thread(name: str) -> None:
    """Raise :class:`InjectedDefectError` in all threads of a name, those to come included."""
    run_thread = GuardedThread.run

    def raise_at_start(self: GuardedThread) -> None:
        if self.name == name:
            self._work = _raise
        run_thread(self)

    GuardedThread.run = raise_at_start  # type: ignore[method-assign]
    for thread in threading.enumerate():
        if thread.name == name and thread.ident is not None:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(
                ctypes.c_ulong(thread.ident), ctypes.py_object(InjectedDefectError)
            )


def _raise() -> None:
    raise InjectedDefectError


def _stand_still(_sender: SetpointSender) -> None:
    time.sleep(1e3)


class StallableLandingNode(LandingNode):
    """Its steps wait behind a callback that takes as long as it is told."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._broken_step = False
        # In the thread that steps.
        self.create_subscription(
            Float64, 'fault/stall', lambda message: time.sleep(message.data), RESULT
        )
        self.create_subscription(String, 'fault/defect', self._on_defect, RESULT)

    def _on_defect(self, message: String) -> None:
        if message.data == 'callback':
            _raise()
        elif message.data == 'timer':
            self._broken_step = True
        elif message.data == 'stuck':
            setattr(SetpointSender, 'tick', _stand_still)  # noqa: B010
        else:
            break_thread(message.data)

    def _step(self) -> None:
        if self._broken_step:
            _raise()
        super()._step()


def main() -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(StallableLandingNode)


if __name__ == '__main__':
    sys.exit(main())
