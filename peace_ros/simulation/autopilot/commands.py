# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""COMMAND_LONG, COMMAND_INT and set-point messages, turned into calls of the flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, isfinite, isinf, isnan, nan, pi, radians
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.geometry import rotation_matrix
from peace_ros.simulation.autopilot.datum import Vector
from peace_ros.simulation.autopilot.flight import FORCE_MAGIC, Flight
from peace_ros.simulation.autopilot.guided import (
    YAW_IGNORED,
    PlaceTarget,
    PositionTarget,
    is_place,
    local_place,
)
from peace_ros.simulation.autopilot.modes import Mode, Result, Severity
from peace_ros.simulation.autopilot.personality import NEEDS_RADIO, SETPOINT_FRAMES_PX4

SET_EKF_SOURCE_SET = 42007
ATTITUDE_IGNORED = 0x80
BODY_RATES_IGNORED = 0x07
NO_PLACE = 2**31 - 1
"""x and y of a COMMAND_INT without a place."""
_GLOBAL_SCALE = 1e7
STICK_CENTRE_US, STICK_DEAD_US, STICK_THROW_US = 1500, 100, 400
"""Of RC_CHANNELS_OVERRIDE: within the dead zone the height is held."""
OVERRIDE_S = 3.0
"""How long an override counts (default of RC_OVERRIDE_TIME of ArduPilot, not measured)."""
STICK_RELEASED = frozenset({0, 65535})


@dataclass(frozen=True)
class VehicleCommand:
    """A command, whichever message carried it."""

    number: int
    params: tuple[float, float, float, float]
    """The first four; a number that is not one asks for the default."""
    latitude_deg: float = nan
    longitude_deg: float = nan
    altitude_m: float = nan
    frame: int = mavlink.MAV_FRAME_GLOBAL

    def value(self, index: int) -> float:
        """Return a parameter, 0 where the default is asked for."""
        each = self.params[index]
        return 0.0 if isnan(each) else each


def read_command(m: Any) -> VehicleCommand:
    """Read COMMAND_LONG or COMMAND_INT; a take-off by COMMAND_LONG counts from home."""
    params = (m.param1, m.param2, m.param3, m.param4)
    if m.get_type() == 'COMMAND_INT':
        place = [nan if each == NO_PLACE else each / _GLOBAL_SCALE for each in (m.x, m.y)]
        return VehicleCommand(m.command, params, place[0], place[1], m.z, m.frame)
    frame = mavlink.MAV_FRAME_GLOBAL
    if m.command == mavlink.MAV_CMD_NAV_TAKEOFF:
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return VehicleCommand(m.command, params, m.param5, m.param6, m.param7, frame)


def run_command(flight: Flight, command: VehicleCommand) -> Result:
    """Carry out a command that concerns the flight; UNSUPPORTED when none does."""
    handler = _COMMANDS.get(command.number)
    if handler is None:
        return Result.UNSUPPORTED
    if any(map(isinf, command.params)):
        return Result.DENIED
    return handler(flight, command)


def _set_mode(flight: Flight, c: VehicleCommand) -> Result:
    if not int(c.value(0)) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return Result.DENIED
    mode = flight.personality.mode_of_command(c.value(1), c.value(2))
    if flight.personality.is_px4 and mode in NEEDS_RADIO:
        return flight.personality.refused
    return flight.set_mode(mode)


def _arm(flight: Flight, c: VehicleCommand) -> Result:
    force = int(c.value(1)) == FORCE_MAGIC
    if c.params[0] == 1.0:
        return flight.arm(force=force)
    if c.params[0] == 0.0:
        return flight.disarm(force=force)
    return Result.UNSUPPORTED


def _take_off(flight: Flight, c: VehicleCommand) -> Result:
    above_home = {
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    }
    if not flight.personality.is_px4 and c.frame not in above_home:
        return Result.DENIED
    return flight.take_off(c.altitude_m)


def _source(flight: Flight, c: VehicleCommand) -> Result:
    return Result.ACCEPTED if flight.estimator.use_source(int(c.value(0))) else Result.DENIED


def _reposition(flight: Flight, c: VehicleCommand) -> Result:
    """Take DO_REPOSITION; on PX4 what is not a number stays as it is."""
    latitude, longitude, altitude_m, frame = (
        c.latitude_deg,
        c.longitude_deg,
        c.altitude_m,
        c.frame,
    )
    if flight.personality.is_px4:
        north, east, down = flight.position_m
        here = [each / _GLOBAL_SCALE for each in flight.datum.geodetic_e7(north, east)]
        latitude = here[0] if isnan(latitude) else latitude
        longitude = here[1] if isnan(longitude) else longitude
        if isnan(altitude_m):
            altitude_m, frame = -down, int(mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT)
    place = flight.datum.local_m(frame, latitude, longitude, altitude_m)
    if place is None:
        return Result.DENIED
    yaw_rad = c.params[3] if flight.personality.is_px4 and isfinite(c.params[3]) else None
    change = int(c.value(1)) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
    return flight.reposition(PlaceTarget(place, yaw_rad), change_mode=bool(change))


def _change_speed(flight: Flight, c: VehicleCommand) -> Result:
    """Take DO_CHANGE_SPEED of the ground speed; climbs and descents keep theirs."""
    kinds = {mavlink.SPEED_TYPE_AIRSPEED, mavlink.SPEED_TYPE_GROUNDSPEED}
    return flight.change_speed(c.value(1)) if int(c.value(0)) in kinds else Result.FAILED


