# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Points of the ground are looked up in a heatmap that was seen from elsewhere."""

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import ground_to_camera, quaternion_from_euler
from peace_ros.core.odometry.movable import ScoredView

CAMERA = Camera.from_degrees(64, 64, 73.0)
MOUNT = ground_to_camera(CAMERA, Pose(0, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 1.0))


def seen(safety, roll=0.0, pitch=0.0, yaw=0.0):
    position = np.array([100.0, -50.0, -40.0])
    return ScoredView(safety, CAMERA, MOUNT, quaternion_from_euler(roll, pitch, yaw), position)


@pytest.fixture
def north_is_unsafe():
    safety = np.full((64, 64), 0.9, np.float32)
    safety[:32] = 0.1
    return safety


def test_each_point_has_the_safety_of_its_pixel(north_is_unsafe):
    ground = np.array([[110.0, -50.0, 0.0], [90.0, -50.0, 0.0], [101.0, -30.0, 0.0]])
    assert seen(north_is_unsafe).is_below(ground, 0.2).tolist() == [True, False, True]
    assert not seen(north_is_unsafe).is_below(ground, 0.05).any()


def test_the_attitude_counts(north_is_unsafe):
    ground = np.array([[110.0, -50.0, 0.0], [100.0, -40.0, 0.0]])
    facing_east = seen(north_is_unsafe, 0.0, 0.0, np.pi / 2.0)
    assert facing_east.is_below(ground + np.array([0.0, 1.0, 0.0]), 0.2).tolist() == [True, True]
    assert facing_east.is_below(ground - np.array([0.0, 20.0, 0.0]), 0.2).tolist() == [False, False]
    looking_up = seen(north_is_unsafe, np.pi, 0.0, 0.0)
    assert not looking_up.is_below(ground, 0.2).any()


def test_ground_out_of_view_is_not_below(north_is_unsafe):
    ground = np.array([[200.0, -50.0, 0.0], [100.0, 300.0, 0.0]])
    assert not seen(north_is_unsafe).is_below(ground, 0.2).any()


def test_safety_that_is_not_a_number_is_below_every_limit(north_is_unsafe):
    north_is_unsafe[:] = np.nan
    ground = np.array([[110.0, -50.0, 0.0]])
    assert seen(north_is_unsafe).is_below(ground, 0.01).all()
