# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink messages that describe the simulated vehicle, by message id."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, degrees, isfinite, nan, pi, radians, sin
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot import instruments
from peace_ros.simulation.autopilot.disturbance import Disturbance, Vector
from peace_ros.simulation.autopilot.estimator import READY_S
from peace_ros.simulation.autopilot.flight import CRITICAL_BATTERY, LOW_BATTERY, Flight
from peace_ros.simulation.autopilot.guided import ALL_BUT_POSITION
from peace_ros.simulation.autopilot.missions import Missions
from peace_ros.simulation.autopilot.modes import LandedState
from peace_ros.simulation.autopilot.parameters import AutopilotParameters
from peace_ros.simulation.autopilot.personality import EKF_STATUS, Personality

UNKNOWN_U16 = 65535
MAX_E7 = 2**31 - 1
VELOCITY_ONLY = 0xDC7
"""Type mask of POSITION_TARGET_LOCAL_NED: only the velocity counts."""
SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)


class Streams:
    """Builds the messages; a builder returns None when there is nothing to say now."""

    def __init__(
        self,
        parameters: AutopilotParameters,
        personality: Personality | None = None,
        disturbance: Disturbance | None = None,
        missions: Missions | None = None,
    ) -> None:
        self._parameters = parameters
        self._datum = parameters.datum
        self._disturbance = disturbance or Disturbance()
        self._personality = personality or Personality()
        self._missions = missions or Missions(self._personality, self._datum)
        estimator = self._personality.estimator_message
        self._builders: dict[int, Callable[[Flight], Any]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position_ned,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._attitude_quaternion,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position_int,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw_int,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
            mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: self._distance_sensor,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._gps_global_origin,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self._position_target,
            mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: self._gimbal,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: self._global_target,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: instruments.vfr_hud,
            mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: instruments.scaled_pressure,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: instruments.system_time,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: instruments.rc_channels,
            mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: instruments.nav_controller_output,
            estimator: ekf_status if estimator == EKF_STATUS else estimator_status,
        }
        if self._personality.is_px4:
            self._builders[mavlink.MAVLINK_MSG_ID_ALTITUDE] = self._altitude
            self._builders[mavlink.MAVLINK_MSG_ID_HIGHRES_IMU] = instruments.highres_imu
        else:
            self._builders[mavlink.MAVLINK_MSG_ID_RAW_IMU] = instruments.raw_imu
            self._builders[mavlink.MAVLINK_MSG_ID_FENCE_STATUS] = lambda flight: (
                flight.fence.status(flight.position_m, flight.time_s)
            )

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
        latitude, longitude = self._datum.geodetic_e7(north, east)
        # ArduPilot fills in where home is on the globe only; its local position says nothing.
        local = (0.0, 0.0, 0.0)
        if self._personality.is_px4:
            local = (north, east, down + self._parameters.origin_above_home_m)
        return mavlink.MAVLink_home_position_message(
            latitude,
            longitude,
            round(self._parameters.home_altitude_msl_m * 1000),
            *local,
            [1.0, 0.0, 0.0, 0.0],
            0.0,
            0.0,
            0.0,
            round(flight.time_s * 1e6),
        )

    def _reported(self, flight: Flight, at_m: Vector | None = None) -> tuple[Vector, Vector]:
        d = self._disturbance
        position_m = flight.position_m if at_m is None else at_m
        return (
            d.reported_position(position_m, self._parameters.home_altitude_msl_m),
            d.reported_velocity(flight.velocity_m_s),
        )

    def _boot_ms(self, flight: Flight) -> int:
        return round((flight.time_s + self._disturbance.clock_step_s) * 1000.0) & 0xFFFFFFFF

    def _local_position_ned(self, flight: Flight) -> Any:
        if not flight.estimator.reports_position(flight.time_s):
            return None
        (north, east, down), velocity = self._reported(flight)
        down += self._parameters.origin_above_home_m
        return mavlink.MAVLink_local_position_ned_message(
            self._boot_ms(flight), north, east, down, *velocity
        )

    def _gps_global_origin(self, flight: Flight) -> Any:
        if not flight.estimator.has_origin(flight.time_s):
            return None
        p = self._parameters
        latitude, longitude = self._datum.geodetic_e7(0.0, 0.0)
        altitude_m = p.home_altitude_msl_m + p.origin_above_home_m
        return mavlink.MAVLink_gps_global_origin_message(
            latitude, longitude, round(altitude_m * 1000), round(flight.time_s * 1e6)
        )

    def _altitude(self, flight: Flight) -> Any:
        """Return ALTITUDE (PX4), which needs the barometer only."""
        p = self._parameters
        down = self._reported(flight, flight.last_place_m)[0][2]
        above_origin = -down - p.origin_above_home_m
        above_sea = p.home_altitude_msl_m - down
        return mavlink.MAVLink_altitude_message(
            round(flight.time_s * 1e6), above_sea, above_sea, above_origin, -down, nan, nan
        )

    def _attitude(self, flight: Flight) -> Any:
        p = flight.physics
        return mavlink.MAVLink_attitude_message(
            self._boot_ms(flight), p.roll_rad, p.pitch_rad, p.yaw_rad, 0.0, 0.0, p.yaw_rate_rad_s
        )

    def _attitude_quaternion(self, flight: Flight) -> Any:
        p = flight.physics
        return mavlink.MAVLink_attitude_quaternion_message(
            self._boot_ms(flight), *p.quaternion_ned_frd, 0.0, 0.0, p.yaw_rate_rad_s
        )

    def _global_position_int(self, flight: Flight) -> Any:
        known = flight.estimator.reports_position(flight.time_s)
        if not known and self._personality.is_px4:
            return None
        # ArduPilot continues with the last place, and with the barometer's altitude.
        at_m = flight.position_m if known else flight.last_place_m
        (north, east, down), (v_north, v_east, v_down) = self._reported(flight, at_m)
        if not isfinite(down):
            return None  # whole millimetres cannot say that
        latitude, longitude = self._datum.geodetic_e7(north, east)
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms(flight),
            latitude,
            longitude,
            round((self._parameters.home_altitude_msl_m - down) * 1000),
            round(-down * 1000),
            round(v_north * 100),
            round(v_east * 100),
            round(v_down * 100),
            round(degrees(flight.physics.yaw_rad) % 360.0 * 100) % 36000,
        )

    def _position_target(self, flight: Flight) -> Any:
        """Return POSITION_TARGET_LOCAL_NED: what GUIDED follows, whoever sent it."""
        target_m_s, target_m, mask = flight.target_m_s, flight.target_place_m, VELOCITY_ONLY
        if target_m is not None:
            north, east, down = target_m
            target_m = north, east, down + self._parameters.origin_above_home_m
            mask = ALL_BUT_POSITION
        elif target_m_s is None:
            return None
        frame, nothing = mavlink.MAV_FRAME_LOCAL_NED, (0.0,) * 3
        values = (*(target_m or nothing), *(target_m_s or nothing), *(0.0,) * 5)
        return mavlink.MAVLink_position_target_local_ned_message(
            self._boot_ms(flight), frame, mask, *values
        )

    def _global_target(self, flight: Flight) -> Any:
        """Return POSITION_TARGET_GLOBAL_INT: the place that is flown to, None without one."""
        if flight.target_place_m is None:
            return None
        north, east, down = flight.target_place_m
        latitude, longitude = self._datum.geodetic_e7(north, east)
        if max(abs(latitude), abs(longitude)) > MAX_E7:
            return None  # a place far beyond the plane around home has no longitude
        altitude_m = self._datum.altitude_msl_m - down
        where = (mavlink.MAV_FRAME_GLOBAL_INT, ALL_BUT_POSITION, latitude, longitude, altitude_m)
        return mavlink.MAVLink_position_target_global_int_message(
            self._boot_ms(flight), *where, *(0.0,) * 8
        )

    def _mission_current(self, _flight: Flight) -> Any:
        return mavlink.MAVLink_mission_current_message(
            self._missions.current, self._missions.count()
        )

    def _gps_raw_int(self, flight: Flight) -> Any:
        physics = flight.physics
        fix = flight.estimator.gps and flight.time_s >= READY_S / 4
        latitude, longitude = self._datum.geodetic_e7(physics.north_m, physics.east_m)
        altitude_m = self._parameters.home_altitude_msl_m - physics.down_m + flight.gnss.error_m
        return mavlink.MAVLink_gps_raw_int_message(
            round(flight.time_s * 1e6),
            mavlink.GPS_FIX_TYPE_3D_FIX if fix else mavlink.GPS_FIX_TYPE_NO_FIX,
            latitude if fix else 0,
            longitude if fix else 0,
            round(altitude_m * 1000) if fix else 0,
            121 if fix else UNKNOWN_U16,
            200 if fix else UNKNOWN_U16,
            UNKNOWN_U16,
            UNKNOWN_U16,
            10 if fix else 0,
            v_acc=round(flight.gnss.size_m * 1000) if fix else 0,
        )

    def _distance_sensor(self, flight: Flight) -> Any:
        """Return DISTANCE_SENSOR, None without a rangefinder."""
        if self._parameters.rangefinder_max_m == 0.0:
            return None
        tilt = min(flight.physics.tilt_rad, pi / 3)
        distance_cm = -flight.physics.down_m / cos(tilt) * 100.0
        return mavlink.MAVLink_distance_sensor_message(
            self._boot_ms(flight),
            20,
            round(self._parameters.rangefinder_max_m * 100),
            max(0, min(round(distance_cm), 65000)),
            mavlink.MAV_DISTANCE_SENSOR_LASER,
            0,
            mavlink.MAV_SENSOR_ROTATION_PITCH_270,
            255,
        )

    def _gimbal(self, flight: Flight) -> Any:
        """Return GIMBAL_DEVICE_ATTITUDE_STATUS: level in roll, turned with the vehicle."""
        if not self._parameters.has_gimbal:
            return None
        half_rad = radians(self._parameters.gimbal_pitch_deg) / 2.0
        flags = (
            mavlink.GIMBAL_DEVICE_FLAGS_ROLL_LOCK
            | mavlink.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
            | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
        )
        quaternion = [cos(half_rad), 0.0, sin(half_rad), 0.0]
        yaw_rad = flight.physics.yaw_rad
        boot_ms = self._boot_ms(flight)
        return mavlink.MAVLink_gimbal_device_attitude_status_message(
            0, 0, boot_ms, flags, quaternion, 0.0, 0.0, 0.0, 0, yaw_rad, 0.0, 1
        )


