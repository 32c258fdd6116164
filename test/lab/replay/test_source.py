# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a replay gets its frames: bags and videos, good and bad ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from peace_ros.core.domain import NADIR, Camera, RecordingError
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.lab.replay import SourceOptions, open_source
from peace_ros.recording import BagWriter, VideoWriter
from peace_ros.recording.bag import TYPESTORE
from peace_ros.recording.messages import diagnostic_array, header, jpeg_message, pose_stamped

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
    seen_by = frames[0].camera
    assert seen_by.focal_xy_px[0] == pytest.approx(CAMERA_73.focal_px)
    assert source.mount == NADIR
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
    remark, assumed = source.remarks
    assert 'field of view of 73 deg' in assumed
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
    assert source.remarks[:-1] == [
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


def test_an_image_whose_clock_jumped_does_not_end_the_replay(tmp_path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for k in range(1, 5):
            bag.write('/pose', k * SECOND, pose_stamped(k * SECOND, (0, 0, 50), LEVEL))
            stamp_ns = k * SECOND if k != 2 else 10**18
            bag.write('/image', k * SECOND, jpeg_message(picture(9 * k), stamp_ns))
    taken = list(open_source(tmp_path / 'a.mcap', SourceOptions()).frames())
    assert [each.frame is not None for each in taken] == [True, False, True, True]
    assert 'after the last pose: its clock jumped' in taken[1].fault


def test_a_video_takes_its_poses_from_a_log_beside_it(tmp_path) -> None:
    with VideoWriter(tmp_path / 'DJI_1.mp4', 5.0) as video:
        for k in range(11):
            video.write(np.full((64, 64, 3), 20 * k, np.uint8))
    cue = '{0}\n00:00:0{0},000 --> 00:00:0{0},900\n[rel_alt: {1}.5 abs_alt: 300.0]\n'
    (tmp_path / 'DJI_1.SRT').write_text('\n'.join(cue.format(k, 60 - k) for k in range(3)))
    source = open_source(tmp_path / 'DJI_1.mp4', SourceOptions())
    assert [pose.altitude_agl_m for pose in source.poses] == [60.5, 59.5, 58.5]
    assert [pose.stamp_ns for pose in source.poses] == [SECOND, 2 * SECOND, 3 * SECOND]
    assert source.remarks[0].startswith('3 poses of DJI_1.SRT, times from the first frame')
    later = open_source(tmp_path / 'DJI_1.mp4', SourceOptions(time_offset_s=0.5, ground_m=1.5))
    assert later.poses[0].stamp_ns == 3 * SECOND // 2
    assert later.poses[0].altitude_agl_m == 59.0
    assumed = open_source(tmp_path / 'DJI_1.mp4', SourceOptions(altitude='30'))
    assert assumed.poses[0].altitude_agl_m == 30.0
    with pytest.raises(RecordingError, match='give --time-offset'):
        open_source(tmp_path / 'DJI_1.mp4', SourceOptions(time_offset_s=100.0))


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
    assert source.options.assumed_camera(64, 64) == Camera.from_degrees(64, 64, 60.0)
    assert next(source.frames()).frame.camera is None
    assert [source.poses[k].altitude_agl_m for k in (0, 10, 20)] == pytest.approx([80, 55, 30])
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
        {'mount_yaw_deg': 400.0},
        {'ground_m': float('nan')},
        {'time_offset_s': float('nan')},
    ],
)
def test_senseless_parts_are_refused(given) -> None:
    with pytest.raises(RecordingError, match='give'):
        SourceOptions(**given)


CAMERA_73 = Camera.from_degrees(352, 352, 73.0)
T = TYPESTORE.types


def info(focal_px: float, frame_id: str, size_px=(64, 48), d=()):
    width, height = size_px
    k = np.array([focal_px, 0, width / 2, 0, focal_px, height / 2, 0, 0, 1.0])
    p = np.array([2 * focal_px, 0, width / 2, 0, 0, 2 * focal_px, height / 2, 0, 0, 0, 1.0, 0])
    roi = T['sensor_msgs/msg/RegionOfInterest'](0, 0, 0, 0, False)
    return T['sensor_msgs/msg/CameraInfo'](
        header=header(1, frame_id),
        height=height,
        width=width,
        distortion_model='plumb_bob',
        d=np.array(d, float),
        k=k,
        r=np.eye(3).ravel(),
        p=p,
        binning_x=0,
        binning_y=0,
        roi=roi,
    )


