# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""/diagnostics of the nodes, as the aggregator wants it, and what prevents engaging."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.prompt_generator import PromptGeneratorNode


def test_silence_is_reported_once_per_second_with_names_for_the_aggregator(bench):
    arrays = bench.heard(DiagnosticArray, '/diagnostics', qos.RESULT)
    bench.run(partial(PromptGeneratorNode, namespace='/drone_1'), template='D')
    bench.until(lambda: len(arrays) >= 5)
    status = next(each for each in arrays[-1].status if each.name.endswith(': image'))
    assert status.name == 'drone_1/prompt_generator: image'
    assert status.hardware_id
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith('no image on /drone_1/image for ')
    stamps = [each.header.stamp.sec + each.header.stamp.nanosec * 1e-9 for each in arrays]
    assert np.median(np.diff(stamps)) == pytest.approx(1.0, abs=0.3)


def test_a_frame_without_a_stamp_is_an_error(bench, picture):
    found = bench.findings('image')
    bench.run(PromptGeneratorNode, template='D')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    bench.until(
        lambda: bool(found) and 'behind the clock' in found[-1].message,
        lambda: images.publish(picture(0)),
    )
    assert found[-1].level == DiagnosticStatus.ERROR


@pytest.fixture
def ready(bench):
    """Return a landing node that could begin, what it reports, and what keeps it so."""
    found = bench.findings('landing')
    node = bench.run(LandingNode, interface='twist')
    see = bench.offer_safe_ground(node, 40.0)
    bench.until(lambda: not node.check_engagement(), see)
    return node, found, see


def test_the_level_of_the_landing_is_its_readiness(bench, ready):
    _, found, see = ready
    bench.until(lambda: bool(found) and found[-1].message == 'IDLE, ready', see)
    assert found[-1].level == DiagnosticStatus.OK
    bench.until(lambda: 'not ready' in found[-1].message)
    assert found[-1].level == DiagnosticStatus.WARN


@pytest.mark.parametrize(
    ('kind', 'topic'),
    [
        (Image, 'image'),
        (CameraInfo, 'camera_info'),
        (DiagnosticArray, 'prompt'),
        (Image, 'heatmap'),
        (CameraInfo, 'heatmap/frame_info'),
        (PoseStamped, 'pose'),
        (DiagnosticArray, 'landing/status'),
    ],
)
def test_nothing_is_engaged_while_a_topic_has_two_publishers(bench, ready, kind, topic):
    node, found, see = ready
    intruders = [bench.peer.create_publisher(kind, topic, 1)]
    if topic in {'image', 'camera_info', 'prompt'}:
        intruders.append(bench.peer.create_publisher(kind, topic, 1))
    bench.until(lambda: f'publishers of /{topic}' in node.check_engagement(), see)
    bench.until(lambda: bool(found) and 'nothing is engaged' in found[-1].message, see)
    assert found[-1].level == DiagnosticStatus.ERROR
    for intruder in intruders:
        bench.peer.destroy_publisher(intruder)
    bench.until(lambda: not node.check_engagement(), see)


def test_the_topics_of_a_remapped_camera_count_under_their_own_names(bench):
    node = LandingNode(
        cli_args=['--ros-args', '-r', 'image:=/belly/image_raw'],
        parameter_overrides=[Parameter('interface', value='twist')],
    )
    bench.spin(node)
    try:
        for kind, topic in (
            (CompressedImage, '/belly/image_raw/compressed'),
            (CameraInfo, '/belly/camera_info'),
        ):
            pair = [bench.peer.create_publisher(kind, topic, 1) for _ in range(2)]
            bench.until(lambda topic=topic: f'2 publishers of {topic}' in node.check_engagement())
            for each in pair:
                bench.peer.destroy_publisher(each)
            bench.until(lambda: 'publishers' not in node.check_engagement())
    finally:
        node.close()
