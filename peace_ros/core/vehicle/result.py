# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The result of a request to the autopilot."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Answer(Enum):
    """Kinds of outcome."""

    ACCEPTED = 'accepted'
    REFUSED = 'refused'
    NO_ANSWER = 'no answer'


@dataclass(frozen=True)
class RequestResult:
    """Outcome of one request; true when it was accepted."""

    answer: Answer
    reason: str = ''
    """The autopilot's own words (STATUSTEXT), or ours; empty when accepted."""
    code: int | None = None
    """MAV_RESULT of the COMMAND_ACK, None without one."""

    def __bool__(self) -> bool:
        return self.answer is Answer.ACCEPTED
