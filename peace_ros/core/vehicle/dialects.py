# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What differs between autopilots: mode numbers, the mode that obeys set-points, its message."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, hypot, sin
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.domain.geometry import rotation_matrix
from peace_ros.core.domain.motion import Pose, Setpoint

VELOCITY_HOLD_HEADING = 0x5C7
"""Type mask: use velocity and yaw rate (which is zero), ignore everything else.

The mask without yaw rate (0xDC7) would turn the nose to the direction of travel.
"""
CUSTOM_MODE = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED

Vector = tuple[float, float, float]
ModeCommand = Vector
"""The first three parameters of MAV_CMD_DO_SET_MODE."""


@dataclass(frozen=True)
class Dialect(ABC):
    """The modes and messages of one kind of autopilot."""

    hold_mode: str
    """The autopilot's own mode for holding position."""
    name: str
    """What a user calls it."""
    autopilot: int
    """MAV_AUTOPILOT in HEARTBEAT."""
    control_mode: str
    """Mode that obeys set-points."""
    land_mode: str
    """The autopilot's own mode for landing where it is."""
    estimator_message: int
    """Message id that tells what its position filter knows."""
    height_message: int
    """Message id of a height above home that needs no position."""
    streams_before_control: bool = False
    """Set-points must flow before the mode that obeys them is entered."""
    level_mode: str = ''
    """Mode in which it keeps its height, level, without a position; empty: it has none."""
    home_is_local: bool = False
    """HOME_POSITION tells where home is in the local frame, not only on the globe."""
    silence_limit_s: float = 0.0
    """After so long without any message it may have left our mode, and set-points would bring it
    back: nothing is sent until it reports its mode. 0: set-points cannot change its mode."""
    heartbeat_rate_hz: float = 0.0
    """Rate of HEARTBEAT to ask for; 0: a new mode is told at once anyway."""

    @abstractmethod
    def mode_name(self, custom_mode: int) -> str:
        """Return the autopilot's own name of a mode."""

    @abstractmethod
    def mode_command(self, mode: str) -> ModeCommand:
        """Return the parameters of MAV_CMD_DO_SET_MODE; VehicleError for an unknown mode."""

    @abstractmethod
    def landing_target_message(self, site_ned_m: Vector, pose: Pose, stamp_us: int) -> Any:
        """Return LANDING_TARGET for a point on the ground, local NED, in a frame it takes."""

    def velocity_message(self, setpoint: Setpoint, boot_ms: int, target: tuple[int, int]) -> Any:
        """Return SET_POSITION_TARGET_LOCAL_NED to (system, component), heading held."""
        v = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
        frame, mask, place = mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_HOLD_HEADING, (0.0,) * 3
        return mavlink.MAVLink_set_position_target_local_ned_message(
            boot_ms & 0xFFFFFFFF, *target, frame, mask, *place, *v, *(0.0,) * 5
        )


LEVEL_HOLDS_HEIGHT = 0.5
"""Thrust that means "climb at zero" in ArduCopter's GUIDED_NOGPS."""
ONLY_ATTITUDE = 0x07
"""Type mask: ignore the body rates; level attitude, heading and thrust count."""


def level_message(yaw_rad: float, boot_ms: int, target: tuple[int, int]) -> Any:
    """Return SET_ATTITUDE_TARGET: level, heading as given, neither climbing nor descending."""
    q = [cos(yaw_rad / 2.0), 0.0, 0.0, sin(yaw_rad / 2.0)]
    return mavlink.MAVLink_set_attitude_target_message(
        boot_ms & 0xFFFFFFFF, *target, ONLY_ATTITUDE, q, 0.0, 0.0, 0.0, LEVEL_HOLDS_HEIGHT
    )


def _from_body(site_ned_m: Vector, pose: Pose) -> Vector:
    """Return the way from the vehicle to a point: forward, right, down."""
    here = (pose.north_m, pose.east_m, pose.down_m)
    away = [there - own for there, own in zip(site_ned_m, here, strict=True)]
    forward, right, down = rotation_matrix(pose.quaternion_ned_frd).T @ away
    return float(forward), float(right), float(down)


