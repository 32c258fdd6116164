# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags are written whole or not at all, and read from either storage."""

from __future__ import annotations

import os
import shutil
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
import zstandard
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from peace_ros.core.domain import ImageError, RecordingError, VehicleError
from peace_ros.core.messages import (
    diagnostic_values,
    frame_from_message,
    pose_from_message,
    stamp_ns_of,
)
from peace_ros.recording import TYPESTORE, BagReader, BagWriter
from peace_ros.recording.messages import (
    diagnostic_array,
    header,
    image_message,
    jpeg_message,
    pose_stamped,
)

SECOND = 1_000_000_000


def gradient(height: int = 40, width: int = 60) -> np.ndarray:
    rows, columns = np.mgrid[0:height, 0:width]
    return np.stack([columns * 4, rows * 6, np.full_like(rows, 90)], axis=-1).astype(np.uint8)


def raw_image(image: np.ndarray, encoding: str, stamp_ns: int, padding: int = 0):
    height, width = image.shape[:2]
    rows = image.reshape(height, -1)
    padded = np.pad(rows, ((0, 0), (0, padding)))
    return TYPESTORE.types['sensor_msgs/msg/Image'](
        header=header(stamp_ns),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=padded.shape[1],
        data=padded.reshape(-1),
    )


def write_mcap(path: Path, messages) -> Path:
    with BagWriter(path) as bag:
        for topic, stamp_ns, message in messages:
            bag.write(topic, stamp_ns, message)
    return path


def write_sqlite3(path: Path, messages) -> Path:
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        known = {}
        for topic, stamp_ns, message in messages:
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = bag.add_connection(topic, kind, typestore=TYPESTORE)
            bag.write(known[topic], stamp_ns, TYPESTORE.serialize_cdr(message, kind))
    return path


WRITERS = {'mcap': (write_mcap, 'bag.mcap'), 'sqlite3': (write_sqlite3, 'bag')}


@pytest.mark.parametrize('storage', WRITERS)
def test_what_is_written_is_read_back(tmp_path, storage) -> None:
    write, name = WRITERS[storage]
    picture = gradient()
    level = (1.0, 0.0, 0.0, 0.0)
    path = write(
        tmp_path / name,
        [
            ('/image', 5 * SECOND, raw_image(picture, 'rgb8', 5 * SECOND)),
            ('/image/compressed', 5 * SECOND, jpeg_message(picture, 5 * SECOND, quality=95)),
            ('/pose', 6 * SECOND, pose_stamped(6 * SECOND, (3.0, 4.0, 50.0), level)),
        ],
    )
    with BagReader(path) as bag:
        assert list(bag.topics) == ['/image', '/image/compressed', '/pose']
        assert bag.count('/image') == 1
        found = {topic: message for topic, _, message in bag.messages(bag.topics)}
    frame = frame_from_message(found['/image'])
    assert frame.stamp_ns == 5 * SECOND
    np.testing.assert_array_equal(frame.image_rgb, picture)
    jpeg = frame_from_message(found['/image/compressed']).image_rgb
    assert np.abs(jpeg.astype(int) - picture).mean() < 4.0
    pose = pose_from_message(found['/pose'])
    assert (pose.north_m, pose.east_m, pose.altitude_agl_m) == (4.0, 3.0, 50.0)
    assert stamp_ns_of(found['/pose']) == 6 * SECOND


def test_raw_bytes_are_recorded_as_they_came(tmp_path) -> None:
    message = diagnostic_array(7, 'landing', 1, 'holding', {'state': 'HOLD'}.items())
    cdr = bytes(TYPESTORE.serialize_cdr(message, message.__msgtype__))
    with BagWriter(tmp_path / 'raw.mcap') as bag:
        bag.add_topic('/landing/status', message.__msgtype__)
        bag.add_topic('/silent', 'sensor_msgs/msg/Image')
        bag.write_raw('/landing/status', 7, cdr)
    with BagReader(tmp_path / 'raw.mcap') as bag:
        assert '/silent' in bag.topics
        ((_, stamp_ns, found),) = bag.messages(['/landing/status'])
    assert stamp_ns == 7
    assert diagnostic_values(found) == {'state': 'HOLD'}
    assert found.status[0].message == 'holding'