def heartbeat(flight: Flight) -> Any:
    """Return HEARTBEAT of a quadrotor."""
    personality = flight.personality
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    if flight.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    status = mavlink.MAV_STATE_STANDBY if flight.landed else mavlink.MAV_STATE_ACTIVE
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR,
        personality.autopilot,
        base,
        personality.custom_mode(flight.mode),
        status,
        3,
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
    if flight.fence.room_m(flight.position_m) >= 0.0:
        health |= mavlink.MAV_SYS_STATUS_GEOFENCE
    if not flight.estimator.gps:
        health &= ~mavlink.MAV_SYS_STATUS_SENSOR_GPS
    return mavlink.MAVLink_sys_status_message(
        SENSORS,
        SENSORS,
        health,
        200,
        12400,
        -1,
        round(flight.battery_remaining * 100.0),
        0,
        0,
        0,
        0,
        0,
        0,
    )


def battery_status(flight: Flight) -> Any:
    """Return BATTERY_STATUS of one battery, with its state of charge."""
    remaining, charge = flight.battery_remaining, mavlink.MAV_BATTERY_CHARGE_STATE_OK
    if remaining < LOW_BATTERY:
        charge = mavlink.MAV_BATTERY_CHARGE_STATE_LOW
    if remaining < CRITICAL_BATTERY:
        charge = mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
    who = (0, mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO)
    voltages_mv = [12400, *[UNKNOWN_U16] * 9]
    return mavlink.MAVLink_battery_status_message(
        *who, 32767, voltages_mv, 200, -1, -1, round(remaining * 100.0), 0, charge
    )


