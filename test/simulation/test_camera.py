# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from math import cos, inf, pi, radians, sin, tan

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from peace_ros.core.domain import Camera, Label, Pose
from peace_ros.core.domain.geometry import ground_to_image, quaternion_from_euler
from peace_ros.simulation import NadirCamera, World

RED = (255, 0, 0)
CAMERA = Camera.from_degrees(352, 352, 73.0)


def pose_at(
    north_m: float = 0.0,
    east_m: float = 0.0,
    altitude_m: float = 100.0,
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    yaw_deg: float = 0.0,
) -> Pose:
    attitude = quaternion_from_euler(radians(roll_deg), radians(pitch_deg), radians(yaw_deg))
    return Pose(0, north_m, east_m, -altitude_m, attitude, altitude_m)


def marked_world(
    north_m: float, east_m: float, size_m: float = 400.0, gsd_m: float = 0.25
) -> World:
    """Grass with one red vehicle, 3 m square, at a place."""
    side = round(size_m / gsd_m)
    image = np.full((side, side, 3), (40, 90, 40), np.uint8)
    labels = np.full((side, side), Label.GRASS, np.uint8)
    world = World(image, labels, gsd_m, 'marked')
    column, row = (round(v) for v in world.pixel(north_m, east_m))
    reach = round(1.5 / gsd_m)
    spot = (slice(row - reach, row + reach + 1), slice(column - reach, column + reach + 1))
    image[spot] = RED
    labels[spot] = Label.VEHICLE
    return world


def red_spot(image: np.ndarray) -> tuple[float, float]:
    rows, columns = np.nonzero((image[..., 0] > 150) & (image[..., 1] < 60))
    assert rows.size, 'the marker is not in view'
    return float(columns.mean()), float(rows.mean())


def expected_pixel(pose: Pose, north_m: float, east_m: float) -> tuple[float, float]:
    u, v, w = ground_to_image(CAMERA, pose) @ (north_m, east_m, 1.0)
    return float(u / w), float(v / w)


@pytest.mark.parametrize(
    ('north_m', 'east_m', 'side'),
    [(40.0, 0.0, 'top'), (-40.0, 0.0, 'bottom'), (0.0, 40.0, 'right'), (0.0, -40.0, 'left')],
)
def test_level_camera_facing_north_shows_north_at_the_top(north_m, east_m, side):
    view = NadirCamera(marked_world(north_m, east_m), CAMERA).view(pose_at())
    column, row = red_spot(view.image_rgb)
    away = 40.0 / 100.0 * CAMERA.focal_px
    expected = {
        'top': (175.5, 175.5 - away),
        'bottom': (175.5, 175.5 + away),
        'right': (175.5 + away, 175.5),
        'left': (175.5 - away, 175.5),
    }[side]
    assert (column, row) == pytest.approx(expected, abs=1.0)


def test_yaw_turns_the_picture_the_other_way():
    view = NadirCamera(marked_world(40.0, 0.0), CAMERA).view(pose_at(yaw_deg=90.0))
    column, row = red_spot(view.image_rgb)
    assert column == pytest.approx(175.5 - 0.4 * CAMERA.focal_px, abs=1.0)
    assert row == pytest.approx(175.5, abs=1.0)


@pytest.mark.parametrize(
    ('roll_deg', 'pitch_deg', 'north_m', 'east_m'),
    [
        # Nose up looks ahead, right wing down looks to the left: 100 m * tan 16 deg = 28.7 m.
        (0.0, 16.0, 100.0 * tan(radians(16.0)), 0.0),
        (0.0, -16.0, -100.0 * tan(radians(16.0)), 0.0),
        (16.0, 0.0, 0.0, -100.0 * tan(radians(16.0))),
        (-16.0, 0.0, 0.0, 100.0 * tan(radians(16.0))),
    ],
)
def test_a_tilt_of_16_degrees_at_100_m_looks_29_m_aside(roll_deg, pitch_deg, north_m, east_m):
    assert np.hypot(north_m, east_m) == pytest.approx(28.7, abs=0.05)
    camera = NadirCamera(marked_world(north_m, east_m), CAMERA)
    view = camera.view(pose_at(roll_deg=roll_deg, pitch_deg=pitch_deg))
    assert red_spot(view.image_rgb) == pytest.approx((175.5, 175.5), abs=1.0)


