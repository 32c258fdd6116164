# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle adds to the velocity that it is told, and the set-point that makes up for it.

An autopilot flies by its estimate of the velocity. Where that is biased (PX4: 0.13 to 0.33 m/s
measured), it drifts, and comes to rest beside the site: by bias / gain.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, hypot, inf

from peace_ros.core.domain import Pose, Setpoint

LIMIT_M_S = 1.0
"""No more is made up for: three times the largest that was measured."""
IGNORED_M_S = 0.1
"""Less than this is noise of the estimate."""
_LAG_S = 0.7
"""Of the vehicle behind what it is told."""
_LEARN_S = 5.0
_POSITION_GAIN, _DRIFT_GAIN = 2.0 / _LEARN_S, 1.0 / _LEARN_S**2
"""Of an observer with both poles at 1 / _LEARN_S."""
_GAP_S = 0.5
_STEP_M = 3.0

Plane = tuple[float, float]
_NONE = (0.0, 0.0)


class Drift:
    """Learns, from reported positions and set-points, the velocity that nobody asked for."""

    def __init__(self) -> None:
        self.velocity_m_s: Plane = _NONE
        """Learned drift, north and east."""
        self._going: Plane = _NONE
        self._place: Plane = _NONE
        self._stamp_ns: int | None = None

    def see(self, pose: Pose | None, told: Setpoint) -> None:
        """Take the position of now and the set-point that held until now."""
        if pose is None or not pose.has_position:
            self._stamp_ns = None
            return
        if pose.stamp_ns == self._stamp_ns:
            return
        place = (pose.north_m, pose.east_m)
        seconds = inf if self._stamp_ns is None else (pose.stamp_ns - self._stamp_ns) * 1e-9
        self._stamp_ns = pose.stamp_ns
        away = hypot(place[0] - self._place[0], place[1] - self._place[1])
        if not 0.0 < seconds <= _GAP_S or away > _STEP_M:
            self._place = place
            self._going = (told.v_north_m_s, told.v_east_m_s)
            return
        north = self._learned(0, told.v_north_m_s, place[0], seconds)
        east = self._learned(1, told.v_east_m_s, place[1], seconds)
        self._going, self._place, drift = zip(north, east, strict=True)
        scale = LIMIT_M_S / max(LIMIT_M_S, hypot(*drift))
        self.velocity_m_s = (drift[0] * scale, drift[1] * scale)

    def _learned(
        self, axis: int, told_m_s: float, place_m: float, seconds: float
    ) -> tuple[float, float, float]:
        going = self._going[axis]
        going += (told_m_s - going) * (1.0 - exp(-seconds / _LAG_S))
        drift = self.velocity_m_s[axis]
        expected_m = self._place[axis] + (going + drift) * seconds
        error_m = place_m - expected_m
        place = expected_m + _POSITION_GAIN * error_m * seconds
        return going, place, drift + _DRIFT_GAIN * error_m * seconds

    def made_up(self, wish: Setpoint, limit_m_s: float) -> Setpoint:
        """Return a set-point by which the vehicle really flies as wished; zero stays zero.

        Args:
            wish: Before the guard.
            limit_m_s: Lateral speed that is not exceeded for this.
        """
        lateral, drift = hypot(wish.v_north_m_s, wish.v_east_m_s), hypot(*self.velocity_m_s)
        if lateral == 0.0 or drift <= IGNORED_M_S:
            return wish
        share = 1.0 - IGNORED_M_S / drift
        north = wish.v_north_m_s - share * self.velocity_m_s[0]
        east = wish.v_east_m_s - share * self.velocity_m_s[1]
        limit = max(limit_m_s, lateral)
        scale = limit / max(limit, hypot(north, east))
        return replace(wish, v_north_m_s=scale * north, v_east_m_s=scale * east)
