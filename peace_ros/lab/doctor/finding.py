# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a check found, and the sentence that mends it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any

from peace_ros.core.domain import PeaceError

NOTHING: Mapping[str, Any] = MappingProxyType({})


class CheckResult(Enum):
    """How a check ended."""

    OK = 'ok'
    MEND = 'mend'
    """Something must be changed before a flight."""
    NOT_CHECKED = 'not checked'
    """Not asked for, or not possible here."""


@dataclass(frozen=True)
class Finding:
    """One line of the report."""

    found: str
    """What is there."""
    remedy: str = ''
    """What to do; empty when nothing, or when the other sentence says it."""
    outcome: CheckResult = CheckResult.OK
    figures: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    """Name with unit -> number or text, for programs."""


def fine(found: str, **figures: Any) -> Finding:
    """Return a finding that needs no change."""
    return Finding(found, figures=figures)


def mend(found: str, remedy: str, **figures: Any) -> Finding:
    """Return a finding with what to do about it."""
    return Finding(found, remedy, CheckResult.MEND, figures)


def not_checked(found: str, remedy: str = '') -> Finding:
    """Return why a check was left out, and how to have it."""
    return Finding(found, remedy, CheckResult.NOT_CHECKED)


def of_error(error: PeaceError) -> Finding:
    """Return the finding of an error, whose sentence holds its own remedy."""
    return mend(str(error), '')


Findings = Iterator[Finding]
