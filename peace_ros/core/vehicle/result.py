# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The result of a request to the autopilot, and the counts of what was not used."""

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


@dataclass(frozen=True)
class LineCounts:
    """Messages that were not used."""

    ignored: int = 0
    """Of other systems than the chosen autopilot, or from another address."""
    unsigned: int = 0
    """Without a signature."""
    forged: int = 0
    """Signed with another key, damaged, or with a time stamp that was used before."""
    rejected: int = 0
    """Of the autopilot, with values that are not numbers or cannot be."""
    late: int = 0
    """Of the autopilot, received twice or out of order."""
