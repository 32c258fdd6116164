# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Videos: frames with an assumed altitude, and overlays that are whole or absent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from peace_ros.core.domain import RecordingError
from peace_ros.recording import AltitudeProfile, VideoReader, VideoWriter


def write_video(path: Path, frames: int = 12) -> Path:
    with VideoWriter(path, 5.0) as video:
        for k in range(frames):
            video.write(np.full((64, 64, 3), (20 * k, 60, 200 - 10 * k), np.uint8))
    return path


def test_frames_come_back_in_order_with_the_altitude_of_the_profile(tmp_path) -> None:
    reader = VideoReader(write_video(tmp_path / 'a.mp4'), AltitudeProfile(100.0, 20.0))
    frames = list(reader.frames())
    assert [index for index, _ in frames] == list(range(12))
    reds = [frame.image_rgb[..., 0].mean() for _, frame in frames]
    assert reds == sorted(reds)
    assert reds[-1] - reds[0] > 150
    stamps = [frame.stamp_ns for _, frame in frames]
    np.testing.assert_allclose(np.diff(stamps), 200_000_000)
    assert reader.pose(0).altitude_agl_m == 100.0
    assert reader.pose(11).altitude_agl_m == 20.0
    assert reader.pose(5).stamp_ns == stamps[5]


def test_no_video_is_left_after_an_error(tmp_path) -> None:
    def fail() -> None:
        with VideoWriter(tmp_path / 'a.mp4', 5.0) as video:
            video.write(np.zeros((64, 64, 3), np.uint8))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_frames_of_another_size_are_refused(tmp_path) -> None:
    with VideoWriter(tmp_path / 'a.mp4', 5.0) as video:
        video.write(np.zeros((64, 64, 3), np.uint8))
        with pytest.raises(RecordingError, match='after ones'):
            video.write(np.zeros((32, 64, 3), np.uint8))


def test_a_file_that_is_no_video_is_refused(tmp_path) -> None:
    (tmp_path / 'a.mp4').write_bytes(b'not a video')
    for name in ('a.mp4', 'missing.mp4'):
        with pytest.raises(RecordingError):
            VideoReader(tmp_path / name, AltitudeProfile(100.0, 20.0))


@pytest.mark.parametrize('text', ['', 'high', '100:low', '0:20', '100:-3', 'nan:20', '1e9:20'])
def test_altitudes_that_make_no_sense_are_refused(text) -> None:
    with pytest.raises(RecordingError, match='START:END'):
        AltitudeProfile.parse(text)


def test_one_altitude_holds_for_the_whole_video() -> None:
    assert AltitudeProfile.parse('60') == AltitudeProfile(60.0, 60.0)
    assert AltitudeProfile.parse('100:20').at(0.25) == 80.0
