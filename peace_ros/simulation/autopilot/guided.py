# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How GUIDED reads SET_POSITION_TARGET_*: frames, type masks, age."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, isfinite, sin

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.datum import Vector

GUID_TIMEOUT_S = 3.0
"""Age at which the vehicle stops obeying a velocity set-point and hovers."""
TURNING_SPEED_M_S = 0.5
"""Slower set-points do not turn the nose to the direction of travel."""

ROTATED_BY_HEADING: dict[int, bool] = {1: False, 7: False, 8: True, 9: True}
"""MAV_FRAME -> its velocities are (forward, right, down); any other frame is not understood."""

VELOCITY_IGNORED = 0x038
FORCE = 0x200
YAW_IGNORED = 0x400
POSITION_IGNORED = 0x007
ALL_BUT_POSITION = 0xDF8
ACCELERATION_IGNORED = 0x1C0
YAW_RATE_IGNORED = 0x800


@dataclass(frozen=True)
class PositionTarget:
    """The fields of SET_POSITION_TARGET_LOCAL_NED that matter for velocity control."""

    frame: int
    type_mask: int
    velocity_m_s: tuple[float, float, float]
    yaw_rad: float = 0.0
    yaw_rate_rad_s: float = 0.0


@dataclass(frozen=True)
class GuidedVelocity:
    """A velocity set-point as the vehicle understood it, local NED."""

    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float
    yaw_rad: float | None
    yaw_rate_rad_s: float


@dataclass(frozen=True)
class PlaceTarget:
    """A place to fly to and stay at."""

    place_m: Vector
    """North, east, down from home, as the filter estimates them."""
    yaw_rad: float | None = None
    """None: the nose turns to the way."""


STOP = GuidedVelocity(0.0, 0.0, 0.0, None, 0.0)


def is_place(type_mask: int) -> bool:
    """Return whether the position counts; velocities beside it are then left out."""
    return not type_mask & POSITION_IGNORED and not _has_force(type_mask)


def _has_force(type_mask: int) -> bool:
    """Return whether the acceleration counts and is a force (source text of ArduPilot)."""
    return bool(type_mask & FORCE) and not type_mask & ACCELERATION_IGNORED


def local_place(
    frame: int, xyz_m: Vector, at_m: Vector, heading_rad: float, origin_above_home_m: float
) -> Vector | None:
    """Return the place of SET_POSITION_TARGET_LOCAL_NED from home; None for an unknown frame.

    LOCAL_NED counts from the origin of the local frame, the others from the vehicle (source text of
    ArduPilot, not measured).
    """
    rotated = ROTATED_BY_HEADING.get(frame)
    if rotated is None or not all(map(isfinite, xyz_m)):
        return None
    x, y, z = xyz_m
    if frame == mavlink.MAV_FRAME_LOCAL_NED:
        return x, y, z - origin_above_home_m
    c, s = (cos(heading_rad), sin(heading_rad)) if rotated else (1.0, 0.0)
    return at_m[0] + x * c - y * s, at_m[1] + x * s + y * c, at_m[2] + z


def understand(target: PositionTarget, heading_rad: float) -> GuidedVelocity | None:
    """Return what the vehicle will do; STOP for what it rejects; None where a number is not finite.

    ArduCopter rejects an unknown frame or mask without an error message, and stops.
    """
    if not all(isfinite(v) for v in target.velocity_m_s):
        return None
    rotated = ROTATED_BY_HEADING.get(target.frame)
    if rotated is None or target.type_mask & VELOCITY_IGNORED or _has_force(target.type_mask):
        return STOP
    north, east, down = target.velocity_m_s
    if rotated:
        c, s = cos(heading_rad), sin(heading_rad)
        north, east = north * c - east * s, north * s + east * c
    uses_yaw = not target.type_mask & YAW_IGNORED
    uses_rate = not target.type_mask & YAW_RATE_IGNORED
    if (uses_yaw and not isfinite(target.yaw_rad)) or (
        uses_rate and not isfinite(target.yaw_rate_rad_s)
    ):
        return None
    yaw: float | None = None
    if uses_yaw:
        yaw = target.yaw_rad + (heading_rad if rotated else 0.0)
    elif not uses_rate and hypot(north, east) > TURNING_SPEED_M_S:
        yaw = atan2(east, north)
    return GuidedVelocity(north, east, down, yaw, target.yaw_rate_rad_s if uses_rate else 0.0)
