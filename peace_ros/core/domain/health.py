# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A finding about a part of the system, for ``/diagnostics``."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """Severity, with the numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Health:
    """One finding."""

    level: Level
    sentence: str
    values: tuple[tuple[str, str], ...] = ()
