# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node of the demo: hears every topic, records it, and calls the landing node's service."""

from __future__ import annotations

import struct
import threading
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, TwistStamped
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.domain import Frame, PeaceError, Pose
from peace_ros.core.messages import (
    diagnostic_values,
    frame_from_message,
    heatmap_from_image,
    pose_from_message,
    stamp_ns_of,
)
from peace_ros.nodes import qos
from peace_ros.recording import BagWriter
from peace_ros.recording.messages import jpeg_message
from peace_ros.simulation.demo.history import History, Status
from peace_ros.simulation.demo.listener import Listener

IMAGE, PROMPT, HEATMAP = '/image', '/prompt', '/heatmap'
STATUS, POSE = '/landing/status', '/ground_truth/pose'
CAMERA_POSE = '/pose'
"""What the camera follows when it is not the ground truth of our own autopilot."""
IMAGE_IN_BAG = '/image/compressed'
_KEPT_FRAMES = 40
"""Frames whose heatmap may still come."""
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_CDR_STAMP = struct.Struct('<iI')


@dataclass(frozen=True)
class _RecordedTopic:
    name: str
    message: Any
    type_name: str
    profile: QoSProfile


_RECORDED = (
    _RecordedTopic('/camera_info', CameraInfo, 'sensor_msgs/msg/CameraInfo', qos.RESULT),
    _RecordedTopic(PROMPT, DiagnosticArray, 'diagnostic_msgs/msg/DiagnosticArray', qos.RESULT),
    _RecordedTopic(HEATMAP, Image, 'sensor_msgs/msg/Image', qos.IMAGE_IN),
    _RecordedTopic(
        '/overlay/compressed', CompressedImage, 'sensor_msgs/msg/CompressedImage', qos.IMAGE_IN
    ),
    _RecordedTopic(STATUS, DiagnosticArray, 'diagnostic_msgs/msg/DiagnosticArray', qos.RESULT),
    _RecordedTopic('/landing/setpoint', TwistStamped, 'geometry_msgs/msg/TwistStamped', qos.RESULT),
    _RecordedTopic('/landing/site', PointStamped, 'geometry_msgs/msg/PointStamped', qos.RESULT),
    _RecordedTopic(POSE, PoseStamped, 'geometry_msgs/msg/PoseStamped', qos.POSE),
    _RecordedTopic(CAMERA_POSE, PoseStamped, 'geometry_msgs/msg/PoseStamped', qos.POSE),
)


class Monitor(Listener):
    """Spins in a thread of its own; everything it knows is read under :attr:`lock`."""

    def __init__(self, writer: BagWriter, *, use_sim_time: bool) -> None:
        self.lock = threading.Lock()
        self.history = History()
        self.counts: Counter[str] = Counter()
        """Topic -> messages heard."""
        self._writer = writer
        self._last_bag_ns = 0
        super().__init__('demo_monitor', use_sim_time=use_sim_time)
        for topic in _RECORDED:
            writer.add_topic(topic.name, topic.type_name)
            self._subscribe(topic)
        writer.add_topic(IMAGE_IN_BAG, 'sensor_msgs/msg/CompressedImage')
        self._waiting: OrderedDict[int, bytes] = OrderedDict()
        self.node.create_subscription(
            Image, IMAGE, self._guarded(self._on_image), qos.IMAGE_IN, raw=True
        )
        self.start()

    def clock_ns(self) -> int:
        """Return the node clock."""
        return int(self.node.get_clock().now().nanoseconds)

    def heard(self, topic: str) -> int:
        """Return how many messages came on a topic."""
        with self.lock:
            return self.counts[topic]

    def engage(self, limit_s: float) -> None:
        """Ask the landing node to take over, and note when it did."""
        super().engage(limit_s)
        with self.lock:
            self.history.engaged_ns = self.clock_ns()

    def _subscribe(self, topic: _RecordedTopic) -> None:
        handle = {
            PROMPT: self._on_prompt,
            HEATMAP: self._on_heatmap,
            STATUS: self._on_status,
            POSE: self._on_pose,
            CAMERA_POSE: self._on_pose,
        }.get(topic.name)

        def store(raw: bytes) -> None:
            self._writer.write_raw(topic.name, self._bag_ns(), raw)
            message = deserialize_message(raw, topic.message) if handle is not None else None
            with self.lock:
                self.counts[topic.name] += 1
                if handle is not None:
                    handle(message)

        self.node.create_subscription(
            topic.message, topic.name, self._guarded(store), topic.profile, raw=True
        )

    def _guarded(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Keep the first failure for the main thread; a full disk must end the demo."""

        def call(message: Any) -> None:
            try:
                callback(message)
            except PeaceError as error:
                self.failure = self.failure or error

        return call

    def _bag_ns(self) -> int:
        """Return the node clock, never running backwards (it starts at 0 before /clock comes)."""
        self._last_bag_ns = max(self._last_bag_ns, self.clock_ns())
        return self._last_bag_ns

    def _on_image(self, raw: bytes) -> None:
        """Keep the bytes until a heatmap asks for them: most frames are never looked at."""
        self._waiting[_stamp_ns_of_raw(raw)] = raw
        while len(self._waiting) > _KEPT_FRAMES:
            self._waiting.popitem(last=False)
        with self.lock:
            self.counts[IMAGE] += 1

    def _frame_of(self, at_ns: int) -> Frame | None:
        """Return the frame with a stamp and record it; None when it was not heard."""
        raw = self._waiting.pop(at_ns, None)
        if raw is None:
            return None
        frame = frame_from_message(deserialize_message(raw, Image))
        self._writer.write(IMAGE_IN_BAG, self._bag_ns(), jpeg_message(frame.image_rgb, at_ns))
        return frame

    def _on_prompt(self, message: Any) -> None:
        template = diagnostic_values(message).get('template', '')
        if template:
            self.history.add_prompt(template)

    def _on_heatmap(self, message: Any) -> None:
        heatmap = heatmap_from_image(message)
        levels = np.rint(heatmap.safety * 255.0).astype(np.uint8)
        frame = self._frame_of(heatmap.stamp_ns)
        self.history.add_heatmap(
            heatmap.stamp_ns, levels, None if frame is None else frame.image_rgb
        )

    def _on_status(self, message: Any) -> None:
        sentence = message.status[0].message if message.status else ''
        status = Status(stamp_ns_of(message), diagnostic_values(message), sentence)
        self.history.add_status(status)
        if not self.counts[POSE] and not self.counts[CAMERA_POSE]:
            self._add_reported_pose(status)

    def _add_reported_pose(self, status: Status) -> None:
        """Use the pose that the autopilot reports, where no better one is published."""
        north_m, east_m = status.number('north_m'), status.number('east_m')
        altitude_m = status.number('altitude_agl_m')
        if north_m is not None and east_m is not None and altitude_m is not None:
            self.history.add_pose(
                Pose(status.stamp_ns, north_m, east_m, -altitude_m, _LEVEL, altitude_m)
            )

    def _on_pose(self, message: Any) -> None:
        self.history.add_pose(pose_from_message(message))


def _stamp_ns_of_raw(raw: bytes) -> int:
    """Return the header stamp of a serialised message: it follows 4 bytes of CDR header."""
    seconds, nanoseconds = _CDR_STAMP.unpack_from(raw, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)
