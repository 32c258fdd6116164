# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which frames are recorded: those that the networks looked at, or a few where they do not."""

from __future__ import annotations

from collections import OrderedDict, deque

_MOST_WAITING_BYTES = 64_000_000
_MOST_WAITING = 40
_UNSEEN_S = 1.0
"""A frame is recorded without a heatmap when there was none for so long."""
_IDLE_S = 5.0
"""While nothing is engaged one frame in so long is enough."""
_KEPT_STAMPS = 16
_EARLY = 0.1
"""Share of the period by which a frame may come too early: cameras are not exact."""


class FrameChoice:
    """Keeps frames until their heatmap comes; only bytes are handled here.

    Args:
        rate_hz: most frames per second of the steady clock.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._waiting: OrderedDict[int, bytes] = OrderedDict()
        self._bytes = 0
        self._last_s = float('-inf')
        self._stamps: deque[int] = deque(maxlen=_KEPT_STAMPS)
        self._late: deque[int] = deque(maxlen=_KEPT_STAMPS)
        """Stamps of recorded heatmaps whose frame, which is larger, may still come."""
        self.is_engaged = False
        """The landing is not IDLE."""

    def image(self, stamp_ns: int, cdr: bytes, now_s: float) -> bool:
        """Take a frame; return whether it is to be recorded at once."""
        if stamp_ns in self._late:
            self._late.remove(stamp_ns)
            return True
        if now_s - self._last_s >= (_UNSEEN_S if self.is_engaged else _IDLE_S):
            self._choose(stamp_ns, now_s)
            return True
        # A camera may repeat a stamp, as one that never sets it does.
        self._bytes += len(cdr) - len(self._waiting.get(stamp_ns, b''))
        self._waiting[stamp_ns] = cdr
        while len(self._waiting) > _MOST_WAITING or self._bytes > _MOST_WAITING_BYTES:
            self._drop_oldest()
        return False

    def heatmap(self, stamp_ns: int, now_s: float) -> tuple[bool, bytes | None]:
        """Return whether a heatmap is to be recorded, and its frame where that is not yet."""
        if stamp_ns in self._stamps:
            return True, None
        period_s = self._period_s if self.is_engaged else _IDLE_S
        if now_s - self._last_s < (1.0 - _EARLY) * period_s:
            return False, None
        frame = self._waiting.get(stamp_ns)
        if frame is None:
            self._late.append(stamp_ns)
        while self._waiting and next(iter(self._waiting)) <= stamp_ns:
            self._drop_oldest()
        self._choose(stamp_ns, now_s)
        return True, frame

    def _choose(self, stamp_ns: int, now_s: float) -> None:
        self._stamps.append(stamp_ns)
        self._last_s = now_s

    def _drop_oldest(self) -> None:
        _, cdr = self._waiting.popitem(last=False)
        self._bytes -= len(cdr)
