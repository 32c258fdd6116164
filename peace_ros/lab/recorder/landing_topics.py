# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The topics of a landing without the landing, at their usual rates."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import final

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image

from peace_ros.core.domain import Camera, Heatmap, Pose, Prompt, RecordingError, Setpoint
from peace_ros.core.threads import GuardedThread
from peace_ros.nodes import qos
from peace_ros.nodes.messages import (
    OK,
    camera_info,
    diagnostic_array,
    heatmap_to_image,
    image_message,
    pose_to_message,
    prompt_to_message,
    setpoint_to_twist_stamped,
)
from peace_ros.recording import BagReader
from peace_ros.simulation.world import draw_world

WIDTH, HEIGHT = 640, 480
IMAGE_HZ, STATUS_HZ, POSE_HZ = 5.0, 10.0, 25.0
_CAMERA = Camera.from_degrees(WIDTH, HEIGHT, 73.0)
_NETWORK_PX = 352
_WORLD_M, _GSD_M = 200.0, 0.15
_STOP_S = 10.0
_FRAMES = '/image/compressed'


@final
class LandingTopics:
    """A node that publishes what a landing does, moving over a drawn world."""

    def __init__(self) -> None:
        rclpy.init(args=[], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        self._world = draw_world(1, _WORLD_M, _GSD_M).image_rgb
        node = self._node = Node('landing_topics')
        self._image = node.create_publisher(Image, 'image', qos.IMAGE_OUT)
        self._info = node.create_publisher(CameraInfo, 'camera_info', qos.IMAGE_OUT)
        self._heatmap = node.create_publisher(Image, 'heatmap', qos.IMAGE_OUT)
        self._prompt = node.create_publisher(DiagnosticArray, 'prompt', qos.RESULT)
        self._status = node.create_publisher(DiagnosticArray, 'landing/status', qos.RESULT)
        self._setpoint = node.create_publisher(TwistStamped, 'landing/setpoint', qos.RESULT)
        self._pose = node.create_publisher(PoseStamped, 'landing/pose', qos.RESULT)
        self._count = 0
        for hertz, publish in (
            (IMAGE_HZ, self._publish_frame),
            (STATUS_HZ, self._publish_status),
            (POSE_HZ, self._publish_motion),
        ):
            node.create_timer(1.0 / hertz, publish)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._thread = GuardedThread(self._executor.spin, 'landing_topics')

    def __enter__(self) -> LandingTopics:
        """Begin to publish."""
        self._thread.start()
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        """Stop."""
        self._executor.shutdown()
        rclpy.try_shutdown()
        self._thread.join(timeout=_STOP_S)

    def _now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def _publish_frame(self) -> None:
        at_ns, self._count = self._now_ns(), self._count + 1
        top, left = (5 * self._count) % (len(self._world) - HEIGHT), 2 * self._count % 500
        view = np.ascontiguousarray(self._world[top : top + HEIGHT, left : left + WIDTH])
        self._info.publish(camera_info((WIDTH, HEIGHT), _CAMERA, at_ns, 'camera'))
        self._image.publish(image_message(view, 'rgb8', at_ns))
        self._prompt.publish(prompt_to_message(Prompt('A photo of {term}.', at_ns)))
        green = view[:_NETWORK_PX, :_NETWORK_PX, 1].astype(np.float32) / 255.0
        self._heatmap.publish(heatmap_to_image(Heatmap(green, at_ns)))

    def _publish_status(self) -> None:
        pairs = [('state', 'SEARCHING'), *((f'value_{k}', f'{k / 7:.3f}') for k in range(40))]
        status = diagnostic_array(self._now_ns(), 'landing/status', OK, 'SEARCHING', pairs)
        self._status.publish(status)

    def _publish_motion(self) -> None:
        at_ns = self._now_ns()
        level = Pose(at_ns, 0.1 * self._count, 0.0, -80.0, (1.0, 0.0, 0.0, 0.0), 80.0)
        self._pose.publish(pose_to_message(level))
        self._setpoint.publish(setpoint_to_twist_stamped(Setpoint(at_ns, 1.0), at_ns))


@contextmanager
def recorder_process(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run the recorder node as a process of its own, and end it.

    Args:
        folder: of the recordings; the log of the process lies beside it.
        arguments: further ones after ``--ros-args``.
    """
    command: Sequence[str] = (
        *(sys.executable, '-m', 'peace_ros.recorder.recorder', '--ros-args'),
        *('-p', f'recordings:={folder}', '-p', 'least_free_mb:=0', *arguments),
    )
    folder.parent.mkdir(parents=True, exist_ok=True)
    with folder.with_suffix('.log').open('ab') as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, env=dict(os.environ))
        try:
            yield process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            try:
                process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def newest_recording(folder: Path, wait_s: float) -> Path | None:
    """Return the newest recording of a folder that holds a frame, None after a time."""
    until_s = time.monotonic() + wait_s
    while time.monotonic() < until_s:
        found = sorted(folder.glob('*.mcap'))
        if found and _holds_frames(found[-1]):
            return found[-1]
        time.sleep(0.1)
    return None


def _holds_frames(path: Path) -> bool:
    try:
        with BagReader(path) as bag:
            return bag.count(_FRAMES) > 0
    except RecordingError:
        return False  # it has just begun
