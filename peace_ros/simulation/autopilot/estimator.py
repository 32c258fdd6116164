# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the simulated autopilot knows of its position, and from whom: GPS or external navigation."""

from __future__ import annotations

from math import isfinite

ORIGIN_S = 20.0
"""When the filter sets its origin from GPS, on the autopilot's clock."""
READY_S = 42.0
"""When GPS and the pre-arm checks are ready."""
VISION_FRESH_S = 0.6
FAILSAFE_S = 7.4
"""From the loss of position to the EKF failsafe."""

GPS_SOURCE = 1
EXTERNAL_SOURCE = 2


class Estimator:
    """Keeps account of the sources of position; the numbers come from the physics."""

    def __init__(self) -> None:
        self.gps = True
        self.source = GPS_SOURCE
        self.stale_position = False
        self.offset_m = (0.0, 0.0, 0.0)
        """Estimate minus truth, north, east, down; external navigation may bring one."""
        self._origin_given = False
        self._vision_s: float | None = None
        self._lost_s: float | None = None
        self._had_position = False

    def has_origin(self, time_s: float) -> bool:
        """The local frame exists."""
        return self._origin_given or (self.gps and time_s >= ORIGIN_S) or self._had_position

    def has_position(self, time_s: float) -> bool:
        """Modes that need a position may be used."""
        if not self.has_origin(time_s):
            return False
        if self.source == GPS_SOURCE:
            return self.gps and time_s >= READY_S
        return self._vision_s is not None and time_s - self._vision_s <= VISION_FRESH_S

    def reports_position(self, time_s: float) -> bool:
        """LOCAL_POSITION_NED is sent."""
        if self.source == GPS_SOURCE and self.gps:
            return self.has_origin(time_s)
        return self.has_position(time_s) or (self.stale_position and self._had_position)

    def give_origin(self) -> None:
        """Take SET_GPS_GLOBAL_ORIGIN."""
        self._origin_given = True

    def see(
        self, time_s: float, seen_m: tuple[float, float, float], truth_m: tuple[float, float, float]
    ) -> None:
        """Take VISION_POSITION_ESTIMATE (north, east, down)."""
        if not all(isfinite(each) for each in seen_m):
            return
        self._vision_s = time_s
        if self.source == EXTERNAL_SOURCE:
            self.offset_m = (
                seen_m[0] - truth_m[0],
                seen_m[1] - truth_m[1],
                seen_m[2] - truth_m[2],
            )

    def use_source(self, source: int) -> bool:
        """Switch the source set (1: GPS, 2: external navigation); False for other numbers."""
        if source not in {GPS_SOURCE, EXTERNAL_SOURCE}:
            return False
        self.source = source
        if source == GPS_SOURCE:
            self.offset_m = (0.0, 0.0, 0.0)
        return True

    def step(self, time_s: float) -> bool:
        """Look at the clock; True when the position has been lost for too long (EKF failsafe)."""
        if self.has_position(time_s):
            self._had_position = True
            self._lost_s = None
            return False
        if not self._had_position:
            return False
        if self._lost_s is None:
            self._lost_s = time_s
        return time_s - self._lost_s >= FAILSAFE_S