@settings(max_examples=25, deadline=None)
@given(
    north=st.floats(-30, 30),
    east=st.floats(-30, 30),
    altitude=st.floats(60, 120),
    roll=st.floats(-12, 12),
    pitch=st.floats(-12, 12),
    yaw=st.floats(-180, 180),
)
def test_a_marker_appears_where_the_homography_of_the_domain_puts_it(
    north, east, altitude, roll, pitch, yaw
):
    pose = pose_at(5.0, -8.0, altitude, roll, pitch, yaw)
    camera = camera_over_marker(north, east)
    column, row = camera.world.pixel(north, east)
    u, v = expected_pixel(pose, *camera.world.place(round(column), round(row)))
    assume(8 < u < 343)
    assume(8 < v < 343)
    view = camera.view(pose)
    assert red_spot(view.image_rgb) == pytest.approx((u, v), abs=0.8)
    assert view.labels is not None
    rows, columns = np.nonzero(view.labels == Label.VEHICLE)
    assert (columns.mean(), rows.mean()) == pytest.approx((u, v), abs=0.8)


def camera_over_marker(north_m: float, east_m: float) -> NadirCamera:
    return NadirCamera(marked_world(north_m, east_m, 300.0, 0.5), CAMERA)


@pytest.mark.parametrize('altitude_m', [12.0, 40.0, 100.0, 250.0])
def test_labels_agree_with_colours_at_every_altitude(altitude_m):
    rng = np.random.default_rng(3)
    coarse = rng.integers(1, 10, (40, 40)).astype(np.uint8)
    labels = np.kron(coarse, np.ones((40, 40), np.uint8))
    colours = rng.integers(0, 256, (10, 3)).astype(np.uint8)
    world = World(colours[labels], labels, 0.25, 'patches')
    pose = pose_at(3.0, 4.0, altitude_m, 5.0, -7.0, 33.0)
    view = NadirCamera(world, CAMERA).view(pose)
    assert view.labels is not None
    same = np.abs(view.image_rgb.astype(int) - colours[view.labels]).max(axis=2) < 12
    # Only pixels on the borders of patches mix two colours.
    assert same.mean() > (0.9 if altitude_m <= 100 else 0.7)


def test_offset_moves_the_world_in_the_local_frame():
    plain = marked_world(0.0, 0.0)
    moved = World(plain.image_rgb, plain.labels, plain.gsd_m, 'moved', 30.0, -20.0)
    view = NadirCamera(moved, CAMERA).view(pose_at(30.0, -20.0))
    assert red_spot(view.image_rgb) == pytest.approx((175.5, 175.5), abs=1.0)


def test_a_view_inside_the_world_is_not_mirrored():
    assert not NadirCamera(marked_world(0.0, 0.0), CAMERA).view(pose_at()).mirrored


def test_beyond_the_world_its_mirror_image_is_seen_and_said_to_be_one():
    world = marked_world(40.0, 0.0, size_m=100.0)
    view = NadirCamera(world, CAMERA).view(pose_at(50.0, 0.0, 30.0))
    assert view.mirrored
    rows = np.nonzero((view.image_rgb[..., 0] > 150) & (view.image_rgb[..., 1] < 60))[0]
    # The marker 10 m south of the edge shows again 10 m north of it.
    outer = (10.0 + 1.6) / 30.0 * CAMERA.focal_px
    assert rows.min() == pytest.approx(175.5 - outer, abs=2.0)
    assert rows.max() == pytest.approx(175.5 + outer, abs=2.0)


def test_a_view_many_times_the_world_is_filled():
    view = NadirCamera(marked_world(0.0, 0.0, size_m=20.0), CAMERA).view(pose_at(altitude_m=200.0))
    assert view.mirrored
    assert view.labels is not None
    assert (view.labels == Label.VEHICLE).mean() == pytest.approx(3.25**2 / 20.0**2, abs=0.006)


