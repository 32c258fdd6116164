# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a message is of the autopilot's present clock, late, or of a reboot; pure."""

from __future__ import annotations

from enum import Enum

TOLERANCE_MS = 1000
"""Largest deviation of a time stamp from the newest one that is no contradiction."""
FASTEST = 25.0
"""A simulation may run so many times faster than our clock."""
MESSAGES_TO_BELIEVE = 5
"""Messages in a row that must agree on a new clock."""
STEP_NS = 2_000_000_000
"""How long a clock that no reboot explains must be reported before it is used."""


class BootMoment(Enum):
    """What the time stamp of a message tells."""

    FITS = 'fits'
    DOUBTFUL = 'late, or not of this clock'
    STEPPED = 'the clock was set, without a reboot'
    REBOOTED = 'the autopilot has rebooted'


class BootClock:
    """Follows the time since boot; one late or absurd time stamp changes nothing.

    A reboot needs five messages in a row whose time advances with ours, none of the old clock
    among them, a HEARTBEAT among them, and a time since boot that fits into the time since the
    old clock was last heard. A new clock without the latter is a step: used after two seconds.
    Time that was left out, as by a machine that stood still, needs the five messages only.
    """

    def __init__(self) -> None:
        self._run: tuple[int, int] | None = None
        self.forget()

    def forget(self) -> None:
        """Take the next time stamp as it is."""
        self._newest: tuple[int, int] | None = None
        self._run = None

    @property
    def newest_ms(self) -> int:
        """The autopilot's clock, 0 before its first message."""
        return 0 if self._newest is None else self._newest[0]

    def judge(self, boot_ms: int, steady_ns: int, heartbeat_ns: int | None) -> BootMoment:
        """Take a time stamp.

        Args:
            boot_ms: Time since boot in the message.
            steady_ns: Steady clock at receipt.
            heartbeat_ns: Steady clock of the newest HEARTBEAT.
        """
        if self._newest is None or _follows(self._newest, boot_ms, steady_ns):
            self._run = None
            if self._newest is None or boot_ms > self._newest[0]:
                self._newest = (boot_ms, steady_ns)
            return BootMoment.FITS
        if self._run is None or not _follows(self._run, boot_ms, steady_ns):
            self._run, self._count, self._begun_ns = (boot_ms, steady_ns), 1, steady_ns
            self._fits_reboot = boot_ms <= _reach_ms(self._newest[1], steady_ns)
            return BootMoment.DOUBTFUL
        if boot_ms > self._run[0]:
            self._run, self._count = (boot_ms, steady_ns), self._count + 1
        if self._count < MESSAGES_TO_BELIEVE:
            return BootMoment.DOUBTFUL
        moment = BootMoment.FITS
        if boot_ms < self._newest[0]:
            lasts = self._fits_reboot or steady_ns - self._begun_ns >= STEP_NS
            if not lasts or (heartbeat_ns or 0) < self._begun_ns:
                return BootMoment.DOUBTFUL
            moment = BootMoment.REBOOTED if self._fits_reboot else BootMoment.STEPPED
        self._newest, self._run = self._run, None
        return moment


def _reach_ms(since_ns: int, steady_ns: int) -> float:
    return TOLERANCE_MS + FASTEST * (steady_ns - since_ns) / 1e6


def _follows(before: tuple[int, int], boot_ms: int, steady_ns: int) -> bool:
    return -TOLERANCE_MS <= boot_ms - before[0] <= _reach_ms(before[1], steady_ns)
