# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, Label, Pose, WorldError
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.drawing.town import DISTRICTS
from peace_ros.simulation.town_camera import TownCamera
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
