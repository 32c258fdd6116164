# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who may command: the token of the page, and a ticket for each command, valid once and briefly."""

from __future__ import annotations

import secrets
from dataclasses import dataclass

TICKET_S = 10.0
ACTIONS = ('engage', 'disengage')


@dataclass(frozen=True)
class _Ticket:
    action: str
    until_s: float


class Tickets:
    """Hands out tickets and takes each back once; not thread-safe."""

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(24)
        """Whoever knows it may command; it is in the address that is printed at the start."""
        self._open: dict[str, _Ticket] = {}

    def is_token(self, given: str) -> bool:
        """Tell whether this is the token, in a time that does not depend on the answer."""
        return secrets.compare_digest(given.encode(), self.token.encode())

    def issue(self, action: str, now_s: float) -> str:
        """Return a ticket for an action; earlier tickets for the same action end.

        Args:
            action: One of ``ACTIONS``.
            now_s: Steady clock.
        """
        ticket = secrets.token_urlsafe(16)
        self._open = {key: each for key, each in self._open.items() if each.action != action}
        self._open[ticket] = _Ticket(action, now_s + TICKET_S)
        return ticket

    def take(self, ticket: str, now_s: float) -> str | None:
        """Return the action of a ticket, None when it is unknown, used, or too old."""
        found = self._open.pop(ticket, None)
        return None if found is None or now_s > found.until_s else found.action
