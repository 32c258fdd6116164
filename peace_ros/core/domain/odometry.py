# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an inertial unit measured, and how a vehicle moves: what odometry takes and gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain.motion import Pose


@dataclass(frozen=True)
class InertialSample:
    """What an inertial measurement unit measured, in the axes of the vehicle (FRD).

    MAVLink has it in HIGHRES_IMU, and in the units of the sensor in RAW_IMU and SCALED_IMU.
    """

    stamp_ns: int
    """Clock of the frames."""
    rates_rad_s: tuple[float, float, float]
    """Angular velocity about forward, right, down."""
    specific_force_m_s2: tuple[float, float, float]
    """Acceleration without gravity: (0, 0, -9.8) for a level vehicle at rest."""


@dataclass(frozen=True)
class MotionEstimate:
    """How the vehicle moves, in the frame of the pose with which the odometry was aligned."""

    pose: Pose
    """At the stamp of the frame; the altitude follows the pictures from key frame to key frame,
    each of which begins with the altitude that is given."""
    position_covariance_m2: NDArray[np.float64]
    """3 x 3: north, east, down. It grows from key frame to key frame."""
    velocity_m_s: NDArray[np.float64]
    """(3,): north, east, down."""
    velocity_stamp_ns: int
    """The velocity is that of this moment, before the stamp of the frame."""
    velocity_covariance_m2_s2: NDArray[np.float64]
    """3 x 3."""
    quality: float
    """Part of the corners in view that agree, 0 to 1."""
    resets: int
    """How often the position was given from outside, or continued by a guess; the estimate does
    not continue one with another number."""