def test_nothing_is_left_after_an_error(tmp_path) -> None:
    def fail() -> None:
        with BagWriter(tmp_path / 'run.mcap') as bag:
            bag.write('/heatmap', 1, image_message(gradient()[:, :, 0], 'mono8', 1))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_the_name_appears_only_when_the_bag_is_whole(tmp_path) -> None:
    path = tmp_path / 'run.mcap'
    with BagWriter(path) as bag:
        bag.write('/heatmap', 1, image_message(gradient()[:, :, 0], 'mono8', 1))
        assert not path.exists()
    assert [each.name for each in tmp_path.iterdir()] == ['run.mcap']


def test_an_existing_bag_is_not_overwritten(tmp_path) -> None:
    (tmp_path / 'run.mcap').write_bytes(b'precious')
    with pytest.raises(RecordingError, match='exists already'):
        BagWriter(tmp_path / 'run.mcap')
    assert (tmp_path / 'run.mcap').read_bytes() == b'precious'


def test_a_place_that_cannot_be_written_to_is_named(tmp_path) -> None:
    (tmp_path / 'file').write_text('')
    with (
        pytest.raises(RecordingError, match='cannot be written'),
        BagWriter(tmp_path / 'file' / 'run.mcap'),
    ):
        pass


def test_a_missing_topic_is_answered_with_those_that_are_there(tmp_path) -> None:
    path = write_mcap(tmp_path / 'a.mcap', [('/camera/down', 1, jpeg_message(gradient(), 1))])
    with BagReader(path) as bag:
        with pytest.raises(RecordingError, match=r'no topic /image.*/camera/down'):
            list(bag.messages(['/image']))
        with pytest.raises(RecordingError, match=r'CompressedImage: give a .*PoseStamped'):
            bag.require('/camera/down', ['geometry_msgs/msg/PoseStamped'])


@pytest.mark.parametrize(
    'content', [b'', b'no bag at all', b'\x89MCAP\x30\r\n'], ids=['empty', 'text', 'head']
)
def test_a_file_that_is_no_bag_is_one_sentence(tmp_path, content) -> None:
    path = tmp_path / 'broken.mcap'
    path.write_bytes(content)
    with pytest.raises(RecordingError, match='cannot be read'), BagReader(path):
        pass


@pytest.mark.parametrize('part', [0.3, 0.7, 0.95])
def test_a_bag_that_is_cut_short_is_read_up_to_there_and_says_so(tmp_path, part) -> None:
    bag = tmp_path / 'whole.mcap'
    with BagWriter(bag) as writer:
        for k in range(1, 50):
            writer.write('/image', k, raw_image(_noise(k), 'rgb8', k))
    cut = tmp_path / 'cut.mcap'
    whole = bag.read_bytes()
    cut.write_bytes(whole[: int(part * len(whole))])
    with BagReader(cut) as bag:
        found = [stamp_ns for _, stamp_ns, _ in bag.messages(['/image'])]
        assert found == list(range(1, len(found) + 1))
        assert 1 <= bag.count('/image') == len(found) <= 49
        (remark,) = bag.remarks
        assert f'breaks off after {len(found)} messages' in remark
        assert 'mcap recover' in remark


def _noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 255, (200, 300, 3), np.uint8)


def test_a_summary_without_topics_is_not_an_empty_bag(tmp_path) -> None:
    """The format allows to leave channels out of the summary; they stand between the messages."""
    path = tmp_path / 'bare.mcap'
    path.write_bytes(_mcap_without_channels_in_its_summary())
    with BagReader(path) as bag:
        assert bag.topics == {'/a': 'std_msgs/msg/Empty'}
        assert len(list(bag.messages(['/a']))) == bag.count('/a') == 1
        assert not bag.remarks


def _write_with_mcap(path: Path, profile: str, encoding: str, kind: str, data: bytes) -> Path:
    with path.open('wb') as file:
        writer = McapWriter(file)
        writer.start(profile=profile, library='')
        other = writer.register_schema('a.Log', 'jsonschema', b'{}')
        log = writer.register_channel('/log', 'json', other)
        writer.add_message(log, log_time=1, publish_time=1, data=b'{}')
        schema = writer.register_schema(kind, 'ros2msg', b'')
        channel = writer.register_channel('/info', encoding, schema)
        writer.add_message(channel, log_time=2, publish_time=2, data=data)
        writer.finish()
    return path


