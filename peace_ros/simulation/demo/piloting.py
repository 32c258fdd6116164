# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pilot of the demo: reaches the vehicle, waits for its boot, brings it up, and lets go."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import final

from peace_ros.core.domain import VehicleError
from peace_ros.core.vehicle import MavlinkLink, open_vehicle
from peace_ros.simulation.demo.options import refuse_to_arm_elsewhere
from peace_ros.simulation.demo.pilot import Pilot
from peace_ros.simulation.positions import why_no_position

CONNECT_S = 90.0
_AGAIN_S = 1.0
_AIRBORNE_M = 5.0


@final
class VehicleLine:
    """The pilot's line, closed on leaving: a port may serve one client, and then another."""

    def __init__(self, url: str, limit_s: float = CONNECT_S) -> None:
        self._url, self._limit_s = url, limit_s
        self._link: MavlinkLink | None = None
        self._left = False

    def __enter__(self) -> VehicleLine:
        """Return itself, not opened yet."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Release the line."""
        self._left = True
        if self._link is not None:
            self._link.close()

    def open(self) -> None:
        """Wait for the autopilot's first HEARTBEAT; it may still be starting.

        Raises:
            VehicleError: not within the limit, and why.
        """
        deadline = time.monotonic() + self._limit_s
        while self._link is None and not self._left:
            left_s = deadline - time.monotonic()
            try:
                self._link = open_vehicle(self._url, timeout_s=max(_AGAIN_S, left_s))
            except VehicleError:
                if deadline - time.monotonic() < _AGAIN_S:
                    raise
                time.sleep(_AGAIN_S)
        if self._left and self._link is not None:
            self._link.close()

    @property
    def problem(self) -> str:
        """Why the autopilot reports no position, empty when it does or was not reached yet."""
        return '' if self._link is None else why_no_position(self._link)

    def bring_up(self, altitude_m: float, ready_s: float, say: Callable[[str], None]) -> None:
        """Bring the vehicle to an altitude, unless it is in the air already.

        Args:
            altitude_m: above home.
            ready_s: how long the boot, and then the take-off, may take.
            say: takes what is waited for.

        Raises:
            VehicleError: it does not get there, or may be a real one and is not in the air.
        """
        link = self._link
        if link is None:
            raise VehicleError(f'the line to {self._url} has not been opened')
        pilot = Pilot(link, say)
        pilot.wait_ready(ready_s)
        told = link.telemetry()
        now_m = told.pose.altitude_agl_m if told.pose is not None else 0.0
        if told.armed and not told.landed and now_m > _AIRBORNE_M:
            say(f'in the air already at {now_m:.0f} m')
            return
        refuse_to_arm_elsewhere(self._url)
        pilot.take_off(altitude_m, ready_s, arm=True)