def _landing_target(frame: int, vector: Vector, body_m: Vector, stamp_us: int) -> Any:
    forward, right, down = body_m
    where = (atan2(right, down), atan2(-forward, down), max(0.01, hypot(*body_m)))
    level, kind = [1.0, 0.0, 0.0, 0.0], mavlink.LANDING_TARGET_TYPE_VISION_OTHER
    return mavlink.MAVLink_landing_target_message(
        stamp_us, 0, frame, *where, 0.0, 0.0, *vector, level, kind, 1
    )


def _unknown_mode(mode: str, known: list[str]) -> VehicleError:
    return VehicleError(f'mode {mode!r} is unknown: choose one of {", ".join(sorted(known))}')


ARDUCOPTER_MODES: dict[str, int] = {
    entry.name.removeprefix('COPTER_MODE_'): number
    for number, entry in mavlink.enums['COPTER_MODE'].items()
    if number != mavlink.COPTER_MODE_ENUM_END
}
_ARDUCOPTER_NAMES = {number: name for name, number in ARDUCOPTER_MODES.items()}


@dataclass(frozen=True)
class ArduPilot(Dialect):
    """ArduCopter: GUIDED obeys set-points (ArduPilot documentation, Copter commands in GUIDED)."""

    hold_mode: str = 'BRAKE'
    name: str = 'ardupilot'
    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    control_mode: str = 'GUIDED'
    land_mode: str = 'LAND'
    level_mode: str = 'GUIDED_NOGPS'
    estimator_message: int = 193
    height_message: int = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT

    def mode_name(self, custom_mode: int) -> str:
        """Return e.g. GUIDED; MODE 99 for one that is not known."""
        return _ARDUCOPTER_NAMES.get(custom_mode, f'MODE {custom_mode}')

    def mode_command(self, mode: str) -> ModeCommand:
        """Return (flags, mode number, 0)."""
        if mode not in ARDUCOPTER_MODES:
            raise _unknown_mode(mode, list(ARDUCOPTER_MODES))
        return float(CUSTOM_MODE), float(ARDUCOPTER_MODES[mode]), 0.0

    def landing_target_message(self, site_ned_m: Vector, pose: Pose, stamp_us: int) -> Any:
        """Return LANDING_TARGET in BODY_FRD, the frame of its precision landing."""
        body_m = _from_body(site_ned_m, pose)
        return _landing_target(mavlink.MAV_FRAME_BODY_FRD, body_m, body_m, stamp_us)


PX4_MODES: dict[str, tuple[int, int]] = {
    'MANUAL': (1, 0),
    'ALTCTL': (2, 0),
    'POSCTL': (3, 0),
    'AUTO.READY': (4, 1),
    'AUTO.TAKEOFF': (4, 2),
    'AUTO.LOITER': (4, 3),
    'AUTO.MISSION': (4, 4),
    'AUTO.RTL': (4, 5),
    'AUTO.LAND': (4, 6),
    'ACRO': (5, 0),
    'OFFBOARD': (6, 0),
    'STABILIZED': (7, 0),
}
"""Main and sub mode: bits 16 to 23 and 24 to 31 of custom_mode (PX4 px4_custom_mode.h)."""
_PX4_NAMES = {numbers: name for name, numbers in PX4_MODES.items()}


@dataclass(frozen=True)
class Px4(Dialect):
    """PX4: OFFBOARD, entered only while set-points flow at 2 Hz or more."""

    name: str = 'px4'
    autopilot: int = mavlink.MAV_AUTOPILOT_PX4
    streams_before_control: bool = True
    control_mode: str = 'OFFBOARD'
    hold_mode: str = 'AUTO.LOITER'
    land_mode: str = 'AUTO.LAND'
    estimator_message: int = 230
    height_message: int = mavlink.MAVLINK_MSG_ID_ALTITUDE
    home_is_local: bool = True
    silence_limit_s: float = 0.9
    heartbeat_rate_hz: float = 5.0

    def mode_name(self, custom_mode: int) -> str:
        """Return e.g. OFFBOARD; MODE 4.9 for one that is not known."""
        main, sub = (custom_mode >> 16) & 0xFF, (custom_mode >> 24) & 0xFF
        return _PX4_NAMES.get((main, sub), f'MODE {main}.{sub}')

    def mode_command(self, mode: str) -> ModeCommand:
        """Return (flags, main mode, sub mode)."""
        if mode not in PX4_MODES:
            raise _unknown_mode(mode, list(PX4_MODES))
        main, sub = PX4_MODES[mode]
        return float(CUSTOM_MODE), float(main), float(sub)

    def landing_target_message(self, site_ned_m: Vector, pose: Pose, stamp_us: int) -> Any:
        """Return LANDING_TARGET in LOCAL_NED, the only frame that it takes."""
        body_m = _from_body(site_ned_m, pose)
        return _landing_target(mavlink.MAV_FRAME_LOCAL_NED, site_ned_m, body_m, stamp_us)


