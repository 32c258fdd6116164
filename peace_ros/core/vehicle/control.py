# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is in control of the vehicle: a mode that we did not request means somebody else; pure."""

from __future__ import annotations

GRACE_NS = 1_000_000_000
"""How long after the end of a request its mode may still be reported."""


SETTLE_NS = 250_000_000
"""After a silence, older messages may still come for so long: a mode among them is not of now."""


class Control:
    """Distinguishes a mode that we left on purpose from a takeover.

    Args:
        silence_limit_s: After so long without any message the mode is not known; 0: it always is.
    """

    def __init__(self, silence_limit_s: float = 0.0) -> None:
        self._silence_ns = round(silence_limit_s * 1e9)
        self._heard_ns: int | None = None
        self._resumed_ns: int | None = None
        """First message after a silence, None once the mode is known again."""
        self.taken_over = False
        """A person or a failsafe has left the mode that obeys us, since we were last in it."""
        self._leaving_to = ''
        self._leaving_until_ns = 0

    def hear(self, now_ns: int, *, is_mode: bool) -> None:
        """Take note of a message, ``is_mode`` of a HEARTBEAT."""
        if not self._silence_ns:
            return
        if self._heard_ns is not None and now_ns - self._heard_ns > self._silence_ns:
            self._resumed_ns = now_ns
        self._heard_ns = now_ns
        if is_mode and self._resumed_ns is not None and now_ns - self._resumed_ns >= SETTLE_NS:
            self._resumed_ns = None

    def mode_known(self, now_ns: int) -> bool:
        """Return whether the mode was reported since the line was last silent."""
        if not self._silence_ns or self._heard_ns is None:
            return True
        return self._resumed_ns is None and now_ns - self._heard_ns <= self._silence_ns

    def ask_anew(self) -> None:
        """A person requests control anew: an earlier takeover no longer counts."""
        self.taken_over = False

    def leave_to(self, mode: str, until_ns: int) -> None:
        """Note that we request another mode ourselves, which must be reported until then."""
        self._leaving_to, self._leaving_until_ns = mode, until_ns + GRACE_NS

    def stay(self) -> None:
        """The request was refused, or it is done."""
        self._leaving_until_ns = 0

    def left_for(self, mode: str, now_ns: int) -> None:
        """Note that the mode in which the vehicle obeys us was left for another one."""
        if now_ns > self._leaving_until_ns or mode != self._leaving_to:
            self.taken_over = True
        self._leaving_until_ns = 0
