# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a node says of itself: is each input alive, from one source, with plausible stamps?"""

from __future__ import annotations

import threading
from collections import deque
from itertools import pairwise

from peace_ros.core.domain import Health, Level

SILENT_S = 3.0
"""An input that was silent for this long is an error."""
LATENCY_S = 10.0
"""A stamp that is older than this when it arrives was made by another clock."""
AHEAD_S = 1.0
"""A stamp that lies further in the future was made by another clock."""
_NS = 1e9
_STAMPS = 100
_FEW = 0.6
"""Part of what is sent that arrives where a warning begins."""


class WorkHealth:
    """The worst finding of each period of reporting; may be used from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._worst: Health | None = None
        self._last = Health(Level.OK, 'has had nothing to do yet')

    def put(self, health: Health) -> None:
        """Add what was found about one piece of work."""
        with self._lock:
            self._last = health
            if self._worst is None or health.level >= self._worst.level:
                self._worst = health

    def take(self) -> Health:
        """Return the worst since the last call, and without any the last one."""
        with self._lock:
            worst, self._worst = self._worst or self._last, None
            return worst


class LossWatch:
    """Estimates from the stamps of a camera how many of its images are lost on the way.

    Two images that both arrive are one period apart when none was lost between them. So the short
    distances between stamps (their tenth percentile, against jitter) are the period; the time
    from the first to the last stamp divided by it is what was sent. Where every second or third
    image is lost with great regularity, this cannot be seen.
    """

    def __init__(self) -> None:
        self._stamps_ns: deque[int] = deque(maxlen=_STAMPS)

    def arrived(self, stamp_ns: int) -> None:
        """Take the stamp of an image; a clock that goes back begins anew."""
        if self._stamps_ns and stamp_ns <= self._stamps_ns[-1]:
            self._stamps_ns.clear()
        self._stamps_ns.append(stamp_ns)

    def rates_hz(self) -> tuple[float, float] | None:
        """Return how many are sent and how many arrive each second; None while it is not known."""
        if len(self._stamps_ns) < _STAMPS // 2:
            return None
        distances = sorted(after - before for before, after in pairwise(self._stamps_ns))
        mean_ns = (self._stamps_ns[-1] - self._stamps_ns[0]) / len(distances)
        return _NS / distances[len(distances) // 10], _NS / mean_ns


class InputWatch:
    """Watches one input of a node; may be used from several threads.

    Args:
        noun: what arrives, such as ``image``.
        topic: its full name.
        began_s: steady clock, when the watch begins.
        periodic: the messages come at one rate where none is lost, as those of a camera.
    """

    def __init__(self, noun: str, topic: str, began_s: float, *, periodic: bool = False) -> None:
        self._noun, self._topic = noun, topic
        self._losses = LossWatch() if periodic else None
        self._lock = threading.Lock()
        self._last_s, self._asked_s = began_s, began_s
        self._count = self._asked_count = 0
        self._latency_s = 0.0

    def arrived(self, stamp_ns: int, clock_ns: int, now_s: float) -> None:
        """Take note of a message.

        Args:
            stamp_ns: of its header.
            clock_ns: the clock of the node.
            now_s: steady clock.
        """
        with self._lock:
            self._last_s = now_s
            self._count += 1
            self._latency_s = (clock_ns - stamp_ns) / _NS
            if self._losses is not None:
                self._losses.arrived(stamp_ns)

    def health(self, now_s: float, sources: int) -> Health:
        """Return what is to be said of the input.

        Args:
            now_s: steady clock.
            sources: how many publish the topic now.
        """
        with self._lock:
            silent_s = now_s - self._last_s
            rate_hz = (self._count - self._asked_count) / max(now_s - self._asked_s, 1e-3)
            self._asked_s, self._asked_count = now_s, self._count
            level, sentence = self._judge(silent_s, sources)
            values = {
                'topic': self._topic,
                'publishers': str(sources),
                'messages': str(self._count),
                'rate_hz': f'{rate_hz:.1f}',
                'silent_s': f'{silent_s:.1f}',
                'latency_s': f'{self._latency_s:.3f}',
            }
            return Health(level, sentence, tuple(values.items()))

    def _judge(self, silent_s: float, sources: int) -> tuple[Level, str]:
        if sources > 1:
            return Level.ERROR, too_many(self._topic, sources)
        if silent_s >= SILENT_S:
            why = 'does its publisher work?' if sources else 'nothing publishes it'
            return Level.ERROR, f'no {self._noun} on {self._topic} for {silent_s:.0f} s: {why}'
        if self._count == 0:
            return Level.WARN, f'no {self._noun} on {self._topic} yet'
        if not -AHEAD_S <= self._latency_s <= LATENCY_S:
            side = 'behind' if self._latency_s > 0.0 else 'ahead of'
            return Level.ERROR, (
                f'stamps on {self._topic} are {abs(self._latency_s):.1f} s {side} the clock of '
                'this node: do both have one clock (use_sim_time, time synchronisation)?'
            )
        rates_hz = None if self._losses is None else self._losses.rates_hz()
        if rates_hz is not None and rates_hz[1] < _FEW * rates_hz[0]:
            return Level.WARN, (
                f'{rates_hz[1]:.1f} messages per second arrive on {self._topic}, by their stamps '
                f'about {rates_hz[0]:.0f} are sent: start their publisher with a shared-memory '
                'segment that holds them (config/fastdds.xml), or choose image_transport compressed'
            )
        return Level.OK, f'{self._noun} arrives'


def too_many(topic: str, sources: int) -> str:
    """Return the sentence about a topic that must have one publisher and has several."""
    return (
        f'{sources} publishers of {topic}, at most 1 is right: end the others (one that crashed '
        'counts for up to 20 s)'
    )
