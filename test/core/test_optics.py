# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lenses with distortion: each direction has its pixel and each pixel its direction."""

from __future__ import annotations

from dataclasses import replace
from math import atan, radians, tan

import cv2
import numpy as np
import pytest

from peace_ros.core import optics
from peace_ros.core.domain import Camera, Distortion, ImageError

PINHOLE = Camera.from_degrees(640, 360, 90.0)
LENSES = {
    'none': None,
    'plumb_bob': Distortion('plumb_bob', (-0.2, 0.05, 0.001, -0.002, -0.004)),
    'rational': Distortion('rational_polynomial', (0.4, 0.1, 0.001, 0.0, 0.01, 0.7, 0.2, 0.02)),
    'fisheye': Distortion('equidistant', (0.05, -0.01, 0.002, -0.001)),
}


@pytest.fixture(params=LENSES)
def camera(request) -> Camera:
    return replace(PINHOLE, distortion=LENSES[request.param])


def test_a_pixel_and_its_direction_belong_together(camera: Camera) -> None:
    u, v = (each.ravel() for each in np.meshgrid(np.arange(0, 640, 53), np.arange(0, 360, 29)))
    directions = optics.rays(camera, u, v)
    assert np.isfinite(directions).all()
    np.testing.assert_allclose(optics.pixels(camera, directions), [u, v], atol=1e-5)


def test_plumb_bob_is_the_polynomial_of_its_specification() -> None:
    k1, k2, p1, p2, k3 = LENSES['plumb_bob'].coefficients
    x, y = 0.6, -0.3
    r2 = x * x + y * y
    radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    seen_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    seen_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    camera = replace(PINHOLE, distortion=LENSES['plumb_bob'])
    (u,), (v,) = optics.pixels(camera, np.array([[2.0 * x], [2.0 * y], [2.0]]))
    assert u == pytest.approx(319.5 + 320.0 * seen_x)
    assert v == pytest.approx(179.5 + 320.0 * seen_y)


def test_equidistant_grows_with_the_angle() -> None:
    camera = replace(PINHOLE, distortion=Distortion('equidistant', (0.0, 0.0, 0.0, 0.0)))
    (u,), _ = optics.pixels(camera, np.array([[tan(radians(50.0))], [0.0], [1.0]]))
    assert u == pytest.approx(319.5 + 320.0 * radians(50.0))


def test_a_stretched_picture_keeps_its_directions(camera: Camera) -> None:
    """The middle of a pixel of the small picture is where it was in the large one."""
    small = camera.resized(160, 120)
    u, v = np.array([10.0, 80.0, 150.0]), np.array([5.0, 60.0, 110.0])
    large = optics.rays(camera, (u + 0.5) * 4.0 - 0.5, (v + 0.5) * 3.0 - 0.5)
    np.testing.assert_allclose(optics.rays(small, u, v), large, atol=1e-7)


def test_a_grid_is_read_where_its_points_are_seen(camera: Camera) -> None:
    """A ramp to the right and one down tell the pixel that each point was read from."""
    directions = np.array([[0.02, 0.003, -0.5], [-0.001, 0.02, -0.3], [0.0004, 0.0, 1.0]])
    columns, rows = np.meshgrid(np.arange(40), np.arange(30))
    points = directions @ np.stack((columns.ravel(), rows.ravel(), np.ones(1200)))
    u, v = optics.pixels(camera, points)
    ramp_u = np.tile(np.minimum(np.arange(640) / 4.0, 255.0), (360, 1)).astype(np.uint8)
    ramp_v = np.tile(np.minimum(np.arange(360) / 2.0, 255.0)[:, None], (1, 640)).astype(np.uint8)
    (read_u, read_v), seen = optics.sample(
        [(ramp_u, cv2.INTER_NEAREST), (ramp_v, cv2.INTER_NEAREST)], camera, directions, (40, 30)
    )
    inside = (u > 2) & (u < 637) & (v > 2) & (v < 357)
    assert seen.all()
    assert inside.sum() > 300
    assert np.abs(read_u.ravel()[inside] * 4.0 - u[inside]).max() < 5.0
    assert np.abs(read_v.ravel()[inside] * 2.0 - v[inside]).max() < 3.0


def test_directions_behind_the_camera_are_not_seen(camera: Camera) -> None:
    directions = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [-0.1, 0.0, 0.55]])
    _, seen = optics.sample([], camera, directions, (11, 2))
    np.testing.assert_array_equal(seen[:, :3], True)
    np.testing.assert_array_equal(seen[:, 6:], False)


def test_what_a_polynomial_folds_back_into_the_picture_is_not_seen() -> None:
    """r (1 - 0.3 r^2) has its maximum at r = 1.054; beyond, far directions look like near ones."""
    camera = replace(PINHOLE, distortion=Distortion('plumb_bob', (-0.3, 0.0, 0.0, 0.0, 0.0)))
    turn = (1.0 / 0.9) ** 0.5
    assert optics.widest_ray(camera) == pytest.approx(turn, abs=0.02)
    beyond = np.array([[1.5, 0.0, 1.0], [0.5, 0.0, 1.0]]).T
    u, _ = optics.pixels(camera, beyond)
    assert np.isnan(u[0])
    assert np.isfinite(u[1])
    directions = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]])
    (read,), seen = optics.sample(
        [(np.full((360, 640), 255, np.uint8), cv2.INTER_NEAREST)], camera, directions, (30, 1)
    )
    assert seen[0, :10].all()
    assert not seen[0, 11:].any()
    assert read[0, 15] == 255, 'the polynomial alone would find it in the picture'


def test_a_lens_without_distortion_has_no_limit_of_its_own() -> None:
    assert atan(optics.widest_ray(PINHOLE)) == pytest.approx(radians(80.0))
    optics.check_lens(PINHOLE)


@pytest.mark.parametrize(
    'wrong',
    [
        replace(PINHOLE, centre_px=(-5.0, 179.5)),
        replace(PINHOLE, centre_px=(319.5, 400.0)),
        replace(PINHOLE, distortion=Distortion('plumb_bob', (-2.0, 0.0, 0.0, 0.0, 0.0))),
        replace(PINHOLE, focal_xy_px=(320.0, 1e9)),
        replace(PINHOLE, rectification=(2.0,) * 9),
        replace(PINHOLE, rectification=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_a_calibration_that_cannot_be_that_of_the_picture_is_refused(wrong: Camera) -> None:
    with pytest.raises(ImageError, match='calibrate the camera again'):
        optics.check_lens(wrong)
