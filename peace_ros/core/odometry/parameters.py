# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the visual-inertial odometry."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class OdometryParameters(ParameterSet):
    """Errors of what is given to a :class:`VisualInertialOdometry`, and when it says nothing."""

    row_time_s: float = parameter(
        0.0,
        'Time between the readout of two rows of a frame (rolling shutter); 0: all at once. The '
        'stamp of a frame is that of its middle row.',
        low=0.0,
        high=0.001,
    )
    turn_error_deg: float = parameter(
        0.03, 'Error of the attitude by body rates from frame to frame.', low=0.005, high=1.0
    )
    turn_drift_deg_s: float = parameter(
        0.1, 'Error of the body rates.', unit='deg/s', low=0.001, high=5.0
    )
    height_error: float = parameter(
        0.15,
        'Error of the change of the given altitude between key frames, as a part of it.',
        low=0.01,
        high=0.5,
    )
    ground_error_m: float = parameter(
        1.5,
        'Error of the height above the ground in view, which may lie higher or lower than that '
        'at home: with it grows the error of the velocity.',
        low=0.0,
        high=20.0,
    )
    movable_below: float = parameter(
        0.2,
        'Corners where the heatmap is below this do not count: water, vehicles, people and trees '
        'may move. Without heatmaps all corners count.',
        low=0.0,
        high=1.0,
    )
    acceleration_limit_m_s: float = parameter(
        0.5,
        'A velocity over ground that differs by more from the one that accelerations give is not '
        'given: the ground moves.',
        low=0.2,
        high=10.0,
    )
    velocity_window_s: float = parameter(
        0.4, 'Velocity is the slope of the position over this time.', low=0.2, high=2.0
    )
    velocity_error_limit_m_s: float = parameter(
        0.3, 'With a larger standard deviation the velocity is not given.', low=0.05, high=5.0
    )
