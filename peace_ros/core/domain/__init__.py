# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nouns of the project, with units, and the conversions between their frames."""

from peace_ros.core.domain.camera import NADIR, Camera, Distortion, Mount
from peace_ros.core.domain.errors import (
    BundleError,
    ConfigurationError,
    ImageError,
    PeaceError,
    RecordingError,
    VehicleError,
    WorldError,
)
from peace_ros.core.domain.health import Health, Level
from peace_ros.core.domain.labels import SAFE_LABELS, Label, is_safe
from peace_ros.core.domain.motion import (
    GimbalReport,
    HeightReport,
    Pose,
    Setpoint,
    Site,
    Telemetry,
)
from peace_ros.core.domain.perception import DepthImage, Frame, Heatmap, Prompt, RankedWord

__all__ = [
    'NADIR',
    'SAFE_LABELS',
    'BundleError',
    'Camera',
    'ConfigurationError',
    'DepthImage',
    'Distortion',
    'Frame',
    'GimbalReport',
    'Health',
    'Heatmap',
    'HeightReport',
    'ImageError',
    'Label',
    'Level',
    'Mount',
    'PeaceError',
    'Pose',
    'Prompt',
    'RankedWord',
    'RecordingError',
    'Setpoint',
    'Site',
    'Telemetry',
    'VehicleError',
    'WorldError',
    'is_safe',
]
