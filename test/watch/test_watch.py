# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The watch node hears standard topics, takes pictures only for viewers, and asks by services."""

from __future__ import annotations

import http.client
import importlib.util
import json
import stat
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage
from std_srvs.srv import Trigger
from websockets.sync.client import connect

from peace_ros.core.domain import Camera, ConfigurationError, Pose
from peace_ros.nodes import qos
from peace_ros.nodes.messages import (
    camera_info,
    diagnostic_array,
    jpeg_message,
    pose_to_message,
)
from peace_ros.watch.watch import WatchNode, map_png

_PATH = Path(__file__).parents[1] / 'nodes' / 'conftest.py'
_SPEC = importlib.util.spec_from_file_location('shared_fixtures', _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_FIXTURES = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_FIXTURES)
ros, bench = _FIXTURES.ros, _FIXTURES.bench

SIZE = (400, 400)


@pytest.fixture
def watch(bench):
    return bench.run(WatchNode, port=0)


def say_status(bench, scenes, scene):
    publisher = bench.offer(DiagnosticArray, 'landing/status', qos.RESULT)
    pairs = scenes.status_of(scene).items()
    publisher.publish(
        diagnostic_array(
            bench.peer.get_clock().now().nanoseconds, 'landing/status', b'\x00', scene, pairs
        )
    )


def test_hears_the_status(bench, watch, scenes):
    say_status(bench, scenes, 'aiming')
    bench.until(lambda: watch.ledger.snapshot(time.monotonic())['state'] == 'AIMING')
    assert watch.ledger.snapshot(time.monotonic())['site']['clearance_m'] == 9.3


def test_pictures_are_taken_only_while_somebody_looks(bench, watch, scenes):
    for topic in ('overlay/compressed', 'landing/map', 'landing/pose'):
        assert bench.peer.count_subscribers(topic) == 0
    overlay = bench.peer.create_publisher(CompressedImage, 'overlay/compressed', qos.IMAGE_OUT)
    infos = bench.peer.create_publisher(CameraInfo, 'heatmap/frame_info', qos.RESULT)
    poses = bench.peer.create_publisher(PoseStamped, 'landing/pose', qos.RESULT)
    say_status(bench, scenes, 'aiming')
    with watch.ledger.lock:
        names = ('mount_roll', 'mount_pitch', 'mount_yaw', 'mount_x', 'mount_y', 'mount_z')
        watch.ledger.parameters = {'mount_source': 'parameters', **dict.fromkeys(names, 0.0)}
    camera = Camera.from_degrees(*SIZE, 90.0)
    with connect(f'ws://127.0.0.1:{watch.port}/live', origin=watch.origin) as viewer:
        bench.until(lambda: bench.peer.count_subscribers('overlay/compressed') == 1)
        bench.until(lambda: poses.get_subscription_count() and infos.get_subscription_count())
        at_ns = bench.peer.get_clock().now().nanoseconds
        poses.publish(pose_to_message(Pose(at_ns, 38.0, 16.0, -60.0, (1.0, 0, 0, 0), 60.0)))
        infos.publish(camera_info(SIZE, camera, at_ns, 'optical'))
        bench.until(lambda: watch.ledger.poses and watch.has_frame_info(at_ns))
        overlay.publish(jpeg_message(np.zeros((400, 400, 3), np.uint8), at_ns))
        while not isinstance(packed := viewer.recv(timeout=10), bytes):
            pass
        length = int.from_bytes(packed[:4], 'big')
        marks = {each['kind']: each for each in json.loads(packed[4 : 4 + length])['marks']}
        assert marks['site']['middle'] == pytest.approx([0.5, 0.5], abs=0.01)
    bench.until(lambda: bench.peer.count_subscribers('overlay/compressed') == 0)


def test_the_map_is_north_up_green_where_safe_and_clear_where_unknown():
    cells = np.array([[0, 100], [-1, 50]], np.int8)
    picture = cv2.imdecode(np.frombuffer(map_png(cells), np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (2, 2, 4)
    assert picture[0, 0, 3] == 0, 'unknown, in the north'
    blue, green, red, opaque = picture[1, 0].tolist()
    assert (green > red, green > blue, opaque) == (True, True, 255)
    blue, green, red, _ = picture[1, 1].tolist()
    assert red > green


def test_a_map_reaches_the_ledger_with_where_it_lies(bench, watch):
    grid = OccupancyGrid()
    grid.info.resolution, grid.info.width, grid.info.height = 0.5, 4, 2
    grid.info.origin.position.x, grid.info.origin.position.y = -3.0, 7.0
    grid.data = [0] * 8
    watch._on_map(grid)
    assert watch.ledger.ground.meta == {
        'west_m': -3.0,
        'south_m': 7.0,
        'width_m': 2.0,
        'height_m': 1.0,
    }


def test_messages_that_cannot_be_used_are_said_and_end_nothing(watch, capfd):
    grid = OccupancyGrid()
    grid.info.width, grid.info.height, grid.data = 4, 2, [0] * 7
    watch._on_map(grid)
    pose = PoseStamped()
    pose.pose.orientation.w = 0.0  # a quaternion of length 0
    watch._on_pose(pose)
    watch._on_prompt(DiagnosticArray())
    assert watch.ledger.ground is None
    assert watch.ledger.poses == []
    told = capfd.readouterr().err
    assert 'a map of 4 x 2 cells with 7 values' in told
    assert 'template' in told


def test_an_answer_that_comes_after_the_page_gave_up_is_dropped(bench, watch):
    asked = threading.Event()

    def late(_request, response):
        asked.wait(10.0)
        response.success = True
        return response

    node = Node('landing')
    node.create_service(Trigger, 'landing/engage', late)
    bench.spin(node)
    bench.until(watch._commands['engage'].service_is_ready)
    answer = watch.command('engage')
    assert answer.cancel()
    asked.set()
    bench.until(lambda: not watch._commands['engage']._pending_requests)
    assert watch.failure is None
    node.destroy_node()


def test_a_command_reaches_the_service_and_its_sentence_comes_back(bench, watch):
    def refuse(_request, response):
        response.success, response.message = False, 'no heatmap has arrived'
        return response

    node = Node('landing')
    node.create_service(Trigger, 'landing/engage', refuse)
    bench.spin(node)
    bench.until(lambda: watch.command('engage').result(timeout=5)[1] == 'no heatmap has arrived')
    node.destroy_node()


def test_without_a_landing_node_a_command_says_so(watch):
    done, sentence = watch.command('disengage').result(timeout=5)
    assert not done
    assert 'does the landing node run?' in sentence


def test_the_address_is_in_a_file_for_its_owner_only(bench, tmp_path):
    path = tmp_path / 'url'
    path.write_text('older')
    path.chmod(0o644)
    watch = bench.run(WatchNode, port=0, url_file=str(path))
    assert path.read_text().strip() == watch.url
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    connection = http.client.HTTPConnection('127.0.0.1', watch.port)
    connection.request('GET', '/')
    assert connection.getresponse().status == 200


def test_an_address_file_that_cannot_be_written_is_refused(bench, tmp_path):
    with pytest.raises(ConfigurationError, match='cannot be written'):
        bench.run(WatchNode, port=0, url_file=str(tmp_path / 'missing' / 'url'))
