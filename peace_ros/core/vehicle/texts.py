# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""STATUSTEXT, long ones put together from their chunks, cleaned of what moves a terminal."""

from __future__ import annotations

from collections import deque
from typing import Any

MAX_TEXTS = 50
CHUNK = 50
MAX_OPEN = 8
MAX_CHARACTERS = 1024


class StatusTexts:
    """The newest texts of the autopilot."""

    def __init__(self) -> None:
        self.entries: deque[tuple[int, str]] = deque(maxlen=MAX_TEXTS)
        """(steady clock ns, text), oldest first."""
        self._chunks: dict[int, str] = {}

    @property
    def newest(self) -> str:
        """The newest text, empty when there was none."""
        return self.entries[-1][1] if self.entries else ''

    def take(self, message: Any, steady_ns: int) -> None:
        """Take a STATUSTEXT."""
        text = message.text
        text = text if isinstance(text, str) else text.decode('utf-8', 'replace')
        text = text.rstrip('\0')
        if message.id:
            if len(self._chunks) > MAX_OPEN:
                self._chunks.clear()
            whole = self._chunks.pop(message.id, '') + text
            if len(text) >= CHUNK and len(whole) < MAX_CHARACTERS:
                self._chunks[message.id] = whole
                return
            text = whole
        self.entries.append((steady_ns, printable(text)))


def printable(text: str) -> str:
    """Return a text in which control and invisible characters became '?': one line, no escapes."""
    return ''.join(each if each.isprintable() else '?' for each in text)
