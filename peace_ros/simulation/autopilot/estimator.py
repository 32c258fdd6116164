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
RECKONS_S, RECKONS_PX4_S = 7.1, 5.4
"""How long LOCAL_POSITION_NED goes on by dead reckoning after the loss of GNSS (measured:
ArduCopter 4.7-dev and PX4 v1.17-alpha); the flags of the filter stay as they were."""
DRIFT_M_S = 0.07
"""Of dead reckoning: right to 0.5 m after 7.1 s (measured: ArduCopter 4.7-dev)."""
FAILSAFE_S = 0.8
"""From the end of dead reckoning to the EKF failsafe."""
VISION_FAILSAFE_S = 7.4
"""From the loss of external navigation to the EKF failsafe."""

GPS_SOURCE = 1
EXTERNAL_SOURCE = 2


class Estimator:
    """Keeps account of the sources of position; the numbers come from the physics.

    Args:
        reckons_s: How long a lost GNSS is bridged.
    """

    def __init__(self, reckons_s: float = RECKONS_S) -> None:
        self._reckons_s = reckons_s
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
        return self._is_aided(time_s) or self._reckons(time_s)

    def _is_aided(self, time_s: float) -> bool:
        if self.source == GPS_SOURCE:
            return self.gps and time_s >= READY_S
        return self._vision_s is not None and time_s - self._vision_s <= VISION_FRESH_S

    def _reckons(self, time_s: float) -> bool:
        if self.source != GPS_SOURCE or not self._had_position or self.stale_position:
            return False
        return self._lost_s is None or time_s - self._lost_s <= self._reckons_s

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
        if self._is_aided(time_s):
            self._had_position = True
            if self._lost_s is not None and self.source == GPS_SOURCE:
                self.offset_m = (0.0, 0.0, 0.0)
            self._lost_s = None
            return False
        if not self._had_position:
            return False
        if self._lost_s is None:
            self._lost_s = time_s
        lost_s = time_s - self._lost_s
        if self.source != GPS_SOURCE:
            return lost_s >= VISION_FAILSAFE_S
        if self._reckons(time_s):
            self.offset_m = (DRIFT_M_S * lost_s, 0.0, 0.0)
        return lost_s >= self._reckons_s + FAILSAFE_S
