# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where home lies below the local frame, and how high the vehicle is without a position; pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any

HOME_STEP_M = 1.0
"""A home whose height changes by more than this in flight says nothing about the ground below."""
MAX_EXTRAPOLATION_S = 0.3


class HomeHeight:
    """Height of home in the local frame, whose origin may lie at another height.

    A height that changes in flight is rejected; on the ground it needs two reports that agree.

    Args:
        is_local: HOME_POSITION tells it itself. ArduPilot fills in zeros there; what it says is
            the altitude of home above the sea, and in GPS_GLOBAL_ORIGIN that of the origin.
    """

    def __init__(self, *, is_local: bool) -> None:
        self._is_local = is_local
        self._origin_msl_m: float | None = None
        self._told_m: float | None = None
        self._moved_to_m: float | None = None
        self.home_msl_m: float | None = None
        """Altitude of home above sea level."""
        self.down_m: float | None = None
        """Home below the origin; None until it is known."""

    def take_home(self, msl_m: float, down_m: float, *, flying: bool) -> bool:
        """Take HOME_POSITION; False when it is rejected: see the class."""
        return self._take(msl_m, self._origin_msl_m, down_m, flying=flying)

    def take_origin(self, msl_m: float, *, flying: bool) -> bool:
        """Take GPS_GLOBAL_ORIGIN; False when it is rejected: see the class."""
        return self._take(self.home_msl_m, msl_m, self._told_m, flying=flying)

    def _take(
        self, home_m: float | None, origin_m: float | None, told_m: float | None, *, flying: bool
    ) -> bool:
        down_m = told_m
        if not self._is_local and home_m is not None and origin_m is not None:
            down_m = origin_m - home_m
        known_m = self.down_m
        # The first report of the origin does not mean that home moved.
        learns = not self._is_local and self._origin_msl_m is None and origin_m is not None
        moves = known_m is not None and down_m is not None and abs(down_m - known_m) > HOME_STEP_M
        if down_m is not None and moves and not learns:
            before_m, self._moved_to_m = self._moved_to_m, down_m
            if flying or before_m is None or abs(down_m - before_m) > HOME_STEP_M:
                return False
        self.home_msl_m, self._origin_msl_m, self._told_m = home_m, origin_m, told_m
        self.down_m = down_m
        return True


@dataclass(frozen=True)
class Height:
    """Above home, by the barometer, at a moment of the autopilot's clock."""

    steady_ns: int
    boot_ms: int
    above_home_m: float
    climb_m_s: float

    def at_m(self, boot_ms: int) -> float:
        """Return it brought to another moment by the climb rate."""
        dt_s = (boot_ms - self.boot_ms) / 1e3
        return self.above_home_m + self.climb_m_s * max(0.0, min(MAX_EXTRAPOLATION_S, dt_s))


def height_of(message: Any, steady_ns: int) -> Height | None:
    """Return the height in GLOBAL_POSITION_INT or ALTITUDE, None where there is none."""
    if message.get_type() == 'GLOBAL_POSITION_INT':
        # The barometer's, also while latitude and longitude stand still without a position.
        above_m, climb_m_s = message.relative_alt / 1e3, -message.vz / 100.0
        return Height(steady_ns, message.time_boot_ms, above_m, climb_m_s)
    above_m = message.altitude_relative
    boot_ms = message.time_usec // 1000
    return Height(steady_ns, boot_ms, above_m, 0.0) if isfinite(above_m) else None
