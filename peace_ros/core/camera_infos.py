# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which ``camera_info`` belongs to an image: a camera may change, and its driver may stop."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

from peace_ros.core.domain import ImageError
from peace_ros.core.health import SILENT_S
from peace_ros.core.messages import ns_from_time

_KEPT = 64
"""An image waits for its prompt while newer messages come."""


class CameraInfos:
    """The newest messages of one ``camera_info``; may be used from several threads.

    Args:
        topic: its name, for sentences.
    """

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._lock = threading.Lock()
        self._kept: deque[Any] = deque(maxlen=_KEPT)
        self._newest_s = 0.0

    @property
    def is_empty(self) -> bool:
        """No message has come yet: the camera may have no calibration."""
        return not self._kept

    def add(self, message: Any, now_s: float) -> None:
        """Take a sensor_msgs/CameraInfo, at a moment (s) of the steady clock."""
        with self._lock:
            self._kept.append(message)
            self._newest_s = now_s

    def of(self, stamp_ns: int, now_s: float) -> Any:
        """Return the message with the stamp of an image, else the newest; None before the first.

        Raises:
            ImageError: none has its stamp, and they have stopped: the camera may be another by now.
        """
        with self._lock:
            for each in reversed(self._kept):
                if ns_from_time(each.header.stamp) == stamp_ns:
                    return each
            silent_s = now_s - self._newest_s
            if self._kept and silent_s >= SILENT_S:
                raise ImageError(
                    f'no camera_info on {self._topic} for {silent_s:.1f} s (limit {SILENT_S:g} s), '
                    'while images come: publish it with each image'
                )
            return self._kept[-1] if self._kept else None
