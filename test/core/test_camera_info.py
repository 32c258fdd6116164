# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CameraInfo -> Camera: K and D of raw images, P and R of rectified ones, of what is read out."""

from __future__ import annotations

from types import SimpleNamespace as Fields

import numpy as np
import pytest

from peace_ros.core.domain import ConfigurationError, ImageError
from peace_ros.core.messages import camera_from_info, camera_info_topic, is_rectified

TURN = (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def info(**changes) -> Fields:
    given = {
        'width': 1280,
        'height': 960,
        'distortion_model': 'plumb_bob',
        'd': [-0.1, 0.01, 0.0, 0.0, 0.0],
        'k': [900.0, 0.0, 639.5, 0.0, 910.0, 479.5, 0.0, 0.0, 1.0],
        'r': list(TURN),
        'p': [800.0, 0.0, 630.0, 0.0, 0.0, 810.0, 470.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        'binning_x': 0,
        'binning_y': 0,
        'roi': Fields(x_offset=0, y_offset=0, width=0, height=0),
    }
    return Fields(**{**given, **changes})


def test_a_raw_image_has_k_and_d() -> None:
    camera = camera_from_info(info(), (1280, 960), rectified=False)
    assert camera.focal_xy_px == (900.0, 910.0)
    assert camera.centre_px == (639.5, 479.5)
    assert camera.distortion.coefficients == (-0.1, 0.01, 0.0, 0.0, 0.0)
    assert camera.rectification == (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def test_a_rectified_image_has_p_and_r() -> None:
    camera = camera_from_info(info(), (1280, 960), rectified=True)
    assert camera.focal_xy_px == (800.0, 810.0)
    assert camera.centre_px == (630.0, 470.0)
    assert camera.distortion is None
    assert camera.rectification == TURN


def test_binning_and_region_of_interest_are_applied_to_pixel_centres() -> None:
    """The middle of a picture stays the middle of the binned one."""
    camera = camera_from_info(info(binning_x=2, binning_y=2), (640, 480), rectified=False)
    assert camera.focal_xy_px == (450.0, 455.0)
    assert camera.centre_px == (319.5, 239.5)
    roi = Fields(x_offset=320, y_offset=240, width=640, height=480)
    camera = camera_from_info(info(roi=roi, binning_x=2), (320, 480), rectified=False)
    assert camera.focal_xy_px == (450.0, 910.0)
    assert camera.centre_px == (159.5, 239.5)


def test_a_camera_that_was_never_calibrated_has_none() -> None:
    assert camera_from_info(info(k=[0.0] * 9), (1280, 960), rectified=False) is None


def test_coefficients_of_zero_are_no_distortion() -> None:
    bare = info(d=[0.0] * 5, distortion_model='')
    assert camera_from_info(bare, (1280, 960), rectified=False).distortion is None


def test_the_size_of_another_image_is_refused_with_both_sizes() -> None:
    with pytest.raises(ImageError, match='1280 x 960 px, the image has 640 x 480 px'):
        camera_from_info(info(), (640, 480), rectified=False)


@pytest.mark.parametrize(
    'changes',
    [
        {'d': [0.1, np.nan, 0.0, 0.0, 0.0]},
        {'d': [0.1, 0.2]},
        {'distortion_model': 'kannala_brandt8'},
        {'k': [-900.0, 0.0, 639.5, 0.0, 910.0, 479.5, 0.0, 0.0, 1.0]},
        {'k': [np.nan, 0.0, 639.5, 0.0, 910.0, 479.5, 0.0, 0.0, 1.0]},
        {'k': [900.0, 0.0, 5000.0, 0.0, 910.0, 479.5, 0.0, 0.0, 1.0]},
    ],
)
def test_what_cannot_be_a_calibration_is_refused(changes) -> None:
    with pytest.raises((ConfigurationError, ImageError), match=r'calib|distortion'):
        camera_from_info(info(**changes), (1280, 960), rectified=False)


@pytest.mark.parametrize(
    ('image', 'beside', 'rectified'),
    [
        ('/camera/image_raw', '/camera/camera_info', False),
        ('/camera/image_raw/compressed', '/camera/camera_info', False),
        ('/image', '/camera_info', False),
        ('/left/image_rect', '/left/camera_info', True),
        ('/left/image_rect_color/compressed', '/left/camera_info', True),
        ('/direct/image', '/direct/camera_info', False),
    ],
)
def test_names_are_those_of_image_transport(image: str, beside: str, *, rectified: bool) -> None:
    assert camera_info_topic(image) == beside
    assert is_rectified(image) == rectified
