# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a fence of the autopilot stops the vehicle where it is; pure."""

from __future__ import annotations

from math import hypot

from peace_ros.core.domain import Setpoint, Telemetry

PATIENCE_NS = 3_000_000_000
"""A vehicle that a fence has kept from moving for so long does not get farther."""
LEAST_M_S = 0.2
"""Slower set-points are not conclusive."""
MOVING = 0.5
"""A vehicle that flies this part of the speed that it is told, the way that it is told, moves."""


class Blockade:
    """Waits a moment before a fence counts as in the way: it may only slow the vehicle down."""

    def __init__(self) -> None:
        self.reason = ''
        """Why the vehicle does not get farther, empty while it may."""
        self._since_ns: int | None = None

    def forget(self) -> None:
        """Begin again, towards another place."""
        self.reason, self._since_ns = '', None

    def see(self, now_ns: int, telemetry: Telemetry | None, told: Setpoint) -> None:
        """Compare the speed that is reported with the set-point that held until now."""
        speed = hypot(told.v_north_m_s, told.v_east_m_s, told.v_down_m_s)
        if telemetry is None or telemetry.pose is None or not telemetry.fence or speed < LEAST_M_S:
            self.forget()
            return
        along = (
            told.v_north_m_s * telemetry.v_north_m_s
            + told.v_east_m_s * telemetry.v_east_m_s
            + told.v_down_m_s * telemetry.v_down_m_s
        ) / speed
        if along >= MOVING * speed:
            self.forget()
            return
        if self._since_ns is None:
            self._since_ns = now_ns
        if now_ns - self._since_ns >= PATIENCE_NS:
            self.reason = (
                f'{telemetry.fence}: told {speed:.1f} m/s, it reports {along:.1f} m/s that way'
            )