def test_above_the_horizon_is_grey_sky_without_label():
    world = marked_world(0.0, 0.0)
    view = NadirCamera(world, CAMERA).view(pose_at(pitch_deg=80.0))
    assert view.labels is not None
    sky = view.labels == Label.UNLABELED
    assert view.mirrored
    assert sky[0].all()
    assert not sky[-1].any()
    horizon = 175.5 - CAMERA.focal_px * tan(radians(10.0))
    assert sky[:, 175].sum() == pytest.approx(horizon, abs=2.0)
    assert np.ptp(view.image_rgb[sky].reshape(-1, 3), axis=0).max() == 0


def test_upside_down_sees_only_sky():
    view = NadirCamera(marked_world(0.0, 0.0), CAMERA).view(pose_at(roll_deg=180.0))
    assert view.labels is not None
    assert (view.labels == Label.UNLABELED).all()


def test_fine_texture_seen_from_high_up_averages_instead_of_aliasing():
    side = 1600
    stripes = np.zeros((side, side, 3), np.uint8)
    stripes[::2] = 200
    view = NadirCamera(World(stripes, None, 0.1, 'stripes'), CAMERA).view(pose_at(altitude_m=95.0))
    assert view.labels is None
    assert view.image_rgb.mean() == pytest.approx(100.0, abs=3.0)
    assert view.image_rgb.std() < 8.0


def test_a_vehicle_on_the_ground_still_sees_something():
    view = NadirCamera(marked_world(0.0, 0.0), CAMERA).view(pose_at(altitude_m=0.0))
    assert tuple(view.image_rgb[176, 176]) == RED


def test_labels_at_counts_the_disc_round_a_place():
    camera = NadirCamera(marked_world(10.0, -5.0), CAMERA)
    near = camera.labels_at(10.0, -5.0, 1.0)
    wide = camera.labels_at(10.0, -5.0, 10.0)
    assert near is not None
    assert wide is not None
    assert set(near) == {Label.VEHICLE}
    assert set(wide) == {Label.VEHICLE, Label.GRASS}
    assert wide.size == pytest.approx(pi * (10.0 / 0.25) ** 2, rel=0.02)


def test_labels_at_a_point_gives_its_pixel_and_honours_mirroring():
    camera = NadirCamera(marked_world(40.0, 0.0, size_m=100.0), CAMERA)
    assert list(camera.labels_at(40.0, 0.0, 0.0)) == [Label.VEHICLE]
    assert Label.VEHICLE in camera.labels_at(60.0, 0.0, 0.5)
    assert Label.VEHICLE not in camera.labels_at(75.0, 0.0, 0.5)


@pytest.mark.parametrize('bearing_deg', [0.0, 90.0, 200.0])
def test_clearance_is_the_distance_to_the_nearest_unsafe_pixel(bearing_deg):
    camera = NadirCamera(marked_world(0.0, 0.0), CAMERA)
    north, east = 30.0 * cos(radians(bearing_deg)), 30.0 * sin(radians(bearing_deg))
    assert camera.clearance_m(north, east) == pytest.approx(30.0 - 1.5, abs=0.8)
    assert camera.clearance_m(0.0, 0.0) == 0.0


def test_clearance_without_labels_is_unknown_and_without_hazards_endless():
    image = np.zeros((20, 20, 3), np.uint8)
    unknown = NadirCamera(World(image, None, 1.0, 'unknown'), CAMERA)
    assert unknown.clearance_m(0.0, 0.0) is None
    assert unknown.labels_at(0.0, 0.0, 1.0) is None
    grass = np.full((20, 20), Label.GRASS, np.uint8)
    assert NadirCamera(World(image, grass, 1.0, 'lawn'), CAMERA).clearance_m(0.0, 0.0) == inf


def test_unlabeled_ground_is_not_counted_as_safe():
    image = np.zeros((20, 20, 3), np.uint8)
    blank = np.zeros((20, 20), np.uint8)
    assert NadirCamera(World(image, blank, 1.0, 'blank'), CAMERA).clearance_m(0.0, 0.0) == 0.0
