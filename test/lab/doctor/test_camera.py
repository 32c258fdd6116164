# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What was heard of a camera is judged: rate, losses, stamps, encoding, geometry."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from peace_ros.core.node_parameters import CameraOptions
from peace_ros.lab.doctor.camera import CameraHeard, judge_camera

MS = 1_000_000
NOW_NS = 1_800_000_000_000 * MS
PARAMETERS = CameraOptions(camera_width=64, camera_height=48, camera_fov=73.0)
YEARS_57_NS = int(57 * 365.25 * 86400e9)


def image(width=64, height=48, encoding='rgb8'):
    pixels = np.random.default_rng(1).integers(0, 256, (height, width, 3), np.uint8)
    return SimpleNamespace(
        width=width,
        height=height,
        encoding=encoding,
        is_bigendian=0,
        step=3 * width,
        data=pixels.tobytes(),
        header=SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=0)),
    )


def calibration(width=64, height=48, focal_px=43.25):
    return SimpleNamespace(
        width=width, height=height, k=[focal_px, *[0.0] * 8], distortion_model='plumb_bob'
    )


def heard(indices=range(60), period_ms=50, age_ms=20, info=None, **changes):
    stamps = [NOW_NS + index * period_ms * MS for index in indices]
    values = {
        'publishers': 1,
        'stamps_ns': stamps,
        'received_ns': [each + age_ms * MS for each in stamps],
        'newest': image(),
        'info': info,
        'info_topic': '/camera/camera_info',
    }
    return CameraHeard('/camera/image_raw', **{**values, **changes})


@pytest.mark.parametrize('info', [None, calibration()])
def test_a_camera_as_the_parameters_say_is_fine(info, to_mend) -> None:
    found = list(judge_camera(heard(info=info), PARAMETERS))
    assert not to_mend(found)
    assert found[0].found == '/camera/image_raw: 64 x 48 px, rgb8, 20.0 Hz'
    assert found[0].figures['lost_share'] == 0.0
    assert 'images are 20 ms old' in found[1].found


def test_frames_that_are_lost_are_counted_by_their_stamps(to_mend) -> None:
    kept = [index for index in range(60) if index % 5]
    found = list(judge_camera(heard(kept), PARAMETERS))
    ((what, remedy),) = to_mend(found)
    assert '% of the frames are lost' in what
    assert 'shared-memory segment' in remedy
    assert found[0].figures['lost_share'] == pytest.approx(0.2, abs=0.02)


def test_a_camera_that_is_too_slow_is_found(to_mend) -> None:
    ((what, remedy),) = to_mend(judge_camera(heard(range(3), period_ms=1000), PARAMETERS))
    assert '1.0 Hz' in what
    assert 'at least 2 Hz' in remedy


@pytest.mark.parametrize(
    ('age_ms', 'words'),
    [(1500, '1.5 s behind'), (-500, '0.5 s ahead of'), (YEARS_57_NS // MS, 's behind')],
)
def test_wrong_stamps_are_found(age_ms, words, to_mend) -> None:
    ((what, remedy),) = to_mend(judge_camera(heard(age_ms=age_ms), PARAMETERS))
    assert words in what
    assert 'ROS clock' in remedy


def test_simulated_time_is_not_compared(to_mend) -> None:
    assert not to_mend(judge_camera(heard(age_ms=YEARS_57_NS // MS, has_clock=True), PARAMETERS))


def test_two_cameras_on_one_topic_are_found(to_mend) -> None:
    ((what, _),) = to_mend(judge_camera(heard(publishers=2), PARAMETERS))
    assert '2 publish /camera/image_raw' in what


def test_an_unknown_encoding_is_found(to_mend) -> None:
    ((what, _),) = to_mend(judge_camera(heard(newest=image(encoding='secret')), PARAMETERS))
    assert 'secret' in what
    assert 'rgb8' in what


def test_ground_that_would_be_stretched_is_found_with_both_sizes(to_mend) -> None:
    ((what, remedy),) = to_mend(judge_camera(heard(newest=image(64, 36)), PARAMETERS))
    assert '64 x 36 px' in what
    assert 'camera_width 64, camera_height 48' in what
    assert 'camera_height: 36' in remedy


def test_a_calibration_counts_whatever_the_parameters_say(to_mend) -> None:
    assert not to_mend(judge_camera(heard(info=calibration(focal_px=60.0)), PARAMETERS))


def test_a_calibration_of_another_size_is_found(to_mend) -> None:
    info = calibration(640, 640, 432.5)
    ((what, remedy),) = to_mend(judge_camera(heard(info=info), PARAMETERS))
    assert '640 x 640 px' in what
    assert 'calibrate' in remedy
