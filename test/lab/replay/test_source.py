# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a replay gets its frames: bags and videos, good and bad ones."""

from __future__ import annotations

from math import degrees
from pathlib import Path

import numpy as np
import pytest

from peace_ros.core.domain import RecordingError
from peace_ros.lab.replay import SourceOptions, open_source
from peace_ros.recording import BagWriter, VideoWriter
from peace_ros.recording.messages import diagnostic_array, jpeg_message, pose_stamped

SMALL = Path(__file__).resolve().parents[2] / 'data' / 'small.mcap'
LEVEL = (1.0, 0.0, 0.0, 0.0)
SECOND = 1_000_000_000


def picture(value: int) -> np.ndarray:
    return np.full((32, 32, 3), value, np.uint8)


def write_bag(path: Path, *, topics=('/image/compressed',), frames: int = 6, broken=()) -> Path:
    with BagWriter(path) as bag:
        for k in range(1, frames + 1):
            stamp_ns = k * SECOND // 2
            bag.write('/ground_truth/pose', stamp_ns, pose_stamped(stamp_ns, (0, 0, 50), LEVEL))
            for topic in topics:
                image = jpeg_message(picture(20 * k), stamp_ns)
                if k in broken:
                    image.data = image.data[:40]
                bag.write(topic, stamp_ns, image)
    return path


def stamps(source) -> list[float]:
    return [taken.stamp_ns / SECOND for taken in source.frames()]


def test_the_small_bag_holds_a_descent() -> None:
    source = open_source(SMALL, SourceOptions())
    frames = [taken.frame for taken in source.frames()]
    assert source.count == len(frames) == 45
    assert all(frame is not None and frame.image_rgb.shape == (352, 352, 3) for frame in frames)
    assert degrees(source.fov_x_rad) == pytest.approx(73.0)
    altitudes = [pose.altitude_agl_m for pose in source.poses]
    assert altitudes[0] == pytest.approx(100.0)
    assert altitudes[-1] < 40.0
    assert SMALL.stat().st_size < 1_500_000


def test_frames_are_chosen_by_number_rate_and_limit(tmp_path) -> None:
    path = write_bag(tmp_path / 'a.mcap')
    assert stamps(open_source(path, SourceOptions())) == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    assert stamps(open_source(path, SourceOptions(every=2))) == [0.5, 1.5, 2.5]
    assert stamps(open_source(path, SourceOptions(hz=1.0))) == [0.5, 1.5, 2.5]
    assert stamps(open_source(path, SourceOptions(limit=2))) == [0.5, 1.0]
    assert open_source(path, SourceOptions(every=4)).count == 2


def test_an_unclear_topic_must_be_named(tmp_path) -> None:
    path = write_bag(tmp_path / 'a.mcap', topics=('/left', '/right'))
    with pytest.raises(RecordingError, match=r'--image-topic.*/left, /right'):
        open_source(path, SourceOptions())
    named = open_source(path, SourceOptions(image_topic='/right'))
    assert len(stamps(named)) == 6
    with pytest.raises(RecordingError, match=r'no topic /up: .*|no topic /up'):
        open_source(path, SourceOptions(image_topic='/up'))
    with pytest.raises(RecordingError, match='CompressedImage'):
        open_source(path, SourceOptions(image_topic='/right', pose_topic='/left'))


def test_a_frame_that_is_cut_short_is_told_and_the_others_are_used(tmp_path) -> None:
    source = open_source(write_bag(tmp_path / 'a.mcap', broken=(2, 5)), SourceOptions())
    taken = list(source.frames())
    assert [each.frame is None for each in taken] == [False, True, False, False, True, False]
    assert 'truncated' in taken[1].fault


