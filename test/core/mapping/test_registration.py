# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures tell how far the camera moved, or that they cannot tell it."""

from dataclasses import replace
from math import hypot

import numpy as np
import pytest

from peace_ros.core.domain import Camera
from peace_ros.core.mapping import Displacement, Mismatch, View, register, small_grey
from peace_ros.simulation import NadirCamera, draw_world

CAMERA = Camera.from_degrees(320, 240, 73.0)


@pytest.fixture(scope='module')
def town():
    return NadirCamera(draw_world(3, 160.0, 0.25), CAMERA)


@pytest.fixture
def view_from(town, pose_at):
    random = np.random.default_rng(5)

    def build(altitude_m, north_m, east_m, **angles) -> View:
        pose = pose_at(altitude_m, north_m, east_m, **angles)
        picture = town.view(pose).image_rgb.astype(np.float32)
        picture = picture * random.uniform(0.9, 1.1) + random.normal(0.0, 4.0, picture.shape)
        return View(small_grey(np.clip(picture, 0.0, 255.0).astype(np.uint8)), pose)

    return build


@pytest.mark.parametrize('altitude_m', [25.0, 50.0])
@pytest.mark.parametrize(
    ('first', 'second'),
    [
        ({}, {}),
        ({'yaw': 10.0, 'roll': 12.0}, {'yaw': 14.0, 'roll': -6.0}),
        ({'yaw': -170.0, 'pitch': 15.0}, {'yaw': 172.0, 'pitch': 18.0}),
    ],
)
def test_finds_the_displacement_whatever_the_attitudes(view_from, altitude_m, first, second):
    moved = (0.05 * altitude_m, -0.08 * altitude_m)
    before = view_from(altitude_m, 4.0, -7.0, **first)
    after = view_from(1.06 * altitude_m, 4.0 + moved[0], -7.0 + moved[1], **second)
    found = register(before, after, CAMERA)
    assert isinstance(found, Displacement)
    off_m = hypot(found.north_m - moved[0], found.east_m - moved[1])
    assert off_m < found.error_m < 0.02 * altitude_m
    assert found.correlation > 0.8


def test_different_places_are_no_displacement(view_from):
    random = np.random.default_rng(1)
    for _ in range(12):
        north, east = random.uniform(-60.0, 60.0, 2)
        before = view_from(30.0, north, east)
        after = view_from(30.0, -north + 90.0, east - 70.0)
        assert isinstance(register(before, after, CAMERA), Mismatch)


def test_a_frozen_camera_is_no_standstill(view_from):
    view = view_from(30.0, 0.0, 0.0)
    turned = replace(view, pose=view_from(30.0, 0.0, 0.0, yaw=5.0).pose)
    assert register(view, turned, CAMERA) is Mismatch.SAME


@pytest.mark.parametrize('altitude_m', [15.0, 50.0, float('nan'), -30.0])
def test_altitudes_that_differ_too_much_or_are_none_are_refused(view_from, altitude_m):
    before, after = view_from(30.0, 0.0, 0.0), view_from(30.0, 1.0, 0.0)
    wrong = replace(after, pose=replace(after.pose, altitude_agl_m=altitude_m))
    assert register(before, wrong, CAMERA) is Mismatch.ALTITUDE


def test_a_camera_at_the_horizon_is_refused(view_from):
    before, after = view_from(30.0, 0.0, 0.0), view_from(30.0, 0.0, 0.0, pitch=70.0)
    assert register(before, after, CAMERA) is Mismatch.HORIZON


def test_bare_and_striped_ground_is_refused(pose_at):
    random = np.random.default_rng(2)

    def seen(pattern):
        noisy = pattern + random.normal(0.0, 1.0, (240, 320))
        return View(np.clip(noisy, 0, 255).astype(np.uint8), pose_at(30.0))

    bare = np.full((240, 320), 120.0)
    assert register(seen(bare), seen(bare), CAMERA) is Mismatch.TEXTURE
    wave = 60.0 * np.sin(np.arange(320) * np.pi / 8.0)
    rows = 120.0 + wave[None, :] + np.zeros((240, 1))
    grid = 120.0 + wave[None, :] + wave[:240, None]
    for pattern in (rows, grid):
        moved = seen(np.roll(pattern, 5, axis=1))
        assert register(seen(pattern), moved, CAMERA) is Mismatch.AMBIGUOUS
    black = np.zeros((240, 320))
    assert isinstance(register(seen(black), seen(black), CAMERA), Mismatch)


def test_pictures_are_kept_small():
    grey = small_grey(np.zeros((1080, 1920, 3), np.uint8))
    assert grey.shape == (144, 256)
    assert small_grey(np.zeros((100, 90, 3), np.uint8)).shape == (100, 90)
