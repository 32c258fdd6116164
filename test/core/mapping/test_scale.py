# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures tell how the height changed, whatever the altitudes say, or that they cannot."""

from dataclasses import replace
from math import nan

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, Distortion
from peace_ros.core.mapping import HeightChange, Mismatch, View, height_change, small_grey
from peace_ros.core.optics import rays
from peace_ros.simulation import NadirCamera, draw_world

CAMERA = Camera.from_degrees(320, 240, 73.0)


@pytest.fixture(scope='module')
def town():
    return NadirCamera(draw_world(3, 200.0, 0.25), CAMERA)


@pytest.fixture
def view_from(town, pose_at):
    random = np.random.default_rng(5)

    def build(altitude_m, north_m=0.0, east_m=0.0, **angles) -> View:
        pose = pose_at(altitude_m, north_m, east_m, **angles)
        picture = town.view(pose).image_rgb.astype(np.float32)
        picture = picture * random.uniform(0.9, 1.1) + random.normal(0.0, 4.0, picture.shape)
        return View(small_grey(np.clip(picture, 0.0, 255.0).astype(np.uint8)), pose)

    return build


@pytest.mark.parametrize('altitude_m', [22.0, 60.0])
@pytest.mark.parametrize('ratio', [0.85, 0.97, 1.0, 1.1])
@pytest.mark.parametrize(
    ('first', 'second'),
    [
        ({}, {}),
        ({'yaw': 10.0, 'roll': 12.0}, {'yaw': 14.0, 'roll': -2.0}),
        ({'yaw': -170.0, 'pitch': 15.0}, {'yaw': -174.0, 'pitch': 18.0}),
    ],
)
def test_finds_the_ratio_whatever_the_attitudes(view_from, altitude_m, ratio, first, second):
    before = view_from(altitude_m, 4.0, -7.0, **first)
    after = view_from(ratio * altitude_m, 4.0 + 0.04 * altitude_m, -7.0, **second)
    found = height_change(before, after, CAMERA)
    assert isinstance(found, HeightChange)
    assert found.ratio == pytest.approx(ratio, rel=0.01)
    assert found.moved == pytest.approx(0.04, abs=0.02)


def test_no_altitude_counts(view_from):
    views = [view_from(30.0), view_from(27.0)]
    blind = [replace(each, pose=replace(each.pose, altitude_agl_m=nan)) for each in views]
    assert height_change(*blind, CAMERA) == height_change(*views, CAMERA)


def test_a_frozen_camera_says_nothing(view_from):
    view = view_from(30.0)
    assert height_change(view, view, CAMERA) is Mismatch.SAME


def test_ground_without_texture_says_nothing(view_from):
    view = view_from(30.0)
    plain = replace(view, grey=np.full_like(view.grey, 90))
    assert height_change(plain, view, CAMERA) is Mismatch.TEXTURE


def test_a_few_things_close_together_say_nothing(view_from):
    view = view_from(30.0)
    grey = np.full_like(view.grey, 90)
    grey[80:120, 100:140] = view.grey[80:120, 100:140]
    before, after = replace(view, grey=grey), replace(view, grey=cv2.blur(grey, (2, 2)))
    assert height_change(before, after, CAMERA) in {Mismatch.TEXTURE, Mismatch.DIFFERENT}


def test_other_ground_says_nothing(view_from):
    for north_m in (20.0, 40.0, 60.0):
        before, after = view_from(25.0), view_from(25.0, north_m, -north_m)
        assert height_change(before, after, CAMERA) is Mismatch.DIFFERENT


def test_an_attitude_that_does_not_fit_says_nothing(view_from):
    before, after = view_from(30.0), view_from(28.0, yaw=8.0)
    wrong = replace(after, pose=before.pose)
    assert height_change(before, wrong, CAMERA) is Mismatch.DIFFERENT


@pytest.mark.parametrize(
    ('pitch_deg', 'why'), [(70.0, Mismatch.DIFFERENT), (140.0, Mismatch.HORIZON)]
)
def test_a_camera_at_the_horizon_says_nothing(view_from, pitch_deg, why):
    before = view_from(30.0)
    after = replace(view_from(28.0), pose=view_from(30.0, pitch=pitch_deg).pose)
    assert height_change(before, after, CAMERA) is why


@pytest.mark.parametrize(
    'lens',
    [None, Distortion('plumb_bob', (-0.1, 0.01, 0.0, 0.0)), Distortion('equidistant', (0.01,) * 4)],
)
def test_a_lens_that_is_covered_in_flight_says_nothing(view_from, lens):
    before = view_from(30.0)
    dark = replace(before, grey=np.zeros_like(before.grey))
    assert height_change(before, dark, replace(CAMERA, distortion=lens)) is Mismatch.DIFFERENT


def test_pictures_of_another_size_say_nothing(view_from):
    before = view_from(30.0)
    smaller = replace(before, grey=before.grey[:-2])
    assert height_change(before, smaller, CAMERA) is Mismatch.DIFFERENT


@pytest.mark.parametrize('ratio', [0.9, 1.1])
def test_a_horizon_in_the_picture_does_not_hide_the_ground(view_from, ratio):
    before, after = view_from(30.0, pitch=62.0), view_from(30.0 * ratio, 1.0, pitch=62.0)
    found = height_change(before, after, CAMERA)
    assert isinstance(found, HeightChange)
    assert found.ratio == pytest.approx(ratio, rel=0.02)


def test_a_lens_that_sees_sideways_still_measures_the_ground(pose_at):
    """Corners at the edge of a fisheye's picture have no direction that counts."""
    lens = Distortion('equidistant', (0.0,) * 4)
    fisheye = replace(CAMERA, focal_xy_px=(100.0, 100.0), distortion=lens)
    world = np.random.default_rng(3).integers(0, 256, (512, 512), np.uint8)
    world = cv2.GaussianBlur(np.kron(world, np.ones((2, 2), np.uint8)), (5, 5), 0)

    def view(altitude_m):
        u, v = (each.ravel() for each in np.meshgrid(np.arange(320), np.arange(240)))
        x, y, _ = np.nan_to_num(rays(fisheye, u, v))
        east, south = (512.0 + 8.0 * altitude_m * each.reshape(240, 320) for each in (x, y))
        maps = (east.astype(np.float32), south.astype(np.float32))
        grey = cv2.remap(world, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        beside = np.isnan(rays(fisheye, u, v)[0]).reshape(240, 320)
        assert beside.any()
        grey[beside] = world[:240, :320][beside]  # the frame of the vehicle
        return View(grey, pose_at(altitude_m))

    found = height_change(view(30.0), view(27.0), fisheye)
    assert isinstance(found, HeightChange)
    assert found.ratio == pytest.approx(0.9, rel=0.02)
