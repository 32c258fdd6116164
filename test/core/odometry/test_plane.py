# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The place of a camera is solved from points of level ground; what is told is only a start."""

from math import radians

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import (
    angle_between,
    ground_to_camera,
    multiply,
    quaternion_from_euler,
    quaternion_from_rotation_vector,
)
from peace_ros.core.odometry.plane import PriorErrors, RelativePose, solve, view_of

CAMERA = Camera.from_degrees(320, 320, 73.0)
MOUNT = ground_to_camera(CAMERA, Pose(0, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 1.0))
TRUE = RelativePose(quaternion_from_euler(0.1, -0.15, 0.7), np.array([0.12, -0.2]), 0.9)
ERRORS = PriorErrors(radians(0.5), 0.15)
FOCAL_PX = 240.0


def points(random, count=80):
    return np.column_stack((random.uniform(-0.6, 0.6, (count, 2)), np.ones(count)))


def seen_from(place, ground):
    directions = view_of(place, MOUNT) @ ground.T
    return (directions[:2] / directions[2]).T


def turned(place, degrees):
    turn = quaternion_from_rotation_vector(np.radians(degrees))
    return RelativePose(multiply(place.quaternion_ned_frd, turn), place.shift, place.ratio)


def test_a_view_is_that_of_the_camera_at_the_place():
    at = Pose(0, 0.12, -0.2, 0.0, TRUE.quaternion_ned_frd, 0.9)
    assert view_of(TRUE, MOUNT) == pytest.approx(ground_to_camera(CAMERA, at))


def test_the_place_is_found_from_a_wrong_one():
    random = np.random.default_rng(1)
    ground = points(random)
    seen = seen_from(TRUE, ground) + random.normal(0.0, 0.1 / FOCAL_PX, (len(ground), 2))
    told = turned(RelativePose(TRUE.quaternion_ned_frd, np.zeros(2), 1.0), (0.4, -0.5, 0.3))
    found = solve(ground, seen, told, ERRORS, MOUNT, FOCAL_PX, 1.05)
    assert found.place.shift == pytest.approx(TRUE.shift, abs=0.002)
    assert found.place.ratio == pytest.approx(0.9, abs=0.001)
    assert angle_between(found.place.quaternion_ned_frd, TRUE.quaternion_ned_frd) < radians(0.05)
    assert np.degrees(found.turned_rad) == pytest.approx((-0.4, 0.5, -0.3), abs=0.05)
    assert found.error_px < 0.2


def test_a_trusted_attitude_would_shift_the_place():
    """The reason why rotation and shift are solved together."""
    ground = points(np.random.default_rng(2))
    told = turned(TRUE, (0.5, 0.0, 0.0))
    trusted = PriorErrors(1e-6, 0.15)
    seen = seen_from(TRUE, ground)
    wrong = solve(ground, seen, told, trusted, MOUNT, FOCAL_PX, 0.9)
    right = solve(ground, seen, told, ERRORS, MOUNT, FOCAL_PX, 0.9)
    assert np.linalg.norm(wrong.place.shift - TRUE.shift) > 0.005
    assert np.linalg.norm(right.place.shift - TRUE.shift) < 0.0005


def test_the_covariance_is_that_of_many_trials():
    random = np.random.default_rng(3)
    ground = points(random)
    clean = seen_from(TRUE, ground)
    shifts, told = [], []
    for _ in range(60):
        seen = clean + random.normal(0.0, 0.4 / FOCAL_PX, clean.shape)
        found = solve(ground, seen, TRUE, ERRORS, MOUNT, FOCAL_PX, 0.9)
        shifts.append([*found.place.shift, np.log(found.place.ratio)])
        told.append(np.sqrt(np.diag(found.covariance)[3:]))
    assert np.std(shifts, axis=0) == pytest.approx(np.mean(told, axis=0), rel=0.35)


def test_few_points_that_move_otherwise_pull_little():
    random = np.random.default_rng(4)
    ground = points(random)
    seen = seen_from(TRUE, ground) + random.normal(0.0, 0.1 / FOCAL_PX, (len(ground), 2))
    seen[:8] += 1.5 / FOCAL_PX
    found = solve(ground, seen, TRUE, ERRORS, MOUNT, FOCAL_PX, 0.9)
    assert found.place.shift == pytest.approx(TRUE.shift, abs=0.0015)


def test_points_close_together_give_a_large_covariance():
    random = np.random.default_rng(5)
    wide, narrow = points(random), points(random) * (0.05, 0.05, 1.0)
    results = [
        solve(each, seen_from(TRUE, each), TRUE, ERRORS, MOUNT, FOCAL_PX, 0.9)
        for each in (wide, narrow)
    ]
    ends = [np.sqrt(np.diag(each.covariance)[3:5]).max() for each in results]
    assert ends[1] > 4.0 * ends[0]