AUTO = 'auto'
_DIALECTS: dict[str, Callable[[str], Dialect]] = {
    'ardupilot': ArduPilot,
    'px4': lambda _hold_mode: Px4(),
}
"""Name -> dialect, given ArduPilot's mode for holding position; the first that fits is taken."""
NO_MULTICOPTERS = {
    mavlink.MAV_TYPE_FIXED_WING: 'a fixed-wing aircraft',
    mavlink.MAV_TYPE_ANTENNA_TRACKER: 'an antenna tracker',
    mavlink.MAV_TYPE_AIRSHIP: 'an airship',
    mavlink.MAV_TYPE_GROUND_ROVER: 'a ground vehicle',
    mavlink.MAV_TYPE_SURFACE_BOAT: 'a boat',
    mavlink.MAV_TYPE_SUBMARINE: 'a submarine',
}
"""MAV_TYPEs that cannot hover; their firmwares also number their modes in another way."""
VTOL_TYPES = range(19, 26)
"""MAV_TYPE_VTOL_...; their names differ between versions of pymavlink."""


def register_dialect(name: str, make: Callable[[str], Dialect]) -> None:
    """Make another dialect known by a name, before the vehicle is opened.

    Args:
        name: What parameter ``dialect`` takes.
        make: Returns the dialect, given parameter ``vehicle.hold_mode``.

    Raises:
        VehicleError: The name is taken.
    """
    if name in dialect_names():
        raise VehicleError(f'dialect {name!r} exists already: choose another name')
    _DIALECTS[name] = make


def dialect_names() -> tuple[str, ...]:
    """Return what may be asked for: ``auto`` and the registered names."""
    return (AUTO, *_DIALECTS)


def check_dialect(wanted: str) -> None:
    """Raise VehicleError for a name that is not known."""
    if wanted not in dialect_names():
        raise VehicleError(f'dialect {wanted!r}: choose one of {", ".join(dialect_names())}')


def choose_dialect(
    wanted: str,
    autopilot: int,
    hold_mode: str = 'BRAKE',
    vehicle_type: int = mavlink.MAV_TYPE_QUADROTOR,
) -> Dialect:
    """Return the dialect of the autopilot that was heard.

    Args:
        wanted: One of :func:`dialect_names`.
        autopilot: MAV_AUTOPILOT of its HEARTBEAT.
        hold_mode: ArduPilot's mode for holding position.
        vehicle_type: MAV_TYPE of its HEARTBEAT.

    Raises:
        VehicleError: Unknown name, the autopilot heard is another one than was asked for, or its
            vehicle is no multicopter.
    """
    check_dialect(wanted)
    kind = NO_MULTICOPTERS.get(vehicle_type, '')
    if autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA and vehicle_type in VTOL_TYPES:
        kind = 'a VTOL, which ArduPlane flies'
    if kind:
        raise VehicleError(
            f'the vehicle heard is {kind} (MAV_TYPE {vehicle_type}): connect to a multicopter or '
            'a helicopter'
        )
    makers = list(_DIALECTS.values()) if wanted == AUTO else [_DIALECTS[wanted]]
    for dialect in (make(hold_mode) for make in makers):
        if dialect.autopilot == autopilot:
            return dialect
    raise VehicleError(
        f'the autopilot heard is of type {autopilot} (MAV_AUTOPILOT) and does not speak '
        f'{wanted!r}: connect to ArduPilot (3) or PX4 (12), or set dialect to auto'
    )
