# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the simulated autopilot."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain.parameters import ParameterSet, parameter
from peace_ros.simulation.autopilot.datum import Datum


@dataclass(frozen=True)
class AutopilotParameters(ParameterSet):
    """What a user may choose of the simulated vehicle and its server."""

    autopilot: str = parameter(
        'ardupilot', 'Which autopilot is played.', choices=('ardupilot', 'px4')
    )
    host: str = parameter('127.0.0.1', 'Address on which the MAVLink server listens.')
    port: int = parameter(
        18570, 'UDP port of the MAVLink server; 0 lets the system choose.', low=0, high=65535
    )
    tcp_port: int = parameter(
        0, 'TCP port of the MAVLink server besides; 0 opens none.', low=0, high=65535
    )
    serial_port: int = parameter(
        0,
        "First of the TCP ports of ArduPilot's own simulation (5760; also 5762 and 5763): one "
        'client each, and it boots when the first client has come; 0 opens none.',
        low=0,
        high=65532,
    )
    fault_port: int = parameter(
        0,
        'UDP port, on the loopback address, on which faults can be injected; 0 opens none.',
        low=0,
        high=65535,
    )
    signing_key_file: str = parameter(
        '',
        'File with the key of MAVLink 2 signing (32 bytes, or a passphrase); messages that are '
        'not signed with it are refused. Empty: no signing.',
    )
    system_id: int = parameter(1, 'MAVLink system id of the vehicle.', low=1, high=254)
    start_north_m: float = parameter(
        0.0, 'Where the vehicle boots, north of the home point.', unit='m', low=-1e5, high=1e5
    )
    start_east_m: float = parameter(
        0.0, 'Where the vehicle boots, east of the home point.', unit='m', low=-1e5, high=1e5
    )
    start_heading_deg: float = parameter(
        0.0, 'Heading at boot, clockwise from north.', unit='deg', low=-360.0, high=360.0
    )
    home_latitude_deg: float = parameter(
        48.858, 'Latitude of the home point.', unit='deg', low=-85.0, high=85.0
    )
    home_longitude_deg: float = parameter(
        2.342, 'Longitude of the home point.', unit='deg', low=-180.0, high=180.0
    )
    home_altitude_msl_m: float = parameter(
        35.0, 'Altitude of the flat ground above sea level.', unit='m', low=-500.0, high=9000.0
    )
    origin_above_home_m: float = parameter(
        0.0,
        "Height of the local frame's origin above home: LOCAL_POSITION_NED tells z from there.",
        unit='m',
        low=-500.0,
        high=500.0,
    )
    wind_to_north_m_s: float = parameter(
        0.0, 'Mean wind, the way the air moves, to the north.', unit='m/s', low=-20.0, high=20.0
    )
    wind_to_east_m_s: float = parameter(
        0.0, 'Mean wind, the way the air moves, to the east.', unit='m/s', low=-20.0, high=20.0
    )
    gust_m_s: float = parameter(
        0.0, 'Standard deviation of the gusts along each axis.', unit='m/s', low=0.0, high=5.0
    )
    seed: int = parameter(
        0, 'Seed of the gusts and of the errors of the estimates.', low=0, high=2**31 - 1
    )
    velocity_bias_m_s: float = parameter(
        -1.0,
        'Standard deviation of the error of the estimated velocity along each horizontal axis, '
        'which the vehicle flies by; -1: as measured of this autopilot (0 for ArduPilot).',
        unit='m/s',
        low=-1.0,
        high=2.0,
    )
    position_noise_m: float = parameter(
        -1.0,
        'Standard deviation of the error of the estimated position along each horizontal axis; '
        '-1: as measured of this autopilot (0 for ArduPilot).',
        unit='m',
        low=-1.0,
        high=5.0,
    )
    speed: float = parameter(
        1.0, 'Simulated seconds per second of the wall clock.', low=0.1, high=50.0
    )
    physics_rate_hz: float = parameter(
        100.0, 'Rate of the physics on the simulated clock.', unit='Hz', low=50.0, high=400.0
    )
    gnss_altitude_noise_m: float = parameter(
        2.5,
        'Standard deviation of the error of the GNSS altitude, which changes within minutes.',
        unit='m',
        low=0.0,
        high=20.0,
    )
    has_gimbal: bool = parameter(
        False, 'A gimbal keeps the camera level with the horizon and reports its attitude.'
    )
    gimbal_pitch_deg: float = parameter(
        -90.0,
        'Its view above the horizon; -90 looks straight down.',
        unit='deg',
        low=-90.0,
        high=0.0,
    )
    rangefinder_max_m: float = parameter(
        0.0, 'Range of the downward rangefinder; 0: there is none.', unit='m', low=0.0, high=500.0
    )

    @property
    def datum(self) -> Datum:
        """Where home lies on the globe."""
        return Datum(
            self.home_latitude_deg,
            self.home_longitude_deg,
            self.home_altitude_msl_m,
            self.origin_above_home_m,
        )
