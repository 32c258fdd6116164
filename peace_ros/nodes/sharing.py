# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Images that several nodes of one process share: received once and decoded once."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from peace_ros.core.domain import Frame
from peace_ros.core.messages import frame_from_message

_Take = Callable[[Any], None]


class SharedImages:
    """Hands each image message to all who take it; may be used from several threads."""

    def __init__(self) -> None:
        self._takers: list[_Take] = []
        self._helpers: list[_Take] = []
        self._lock = threading.Lock()
        self.decode: Callable[[Any], Frame] = frame_from_message
        """By whoever subscribes, who may know the camera."""
        self._decoded: tuple[Any, Frame] | None = None

    def add(self, take: _Take, *, when_begun: bool = False) -> None:
        """Hand the images from now on to ``take``, too.

        Args:
            take: must not block.
            when_begun: only those that another node begins to work on, see :meth:`begin`: of a
                fast camera that is a part of them.
        """
        (self._helpers if when_begun else self._takers).append(take)

    def remove(self, take: _Take) -> None:
        """Hand it no further image."""
        for takers in (self._takers, self._helpers):
            if take in takers:
                takers.remove(take)

    def offer(self, message: Any) -> None:
        """Hand on an image."""
        for take in tuple(self._takers):
            take(message)

    def begin(self, message: Any) -> None:
        """Hand an image to those who help with it, as work on it begins."""
        for take in tuple(self._helpers):
            take(message)

    def frame(self, message: Any) -> Frame:
        """Return the frame of an image; the next one who asks for the same image gets it, too."""
        with self._lock:
            if self._decoded is None or self._decoded[0] is not message:
                self._decoded = (message, self.decode(message))
            return self._decoded[1]
