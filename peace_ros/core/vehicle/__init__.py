# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Setpoint to MAVLink and MAVLink to Telemetry."""

from peace_ros.core.vehicle.link import VehicleLink, open_vehicle
from peace_ros.core.vehicle.mavlink import MavlinkLink
from peace_ros.core.vehicle.parameters import SenderParameters, VehicleParameters
from peace_ros.core.vehicle.result import Answer, RequestResult
from peace_ros.core.vehicle.sender import SenderState, SenderStatistics, SetpointSender

__all__ = [
    'Answer',
    'MavlinkLink',
    'RequestResult',
    'SenderParameters',
    'SenderState',
    'SenderStatistics',
    'SetpointSender',
    'VehicleLink',
    'VehicleParameters',
    'open_vehicle',
]