def ekf_flags(flight: Flight) -> int:
    """Return EKF_STATUS_FLAGS; ESTIMATOR_STATUS of PX4 gives the same bits the same meaning."""
    known = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_VERT
    known |= mavlink.ESTIMATOR_POS_VERT_ABS
    if not flight.has_position:
        return int(known | mavlink.ESTIMATOR_CONST_POS_MODE)
    known |= mavlink.ESTIMATOR_VELOCITY_HORIZ
    known |= mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    known |= mavlink.ESTIMATOR_POS_HORIZ_ABS | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
    return int(known)


def ekf_status(flight: Flight) -> Any:
    """Return EKF_STATUS_REPORT (ArduPilot)."""
    return mavlink.MAVLink_ekf_status_report_message(ekf_flags(flight), 0.1, 0.1, 0.1, 0.1, 0.0)


def estimator_status(flight: Flight) -> Any:
    """Return ESTIMATOR_STATUS (PX4).

    Measured, PX4 v1.17-alpha: 0x3FF at rest on the ground, with good GNSS. CONST_POS_MODE is set
    for a vehicle at rest, beside POS_HORIZ_ABS.
    """
    flags = ekf_flags(flight)
    if flight.has_position:
        flags |= mavlink.ESTIMATOR_POS_VERT_AGL
        if flight.landed:
            flags |= mavlink.ESTIMATOR_CONST_POS_MODE
    return mavlink.MAVLink_estimator_status_message(
        round(flight.time_s * 1e6), flags, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.5, 0.5
    )


def autopilot_version(flight: Flight) -> Any:
    """Return AUTOPILOT_VERSION: firmware and what this server serves."""
    capabilities, version = flight.personality.capabilities, flight.personality.version
    empty = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, version, 0, 0, 0, empty, empty, empty, 0, 0, 0
    )
