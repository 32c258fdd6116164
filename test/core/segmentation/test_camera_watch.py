# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frames that no working camera gives never reach the network."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.domain import Frame, ImageError
from peace_ros.core.segmentation.camera_watch import CameraWatch
from peace_ros.simulation.drawing import apply_condition, draw_scene


def _frame(image: np.ndarray) -> Frame:
    return Frame(np.ascontiguousarray(image, dtype=np.uint8), 1)


@pytest.mark.parametrize('level', [0, 1, 90, 254, 255])
def test_a_picture_of_one_colour_is_refused(level: int) -> None:
    with pytest.raises(ImageError, match='one colour'):
        CameraWatch().check(_frame(np.full((352, 352, 3), level)))


@pytest.mark.parametrize(('level', 'name'), [(255, 'white'), (0, 'black')])
def test_a_picture_that_is_mostly_saturated_is_refused(level: int, name: str) -> None:
    image = draw_scene(1, 352, 0.2).image_rgb.copy()
    image[:330] = level
    with pytest.raises(ImageError, match=name):
        CameraWatch().check(_frame(image))


@pytest.mark.parametrize('condition', ['clear', 'fog', 'night', 'snowy', 'dark', 'bright', 'smog'])
def test_hard_weather_is_no_broken_camera(condition: str) -> None:
    for seed in range(12):
        image = draw_scene(seed, 352, 0.02 + 0.03 * seed).image_rgb
        rng = np.random.default_rng(seed)
        CameraWatch().check(_frame(apply_condition(image, condition, rng, strength=1.0)))


def test_the_size_may_change_but_not_the_shape() -> None:
    watch = CameraWatch()
    image = draw_scene(1, 352, 0.2).image_rgb
    watch.check(_frame(image))
    watch.check(_frame(image[::2, ::2]))
    with pytest.raises(ImageError, match=r'352 x 176'):
        watch.check(_frame(image[:176]))
    watch.check(_frame(image))
