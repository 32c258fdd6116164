# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a person with a ground station would do: ready, arm, take off.

Made for demonstrations and tests. Nothing here arms unless the caller says so:
by :meth:`Pilot.arm`, or by ``arm=True`` of :meth:`Pilot.take_off`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import nan

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.vehicle.mavlink import MavlinkLink
from peace_ros.core.vehicle.result import Answer, RequestResult

RETRY_S = 1.0
LOOK_S = 0.02
ARMED_BIT_S = 3.0
"""The armed bit follows the acknowledgement by up to a second."""

Progress = Callable[[str], None]


class Pilot:
    """Verbs with limits; each raises VehicleError with what was waited for and what was heard.

    Args:
        link: The line to the vehicle.
        progress: Called with a sentence whenever something changes.
        retry_s: Pause before a refused request is made again.
    """

    def __init__(
        self, link: MavlinkLink, progress: Progress | None = None, retry_s: float = RETRY_S
    ) -> None:
        self._link = link
        self._retry_s = retry_s
        self._progress = progress or _quiet
        self._said = ''

    def wait_ready(self, timeout_s: float = 120.0) -> None:
        """Wait until the autopilot reports its position (a real one boots 42 s and longer)."""
        self._wait(lambda: self._link.telemetry().pose is not None, 'a position', timeout_s)

    def set_mode(self, mode: str, timeout_s: float = 60.0) -> None:
        """Ask for a mode until it is taken."""
        self._insist(lambda: self._link.set_mode(mode), f'mode {mode}', timeout_s)

    def arm(self, timeout_s: float = 90.0) -> None:
        """Arm the motors; asks again until the pre-arm checks pass and the armed bit shows."""
        deadline = time.monotonic() + timeout_s
        while not self._link.telemetry().armed:
            self._insist(
                lambda: self._link.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0),
                'arming',
                deadline - time.monotonic(),
            )
            self._holds_within(lambda: self._link.telemetry().armed, ARMED_BIT_S)
        self._say('armed')

    def take_off(self, altitude_m: float, timeout_s: float = 180.0, *, arm: bool = False) -> None:
        """GUIDED (PX4: AUTO.TAKEOFF), climb; returns when the take-off is over.

        No velocity set-point may be sent meanwhile: it would abort the take-off.

        Args:
            altitude_m: Above home.
            timeout_s: For everything together.
            arm: Arm as well, and again after the autopilot disarmed by itself.

        Raises:
            VehicleError: Not armed and not allowed to arm, refused until the time was over,
                or disarmed on the way.
        """
        deadline = time.monotonic() + timeout_s
        goal_m = self._prepare_take_off(altitude_m, timeout_s)
        # PX4 reads zero as latitude and longitude; ArduCopter looks at the altitude only.
        unused = nan if self._link.dialect.name == 'px4' else 0.0
        accepted = RequestResult(Answer.NO_ANSWER)
        while not accepted:
            # It disarms by itself 10 s after arming, so arming belongs into the loop.
            if arm:
                self.arm(deadline - time.monotonic())
            elif not self._link.telemetry().armed:
                raise VehicleError(
                    'take-off: the vehicle is not armed; call arm() or pass arm=True'
                )
            accepted = self._link.command(
                mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, unused, unused, unused, goal_m
            )
            if not accepted:
                self._check_time(deadline, f'take-off: {accepted.reason}')
                self._say(f'take-off: {accepted.reason}')
                time.sleep(self._retry_s)
        self._wait(
            lambda: self._has_climbed(altitude_m),
            f'{altitude_m} m above home',
            deadline - time.monotonic(),
        )

    def _prepare_take_off(self, altitude_m: float, timeout_s: float) -> float:
        """Make ready; return the altitude to ask for (PX4 counts it from sea level)."""
        if self._link.dialect.name != 'px4':
            self.set_mode(self._link.dialect.control_mode, timeout_s)
            return altitude_m
        self._wait(lambda: self._link.home_msl_m is not None, 'the altitude of home', timeout_s)
        return altitude_m + (self._link.home_msl_m or 0.0)

    def _has_climbed(self, altitude_m: float) -> bool:
        told = self._link.telemetry()
        if told.pose is None:
            return False
        if not told.armed:
            raise VehicleError(f'disarmed during the take-off: {told.status_text}')
        self._say(f'{told.mode}: {5 * round(told.pose.altitude_agl_m / 5)} m of {altitude_m:.0f} m')
        high = told.pose.altitude_agl_m >= 0.9 * altitude_m
        # Without a landed state the altitude alone decides.
        return high and self._link.landed_state in {
            mavlink.MAV_LANDED_STATE_UNDEFINED,
            mavlink.MAV_LANDED_STATE_IN_AIR,
        }

    def _insist(self, ask: Callable[[], RequestResult], what: str, timeout_s: float) -> None:
        deadline = time.monotonic() + timeout_s
        while not (result := ask()):
            self._check_time(deadline, f'{what}: {result.answer.value}, {result.reason}')
            self._say(f'{what}: {result.reason}')
            time.sleep(min(self._retry_s, max(0.0, deadline - time.monotonic())))
        self._say(f'{what}: accepted')

    def _wait(self, predicate: Callable[[], bool], what: str, timeout_s: float) -> None:
        self._say(f'waiting for {what}')
        if not self._holds_within(predicate, timeout_s):
            told = self._link.telemetry()
            raise VehicleError(
                f'{what}: not within {timeout_s:.0f} s; mode {told.mode}, '
                f'last words of the autopilot: {told.status_text!r}'
            )

    def _holds_within(self, predicate: Callable[[], bool], timeout_s: float) -> bool:
        deadline = time.monotonic() + timeout_s
        while not predicate():
            if time.monotonic() >= deadline:
                return False
            time.sleep(LOOK_S)
        return True

    def _check_time(self, deadline: float, what: str) -> None:
        if time.monotonic() >= deadline:
            raise VehicleError(f'{what}; the time for it is over')

    def _say(self, text: str) -> None:
        if text != self._said:
            self._said = text
            self._progress(text)


def _quiet(_text: str) -> None:
    """Ignore progress."""
