# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, Label, Pose, WorldError
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.drawing.light import Sun
from peace_ros.simulation.drawing.plan_index import PlanIndex
from peace_ros.simulation.drawing.scene import Look, render
from peace_ros.simulation.drawing.town import DISTRICTS, Town, plan_town
from peace_ros.simulation.drawing.window import DrawnWindow
from peace_ros.simulation.town_camera import TownCamera, tiles_in_view
from peace_ros.simulation.world import draw_world

CAMERA = Camera.from_degrees(96, 96, 73)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def pose(north_m: float, east_m: float, altitude_m: float) -> Pose:
    return Pose(0, north_m, east_m, -altitude_m, LEVEL, altitude_m)


@pytest.fixture(scope='module')
def whole() -> NadirCamera:
    return NadirCamera(draw_world(5, 120.0, 0.2), CAMERA)


@pytest.fixture(scope='module')
def town() -> TownCamera:
    return TownCamera(5, CAMERA, 120.0, 0.2)


@pytest.mark.parametrize('altitude_m', [12.0, 25.0, 60.0])
def test_it_sees_what_the_whole_drawing_shows(whole, town, altitude_m):
    seen, expected = (camera.view(pose(8.0, -5.0, altitude_m)) for camera in (town, whole))
    assert (seen.labels == expected.labels).mean() > 0.93
    smooth = [cv2.blur(view.image_rgb.astype(np.float32), (9, 9)) for view in (seen, expected)]
    assert np.abs(smooth[0] - smooth[1]).mean() < 5.0


def test_ground_truth_of_a_circle_is_that_of_the_whole_drawing(whole, town):
    for place in ((0.0, 0.0), (20.0, -30.0), (-41.0, 17.0)):
        assert np.array_equal(whole.labels_at(*place, 1.5), town.labels_at(*place, 1.5))
        for radius_m in (30.0, 50.0):
            far, near = (c.labels_around(*place, radius_m) for c in (whole, town))
            shares = [np.bincount(each.labels.ravel(), minlength=10) for each in (far, near)]
            shares = [each / each.sum() for each in shares]
            assert np.abs(shares[0] - shares[1]).max() < 0.03
            assert near.away_m.min() < 0.8


def test_the_order_of_views_changes_nothing():
    poses = [pose(0.0, 0.0, 60.0), pose(30.0, 30.0, 12.0), pose(-30.0, -20.0, 25.0)]
    views = []
    for order in (poses, poses[::-1]):
        camera = TownCamera(6, CAMERA, 120.0, 0.2)
        seen = {each: camera.view(each) for each in order}
        views.append([seen[each] for each in poses])
    for first, second in zip(*views, strict=True):
        assert np.array_equal(first.image_rgb, second.image_rgb)
        assert np.array_equal(first.labels, second.labels)


def test_no_pixel_in_view_is_left_undrawn(town):
    turned = (0.924, 0.0, 0.0, 0.383)
    for place in ((0.0, 0.0), (49.0, -49.0), (-58.0, 58.0)):
        view = town.view(Pose(0, *place, -30.0, turned, 30.0))
        assert not (view.labels == Label.UNLABELED).any()


def test_beyond_the_edge_the_ground_is_the_mirror_image_of_drawn_ground(whole):
    town = TownCamera(5, CAMERA, 120.0, 0.2)
    for place in ((150.0, 0.0), (20.0, -175.0), (-130.0, 140.0)):
        assert np.array_equal(whole.labels_at(*place, 1.5), town.labels_at(*place, 1.5))
        view = town.view(pose(*place, 20.0))
        assert view.mirrored
        assert not (view.labels == Label.UNLABELED).any()


def test_a_size_that_does_not_halve_evenly_is_refused():
    with pytest.raises(WorldError, match='multiple of 4 px'):
        TownCamera(1, CAMERA, 60.2, 0.2)


@pytest.mark.parametrize(
    ('district', 'most', 'least'),
    [
        ('farmland', Label.GRASS, Label.PAVED),
        ('city_centre', Label.PAVED, Label.TREE),
        ('industrial', Label.PAVED, Label.WATER),
        ('forest_edge', Label.TREE, Label.BUILDING),
        ('coast', Label.WATER, Label.OBSTACLE),
    ],
)
def test_a_district_looks_like_its_name(district, most, least):
    shares = np.zeros(len(Label))
    for seed in range(3):
        labels = draw_world(seed, 240.0, 0.8, district, 'summer').labels
        shares += np.bincount(labels.ravel(), minlength=len(Label)) / labels.size / 3.0
    assert shares[most] > 0.2 > shares[least]


def test_unknown_districts_are_refused():
    assert 'campus' in DISTRICTS
    with pytest.raises(WorldError, match=r"district 'moon': choose one of mixed, suburb"):
        draw_world(1, 60.0, 0.5, 'moon')
    with pytest.raises(WorldError, match=r"season 'monsoon'"):
        draw_world(1, 60.0, 0.5, 'suburb', 'monsoon')


@pytest.mark.parametrize('gsd_m', [0.1, 0.4])
def test_a_part_looks_as_it_does_within_a_larger_one(gsd_m):
    drawn = Town(7, 300.0)
    image, labels = drawn.draw(slice(100, 500), slice(200, 600), gsd_m)
    inner_image, inner_labels = drawn.draw(slice(220, 340), slice(300, 420), gsd_m)
    same = (slice(120, 240), slice(100, 220))
    assert np.mean(labels[same] != inner_labels) < 1e-3
    # Only the noise of the pixels differs.
    smooth, inner_smooth = (
        cv2.GaussianBlur(each.astype(np.float32), (0, 0), 3.0)
        for each in (image[same], inner_image)
    )
    assert np.abs(smooth - inner_smooth)[12:-12, 12:-12].max() < 4.0


def test_what_cannot_show_in_a_window_is_left_out_without_a_trace():
    rng = np.random.Generator(np.random.PCG64(3))
    plan = plan_town(rng, 'summer', 200.0)
    sun, look = Sun(1.0, 0.9, 0.9), Look.draw(rng)
    window = DrawnWindow(-30.0, -20.0, 150, 120, 0.4)
    reduced = PlanIndex(plan).within(window)
    assert 0 < len(reduced.things) < 0.5 * len(plan.things)
    whole, part = (render(each, window, 3, sun, look) for each in (plan, reduced))
    assert np.array_equal(whole.labels, part.labels)
    assert np.array_equal(whole.rgb, part.rgb)
    assert np.array_equal(whole.height_m, part.height_m)


def test_a_turned_view_needs_only_the_tiles_that_it_touches():
    middle, reach = 1000.0, 750.0
    corners = middle + reach * np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    needed = set(tiles_in_view(corners, 2000))
    assert not {(1, 1), (1, 6), (6, 1), (6, 6)} & needed
    grid = np.stack(np.meshgrid(np.arange(0, 2000, 10.0), np.arange(0, 2000, 10.0)), axis=-1)
    inside = np.abs(grid - middle).sum(axis=-1) < reach
    assert {(int(y) // 250, int(x) // 250) for x, y in grid[inside]} <= needed
