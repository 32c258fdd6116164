# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the odometry says of a frame: how the vehicle moves, or why that is not known."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Pose


class Doubt(Enum):
    """Why a frame does not show how the vehicle moves."""

    UNALIGNED = 'no position and attitude to begin from'
    OLD = 'the picture is not newer than the last one'
    RATES = 'no body rates from the last picture to this one'
    ALTITUDE = 'the altitude is not known, or below 1 m'
    SAME = 'the camera gave the same picture twice'
    TEXTURE = 'the ground has too little texture in two directions'
    DIFFERENT = 'too few corners of the ground are found again'
    TURN = 'the pictures turn otherwise than the body rates'
    ERROR = 'the corners do not move like level ground'
    MOVABLE = 'too little of the ground in view is sure to keep still'
    MOVING = 'the velocity over ground does not change as the vehicle is accelerated'
    BEGINNING = 'too few pictures for a velocity'
    UNCERTAIN = 'the velocity is too uncertain'


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
