# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the simulators' nodes can be told."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain import ConfigurationError, Distortion
from peace_ros.core.domain.camera import DISTORTION_SIZES
from peace_ros.core.domain.parameters import ParameterSet, parameter
from peace_ros.core.node_parameters import CameraOptions, Group
from peace_ros.core.vehicle import AUTO, check_access
from peace_ros.core.vehicle.transport import parse_url
from peace_ros.simulation.autopilot import AutopilotParameters

CAMERA_SYSTEM_ID = 254
"""Differs from that of the companion, which has its own connection to the same autopilot."""


@dataclass(frozen=True)
class SatelliteViewOptions(ParameterSet):
    """Options of the satellite_view node."""

    world: str = parameter(
        '', 'Orthophoto (JPEG, PNG, GeoTIFF), north up; empty draws a world from world_seed'
    )
    gsd: float = parameter(
        0.0,
        'Ground sampling distance of the orthophoto; 0 takes it from a GeoTIFF',
        unit='m/px',
        low=0.0,
        high=10.0,
    )
    labels: str = parameter('', 'Label raster of the orthophoto (PNG); empty when there is none')
    world_seed: int = parameter(0, 'Seed of the drawn world', low=0, high=2**31 - 1)
    world_size: float = parameter(400.0, 'Edge of the drawn world', unit='m', low=60.0, high=2000.0)
    world_gsd: float = parameter(
        0.1, 'Ground sampling distance of the drawn world', unit='m/px', low=0.05, high=2.0
    )
    start_x: float = parameter(
        0.0,
        'The local origin of the vehicle lies this far east of the centre of the world',
        unit='m',
        low=-1e5,
        high=1e5,
    )
    start_y: float = parameter(0.0, 'The same to the north', unit='m', low=-1e5, high=1e5)
    distortion_model: str = parameter(
        'plumb_bob',
        'Of the lens, as sensor_msgs/CameraInfo names it',
        choices=tuple(DISTORTION_SIZES),
    )
    distortion: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 0.0, 0.0),
        'Coefficients of the distortion as in CameraInfo; all 0: none',
        low=-100.0,
        high=100.0,
    )
    rate: float = parameter(10.0, 'Frames per second of the pose', unit='Hz', low=0.1, high=120.0)
    pose_source: str = parameter(
        'topic',
        'Where the pose comes from: the topic ground_truth/pose, an autopilot over MAVLink, or '
        'velocities on the topic cmd_vel that are integrated here',
        choices=('topic', 'mavlink', 'twist'),
    )
    pose_mavlink: str = parameter(
        '', 'Connection that reports the pose, written as for landing; implies pose_source mavlink'
    )
    pose_signing_key_file: str = parameter(
        '',
        'File with the key of MAVLink 2 signing on that connection, as '
        'vehicle.signing_key_file of landing; empty: no signing',
    )
    start_altitude: float = parameter(
        100.0, 'With pose_source twist: altitude at the start', unit='m', low=1.0, high=1000.0
    )
    twist_timeout: float = parameter(
        1.0,
        'With pose_source twist: the vehicle stops when no velocity came for this long',
        unit='s',
        low=0.05,
        high=60.0,
    )

    @property
    def lens(self) -> Distortion | None:
        """The distortion that the options describe."""
        bends = any(self.distortion)
        return Distortion(self.distortion_model, self.distortion) if bends else None

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.lens
        if self.pose_source == 'mavlink' and not self.pose_mavlink:
            raise ConfigurationError(
                'parameter pose_source = mavlink without pose_mavlink: say where the autopilot is'
            )
        if self.pose_mavlink:
            check_access(self.pose_mavlink, AUTO, self.pose_signing_key_file, CAMERA_SYSTEM_ID)
        if not self.world and self.labels:
            raise ConfigurationError(
                f'parameter labels = {self.labels!r} without world: give the orthophoto too'
            )


@dataclass(frozen=True)
class AutopilotSimOptions(ParameterSet):
    """Options of the autopilot_sim node."""

    pose_rate: float = parameter(
        50.0, 'Rate of ground_truth/pose, simulated time', unit='Hz', low=1.0, high=200.0
    )
    publish_clock: bool = parameter(
        False, 'Publish /clock also at speed 1 (at any other speed it always is)'
    )
    ground_station: str = parameter(
        'udpout:127.0.0.1:14550',
        "Where it sends from the start, as the autopilots' own simulations do: "
        'udpout:HOST:PORT, by default to the landing node; empty: it answers only',
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ground_station and parse_url(self.ground_station)[0] != 'udpout':
            raise ConfigurationError(
                f'parameter ground_station = {self.ground_station!r}: write udpout:HOST:PORT'
            )

    @property
    def ground_station_address(self) -> tuple[str, int] | None:
        """Host and UDP port of the ground station, None without one."""
        return parse_url(self.ground_station)[1:] if self.ground_station else None


SATELLITE_VIEW: tuple[Group, ...] = (('', SatelliteViewOptions), ('', CameraOptions))
"""The parameters of the satellite_view node."""
AUTOPILOT_SIM: tuple[Group, ...] = (('', AutopilotParameters), ('', AutopilotSimOptions))
"""The parameters of the autopilot_sim node."""
