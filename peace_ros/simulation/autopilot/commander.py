# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A second commander: set-points that come from neither the companion nor a pilot.

Measured, ArduCopter 4.7-dev: set-points of a second companion (50 Hz) are obeyed in turn with those
of the first, and POSITION_TARGET_LOCAL_NED reports them.
"""

from __future__ import annotations

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.guided import PositionTarget

VELOCITY_HOLD_HEADING = 0x5C7


@dataclass
class SecondCommander:
    """Commands one velocity at a steady rate; none at a rate of 0."""

    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """North, east, down."""
    rate_hz: float = 0.0
    _due_s: float = 0.0

    def due(self, time_s: float) -> PositionTarget | None:
        """Return a set-point when it is due by the clock of the autopilot."""
        if self.rate_hz <= 0.0 or time_s < self._due_s:
            return None
        self._due_s = time_s + 1.0 / self.rate_hz
        return PositionTarget(mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_HOLD_HEADING, self.velocity_m_s)
