# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where home lies below the local frame, and every height that the autopilot reports; pure."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.motion import HeightReport
from peace_ros.core.vehicle.trust import Pairwise

HOME_STEP_M = 1.0
"""A home whose height changes by more than this in flight says nothing about the ground below."""
MAX_EXTRAPOLATION_S = 0.3
FRESH_NS = 2_000_000_000
"""A height that is not renewed for so long is no longer compared."""
LEAST_GNSS_ERROR_M, GNSS_ERROR_M = 1.0, 3.0
"""Standard deviation of GNSS altitude: at least, and where the receiver does not report it."""
TERRAIN_ERROR_M = 5.0
"""Of terrain data, as of SRTM."""
RANGE_ERROR_M = 0.3
LEAST_LEVEL_SHARE = 0.5
"""Tilted farther, 60 degrees, a rangefinder says nothing of the height (a forged ATTITUDE)."""


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


class OtherHeights:
    """Heights that do not rest on the barometer: GNSS (GPS_RAW_INT), terrain data, rangefinder.

    Args:
        limit_m: The first, and one that is farther from the message before it, need a second one.
    """

    def __init__(self, limit_m: float) -> None:
        self._pairs: defaultdict[str, Pairwise] = defaultdict(
            lambda: Pairwise(limit_m, first=False)
        )
        self._newest: dict[str, tuple[int, HeightReport]] = {}

    def fresh(self, steady_ns: int, level_share: float) -> tuple[HeightReport, ...]:
        """Return what was reported lately.

        Args:
            steady_ns: Steady clock.
            level_share: Vertical part of a distance along body-down, 0 to 1.
        """
        fresh = (each for at_ns, each in self._newest.values() if steady_ns - at_ns <= FRESH_NS)
        return tuple(
            replace(each, height_m=each.height_m * level_share) if each.is_narrow else each
            for each in fresh
            if not each.is_narrow or level_share >= LEAST_LEVEL_SHARE
        )

    def take_fix(self, m: Any, steady_ns: int) -> None:
        """Take GPS_RAW_INT: only changes count of an altitude above the sea."""
        if m.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX:
            self._newest.pop('GNSS', None)
            return
        error_m = max(LEAST_GNSS_ERROR_M, m.v_acc / 1e3) if m.v_acc else GNSS_ERROR_M
        self._keep(steady_ns, HeightReport('GNSS', m.alt / 1e3, error_m, above_ground=False))

    def take_terrain(self, m: Any, steady_ns: int) -> None:
        """Take TERRAIN_REPORT, whose spacing is 0 where there are no data."""
        if m.spacing > 0:
            self._keep(steady_ns, HeightReport('terrain data', m.current_height, TERRAIN_ERROR_M))

    def take_range(self, distance_m: float | None, steady_ns: int) -> None:
        """Take the distance along body-down, None when out of range; the caller has checked it."""
        if distance_m is None:
            self._newest.pop('rangefinder', None)
            return
        report = HeightReport('rangefinder', distance_m, RANGE_ERROR_M, is_narrow=True)
        self._newest['rangefinder'] = (steady_ns, report)

    def _keep(self, steady_ns: int, report: HeightReport) -> None:
        if self._pairs[report.source].believes(report.height_m):
            self._newest[report.source] = (steady_ns, report)
