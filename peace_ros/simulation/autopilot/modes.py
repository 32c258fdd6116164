# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Flight modes of ArduCopter that the simulated autopilot knows, and what each allows."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Mode(IntEnum):
    """Custom mode number in HEARTBEAT."""

    STABILIZE = 0
    ALT_HOLD = 2
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    POSHOLD = 16
    BRAKE = 17
    GUIDED_NOGPS = 20
    TAKEOFF = 1000
    """Of PX4 only, where a take-off is a mode of its own; no number of ArduCopter."""


@dataclass(frozen=True)
class ModeRules:
    """What a mode needs and allows."""

    needs_position: bool
    armable: bool


RULES: dict[Mode, ModeRules] = {
    Mode.STABILIZE: ModeRules(needs_position=False, armable=True),
    Mode.ALT_HOLD: ModeRules(needs_position=False, armable=True),
    Mode.GUIDED: ModeRules(needs_position=True, armable=True),
    Mode.LOITER: ModeRules(needs_position=True, armable=True),
    Mode.RTL: ModeRules(needs_position=True, armable=False),
    Mode.LAND: ModeRules(needs_position=False, armable=False),
    Mode.POSHOLD: ModeRules(needs_position=True, armable=True),
    Mode.BRAKE: ModeRules(needs_position=True, armable=False),
    Mode.GUIDED_NOGPS: ModeRules(needs_position=False, armable=True),
    Mode.TAKEOFF: ModeRules(needs_position=True, armable=True),
}


class Result(IntEnum):
    """MAV_RESULT of a command."""

    ACCEPTED = 0
    REJECTED = 1
    """Temporarily: PX4 says it where ArduPilot says FAILED."""
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class Severity(IntEnum):
    """MAV_SEVERITY of a STATUSTEXT, those that are used."""

    CRITICAL = 2
    WARNING = 4
    INFO = 6


class LandedState(IntEnum):
    """MAV_LANDED_STATE of EXTENDED_SYS_STATE."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4
