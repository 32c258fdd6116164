# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A part of a recording, in seconds since its first frame."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isnan, nan

from peace_ros.core.domain import RecordingError


@dataclass(frozen=True)
class Excerpt:
    """From a moment to another, both included."""

    start_s: float = 0.0
    end_s: float = inf

    def __post_init__(self) -> None:
        if not 0.0 <= self.start_s < self.end_s:
            raise RecordingError(
                f'--segment {self.start_s:g}:{self.end_s:g}: give START:END in seconds since the '
                'first frame, the end after the start'
            )

    @classmethod
    def parse(cls, text: str) -> Excerpt:
        """Read ``START:END``; either may be left out.

        Raises:
            RecordingError: anything else.
        """
        start, colon, end = text.partition(':')
        try:
            begin_s, end_s = float(start or 0.0), float(end or inf)
        except ValueError:
            begin_s = end_s = nan
        if not colon or isnan(begin_s + end_s):
            raise RecordingError(
                f'--segment {text!r}: give START:END in seconds since the first frame, e.g. 10:40'
            )
        return cls(begin_s, end_s)