def test_the_recorded_engagement_is_found(tmp_path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for k, state in enumerate(('IDLE', 'IDLE', 'SEARCHING', 'AIMING'), start=1):
            status = diagnostic_array(k * SECOND, 'landing', 0, '', [('state', state)])
            bag.write('/landing/status', k * SECOND, status)
            bag.write('/pose', k * SECOND, pose_stamped(k * SECOND, (0, 0, 50), LEVEL))
            bag.write('/image', k * SECOND, jpeg_message(picture(9), k * SECOND))
    assert open_source(tmp_path / 'a.mcap', SourceOptions()).engage_ns == 3 * SECOND


def test_a_pose_that_is_none_is_left_out_and_told(tmp_path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for k in range(1, 5):
            turn = (0.0, 0.0, 0.0, 0.0) if k < 3 else LEVEL
            bag.write('/pose', k * SECOND, pose_stamped(k * SECOND, (0, 0, 50), turn))
            bag.write('/image', k * SECOND, jpeg_message(picture(9), k * SECOND))
    source = open_source(tmp_path / 'a.mcap', SourceOptions())
    assert [pose.stamp_ns for pose in source.poses] == [3 * SECOND, 4 * SECOND]
    (remark,) = source.remarks
    assert remark.startswith('2 poses of /pose left out; the first: pose (0.0, 0.0, 50.0)')


def test_a_topic_without_a_pose_is_one_sentence(tmp_path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.add_topic('/empty', 'geometry_msgs/msg/PoseStamped')
        bag.write('/pose', SECOND, pose_stamped(SECOND, (0, 0, 50), (0.0, 0.0, 0.0, 0.0)))
        bag.write('/image', SECOND, jpeg_message(picture(9), SECOND))
    with pytest.raises(RecordingError, match=r'/empty .* has 0 messages: choose .*--pose-topic'):
        open_source(tmp_path / 'a.mcap', SourceOptions(pose_topic='/empty'))
    with pytest.raises(RecordingError, match='none of 1 messages of /pose is a pose; the first'):
        open_source(tmp_path / 'a.mcap', SourceOptions())


def test_images_without_a_stamp_get_that_of_their_receipt(tmp_path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for k in range(1, 4):
            bag.write('/pose', k * SECOND, pose_stamped(k * SECOND, (0, 0, 50), LEVEL))
            bag.write('/image', k * SECOND, jpeg_message(picture(9 * k), 0))
    source = open_source(tmp_path / 'a.mcap', SourceOptions())
    taken = list(source.frames())
    assert [each.frame.stamp_ns for each in taken] == [k * SECOND for k in (1, 2, 3)]
    assert source.remarks == [
        'images of /image have the stamp 0: the time of their receipt is used'
    ]


@pytest.mark.parametrize('shift_s', [-7200, 7200, 1_700_000_000])
def test_clocks_that_never_meet_are_refused(tmp_path, shift_s) -> None:
    at_ns = 10_000 * SECOND
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.write('/pose', at_ns, pose_stamped(at_ns, (0, 0, 50), LEVEL))
        bag.write('/image', at_ns, jpeg_message(picture(9), at_ns + shift_s * SECOND))
    with pytest.raises(
        RecordingError, match=r'poses are stamped 10000\.0 to 10000\.0 s.*one clock'
    ):
        open_source(tmp_path / 'a.mcap', SourceOptions())


def test_poses_above_sea_level_are_put_above_ground(tmp_path) -> None:
    path = write_bag(tmp_path / 'a.mcap')
    pose = open_source(path, SourceOptions(ground_m=35.0)).poses[0]
    assert pose.altitude_agl_m == pytest.approx(15.0)
    assert pose.down_m == pytest.approx(-50.0)


def test_a_video_gets_a_camera_and_an_altitude(tmp_path) -> None:
    with VideoWriter(tmp_path / 'a.mp4', 5.0) as video:
        for k in range(11):
            video.write(np.full((64, 64, 3), 20 * k, np.uint8))
    source = open_source(tmp_path / 'a.mp4', SourceOptions(fov_x_deg=60.0, altitude='80:30'))
    assert len(stamps(source)) == 11
    assert degrees(source.fov_x_rad) == pytest.approx(60.0)
    assert [source.poses[k].altitude_agl_m for k in (0, 5, 10)] == pytest.approx([80, 55, 30])
    assert source.remarks == ['no altitude was recorded: 80:30 m is assumed, linear (--altitude)']


@pytest.mark.parametrize('name', ['missing.mcap', 'notes.txt', 'folder', 'empty.mp4', 'empty.db3'])
def test_a_bad_source_is_one_sentence(tmp_path, name) -> None:
    (tmp_path / 'notes.txt').write_text('hello')
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'empty.mp4').write_bytes(b'')
    (tmp_path / 'empty.db3').write_bytes(b'')
    with pytest.raises(RecordingError) as told:
        open_source(tmp_path / name, SourceOptions())
    assert name in str(told.value)
    assert '\n' not in str(told.value)


@pytest.mark.parametrize(
    'given',
    [
        {'every': 0},
        {'hz': 0.0},
        {'hz': float('nan')},
        {'limit': 0},
        {'fov_x_deg': 180.0},
        {'ground_m': float('nan')},
    ],
)
def test_senseless_parts_are_refused(given) -> None:
    with pytest.raises(RecordingError, match='give'):
        SourceOptions(**given)
