# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ground lies where it is, whatever the shape, lens and mount of the camera that saw it."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import NADIR, Camera, Distortion, Heatmap, Label, Mount, Pose
from peace_ros.core.domain.geometry import camera_pose, mount_from_degrees, quaternion_from_euler
from peace_ros.core.mapping import MapParameters, SafetyMap
from peace_ros.simulation import NadirCamera, World

SIZES = {'square': (352, 352), '4:3': (640, 480), '16:9': (1280, 720)}
LENSES = {
    'pinhole': None,
    'barrel': Distortion('plumb_bob', (-0.12, 0.015, 0.0005, -0.0005, 0.0)),
    'rational': Distortion('rational_polynomial', (0.4, 0.1, 0.001, 0.0, 0.01, 0.7, 0.2, 0.02)),
    'fisheye': Distortion('equidistant', (0.05, -0.01, 0.002, -0.001)),
}
MOUNTS = {
    'nadir': NADIR,
    'ahead': mount_from_degrees((0.0, 15.0, 0.0), (0.2, 0.0, 0.1)),
    'turned': mount_from_degrees((-6.0, 8.0, 130.0), (-0.1, 0.3, 0.05)),
}
SPOTS = ((14.0, -9.0), (-10.0, 17.0), (3.0, 4.0))
"""North, east of what is safe."""
RADIUS_M = 3.0


def ground() -> World:
    """A world that is unsafe but for three discs."""
    labels = np.full((600, 600), Label.BUILDING, np.uint8)
    for north, east in SPOTS:
        cv2.circle(labels, (round(300 + 5 * east), round(300 - 5 * north)), 15, Label.GRASS, -1)
    image = np.repeat(labels[..., None], 3, axis=2)
    return World(image, labels, 0.2, 'discs')


@pytest.fixture(scope='module')
def world() -> World:
    return ground()


def found_spots(world: World, camera: Camera, mount: Mount, taken_with: Camera) -> list[float]:
    """Return how far from the truth each disc lies on the map, infinite for one that is missing."""
    pose = Pose(0, 2.0, -1.0, -40.0, quaternion_from_euler(0.05, -0.08, 0.6), 40.0)
    eye = NadirCamera(world, taken_with, mount)
    labels = eye.view(pose).labels
    safe = np.where(labels == Label.GRASS, np.float32(0.95), np.float32(0.05))
    safety_map = SafetyMap(MapParameters(map_size_m=120.0))
    # The network's picture is square, whatever the frame is.
    stretched = cv2.resize(safe, (352, 352), interpolation=cv2.INTER_AREA)
    for number in range(4):
        safety_map.add(Heatmap(stretched, (number + 1) * 10**9), camera, camera_pose(mount, pose))
    layers = safety_map.layers(4 * 10**9)
    _, _, _, centres = cv2.connectedComponentsWithStats((layers.score > 0.6).astype(np.uint8))
    places = [layers.centre_of(row, column) for column, row in centres[1:]]
    return [
        min((hypot(n - north, e - east) for n, e in places), default=np.inf)
        for north, east in SPOTS
    ]


@pytest.mark.parametrize('mount', MOUNTS)
@pytest.mark.parametrize('lens', LENSES)
@pytest.mark.parametrize('size', SIZES)
def test_safe_ground_lies_where_it_is(world: World, size: str, lens: str, mount: str) -> None:
    camera = replace(Camera.from_degrees(*SIZES[size], 95.0), distortion=LENSES[lens])
    assert max(found_spots(world, camera, MOUNTS[mount], camera)) < 0.5


def test_a_wide_frame_that_is_taken_for_a_square_one_lies_elsewhere(world: World) -> None:
    wide, square = Camera.from_degrees(1280, 720, 95.0), Camera.from_degrees(352, 352, 95.0)
    assert max(found_spots(world, square, NADIR, wide)) > 3.0


def test_a_lens_that_is_taken_for_a_pinhole_moves_the_ground(world: World) -> None:
    pinhole = Camera.from_degrees(640, 480, 95.0)
    bent = replace(pinhole, distortion=LENSES['barrel'])
    assert max(found_spots(world, pinhole, NADIR, bent)) > 0.8


def test_a_mount_that_is_not_known_moves_the_ground(world: World) -> None:
    camera = Camera.from_degrees(640, 480, 95.0)
    pose = Pose(0, 0.0, 0.0, -40.0, (1.0, 0.0, 0.0, 0.0), 40.0)
    seen = NadirCamera(world, camera, MOUNTS['ahead']).view(pose).labels
    level = NadirCamera(world, camera).view(pose).labels
    assert np.count_nonzero(seen != level) > 1000
