# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""SIGTERM and SIGHUP end the demo as Ctrl-C does: through its finally blocks."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    # A second signal while everything is being stopped must not leave processes behind.
    for each in _ENDING:
        signal.signal(each, signal.SIG_IGN)
    raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[None]:
    """Turn the first ending signal into KeyboardInterrupt and ignore those that follow it."""
    before = {each: signal.signal(each, _interrupt) for each in _ENDING}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
