# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The recorder node: what flows on the topics is in the file, under names that a replay knows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from mcap.reader import make_reader
from mcap.stream_reader import MAGIC_SIZE
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.messages import stamp_ns_of
from peace_ros.nodes import qos
from peace_ros.nodes.messages import (
    OK,
    camera_info,
    diagnostic_array,
    jpeg_message,
    pose_to_message,
)
from peace_ros.nodes.prompt_generator import PromptGeneratorNode
from peace_ros.recorder.recorder import RecorderNode, recordings_folder
from peace_ros.recording import BagReader

SECOND = 1_000_000_000


def recorder(bench, folder: Path, **parameters) -> RecorderNode:
    return bench.run(RecorderNode, recordings=str(folder), least_free_mb=0, **parameters)


def file_of(folder: Path) -> Path:
    (path,) = folder.glob('*.mcap')
    return path


def topics_of(folder: Path) -> dict[str, int]:
    if file_of(folder).stat().st_size < MAGIC_SIZE:
        return {}  # just begun
    with BagReader(file_of(folder)) as bag:
        return {topic: bag.count(topic) for topic in bag.topics}


def test_a_landing_is_recorded_with_its_frames_and_parameters(bench, tmp_path, picture) -> None:
    node = recorder(bench, tmp_path)
    bench.run(PromptGeneratorNode, template='DD')
    status = bench.offer(DiagnosticArray, 'landing/status', qos.RESULT)
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    infos = bench.offer(CameraInfo, 'camera_info', qos.IMAGE_OUT)
    poses = bench.offer(PoseStamped, 'landing/pose', qos.RESULT)
    camera = Camera.from_degrees(64, 48, 73.0)
    count = 0

    def fly() -> None:
        nonlocal count
        count += 1
        at_ns = count * SECOND
        pairs = [('state', 'SEARCHING')]
        status.publish(diagnostic_array(at_ns, 'landing/status', OK, 'SEARCHING', pairs))
        infos.publish(camera_info((64, 48), camera, at_ns, 'optical'))
        images.publish(picture(at_ns))
        poses.publish(pose_to_message(Pose(at_ns, 0.0, 0.0, -50.0, (1.0, 0.0, 0.0, 0.0), 50.0)))

    def metadata() -> dict[str, dict[str, str]]:
        with file_of(tmp_path).open('rb') as stream:
            return {each.name: each.metadata for each in make_reader(stream).iter_metadata()}

    wanted = {'/landing/status', '/image/compressed', '/camera_info', '/landing/pose'}
    bench.until(
        lambda: list(tmp_path.glob('*.mcap')) != [] and wanted <= {*topics_of(tmp_path)}, fly
    )
    bench.until(lambda: not node._setting._clients.get('prompt_generator'), fly)
    node.close()
    counts = topics_of(tmp_path)
    assert counts['/landing/status'] > counts['/camera_info'], 'a calibration once per second'
    with BagReader(file_of(tmp_path)) as bag:
        frames = [message for _, _, message in bag.messages(['/image/compressed'])]
        assert [stamp_ns_of(each) % SECOND for each in frames] == [0] * len(frames)
        assert next(bag.messages(['/landing/pose']))[2].pose.position.z == 50.0
    told = metadata()
    assert {'peace_ros', 'parameters/prompt_generator'} <= {*told}
    assert told['peace_ros']['image'] == '/image'
    given = yaml.safe_load(told['parameters/prompt_generator']['yaml'])
    assert given['/**/prompt_generator']['ros__parameters']['template'] == 'DD'


def test_compressed_and_rectified_images_of_a_namespace_keep_what_a_replay_needs(
    bench, tmp_path
) -> None:
    node = bench.run(
        lambda **options: RecorderNode(
            namespace='/drone_1',
            cli_args=['--ros-args', '-r', 'image:=image_rect'],
            **options,
        ),
        recordings=str(tmp_path),
        least_free_mb=0,
        image_transport='compressed',
    )
    images = bench.offer(CompressedImage, '/drone_1/image_rect/compressed', qos.IMAGE_OUT)
    prompts = bench.offer(DiagnosticArray, '/drone_1/prompt', qos.RESULT)
    message = jpeg_message(np.zeros((8, 8, 3), np.uint8), SECOND)

    def fly() -> None:
        images.publish(message)
        prompts.publish(diagnostic_array(SECOND, 'prompt', OK, 'x', []))

    wanted = {'/image_rect/compressed', '/prompt'}
    bench.until(
        lambda: list(tmp_path.glob('*.mcap')) != [] and wanted <= {*topics_of(tmp_path)}, fly
    )
    node.close()
    with BagReader(file_of(tmp_path)) as bag:
        _, _, found = next(bag.messages(['/image_rect/compressed']))
    assert found.data.tobytes() == message.data.tobytes()


def test_a_folder_that_cannot_be_used_is_a_finding_and_no_end(bench, tmp_path) -> None:
    (tmp_path / 'file').write_text('in the way')
    found = bench.findings('recording')
    node = recorder(bench, tmp_path / 'file' / 'recordings')
    bench.until(lambda: any('nothing is recorded' in each.message for each in found))
    assert node.failure is None
    assert any('Not a directory' in each.message for each in found)


@pytest.mark.parametrize(
    ('given', 'ros_home', 'folder'),
    [
        ('/data/flights', '/ros', '/data/flights'),
        ('', '/ros', '/ros/peace_ros'),
        ('', '', '/home/pilot/.ros/peace_ros'),
    ],
)
def test_where_recordings_go(monkeypatch, given, ros_home, folder) -> None:
    monkeypatch.setenv('HOME', '/home/pilot')
    monkeypatch.setenv('ROS_HOME', ros_home)
    assert recordings_folder(given) == Path(folder)
