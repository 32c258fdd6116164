# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Maps the autopilot's clock to ours by TIMESYNC round trips, of which the quickest are used.

Pure: clocks are handed in. An answer that took long says little about when it was given, so the
offset is the median over the round trips that were nearly as quick as the quickest.
"""

from __future__ import annotations

from collections import deque
from statistics import median

WINDOW = 40
FEWEST = 3
"""Round trips before an offset is used."""
KNOWN = 3 * FEWEST
"""Round trips after which the clocks are asked for less often."""
QUICK_NS = 2_000_000
"""Slack above the quickest round trip."""
SLOWEST_NS = 500_000_000
"""Longer round trips are not used at all."""
STEP_NS = 50_000_000
"""A deviation beyond this and beyond the round trip is a step of one of the clocks."""
STEPS_TO_BELIEVE = 3
OLDEST_NS = 1_000_000_000
"""A message that seems older than this at receipt proves that the offset is wrong."""
AHEAD_NS = 20_000_000
"""Resolution of the clocks: so much in the future is still now."""


class TimeMap:
    """Offset between the autopilot's time since boot and the node clock."""

    def __init__(self) -> None:
        self._samples: deque[tuple[int, int]] = deque(maxlen=WINDOW)
        self._deviating = 0
        self._offset_ns: int | None = None
        self._last_stamp_ns: dict[str, int] = {}
        self.steps = 0
        """How often one of the clocks was seen to step."""

    @property
    def offset_ns(self) -> int | None:
        """Node clock minus the autopilot's; None until it is known."""
        return self._offset_ns

    @property
    def samples(self) -> int:
        """Round trips in the window."""
        return len(self._samples)

    @property
    def wants_more(self) -> bool:
        """Round trips are needed soon: too few were made, or the last one did not fit."""
        return len(self._samples) < KNOWN or self._deviating > 0

    @property
    def round_trip_ns(self) -> int | None:
        """The quickest round trip of the window."""
        return min((trip for trip, _ in self._samples), default=None)

    def forget(self) -> None:
        """Begin anew: the autopilot rebooted."""
        self._samples.clear()
        self._offset_ns = None
        self._deviating = 0

    def add(self, sent_ns: int, remote_ns: int, received_ns: int) -> None:
        """Take one round trip.

        Args:
            sent_ns: Node clock when we asked.
            remote_ns: The autopilot's clock in its answer.
            received_ns: Node clock when the answer came.
        """
        trip_ns = received_ns - sent_ns
        if not 0 <= trip_ns <= SLOWEST_NS:
            return
        offset_ns = (sent_ns + received_ns) // 2 - remote_ns
        if self._offset_ns is not None and abs(offset_ns - self._offset_ns) > STEP_NS + trip_ns:
            self._deviating += 1
            if self._deviating < STEPS_TO_BELIEVE:
                return
            self.forget()
            self.steps += 1
        self._deviating = 0
        self._samples.append((trip_ns, offset_ns))
        if len(self._samples) < FEWEST:
            return
        limit_ns = min(trip for trip, _ in self._samples) + QUICK_NS
        quick = [offset for trip, offset in self._samples if trip <= limit_ns]
        # Clocks that run at different speeds (a simulation that does) have no offset.
        drifts = max(quick) - min(quick) > STEP_NS + limit_ns
        self._offset_ns = None if drifts else round(median(quick))

    def stamp_ns(self, boot_ms: int, received_ns: int, series: str = '') -> int:
        """Return the node clock of a moment of the autopilot's; stamps of a series never go back.

        Where the offset is unknown or in doubt, or gives a moment in the future or long ago, it is
        the moment of receipt: a simulation that stood still for a moment has lost that time.
        """
        stamp_ns = received_ns
        if self._offset_ns is not None and not self._deviating:
            mapped_ns = boot_ms * 1_000_000 + self._offset_ns
            if received_ns - OLDEST_NS <= mapped_ns <= received_ns + AHEAD_NS:
                stamp_ns = min(mapped_ns, received_ns)
        last_ns = self._last_stamp_ns.get(series, 0)
        if received_ns < last_ns - OLDEST_NS:
            last_ns = 0  # our own clock stepped back
        stamp_ns = max(stamp_ns, last_ns + 1)
        self._last_stamp_ns[series] = stamp_ns
        return stamp_ns
