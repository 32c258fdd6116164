# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the rest of the project sees of the vehicle, and how to open it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.domain.motion import Pose, Setpoint, Telemetry
from peace_ros.core.vehicle.dialects import DIALECTS
from peace_ros.core.vehicle.lasting import LastingTransport
from peace_ros.core.vehicle.mavlink import MavlinkLink
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.result import RequestResult


class VehicleLink(Protocol):
    """A line to one autopilot; every method may be called from any thread."""

    @property
    def taken_over(self) -> bool:
        """A person or a failsafe has left the mode that obeys us."""
        ...

    def telemetry(self) -> Telemetry:
        """Return what the autopilot last said."""
        ...

    def take_poses(self) -> list[Pose]:
        """Return the poses since the last call, oldest first, stamped with the node clock.

        Where only attitude and altitude are known, north and east are NaN.
        """
        ...

    def send_velocity(self, setpoint: Setpoint) -> None:
        """Send one set-point; VehicleError when it is not finite or the line broke."""
        ...

    def request_control(self, *, by_person: bool = False) -> RequestResult:
        """Ask for the mode that obeys set-points; refused after a takeover unless by a person."""
        ...

    def request_hold(self) -> RequestResult:
        """Ask for the autopilot's own hold mode."""
        ...

    def close(self) -> None:
        """Release the line."""
        ...


def open_vehicle(
    url: str,
    dialect: str = 'auto',
    clock_ns: Callable[[], int] = time.monotonic_ns,
    parameters: VehicleParameters | None = None,
    timeout_s: float | None = None,
) -> MavlinkLink:
    """Open the line and wait for the autopilot's first HEARTBEAT.

    Args:
        url: ``udpin:HOST:PORT`` (listen), ``udpout:HOST:PORT`` (call), ``tcp:HOST:PORT``,
            ``serial:/dev/NAME:BAUD`` or ``/dev/NAME:BAUD``.
        dialect: ``auto``, ``ardupilot`` or ``px4``.
        clock_ns: Node clock; poses are stamped with it, as TIMESYNC maps the autopilot's.
        parameters: Rates, limits, source of altitude.
        timeout_s: Replaces ``parameters.connect_timeout_s``.

    Raises:
        VehicleError: Wrong URL or dialect, port in use, nothing heard in time.
    """
    if dialect not in DIALECTS:
        raise VehicleError(f'dialect {dialect!r}: choose one of {", ".join(DIALECTS)}')
    chosen = parameters or VehicleParameters()
    if timeout_s is not None:
        chosen = replace(chosen, connect_timeout_s=timeout_s)
    try:
        return MavlinkLink(LastingTransport(url), dialect, chosen, clock_ns)
    except VehicleError as error:
        raise VehicleError(f'vehicle at {url}: {error}') from error
