# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What happened in the last ten minutes: the state and the altitude over time, and events."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass

KEPT_S = 600.0
_SAMPLE_S = 0.5
_MOST_EVENTS = 500
"""Something that flickers must not cost memory."""


@dataclass(frozen=True)
class PastMoment:
    """The landing at one moment."""

    time_s: float
    """Steady clock of the watch node."""
    state: str
    reason: str
    altitude_agl_m: float | None
    north_m: float | None
    east_m: float | None


@dataclass(frozen=True)
class Event:
    """Something that changed."""

    number: int
    time_s: float
    kind: str
    """``state``, ``reason``, ``guard``, ``site`` or ``command``."""
    sentence: str


class Timeline:
    """Samples twice per second, and at once when the state changes; not thread-safe."""

    def __init__(self) -> None:
        self.samples: deque[PastMoment] = deque()
        self.events: deque[Event] = deque(maxlen=_MOST_EVENTS)
        self._number = 0
        self._said: dict[str, str] = {}

    def add(self, sample: PastMoment) -> None:
        """Take a sample, and forget what is older than ten minutes."""
        last = self.samples[-1] if self.samples else None
        is_new = last is None or last.state != sample.state
        if last is None or is_new or sample.time_s - last.time_s >= _SAMPLE_S:
            self.samples.append(sample)
        while self.samples and sample.time_s - self.samples[0].time_s > KEPT_S:
            self.samples.popleft()
        while self.events and sample.time_s - self.events[0].time_s > KEPT_S:
            self.events.popleft()

    def note(self, time_s: float, kind: str, sentence: str) -> None:
        """Add an event, unless only the digits differ from the last one of its kind."""
        words = re.sub(r'[\d.]+', '#', sentence)
        if self._said.get(kind, '') == words:
            return
        self._said[kind] = words
        if sentence:
            self.tell(time_s, kind, sentence)

    def tell(self, time_s: float, kind: str, sentence: str) -> None:
        """Add an event in every case."""
        self._number += 1
        self.events.append(Event(self._number, time_s, kind, sentence))
