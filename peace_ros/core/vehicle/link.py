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
from peace_ros.core.threads import OnDefect
from peace_ros.core.vehicle.dialects import AUTO, check_dialect
from peace_ros.core.vehicle.lasting import LastingTransport
from peace_ros.core.vehicle.mavlink import MavlinkLink
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.result import LineCounts, RequestResult
from peace_ros.core.vehicle.signing import Signer
from peace_ros.core.vehicle.transport import parse_url


class VehicleLink(Protocol):
    """All that is asked of a line to one autopilot; every method may be called from any thread."""

    @property
    def taken_over(self) -> bool:
        """A person or a failsafe has left the mode that obeys us."""

    @property
    def problem(self) -> str:
        """Why the vehicle cannot be reached now, empty when it can."""

    @property
    def position_problem(self) -> str:
        """Why the vehicle will not obey velocities now, empty when nothing speaks against it."""

    @property
    def warning(self) -> str:
        """What a person should know of the line and the vehicle, empty when nothing."""

    @property
    def counts(self) -> LineCounts:
        """Messages that were not used, since the line was opened."""

    def telemetry(self) -> Telemetry:
        """Return what the autopilot last said."""

    def take_poses(self) -> list[Pose]:
        """Return the poses since the last call, oldest first, stamped with the node clock.

        Where only attitude and altitude are known, north and east are NaN.
        """

    def send_velocity(self, setpoint: Setpoint) -> None:
        """Send one set-point; VehicleError when it is not finite or the line broke."""

    def send_landing_target(self, site_ned_m: tuple[float, float, float], pose: Pose) -> None:
        """Tell where the site is, local NED; VehicleError when it cannot be told."""

    def report_health(self, mav_state: int) -> None:
        """Say MAV_STATE of this companion from now on, where the line has a place for it."""

    def request_control(self, *, by_person: bool = False) -> RequestResult:
        """Ask for the mode that obeys set-points; refused after a takeover unless by a person."""

    def request_hold(self) -> RequestResult:
        """Ask for the autopilot's own hold mode."""

    def request_land(self, wanted: Callable[[], bool] = lambda: True) -> RequestResult:
        """Ask for the autopilot's own landing, only while it obeys us and it is wanted."""

    def request_level_hold(self) -> RequestResult:
        """Ask to be held level without any position; only for a person who asks."""

    def stop_at_once(self) -> bool:
        """Send zero velocity and ask for the autopilot's own hold mode, without any waiting.

        It works when other threads of the link are dead. Return whether the vehicle still obeyed
        us, and it is worth repeating; VehicleError when the line broke.
        """

    def close(self) -> None:
        """Release the line."""


def check_access(url: str, dialect: str, signing_key_file: str, system_id: int) -> None:
    """Refuse what no autopilot could mend, before anything is opened.

    Args:
        url: See :func:`open_vehicle`.
        dialect: ``auto`` or a name among the registered ones.
        signing_key_file: Empty: no signing.
        system_id: Of this companion: each has a file of time stamps beside the key.

    Raises:
        ConfigurationError: The signing key cannot be read, or its time stamps are damaged.
        VehicleError: The URL is not understood, or the dialect is not known.
    """
    parse_url(url)
    check_dialect(dialect)
    if signing_key_file:
        Signer.from_file(signing_key_file, system_id)


def open_vehicle(
    url: str,
    dialect: str = AUTO,
    clock_ns: Callable[[], int] = time.monotonic_ns,
    parameters: VehicleParameters | None = None,
    timeout_s: float | None = None,
    on_defect: OnDefect | None = None,
) -> MavlinkLink:
    """Open the line and wait for the autopilot's first HEARTBEAT.

    Args:
        url: ``udpin:HOST:PORT`` (listen), ``udpout:HOST:PORT`` (call), ``tcp:HOST:PORT``,
            ``serial:/dev/NAME:BAUD`` or ``/dev/NAME:BAUD``.
        dialect: ``auto`` or a name among the registered ones (``ardupilot``, ``px4``).
        clock_ns: Node clock; poses are stamped with it, as TIMESYNC maps the autopilot's.
        parameters: Rates, limits, source of altitude.
        timeout_s: Replaces ``parameters.connect_timeout_s``.
        on_defect: Takes what ended the reading thread; None: it is printed.

    Raises:
        ConfigurationError: The signing key cannot be read.
        VehicleError: Wrong URL or dialect, port in use, nothing heard in time.
    """
    chosen = parameters or VehicleParameters()
    check_access(url, dialect, chosen.signing_key_file, chosen.system_id)
    if timeout_s is not None:
        chosen = replace(chosen, connect_timeout_s=timeout_s)
    try:
        return MavlinkLink(LastingTransport(url), dialect, chosen, clock_ns, on_defect)
    except VehicleError as error:
        raise VehicleError(f'vehicle at {url}: {error}') from error
