# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frames, body rates and altitude become position and velocity, without GNSS."""

from peace_ros.core.odometry.doubt import Doubt
from peace_ros.core.odometry.estimator import VisualInertialOdometry
from peace_ros.core.odometry.parameters import OdometryParameters

__all__ = [
    'Doubt',
    'OdometryParameters',
    'VisualInertialOdometry',
]