@pytest.mark.parametrize('profile', ['ros2', '', 'ros1'])
def test_channels_that_nobody_asked_for_and_profiles_do_not_matter(tmp_path, profile) -> None:
    is_ros1 = profile == 'ros1'
    store = get_typestore(Stores.ROS1_NOETIC) if is_ros1 else TYPESTORE
    text = store.types['std_msgs/msg/String']('hello')
    serialise = store.serialize_ros1 if is_ros1 else store.serialize_cdr
    data = bytes(serialise(text, 'std_msgs/msg/String'))
    kind = 'std_msgs/String' if is_ros1 else 'std_msgs/msg/String'
    encoding = 'ros1' if is_ros1 else 'cdr'
    path = _write_with_mcap(tmp_path / 'a.mcap', profile, encoding, kind, data)
    with BagReader(path) as bag:
        assert bag.topics == {'/info': 'std_msgs/msg/String'}
        assert [message.data for *_, message in bag.messages(['/info'])] == ['hello']


def test_a_bag_of_ros_1_is_read_with_the_names_of_ros_2(tmp_path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    info = types['sensor_msgs/msg/CameraInfo'](
        header=types['std_msgs/msg/Header'](
            seq=0, stamp=types['builtin_interfaces/msg/Time'](sec=1, nanosec=0), frame_id='c'
        ),
        height=480,
        width=640,
        distortion_model='plumb_bob',
        D=np.zeros(5),
        K=np.arange(9.0),
        R=np.zeros(9),
        P=np.zeros(12),
        binning_x=0,
        binning_y=0,
        roi=types['sensor_msgs/msg/RegionOfInterest'](
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        ),
    )
    path = tmp_path / 'a.bag'
    with Ros1Writer(path) as bag:
        connection = bag.add_connection('/camera_info', info.__msgtype__, typestore=store)
        bag.write(connection, SECOND, store.serialize_ros1(info, info.__msgtype__))
    with BagReader(path) as bag:
        ((_, stamp_ns, message),) = bag.messages(['/camera_info'])
    assert stamp_ns == SECOND
    assert message.k.tolist() == list(range(9))
    assert stamp_ns_of(message) == SECOND


@pytest.mark.parametrize('change', ['qos', 'storage'])
def test_the_metadata_of_a_folder_needs_to_tell_its_files_only(tmp_path, change) -> None:
    folder = write_sqlite3(tmp_path / 'bag', [('/image', 1, raw_image(gradient(), 'rgb8', 1))])
    path = folder / 'metadata.yaml'
    content = yaml.safe_load(path.read_text())
    metadata = content['rosbag2_bagfile_information']
    if change == 'qos':
        for each in metadata['topics_with_message_count']:
            each['topic_metadata']['offered_qos_profiles'] = 'of another writer'
    else:
        metadata['storage_identifier'] = ''
    path.write_text(yaml.safe_dump(content))
    with BagReader(folder) as bag:
        assert len(list(bag.messages(['/image']))) == 1


@pytest.mark.parametrize('name', ['a.mcap.zstd', 'a.MCAP'])
def test_files_may_be_compressed_whole_or_named_in_capitals(tmp_path, name) -> None:
    data = write_mcap(
        tmp_path / 'a.mcap', [('/image', 1, raw_image(gradient(), 'rgb8', 1))]
    ).read_bytes()
    path = tmp_path / name
    path.write_bytes(zstandard.compress(data) if name.endswith('.zstd') else data)
    with BagReader(path) as bag:
        assert len(list(bag.messages(['/image']))) == 1


def test_messages_may_be_compressed_one_by_one(tmp_path) -> None:
    writer = Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer as bag:
        image = raw_image(gradient(), 'rgb8', 1)
        connection = bag.add_connection('/image', image.__msgtype__, typestore=TYPESTORE)
        bag.write(connection, 1, TYPESTORE.serialize_cdr(image, image.__msgtype__))
    for path in (tmp_path / 'bag', next((tmp_path / 'bag').glob('*.db3'))):
        with BagReader(path) as bag:
            ((_, _, message),) = bag.messages(['/image'])
        assert np.array_equal(frame_from_message(message).image_rgb, gradient())


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        ('a: [', 'not usable YAML'),
        ('a: 1', 'does not tell the files'),
        ('rosbag2_bagfile_information: {relative_file_paths: []}', 'names no files'),
        ('rosbag2_bagfile_information: {relative_file_paths: [x.db3]}', 'names x.db3, which'),
    ],
)
def test_metadata_that_tells_no_files_is_one_sentence(tmp_path, text, says) -> None:
    (tmp_path / 'metadata.yaml').write_text(text)
    with pytest.raises(RecordingError, match=rf'{says}.*give the .mcap or .db3 itself'):
        BagReader(tmp_path)


