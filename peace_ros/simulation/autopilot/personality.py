# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ArduPilot or PX4: what the same vehicle says of itself, and which set-points it takes.

The modes of the simulation are those of ArduCopter; PX4 has its own name and number for most.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.estimate_errors import PX4_ERRORS, ErrorSizes
from peace_ros.simulation.autopilot.modes import Mode, Result

EKF_STATUS = 193
ESTIMATOR_STATUS = 230
SETPOINT_FRAMES_PX4 = frozenset({mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_NED})
OFFBOARD_LOSS_S = 1.05
"""Age of the newest set-point at which PX4 leaves OFFBOARD (measured, PX4 v1.17-alpha: 1.05 to
1.1 s)."""
DEVELOPMENT, ALPHA = mavlink.FIRMWARE_VERSION_TYPE_DEV, mavlink.FIRMWARE_VERSION_TYPE_ALPHA
CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
)
NEEDS_RADIO = frozenset({Mode.ALT_HOLD, Mode.LOITER, Mode.STABILIZE})
"""Modes of the sticks: PX4 without a radio refuses them over MAVLink and stays where it is
(measured, PX4 v1.17-alpha)."""

PX4_NUMBERS: dict[Mode, tuple[int, int]] = {
    Mode.ALT_HOLD: (2, 0),
    Mode.LOITER: (3, 0),
    Mode.TAKEOFF: (4, 2),
    Mode.BRAKE: (4, 3),
    Mode.RTL: (4, 5),
    Mode.LAND: (4, 6),
    Mode.GUIDED: (6, 0),
    Mode.STABILIZE: (7, 0),
}
"""Main and sub mode (PX4 px4_custom_mode.h)."""
PX4_NAMES: dict[Mode, str] = {
    Mode.ALT_HOLD: 'ALTCTL',
    Mode.LOITER: 'POSCTL',
    Mode.TAKEOFF: 'AUTO.TAKEOFF',
    Mode.BRAKE: 'AUTO.LOITER',
    Mode.RTL: 'AUTO.RTL',
    Mode.LAND: 'AUTO.LAND',
    Mode.GUIDED: 'OFFBOARD',
    Mode.STABILIZE: 'STABILIZED',
}


class Kind(str, Enum):
    """Which autopilot is played."""

    ARDUPILOT = 'ardupilot'
    PX4 = 'px4'


@dataclass(frozen=True)
class Personality:
    """How one autopilot names and numbers things."""

    kind: Kind = Kind.ARDUPILOT

    @property
    def is_px4(self) -> bool:
        """It plays PX4."""
        return self.kind is Kind.PX4

    @property
    def autopilot(self) -> int:
        """MAV_AUTOPILOT."""
        played = mavlink.MAV_AUTOPILOT_PX4 if self.is_px4 else mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return int(played)

    @property
    def banner(self) -> str:
        """The first STATUSTEXT."""
        name = 'PX4 v1.17.0-alpha' if self.is_px4 else 'ArduCopter V4.7.0-dev'
        return f'{name} (peace_ros simulation)'

    @property
    def version(self) -> int:
        """flight_sw_version of AUTOPILOT_VERSION: major, minor, patch, type of the firmware."""
        major, minor, patch, kind = (1, 17, 0, ALPHA) if self.is_px4 else (4, 7, 0, DEVELOPMENT)
        return int(major << 24 | minor << 16 | patch << 8 | kind)

    @property
    def capabilities(self) -> int:
        """MAV_PROTOCOL_CAPABILITY of what is served here."""
        own = mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        if self.is_px4:
            own = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        return int(CAPABILITIES | own)

    @property
    def refused(self) -> Result:
        """Answer to a mode that cannot be entered now."""
        return Result.REJECTED if self.is_px4 else Result.FAILED

    @property
    def estimator_message(self) -> int:
        """Message id of the health of its filter; the other autopilot's is unknown to it."""
        return ESTIMATOR_STATUS if self.is_px4 else EKF_STATUS

    @property
    def errors(self) -> ErrorSizes:
        """Measured errors of its estimates."""
        return PX4_ERRORS if self.is_px4 else ErrorSizes()

    def custom_mode(self, mode: Mode) -> int:
        """Return custom_mode of HEARTBEAT."""
        if not self.is_px4:
            return int(mode)
        main, sub = PX4_NUMBERS.get(mode, (1, 0))
        return main << 16 | sub << 24

    def mode_name(self, mode: Mode) -> str:
        """Return its own name of a mode."""
        return PX4_NAMES.get(mode, mode.name) if self.is_px4 else mode.name

    def mode_of_name(self, name: str) -> Mode:
        """Return the mode of its own name; KeyError where the name is unknown."""
        if not self.is_px4:
            return Mode[name]
        return {own: mode for mode, own in PX4_NAMES.items()}[name]

    def mode_of_command(self, main: float, sub: float) -> int:
        """Return the mode number that DO_SET_MODE asks for, -1 for none."""
        if not self.is_px4:
            return -1 if int(main) == Mode.TAKEOFF else int(main)
        for mode, numbers in PX4_NUMBERS.items():
            if numbers == (int(main), int(sub)):
                return int(mode)
        return -1
