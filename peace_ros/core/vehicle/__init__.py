# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Setpoint to MAVLink and MAVLink to Telemetry."""

from peace_ros.core.vehicle.dialects import AUTO, ArduPilot, Dialect, Px4, register_dialect
from peace_ros.core.vehicle.link import VehicleLink, check_access, open_vehicle
from peace_ros.core.vehicle.mavlink import MavlinkLink
from peace_ros.core.vehicle.parameters import SenderParameters, VehicleParameters
from peace_ros.core.vehicle.result import Answer, LineCounts, RequestResult
from peace_ros.core.vehicle.sender import SenderState, SenderStatistics, SetpointSender

__all__ = [
    'AUTO',
    'Answer',
    'ArduPilot',
    'Dialect',
    'LineCounts',
    'MavlinkLink',
    'Px4',
    'RequestResult',
    'SenderParameters',
    'SenderState',
    'SenderStatistics',
    'SetpointSender',
    'VehicleLink',
    'VehicleParameters',
    'check_access',
    'open_vehicle',
    'register_dialect',
]
