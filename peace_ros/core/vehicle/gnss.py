# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the position rests on a GNSS fix that was lost (GPS_RAW_INT); pure."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

BRIDGED_MS = 10_000
"""A position that the filter still has so long after the fix comes from another source: dead
reckoning was seen to end after 7.1 s (ArduCopter 4.7-dev) and 5.4 s (PX4 v1.17-alpha)."""


class GnssWatch:
    """Compares what the receivers say with what the position filter says.

    A filter reports a position by dead reckoning for seconds after the last fix, with nothing in
    its flags. So the fix counts from the first 3D fix on. Without any, or when the filter keeps
    its position for longer than dead reckoning lasts, external navigation or optical flow carry
    it, until the filter loses it.
    """

    def __init__(self) -> None:
        self._fixes: dict[str, tuple[bool, bool]] = {}
        """Receiver -> it had a 3D fix in the message before the newest, and in the newest."""
        self._relied = self._carried = False
        self._lost_ms: int | None = None
        self.problem = ''
        """Why the position is not used, empty when nothing speaks against it."""
        self.fix_note = ''
        """That there is no 3D fix, empty while there is one or nothing is known."""

    def take(self, receiver: str, fix_type: int, boot_ms: int, *, known: bool | None) -> None:
        """Take what a receiver says.

        Args:
            receiver: Name of its message.
            fix_type: GPS_FIX_TYPE.
            boot_ms: The autopilot's clock.
            known: Whether the filter says that it has a position, None when it says nothing.
        """
        has_fix = fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
        self._fixes[receiver] = (self._fixes.get(receiver, (has_fix, has_fix))[1], has_fix)
        any_fix = any(newest for _, newest in self._fixes.values())
        # A fix has come back when two messages in a row say so.
        if any(all(fix) for fix in self._fixes.values()):
            self._relied, self._lost_ms = True, None
        elif self._lost_ms is None and not any_fix:
            self._lost_ms = boot_ms
        self.fix_note = '' if any_fix else f'fix type {fix_type}, 3 is needed'
        lost = self._relied and self._lost_ms is not None
        outlived = lost and boot_ms - (self._lost_ms or 0) >= BRIDGED_MS
        self._carried = known is not False and (self._carried or (outlived and known is True))
        self.problem = ''
        if lost and not self._carried:
            self.problem = (
                f'GNSS has lost its fix ({self.fix_note}): the position is dead '
                'reckoning, until the fix is back or another source carries the position'
            )
