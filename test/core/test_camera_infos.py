# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each image has the camera_info of its stamp; one that has stopped is not used for ever."""

from types import SimpleNamespace

import pytest

from peace_ros.core.camera_infos import CameraInfos
from peace_ros.core.domain import ImageError


def info(stamp_ns: int) -> SimpleNamespace:
    stamp = SimpleNamespace(sec=0, nanosec=stamp_ns)
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp))


def test_a_camera_without_calibration_has_none():
    infos = CameraInfos('/camera_info')
    assert infos.is_empty
    assert infos.of(1, now_s=1000.0) is None


def test_an_image_that_waited_gets_the_one_of_its_stamp_and_others_the_newest():
    infos = CameraInfos('/camera_info')
    one, two = info(1), info(2)
    infos.add(one, now_s=10.0)
    infos.add(two, now_s=10.1)
    assert not infos.is_empty
    assert infos.of(1, now_s=10.2) is one
    assert infos.of(2, now_s=10.2) is two
    assert infos.of(3, now_s=10.2) is two


def test_one_that_has_stopped_counts_for_its_own_image_only():
    infos = CameraInfos('/belly/camera_info')
    one = info(1)
    infos.add(one, now_s=10.0)
    assert infos.of(2, now_s=12.9) is one
    with pytest.raises(ImageError, match=r'no camera_info on /belly/camera_info for 3\.0 s'):
        infos.of(2, now_s=13.0)
    assert infos.of(1, now_s=100.0) is one
