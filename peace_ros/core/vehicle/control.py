# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is in control of the vehicle: a mode that we did not request means somebody else; pure."""

from __future__ import annotations

GRACE_NS = 1_000_000_000
"""How long after the end of a request its mode may still be reported."""


class Control:
    """Distinguishes a mode that we left on purpose from a takeover."""

    def __init__(self) -> None:
        self.taken_over = False
        """A person or a failsafe has left the mode that obeys us, since we were last in it."""
        self._leaving_to = ''
        self._leaving_until_ns = 0

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
