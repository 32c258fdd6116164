# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameter protocol: PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET -> PARAM_VALUE.

A real ArduCopter has 1348 parameters (measured, 4.7-dev). Here are those that the usual clients ask
for and those that change the simulated flight (:data:`FLOWN`). The others are kept and told only.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from struct import pack, unpack
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.personality import Personality

REAL32 = mavlink.MAV_PARAM_TYPE_REAL32
INT8, INT16, INT32 = (
    mavlink.MAV_PARAM_TYPE_INT8,
    mavlink.MAV_PARAM_TYPE_INT16,
    mavlink.MAV_PARAM_TYPE_INT32,
)
_BITS = {INT8: 8, INT16: 16, INT32: 32}

ARDUPILOT: dict[str, tuple[float, int]] = {
    'ARMING_SKIPCHK': (0.0, INT32),
    'BATT_MONITOR': (4.0, INT8),
    'FENCE_ENABLE': (0.0, INT8),
    'FENCE_TYPE': (7.0, INT8),
    'FRAME_CLASS': (1.0, INT8),
    'FRAME_TYPE': (1.0, INT8),
    'FS_EKF_ACTION': (1.0, INT8),
    'FS_GCS_ENABLE': (0.0, INT8),
    'FS_THR_ENABLE': (1.0, INT8),
    'GUID_OPTIONS': (0.0, INT32),
    'GUID_TIMEOUT': (3.0, REAL32),
    'MAV_GCS_SYSID': (255.0, INT16),
    'PILOT_SPD_DN': (0.0, REAL32),
    'PILOT_SPD_UP': (2.5, REAL32),
    'RTL_ALT_M': (15.0, REAL32),
    'WP_SPD': (10.0, REAL32),
}
"""Names of ArduCopter 4.7, where SYSID_THISMAV is MAV_SYSID (measured, 4.7-dev)."""
PX4: dict[str, tuple[float, int]] = {
    'CAL_ACC0_ID': (1310988.0, INT32),
    'CAL_GYRO0_ID': (1310988.0, INT32),
    'CAL_MAG0_ID': (197388.0, INT32),
    'COM_DISARM_LAND': (2.0, REAL32),
    'COM_OBL_RC_ACT': (0.0, INT32),
    'COM_OF_LOSS_T': (1.0, REAL32),
    'COM_RCL_EXCEPT': (4.0, INT32),
    'COM_RC_IN_MODE': (1.0, INT32),
    'GF_ACTION': (2.0, INT32),
    'MIS_TAKEOFF_ALT': (2.5, REAL32),
    'MPC_XY_CRUISE': (5.0, REAL32),
    'MPC_XY_VEL_MAX': (12.0, REAL32),
    'NAV_RCL_ACT': (2.0, INT32),
    'RTL_RETURN_ALT': (15.0, REAL32),
    'SYS_AUTOSTART': (10040.0, INT32),
}
"""Names of PX4 v1.17; COM_RCL_EXCEPT lets OFFBOARD fly without a radio."""

RTL_ALTITUDE, CRUISE_SPEED, TAKE_OFF_ALTITUDE = 'RTL altitude', 'cruise speed', 'take-off altitude'
FLOWN: dict[str, tuple[str, str]] = {
    RTL_ALTITUDE: ('RTL_ALT_M', 'RTL_RETURN_ALT'),
    CRUISE_SPEED: ('WP_SPD', 'MPC_XY_CRUISE'),
    TAKE_OFF_ALTITUDE: ('', 'MIS_TAKEOFF_ALT'),
}
"""What changes the flight: its names on ArduPilot and on PX4."""


@dataclass(frozen=True)
class _Value:
    value: float
    kind: int


class ParameterStore:
    """Parameters of one autopilot, which outlive its reboots.

    Args:
        personality: Whose names and whose encoding of whole numbers.
        system_id: Value of MAV_SYSID or MAV_SYS_ID.
    """

    def __init__(self, personality: Personality | None = None, system_id: int = 1) -> None:
        self._is_px4 = (personality or Personality()).is_px4
        table = dict(PX4 if self._is_px4 else ARDUPILOT)
        table['MAV_SYS_ID' if self._is_px4 else 'MAV_SYSID'] = (float(system_id), INT32)
        self._values = {name: _Value(*table[name]) for name in sorted(table)}

    def flown(self, what: str) -> float:
        """Return a value of :data:`FLOWN`, in metres or m/s."""
        return self._values[FLOWN[what][self._is_px4]].value

    def take(self, message: Any) -> tuple[list[Any], bool]:
        """Answer a message of the protocol.

        Returns:
            PARAM_VALUE messages, and whether they are news for every peer. A name or an index that
            is unknown is not answered, as by the real ones.
        """
        names = list(self._values)
        kind = message.get_type()
        if kind == 'PARAM_REQUEST_LIST':
            return [self._told(name) for name in names], False
        if kind == 'PARAM_REQUEST_READ' and message.param_index >= 0:
            return [self._told(name) for name in names[message.param_index :][:1]], False
        if kind not in {'PARAM_REQUEST_READ', 'PARAM_SET'} or message.param_id not in names:
            return [], False
        if kind == 'PARAM_SET':
            self._set(message.param_id, self._decoded(message))
        return [self._told(message.param_id)], kind == 'PARAM_SET'

    def _set(self, name: str, value: float) -> None:
        kind = self._values[name].kind
        if not isfinite(value):
            return
        if kind in _BITS:
            limit = 2 ** (_BITS[kind] - 1)
            value = float(max(-limit, min(limit - 1, round(value))))
        self._values[name] = _Value(value, kind)

    def _decoded(self, message: Any) -> float:
        """Return the value of PARAM_SET: PX4 puts the bytes of whole numbers into the float."""
        if self._is_px4 and message.param_type == INT32:
            return float(unpack('<i', pack('<f', message.param_value))[0])
        return float(message.param_value)

    def _told(self, name: str) -> Any:
        value, kind = self._values[name].value, self._values[name].kind
        if self._is_px4 and kind == INT32:
            value = unpack('<f', pack('<i', round(value)))[0]
        names = list(self._values)
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(names), names.index(name)
        )
