# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that show what a ground station draws: sensors, head-up display, sticks, clock.

All values come from the physics; the noise of real sensors is left out.
"""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, radians, sin
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.geometry import rotation_matrix
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.physics import GRAVITY_M_S2, Physics

SEA_LEVEL_PA, SEA_LEVEL_K, LAPSE_K_M = 101_325.0, 288.15, 0.0065
"""International Standard Atmosphere."""
BAROMETRIC_EXPONENT = 5.2559
FIELD_GAUSS = (0.21, 0.0, 0.43)
"""Magnetic field at middle northern latitudes: north, east, down."""
HOVER_THROTTLE = 0.5
NO_CHANNEL = 65535
CENTRE_US, THROW_US = 1500, 500


def highres_imu(flight: Flight) -> Any:
    """Return HIGHRES_IMU (PX4): m/s^2, rad/s, Gauss, hPa, degrees Celsius."""
    force, field = _body(flight.physics)
    pressure_hpa, celsius = _air(flight)
    return mavlink.MAVLink_highres_imu_message(
        round(flight.time_s * 1e6),
        *force,
        *_rates(flight.physics),
        *field,
        pressure_hpa,
        0.0,
        flight.datum.altitude_msl_m - flight.last_place_m[2],
        celsius,
        0xFFF,
    )


def raw_imu(flight: Flight) -> Any:
    """Return RAW_IMU (ArduPilot): thousandths of g, of rad/s and of a Gauss."""
    force, field = _body(flight.physics)
    return mavlink.MAVLink_raw_imu_message(
        round(flight.time_s * 1e6),
        *(round(each / GRAVITY_M_S2 * 1000.0) for each in force),
        *(round(each * 1000.0) for each in _rates(flight.physics)),
        *(round(each * 1000.0) for each in field),
    )


def scaled_pressure(flight: Flight) -> Any:
    """Return SCALED_PRESSURE of the barometer, which may be wrong."""
    pressure_hpa, celsius = _air(flight)
    boot_ms = round(flight.time_s * 1000.0)
    return mavlink.MAVLink_scaled_pressure_message(
        boot_ms, pressure_hpa, 0.0, round(celsius * 100.0)
    )


def vfr_hud(flight: Flight) -> Any:
    """Return VFR_HUD; without an airspeed sensor the air speed is the ground speed."""
    north, east, down = flight.velocity_m_s
    ground_m_s = hypot(north, east)
    return mavlink.MAVLink_vfr_hud_message(
        ground_m_s,
        ground_m_s,
        round(degrees(flight.physics.yaw_rad) % 360.0) % 360,
        _throttle_percent(flight),
        flight.datum.altitude_msl_m - flight.last_place_m[2],
        -down,
    )


def system_time(flight: Flight) -> Any:
    """Return SYSTEM_TIME; the simulation knows no date, so that field is 0."""
    return mavlink.MAVLink_system_time_message(0, round(flight.time_s * 1000.0))


def rc_channels(flight: Flight) -> Any:
    """Return RC_CHANNELS: roll, pitch, throttle, yaw in microseconds; None without a radio."""
    if flight.personality.is_px4:
        return None
    throttle_us = round(CENTRE_US + THROW_US * flight.throttle_stick)
    channels = [CENTRE_US, CENTRE_US, throttle_us, CENTRE_US, *[NO_CHANNEL] * 14]
    return mavlink.MAVLink_rc_channels_message(round(flight.time_s * 1000.0), 4, *channels, 255)


def nav_controller_output(flight: Flight) -> Any:
    """Return NAV_CONTROLLER_OUTPUT: attitude, and the way to the place that is flown to."""
    p = flight.physics
    north = east = up = 0.0
    if flight.target_place_m is not None:
        at = flight.position_m
        north, east, down = (flight.target_place_m[i] - at[i] for i in range(3))
        up = -down
    bearing = round(degrees(atan2(east, north)))
    return mavlink.MAVLink_nav_controller_output_message(
        degrees(p.roll_rad),
        degrees(p.pitch_rad),
        round(degrees(p.yaw_rad)),
        bearing,
        min(65535, round(hypot(north, east))),
        up,
        0.0,
        0.0,
    )


def _body(p: Physics) -> tuple[list[float], list[float]]:
    """Return specific force (m/s^2) and magnetic field (Gauss) along forward, right, down."""
    to_ned = rotation_matrix(p.quaternion_ned_frd)
    field = [float(each) for each in to_ned.T @ np.array(FIELD_GAUSS)]
    # The thrust of a multicopter acts along its own vertical axis only.
    lift = GRAVITY_M_S2 if p.on_ground else GRAVITY_M_S2 / max(0.3, cos(p.tilt_rad))
    return [0.0, 0.0, -lift], field


def _rates(p: Physics) -> tuple[float, float, float]:
    """Return the turn about forward, right and down, rad/s."""
    rate, pitch = p.yaw_rate_rad_s, p.pitch_rad
    return (
        -rate * sin(pitch),
        rate * cos(pitch) * sin(p.roll_rad),
        rate * cos(pitch) * cos(p.roll_rad),
    )


def _air(flight: Flight) -> tuple[float, float]:
    """Return pressure in hPa and temperature in degrees Celsius at the barometer's height."""
    altitude_m = flight.datum.altitude_msl_m - flight.last_place_m[2]
    kelvin = SEA_LEVEL_K - LAPSE_K_M * max(-500.0, min(11_000.0, altitude_m))
    pressure_pa = SEA_LEVEL_PA * (kelvin / SEA_LEVEL_K) ** BAROMETRIC_EXPONENT
    return pressure_pa / 100.0, kelvin - 273.15


def _throttle_percent(flight: Flight) -> int:
    if not flight.armed or flight.landed:
        return 0
    tilt_rad = min(flight.physics.tilt_rad, radians(70.0))
    return round(100.0 * HOVER_THROTTLE / cos(tilt_rad))
