# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A fence of the simulated autopilot: it keeps the vehicle inside, and reports it when asked.

Measured, ArduCopter 4.7-dev: the vehicle stops about 2 m before a least altitude or a circle, says
nothing, and FENCE_STATUS is sent only when it is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from math import hypot

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.physics import VelocityCommand, approach_speed_m_s

MARGIN_M = 2.0
"""The vehicle stops this far before the fence (measured, ArduCopter 4.7-dev)."""
LATERAL_M_S2, VERTICAL_M_S2 = 1.5, 1.0
FASTEST_M_S = 20.0
ACTIVE_S = 0.5
"""FENCE_STATUS says for so long that the speed was limited (source text of ArduPilot)."""

Vector = tuple[float, float, float]
"""North, east, down."""


class FenceKind(str, Enum):
    """What a fence limits."""

    NONE = 'none'
    FLOOR = 'floor'
    """Least altitude."""
    CEILING = 'ceiling'
    """Greatest altitude."""
    CIRCLE = 'circle'


BREACHES: dict[FenceKind, int] = {
    FenceKind.NONE: mavlink.FENCE_BREACH_NONE,
    FenceKind.FLOOR: mavlink.FENCE_BREACH_MINALT,
    FenceKind.CEILING: mavlink.FENCE_BREACH_MAXALT,
    FenceKind.CIRCLE: mavlink.FENCE_BREACH_BOUNDARY,
}


@dataclass
class Fence:
    """One fence, and when it last limited the speed."""

    kind: FenceKind = FenceKind.NONE
    at_m: float = 0.0
    """Altitude above home, or radius of the circle."""
    centre_m: tuple[float, float] = (0.0, 0.0)
    """Of the circle: north, east."""
    limited_s: float | None = None
    """Clock of the autopilot."""

    def room_m(self, position_m: Vector) -> float:
        """Return the distance to the fence, negative outside of it."""
        altitude_m = -position_m[2]
        if self.kind is FenceKind.FLOOR:
            return altitude_m - self.at_m
        if self.kind is FenceKind.CEILING:
            return self.at_m - altitude_m
        away_m = hypot(*self._from_centre(position_m))
        return self.at_m - away_m if self.kind is FenceKind.CIRCLE else FASTEST_M_S * 60.0

    def kept(self, command: VelocityCommand, position_m: Vector, time_s: float) -> VelocityCommand:
        """Return a command that stops before the fence; motion along it stays."""
        if self.kind is FenceKind.NONE or command.lean_rad is not None:
            return command
        room_m = max(0.0, self.room_m(position_m) - MARGIN_M)
        if self.kind is FenceKind.CIRCLE:
            kept = self._inside_circle(command, position_m, room_m)
        else:
            fastest = approach_speed_m_s(room_m, FASTEST_M_S, VERTICAL_M_S2)
            down = command.v_down_m_s
            is_floor = self.kind is FenceKind.FLOOR
            kept = replace(
                command, v_down_m_s=min(down, fastest) if is_floor else max(down, -fastest)
            )
        if kept != command:
            self.limited_s = time_s
        return kept

    def limits(self, time_s: float) -> bool:
        """Return whether it limits the speed now."""
        return self.limited_s is not None and time_s - self.limited_s <= ACTIVE_S

    def status(self, position_m: Vector, time_s: float) -> mavlink.MAVLink_message | None:
        """Return FENCE_STATUS, None without a fence: ArduPilot does not send it then."""
        if self.kind is FenceKind.NONE:
            return None
        outside = self.room_m(position_m) < 0.0
        limits = self.limits(time_s)
        return mavlink.MAVLink_fence_status_message(
            int(outside),
            int(outside),
            BREACHES[self.kind if outside else FenceKind.NONE],
            0,
            mavlink.FENCE_MITIGATE_VEL_LIMIT if limits else mavlink.FENCE_MITIGATE_NONE,
        )

    def _from_centre(self, position_m: Vector) -> tuple[float, float]:
        return position_m[0] - self.centre_m[0], position_m[1] - self.centre_m[1]

    def _inside_circle(
        self, command: VelocityCommand, position_m: Vector, room_m: float
    ) -> VelocityCommand:
        north, east = self._from_centre(position_m)
        away_m = hypot(north, east)
        if away_m == 0.0:
            return command
        north, east = north / away_m, east / away_m
        outward = command.v_north_m_s * north + command.v_east_m_s * east
        excess = outward - approach_speed_m_s(room_m, FASTEST_M_S, LATERAL_M_S2)
        if excess <= 0.0:
            return command
        return replace(
            command,
            v_north_m_s=command.v_north_m_s - excess * north,
            v_east_m_s=command.v_east_m_s - excess * east,
        )
