# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Asks for the messages that the link needs, and again when they stop; pure."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.dialects import Dialect
from peace_ros.core.vehicle.parameters import VehicleParameters

SILENT_NS = 1_500_000_000
"""A stream that is silent for so long is asked for again."""
ASK_AGAIN_NS = 1_000_000_000
MAYBE_AGAIN_NS = 15_000_000_000
ONCE_AGAIN_NS = 3_000_000_000
HEALTH_HZ = 1.0
HEIGHT_HZ = 10.0
ESTIMATOR_HZ = 4.0
FIX_HZ = 10.0
"""A descent by GNSS has to stop within 1 s of a lost fix."""
TERRAIN_HZ = 1.0
MAYBE = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_GPS2_RAW,
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_TERRAIN_REPORT,
        mavlink.MAVLINK_MSG_ID_FENCE_STATUS,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    }
)
"""Seldom asked for again: not every vehicle has them, or it sends them in some modes only."""
TARGET_HZ = 10.0
FENCE_HZ = TARGET_HZ
"""As often as targets: a fence changes them."""

Request = tuple[int, tuple[float, float]]
"""MAV_CMD and its first two parameters."""


class StreamKeeper:
    """Knows which messages are wanted and when each was last asked for."""

    def __init__(self, parameters: VehicleParameters, dialect: Dialect) -> None:
        self.rates_hz: dict[int, float] = {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: parameters.pose_rate_hz,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: parameters.pose_rate_hz,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: parameters.state_rate_hz,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: HEALTH_HZ,
            dialect.estimator_message: ESTIMATOR_HZ,
            dialect.height_message: HEIGHT_HZ,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: FIX_HZ,
            mavlink.MAVLINK_MSG_ID_GPS2_RAW: FIX_HZ,
            mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: HEIGHT_HZ,
            mavlink.MAVLINK_MSG_ID_TERRAIN_REPORT: TERRAIN_HZ,
            mavlink.MAVLINK_MSG_ID_FENCE_STATUS: FENCE_HZ,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: TARGET_HZ,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: HEALTH_HZ,
        }
        """Message id -> the rate that is asked for."""
        if dialect.heartbeat_rate_hz > 0.0:
            self.rates_hz[mavlink.MAVLINK_MSG_ID_HEARTBEAT] = dialect.heartbeat_rate_hz
        self._optional = {*MAYBE}
        if parameters.altitude_source == 'rangefinder':
            self.rates_hz[mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR] = parameters.pose_rate_hz
            self._optional.remove(mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR)
        if parameters.follow_gimbal:
            gimbal = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS
            self.rates_hz[gimbal] = parameters.pose_rate_hz
        self._wanted_once = [mavlink.MAVLINK_MSG_ID_HOME_POSITION]
        if not dialect.home_is_local:
            self._wanted_once.append(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
        self._asked_ns: dict[int, int] = {}
        self._reboots = 0

    def due(self, assembler: Assembler, now_ns: int) -> list[Request]:
        """Return the requests to send now."""
        if assembler.reboots != self._reboots:
            self._reboots = assembler.reboots
            self.forget()
        requests: list[Request] = []
        for message_id, rate_hz in self.rates_hz.items():
            limit_ns = max(SILENT_NS, round(3e9 / rate_hz))
            silent = now_ns - assembler.arrived_ns.get(message_id, 0) > limit_ns
            if message_id not in self._asked_ns or silent:
                again_ns = MAYBE_AGAIN_NS if message_id in self._optional else ASK_AGAIN_NS
                request = (
                    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
                    (float(message_id), 1e6 / rate_hz),
                )
                self._ask(requests, message_id, request, again_ns, now_ns)
        for once in self._wanted_once:
            if once not in assembler.arrived_ns:
                request = (mavlink.MAV_CMD_REQUEST_MESSAGE, (float(once), 0.0))
                self._ask(requests, once, request, ONCE_AGAIN_NS, now_ns)
        return requests

    def forget(self) -> None:
        """Ask for everything again: the autopilot or the line begins anew."""
        self._asked_ns.clear()

    def _ask(
        self, requests: list[Request], key: int, request: Request, again_ns: int, now_ns: int
    ) -> None:
        asked_ns = self._asked_ns.get(key)
        if asked_ns is None or now_ns - asked_ns >= again_ns:
            self._asked_ns[key] = now_ns
            requests.append(request)