def _condition_yaw(flight: Flight, c: VehicleCommand) -> Result:
    angle_deg, relative = c.value(0), c.value(3)
    if flight.personality.is_px4:
        return Result.UNSUPPORTED
    if not 0.0 <= angle_deg <= 360.0 or relative not in {0.0, 1.0}:
        return Result.FAILED
    sign = -1.0 if relative and c.value(2) < 0.0 else 1.0
    heading_rad = flight.physics.yaw_rad if relative else 0.0
    flight.turn((heading_rad + sign * radians(angle_deg) + pi) % (2.0 * pi) - pi)
    return Result.ACCEPTED


def _start_mission(flight: Flight, _: VehicleCommand) -> Result:
    flight.say(Severity.WARNING, 'Mission not started: this simulation flies none')
    return flight.personality.refused


_COMMANDS: dict[int, Callable[[Flight, VehicleCommand], Result]] = {
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _take_off,
    mavlink.MAV_CMD_NAV_LAND: lambda flight, _: flight.set_mode(Mode.LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda flight, _: flight.set_mode(Mode.RTL),
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda flight, _: flight.set_mode(
        Mode.BRAKE if flight.personality.is_px4 else Mode.LOITER
    ),
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_CONDITION_YAW: _condition_yaw,
    mavlink.MAV_CMD_MISSION_START: _start_mission,
    SET_EKF_SOURCE_SET: _source,
}


def run_message(flight: Flight, message: Any) -> bool:
    """Take a set-point or navigation message; False when it is another one."""
    handler = _MESSAGES.get(message.get_msgId())
    if handler is None:
        return False
    handler(flight, message)
    return True


def _position_target(flight: Flight, m: Any) -> None:
    px4_refuses = flight.personality.is_px4 and m.coordinate_frame not in SETPOINT_FRAMES_PX4
    if not is_place(m.type_mask) or px4_refuses:
        _velocity_target(flight, m, m.coordinate_frame)
        return
    heading_rad = flight.physics.yaw_rad
    above_m = flight.datum.origin_above_home_m
    xyz_m = (m.x, m.y, m.z)
    _fly_to(
        flight, m, local_place(m.coordinate_frame, xyz_m, flight.position_m, heading_rad, above_m)
    )


def _global_target(flight: Flight, m: Any) -> None:
    if not is_place(m.type_mask):
        _velocity_target(flight, m, mavlink.MAV_FRAME_LOCAL_NED)
        return
    latitude, longitude = m.lat_int / _GLOBAL_SCALE, m.lon_int / _GLOBAL_SCALE
    _fly_to(flight, m, flight.datum.local_m(m.coordinate_frame, latitude, longitude, m.alt))


def _velocity_target(flight: Flight, m: Any, frame: int) -> None:
    flight.take_velocity(PositionTarget(frame, m.type_mask, (m.vx, m.vy, m.vz), m.yaw, m.yaw_rate))


def _fly_to(flight: Flight, m: Any, place: Vector | None) -> None:
    uses_yaw = not m.type_mask & YAW_IGNORED
    if place is None or (uses_yaw and not isfinite(m.yaw)):
        flight.refuse_place()
        return
    flight.take_place(PlaceTarget(place, m.yaw if uses_yaw else None))


def _override(flight: Flight, m: Any) -> None:
    """Take RC_CHANNELS_OVERRIDE: the throttle only; a PX4 without a radio ignores it."""
    if flight.personality.is_px4:
        return
    away_us = 0 if m.chan3_raw in STICK_RELEASED else m.chan3_raw - STICK_CENTRE_US
    beyond_us = max(0, abs(away_us) - STICK_DEAD_US)
    stick = (1 if away_us > 0 else -1) * beyond_us / STICK_THROW_US
    flight.move_throttle(stick, OVERRIDE_S)


def _attitude_target(flight: Flight, m: Any) -> None:
    q = (m.q[0], m.q[1], m.q[2], m.q[3])
    square = sum(each * each for each in q)
    if not isfinite(m.thrust) or not 0.9 < square < 1.1 or m.type_mask & ATTITUDE_IGNORED:
        return
    if m.type_mask & BODY_RATES_IGNORED != BODY_RATES_IGNORED:
        return
    r = rotation_matrix(q)
    roll, pitch = atan2(r[2, 1], r[2, 2]), atan2(-r[2, 0], (r[2, 1] ** 2 + r[2, 2] ** 2) ** 0.5)
    steepest = 0.52
    lean = (max(-steepest, min(steepest, roll)), max(-steepest, min(steepest, pitch)))
    flight.take_attitude(lean, atan2(r[1, 0], r[0, 0]), max(0.0, min(1.0, m.thrust)))


def _old_set_mode(flight: Flight, m: Any) -> None:
    if m.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        packed = m.custom_mode
        main, sub = (
            (packed >> 16 & 0xFF, packed >> 24) if flight.personality.is_px4 else (packed, 0)
        )
        flight.set_mode(flight.personality.mode_of_command(main, sub))


_MESSAGES: dict[int, Callable[[Flight, Any], None]] = {
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: _position_target,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: _global_target,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: _override,
    mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: _attitude_target,
    mavlink.MAVLINK_MSG_ID_SET_MODE: _old_set_mode,
    mavlink.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: lambda flight, _: flight.estimator.give_origin(),
    mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: lambda flight, m: flight.see((m.x, m.y, m.z)),
}