def _mcap_without_channels_in_its_summary() -> bytes:
    def record(opcode: int, *parts: bytes) -> bytes:
        return struct.pack('<BQ', opcode, len(b''.join(parts))) + b''.join(parts)

    def text(value: str) -> bytes:
        return struct.pack('<I', len(value)) + value.encode()

    inside = (
        record(3, struct.pack('<H', 1), text('std_msgs/msg/Empty'), text('ros2msg'), text(''))
        + record(4, struct.pack('<HH', 1, 1), text('/a'), text('cdr'), text(''))
        + record(5, struct.pack('<HIQQ', 1, 0, 1, 1), bytes([0, 1, 0, 0, 0]))
    )
    magic = b'\x89MCAP0\r\n'
    begin = magic + record(1, text('ros2'), text('test'))
    times = struct.pack('<QQ', 1, 1)
    chunk = record(
        6,
        times,
        struct.pack('<QI', len(inside), 0),
        text(''),
        struct.pack('<Q', len(inside)),
        inside,
    )
    index = record(7, struct.pack('<HIQQ', 1, 16, 1, 0))
    data_end = record(15, struct.pack('<I', 0))
    indexed = record(
        *(8, times, struct.pack('<QQ', len(begin), len(chunk))),
        struct.pack('<IHQQ', 10, 1, len(begin + chunk), len(index)),
        *(text(''), struct.pack('<QQ', len(inside), len(inside))),
    )
    start = len(begin + chunk + index + data_end)
    footer = record(2, struct.pack('<QQI', start, 0, 0))
    return begin + chunk + index + data_end + indexed + footer + magic


def test_a_folder_without_a_bag_is_refused(tmp_path) -> None:
    with pytest.raises(RecordingError, match=r'metadata\.yaml'):
        BagReader(tmp_path)
    with pytest.raises(RecordingError, match='does not exist'):
        BagReader(tmp_path / 'nothing.mcap')


@pytest.mark.parametrize(
    ('encoding', 'order'), [('rgb8', [0, 1, 2]), ('bgr8', [2, 1, 0]), ('8UC3', [2, 1, 0])]
)
def test_encodings_and_padded_rows_come_out_as_rgb(encoding, order) -> None:
    picture = gradient()
    message = raw_image(np.ascontiguousarray(picture[:, :, order]), encoding, 1, padding=4)
    np.testing.assert_array_equal(frame_from_message(message).image_rgb, picture)


def test_images_that_cannot_be_used_say_why() -> None:
    depth = raw_image(gradient(), 'rgb8', 1)
    depth.encoding = '32FC1'
    with pytest.raises(ImageError, match='32FC1'):
        frame_from_message(depth)
    short = raw_image(gradient(), 'rgb8', 1)
    short.data = short.data[:-1]
    with pytest.raises(ImageError, match='bytes'):
        frame_from_message(short)
    huge = raw_image(gradient(), 'rgb8', 1)
    huge.height = huge.width = 100_000
    with pytest.raises(ImageError, match='100000'):
        frame_from_message(huge)
    jpeg = jpeg_message(gradient(), 1)
    for length in (0, 1, 10, len(jpeg.data) // 2, len(jpeg.data) - 2):
        cut = jpeg_message(gradient(), 1)
        cut.data = jpeg.data[:length]
        with pytest.raises(ImageError):
            frame_from_message(cut)


@pytest.mark.parametrize(
    ('position', 'turn'),
    [
        ((float('nan'), 0.0, 1.0), (1.0, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, float('inf')), (1.0, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_a_pose_that_is_not_one_is_refused(position, turn) -> None:
    with pytest.raises(VehicleError, match='finite'):
        pose_from_message(pose_stamped(1, position, turn))


def test_a_pipe_named_as_a_bag_is_not_waited_for(tmp_path) -> None:
    os.mkfifo(tmp_path / 'a.mcap')
    with pytest.raises(RecordingError, match='is a device or a pipe'):
        BagReader(tmp_path / 'a.mcap')


def test_a_file_that_unpacks_to_more_than_the_disk_has_is_refused(tmp_path, monkeypatch) -> None:
    (tmp_path / 'a.mcap.zstd').write_bytes(zstandard.ZstdCompressor().compress(bytes(3_000_000)))
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: SimpleNamespace(free=4_000_000))
    with pytest.raises(RecordingError, match='larger than 1 MiB when unpacked'):
        BagReader(tmp_path / 'a.mcap.zstd').__enter__()
