# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Corners are where the ground has texture in two directions, and are found again or left out."""

from dataclasses import replace

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Distortion, Pose
from peace_ros.core.domain.geometry import ground_to_camera, quaternion_from_euler
from peace_ros.core.odometry.keyframe import Readout, build_keyframe, find
from peace_ros.core.odometry.plane import RelativePose
from peace_ros.simulation import NadirCamera

CAMERA = Camera.from_degrees(320, 240, 73.0)
LENS = replace(CAMERA, distortion=Distortion('plumb_bob', (-0.12, 0.02, 0.001, 0.0)))
LEVEL = (1.0, 0.0, 0.0, 0.0)
MOUNT = ground_to_camera(CAMERA, Pose(0, 0.0, 0.0, 0.0, LEVEL, 1.0))
AT_ONCE = Readout(0.0, np.zeros(3), np.zeros(3))
HEIGHT_M = 40.0


def key_of(grey, camera=CAMERA, quaternion=LEVEL):
    return build_keyframe(grey, camera, quaternion, MOUNT, AT_ONCE)


def noisy(levels, sigma=3.0):
    noise = np.random.default_rng(1).normal(0.0, sigma, (240, 320))
    return np.clip(levels + noise, 0.0, 255.0).astype(np.uint8)


def grey_from(town, place, camera=CAMERA):
    north_m, east_m, down = HEIGHT_M * place.position
    height_m = HEIGHT_M * place.ratio
    pose = Pose(0, north_m, east_m, down, place.quaternion_ned_frd, height_m)
    return noisy(NadirCamera(town, camera).view(pose).image_rgb.mean(axis=2))


@pytest.mark.parametrize('sigma', [0.0, 1.0, 3.0, 8.0])
def test_blank_ground_has_no_corners_whatever_the_noise(sigma):
    assert len(key_of(noisy(np.full((240, 320), 120.0), sigma)).ground) == 0


@pytest.mark.parametrize('sigma', [1.0, 3.0, 8.0])
@pytest.mark.parametrize('period_px', [6, 16, 40])
def test_stripes_have_no_corners_whatever_the_noise(sigma, period_px):
    wave = 120.0 + 60.0 * np.sin(2.0 * np.pi * np.arange(320) / period_px)
    assert len(key_of(noisy(np.tile(wave, (240, 1)), sigma)).ground) == 0


@pytest.mark.parametrize('camera', [CAMERA, LENS])
def test_corners_lie_where_their_pixels_see_the_ground(town, camera):
    attitude = quaternion_from_euler(0.15, -0.1, 1.0)
    key = key_of(
        grey_from(town, RelativePose(attitude, np.zeros(2), 1.0), camera), camera, attitude
    )
    assert len(key.ground) > 40
    again = ground_to_camera(CAMERA, Pose(0, 0.0, 0.0, 0.0, attitude, 1.0)) @ key.ground.T
    focal, centre = np.array(CAMERA.focal_xy_px), np.array(CAMERA.centre_px)
    assert focal * (again[:2] / again[2]).T + centre == pytest.approx(key.corners_px, abs=1e-3)


@pytest.mark.parametrize('camera', [CAMERA, LENS])
def test_corners_are_found_in_a_picture_from_elsewhere(town, camera):
    began = RelativePose(quaternion_from_euler(0.1, 0.05, 0.0), np.zeros(2), 1.0)
    there = RelativePose(quaternion_from_euler(-0.1, 0.1, 0.9), np.array([0.1, -0.15]), 0.9)
    key = key_of(grey_from(town, began, camera), camera, began.quaternion_ned_frd)
    predicted = replace(there, shift=there.shift + 0.01)
    found = find(key, grey_from(town, there, camera), camera, predicted, MOUNT, 1)
    assert len(found.which) > max(15, 0.7 * found.expected)
    at = Pose(0, *there.shift, 0.0, there.quaternion_ned_frd, there.ratio)
    true = ground_to_camera(CAMERA, at) @ key.ground[found.which].T
    off = found.directions[:2] / found.directions[2] - true[:2] / true[2]
    assert np.median(np.hypot(*off)) * CAMERA.focal_px < 0.25


def test_another_exposure_does_not_hide_the_corners(town):
    place = RelativePose(LEVEL, np.zeros(2), 1.0)
    grey = grey_from(town, place)
    key = key_of(grey)
    darker = np.clip(0.6 * grey.astype(float) + 30.0, 0.0, 255.0).astype(np.uint8)
    found = find(key, darker, CAMERA, place, MOUNT, 1)
    assert len(found.which) > 0.9 * found.expected


def test_other_ground_is_not_found(town):
    place = RelativePose(LEVEL, np.zeros(2), 1.0)
    key = key_of(grey_from(town, place))
    elsewhere = grey_from(town, replace(place, shift=np.array([-1.6, 1.2])))
    found = find(key, elsewhere, CAMERA, place, MOUNT, 3)
    assert len(found.which) < 0.3 * found.expected


def test_corners_out_of_view_are_not_expected(town):
    place = RelativePose(LEVEL, np.zeros(2), 1.0)
    key = key_of(grey_from(town, place))
    aside = RelativePose(LEVEL, np.array([0.0, 0.7]), 1.0)
    found = find(key, grey_from(town, aside), CAMERA, aside, MOUNT, 1)
    assert 0 < found.expected < 0.8 * len(key.ground)
    assert key.ground[found.which, 1].min() > 0.0
    beyond = RelativePose(LEVEL, np.array([0.0, 5.0]), 1.0)
    assert find(key, grey_from(town, place), CAMERA, beyond, MOUNT, 1).expected == 0


def test_rows_read_one_after_another_are_put_right():
    """A camera that turns and moves sees each row from elsewhere."""
    readout = Readout(0.04, np.array([0.0, 0.0, 0.5]), np.array([0.1, 0.0, 0.0]))
    last_row = np.array([[0.0], [119.5 / CAMERA.focal_xy_px[1]], [1.0]])
    seen, moved = readout.at_once(CAMERA, last_row)
    assert moved == pytest.approx(np.array([[0.002, 0.0, 0.0]]), abs=1e-6)
    assert seen[:, 0] == pytest.approx(
        (-0.02 * 0.5 * last_row[1, 0], last_row[1, 0], 1.0), abs=1e-6
    )
    middle = np.array([[0.3], [0.0], [1.0]])
    assert readout.at_once(CAMERA, middle)[0] == pytest.approx(middle)
