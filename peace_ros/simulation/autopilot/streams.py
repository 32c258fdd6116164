# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink messages that describe the simulated vehicle, by message id."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, degrees, pi, radians
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.estimator import READY_S
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.modes import LandedState
from peace_ros.simulation.autopilot.parameters import AutopilotParameters

METRES_PER_DEGREE = 111_319.49
UNKNOWN_U16 = 65535
SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)


class Streams:
    """Builds the messages; a builder returns None when there is nothing to say now."""

    def __init__(self, parameters: AutopilotParameters) -> None:
        self._parameters = parameters
        self._builders: dict[int, Callable[[Flight], Any]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position_int,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw_int,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
            mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: self._distance_sensor,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
        }

    def knows(self, message_id: int) -> bool:
        """Whether this message can be asked for."""
        return message_id in self._builders

    def build(self, message_id: int, flight: Flight) -> Any:
        """Return the message as it is now, or None."""
        return self._builders[message_id](flight)

    def home_position(self, flight: Flight) -> Any:
        """Return HOME_POSITION, None before it is known."""
        if flight.home_changes == 0:
            return None
        north, east, down = flight.home_m
        latitude, longitude = self._geodetic(north, east)
        return mavlink.MAVLink_home_position_message(
            latitude,
            longitude,
            round(self._parameters.home_altitude_msl_m * 1000),
            north,
            east,
            down,
            [1.0, 0.0, 0.0, 0.0],
            0.0,
            0.0,
            0.0,
            round(flight.time_s * 1e6),
        )

    def _geodetic(self, north_m: float, east_m: float) -> tuple[int, int]:
        p = self._parameters
        latitude = p.home_latitude_deg + north_m / METRES_PER_DEGREE
        shrink = cos(radians(p.home_latitude_deg))
        longitude = p.home_longitude_deg + east_m / (METRES_PER_DEGREE * shrink)
        return round(latitude * 1e7), round(longitude * 1e7)

    def _global_position_int(self, flight: Flight) -> Any:
        if not flight.estimator.reports_position(flight.time_s):
            return None
        north, east, down = flight.position_m
        latitude, longitude = self._geodetic(north, east)
        v_north, v_east, v_down = flight.physics.velocity_ned_m_s
        return mavlink.MAVLink_global_position_int_message(
            _boot_ms(flight),
            latitude,
            longitude,
            round((self._parameters.home_altitude_msl_m - down) * 1000),
            round(-down * 1000),
            round(v_north * 100),
            round(v_east * 100),
            round(v_down * 100),
            round(degrees(flight.physics.yaw_rad) % 360.0 * 100) % 36000,
        )

    def _gps_raw_int(self, flight: Flight) -> Any:
        physics = flight.physics
        fix = flight.estimator.gps and flight.time_s >= READY_S / 4
        latitude, longitude = self._geodetic(physics.north_m, physics.east_m)
        return mavlink.MAVLink_gps_raw_int_message(
            round(flight.time_s * 1e6),
            mavlink.GPS_FIX_TYPE_RTK_FIXED if fix else mavlink.GPS_FIX_TYPE_NO_FIX,
            latitude if fix else 0,
            longitude if fix else 0,
            round((self._parameters.home_altitude_msl_m - physics.down_m) * 1000) if fix else 0,
            121 if fix else UNKNOWN_U16,
            200 if fix else UNKNOWN_U16,
            UNKNOWN_U16,
            UNKNOWN_U16,
            10 if fix else 0,
        )

    def _distance_sensor(self, flight: Flight) -> Any:
        tilt = min(flight.physics.tilt_rad, pi / 3)
        distance_cm = -flight.physics.down_m / cos(tilt) * 100.0
        return mavlink.MAVLink_distance_sensor_message(
            _boot_ms(flight),
            20,
            round(self._parameters.rangefinder_max_m * 100),
            max(0, min(round(distance_cm), 65000)),
            mavlink.MAV_DISTANCE_SENSOR_LASER,
            0,
            mavlink.MAV_SENSOR_ROTATION_PITCH_270,
            255,
        )


def heartbeat(flight: Flight) -> Any:
    """Return HEARTBEAT of a quadrotor under ArduPilot."""
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    if flight.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    status = mavlink.MAV_STATE_STANDBY if flight.landed else mavlink.MAV_STATE_ACTIVE
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        base,
        int(flight.mode),
        status,
        3,
    )


def local_position_ned(flight: Flight) -> Any:
    """Return LOCAL_POSITION_NED, None while the filter has no position."""
    if not flight.estimator.reports_position(flight.time_s):
        return None
    north, east, down = flight.position_m
    return mavlink.MAVLink_local_position_ned_message(
        _boot_ms(flight), north, east, down, *flight.physics.velocity_ned_m_s
    )


def attitude(flight: Flight) -> Any:
    """Return ATTITUDE (Euler angles, radians)."""
    p = flight.physics
    return mavlink.MAVLink_attitude_message(
        _boot_ms(flight), p.roll_rad, p.pitch_rad, p.yaw_rad, 0.0, 0.0, p.yaw_rate_rad_s
    )


def attitude_quaternion(flight: Flight) -> Any:
    """Return ATTITUDE_QUATERNION (w, x, y, z)."""
    p = flight.physics
    return mavlink.MAVLink_attitude_quaternion_message(
        _boot_ms(flight), *p.quaternion_ned_frd, 0.0, 0.0, p.yaw_rate_rad_s
    )


def extended_sys_state(flight: Flight) -> Any:
    """Return EXTENDED_SYS_STATE with landed_state."""
    state: LandedState = flight.landed_state
    return mavlink.MAVLink_extended_sys_state_message(0, int(state))


def sys_status(flight: Flight) -> Any:
    """Return SYS_STATUS; the pre-arm bit of health tells when arming may succeed."""
    health = SENSORS
    if flight.prearm_problem():
        health &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    if not flight.estimator.gps:
        health &= ~mavlink.MAV_SYS_STATUS_SENSOR_GPS
    return mavlink.MAVLink_sys_status_message(
        SENSORS, SENSORS, health, 200, 12400, -1, -1, 0, 0, 0, 0, 0, 0
    )


def autopilot_version(_flight: Flight) -> Any:
    """Return AUTOPILOT_VERSION: 4.7.0, MAVLink 2, velocity set-points."""
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    )
    version = (4 << 24) | (7 << 16) | (0 << 8) | 255
    empty = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, version, 0, 0, 0, empty, empty, empty, 0, 0, 0
    )


def _boot_ms(flight: Flight) -> int:
    return round(flight.time_s * 1000.0) & 0xFFFFFFFF
