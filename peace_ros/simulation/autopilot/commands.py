# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""COMMAND_LONG, COMMAND_INT and set-point messages, turned into calls of the flight."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.geometry import rotation_matrix
from peace_ros.simulation.autopilot.flight import FORCE_MAGIC, Flight
from peace_ros.simulation.autopilot.guided import PositionTarget
from peace_ros.simulation.autopilot.modes import Mode, Result
from peace_ros.simulation.autopilot.personality import NEEDS_RADIO

Params = tuple[float, float, float, float, float, float, float]
SET_EKF_SOURCE_SET = 42007
ATTITUDE_IGNORED = 0x80
BODY_RATES_IGNORED = 0x07


def run_command(flight: Flight, command: int, p: Params) -> Result:
    """Carry out a command that concerns the flight; UNSUPPORTED when none does."""
    handler = _COMMANDS.get(command)
    if handler is None:
        return Result.UNSUPPORTED
    if not all(isfinite(each) for each in p[:3]):
        return Result.DENIED
    return handler(flight, p)


def _set_mode(flight: Flight, p: Params) -> Result:
    if not int(p[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return Result.DENIED
    mode = flight.personality.mode_of_command(p[1], p[2])
    if flight.personality.is_px4 and mode in NEEDS_RADIO:
        return flight.personality.refused
    return flight.set_mode(mode)


def _arm(flight: Flight, p: Params) -> Result:
    force = int(p[1]) == FORCE_MAGIC
    if p[0] == 1.0:
        return flight.arm(force=force)
    if p[0] == 0.0:
        return flight.disarm(force=force)
    return Result.UNSUPPORTED


def _take_off(flight: Flight, p: Params) -> Result:
    return flight.take_off(p[6]) if isfinite(p[6]) else Result.DENIED


def _source(flight: Flight, p: Params) -> Result:
    if flight.personality.is_px4:
        return Result.UNSUPPORTED
    return Result.ACCEPTED if flight.estimator.use_source(int(p[0])) else Result.DENIED


_COMMANDS: dict[int, Callable[[Flight, Params], Result]] = {
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _take_off,
    mavlink.MAV_CMD_NAV_LAND: lambda flight, _: flight.set_mode(Mode.LAND),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda flight, _: flight.set_mode(Mode.RTL),
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda flight, _: flight.set_mode(Mode.LOITER),
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
    flight.take_velocity(
        PositionTarget(m.coordinate_frame, m.type_mask, (m.vx, m.vy, m.vz), m.yaw, m.yaw_rate)
    )


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


def _odometry(flight: Flight, m: Any) -> None:
    """Take ODOMETRY in the frames in which a flight was measured with each autopilot."""
    px4 = (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_NED)
    ardupilot = (mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD)
    if (m.frame_id, m.child_frame_id) != (px4 if flight.personality.is_px4 else ardupilot):
        return
    velocity = [m.vx, m.vy, m.vz]
    if not flight.personality.is_px4:
        velocity = list(rotation_matrix((m.q[0], m.q[1], m.q[2], m.q[3])) @ velocity)
    flight.estimator.see(flight.time_s, (m.x, m.y), m.reset_counter)
    flight.estimator.see_velocity(flight.time_s, (float(velocity[0]), float(velocity[1])))


def _old_set_mode(flight: Flight, m: Any) -> None:
    if m.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        packed = m.custom_mode
        main, sub = (
            (packed >> 16 & 0xFF, packed >> 24) if flight.personality.is_px4 else (packed, 0)
        )
        flight.set_mode(flight.personality.mode_of_command(main, sub))


_MESSAGES: dict[int, Callable[[Flight, Any], None]] = {
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: _position_target,
    mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: _attitude_target,
    mavlink.MAVLINK_MSG_ID_SET_MODE: _old_set_mode,
    mavlink.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: lambda flight, _: flight.estimator.give_origin(),
    mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: lambda flight, m: flight.estimator.see(
        flight.time_s, (m.x, m.y), m.reset_counter
    ),
    mavlink.MAVLINK_MSG_ID_VISION_SPEED_ESTIMATE: lambda flight, m: flight.estimator.see_velocity(
        flight.time_s, (m.x, m.y)
    ),
    mavlink.MAVLINK_MSG_ID_ODOMETRY: _odometry,
}