def turned_tf(parent: str, child: str):
    """The camera looks down, and the top of its picture points to the right."""
    vector, quaternion = T['geometry_msgs/msg/Vector3'], T['geometry_msgs/msg/Quaternion']
    transform = T['geometry_msgs/msg/Transform'](
        vector(0.1, 0.0, 0.0), quaternion(0.0, 1.0, 0.0, 0.0)
    )
    stamped = T['geometry_msgs/msg/TransformStamped'](header(1, parent), child, transform)
    return T['tf2_msgs/msg/TFMessage'](transforms=[stamped])


def bag_with(path: Path, image_topic: str, extra) -> Path:
    """Return a bag of one image (64 x 48, frame_id optical) and other messages by topic."""
    with BagWriter(path) as bag:
        for topic, message in extra:
            bag.write(topic, 1, message)
        bag.write('/pose', SECOND, pose_stamped(SECOND, (0, 0, 50), LEVEL))
        image = jpeg_message(np.full((48, 64, 3), 90, np.uint8), SECOND)
        image.header.frame_id = 'optical'
        bag.write(image_topic, SECOND, image)
    return path


def camera_of(path: Path, **given):
    (taken,) = open_source(path, SourceOptions(**given)).frames()
    assert taken.frame is not None, taken.fault
    return taken.frame.camera


def test_the_calibration_is_that_beside_the_image(tmp_path) -> None:
    extra = [('/aux/camera_info', info(999.0, 'optical')), ('/belly/camera_info', info(80.0, 'b'))]
    path = bag_with(tmp_path / 'a.mcap', '/belly/image_raw/compressed', extra)
    assert camera_of(path).focal_px == 80.0
    assert camera_of(path, fov_x_deg=60.0) is None


def test_else_it_is_the_one_of_the_same_frame_id(tmp_path) -> None:
    extra = [
        ('/aux/camera_info', info(999.0, 'aux')),
        ('/other/camera_info', info(70.0, 'optical')),
    ]
    path = bag_with(tmp_path / 'a.mcap', '/belly/image_raw/compressed', extra)
    assert camera_of(path).focal_px == 70.0


def test_the_calibrations_of_other_cameras_are_not_used(tmp_path) -> None:
    path = bag_with(
        tmp_path / 'a.mcap', '/b/image/compressed', [('/c/camera_info', info(9.0, 'c'))]
    )
    with pytest.raises(RecordingError, match=r'none of /c/camera_info is beside .* give --fov'):
        open_source(path, SourceOptions())
    assert camera_of(path, fov_x_deg=60.0) is None


def test_a_rectified_image_has_no_distortion(tmp_path) -> None:
    bent = info(80.0, 'optical', d=(-0.1, 0.01, 0.0, 0.0, 0.0))
    raw = bag_with(tmp_path / 'a.mcap', '/b/image_raw/compressed', [('/b/camera_info', bent)])
    assert camera_of(raw).distortion.coefficients[0] == -0.1
    flat = bag_with(tmp_path / 'b.mcap', '/b/image_rect/compressed', [('/b/camera_info', bent)])
    assert camera_of(flat).distortion is None
    assert camera_of(flat).focal_px == 160.0


def test_a_calibration_that_cannot_be_used_is_told(tmp_path) -> None:
    never = bag_with(
        tmp_path / 'a.mcap', '/b/image/compressed', [('/b/camera_info', info(0.0, 'o'))]
    )
    with pytest.raises(RecordingError, match=r'not calibrated: give --fov'):
        open_source(never, SourceOptions())
    other = info(80.0, 'o', (640, 480))
    path = bag_with(tmp_path / 'b.mcap', '/b/image/compressed', [('/b/camera_info', other)])
    (taken,) = open_source(path, SourceOptions()).frames()
    assert taken.frame is None
    assert '640 x 480 px, the image has 64 x 48 px' in taken.fault


def test_the_mount_is_that_of_tf_static_unless_it_is_given(tmp_path) -> None:
    extra = [('/tf_static', turned_tf('base_link', 'optical'))]
    path = bag_with(tmp_path / 'a.mcap', '/image/compressed', extra)
    mount = open_source(path, SourceOptions()).mount
    turned = mount_from_degrees((0.0, 0.0, 90.0), (0.1, 0.0, 0.0))
    assert mount.quaternion == pytest.approx(turned.quaternion)
    assert mount.offset_frd_m == turned.offset_frd_m
    given = open_source(path, SourceOptions(mount_yaw_deg=180.0)).mount
    assert given == mount_from_degrees((0.0, 0.0, 180.0), (0.0, 0.0, 0.0))
    elsewhere = [('/tf_static', turned_tf('base_link', 'another'))]
    other = bag_with(tmp_path / 'b.mcap', '/image/compressed', elsewhere)
    assert open_source(other, SourceOptions()).mount == NADIR
