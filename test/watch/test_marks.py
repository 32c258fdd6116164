# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places on the ground are marked where the camera sees them, or not at all."""

import pytest

from peace_ros.core.domain import NADIR, Camera, Pose
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.watch.marks import camera_of, marks, mount_of, pose_at

LEVEL = (1.0, 0.0, 0.0, 0.0)
CAMERA = Camera.from_degrees(400, 400, 90.0)
POSE = Pose(0, 10.0, -5.0, -50.0, LEVEL, 50.0)
"""100 m of ground are seen across the picture."""


def circle(north_m, east_m, radius_m=5.0):
    return {'kind': 'site', 'north_m': north_m, 'east_m': east_m, 'radius_m': radius_m}


@pytest.mark.parametrize(
    ('north_m', 'east_m', 'seen'),
    [(10.0, -5.0, (0.5, 0.5)), (35.0, -5.0, (0.5, 0.25)), (10.0, 20.0, (0.75, 0.5))],
    ids=['below', 'north is up', 'east is right'],
)
def test_a_place_is_marked_where_it_is_seen(north_m, east_m, seen):
    (mark,) = marks([circle(north_m, east_m)], CAMERA, NADIR, POSE)
    assert mark['middle'] == pytest.approx(seen, abs=0.005)
    across = max(u for u, _ in mark['corners']) - min(u for u, _ in mark['corners'])
    assert across == pytest.approx(0.1, abs=0.005)


def test_a_camera_that_looks_ahead_sees_what_lies_below_lower_in_the_picture():
    mount = mount_from_degrees((0.0, 20.0, 0.0), (0.0, 0.0, 0.0))
    (mark,) = marks([circle(10.0, -5.0)], CAMERA, mount, POSE)
    assert mark['middle'][1] > 0.6


def test_a_place_behind_the_camera_has_no_mark():
    mount = mount_from_degrees((0.0, 80.0, 0.0), (0.0, 0.0, 0.0))
    assert marks([circle(-60.0, -5.0)], CAMERA, mount, POSE) == []


def test_a_pose_is_interpolated_and_none_is_made_up():
    poses = [Pose(ns, ns / 1e9, 0.0, -50.0, LEVEL, 50.0) for ns in (10**9, 2 * 10**9)]
    assert pose_at(poses, 15 * 10**8).north_m == pytest.approx(1.5)
    assert pose_at(poses, 23 * 10**8) == poses[-1]
    assert pose_at(poses, 26 * 10**8) is None
    assert pose_at([], 0) is None


def test_a_mount_or_camera_that_is_not_known_is_none():
    angles = dict.fromkeys(('mount_roll', 'mount_pitch', 'mount_yaw'), 0.0)
    known = {**angles, **dict.fromkeys(('mount_x', 'mount_y', 'mount_z'), 0.0)}
    assert mount_of({**known, 'mount_source': 'parameters'}) == NADIR
    assert mount_of({**known, 'mount_source': 'tf'}) is None
    gimbal = {'mount_source': 'parameters', 'vehicle.follow_gimbal': True}
    assert mount_of({**known, **gimbal}) is None
    assert mount_of({'mount_source': 'parameters'}) is None
    assert camera_of({}) is None
    size = {'camera_width': 400, 'camera_height': 400, 'camera_fov': 90.0}
    assert camera_of(size).focal_px == pytest.approx(CAMERA.focal_px)
