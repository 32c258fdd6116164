# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The recorder node: everything that a replay of the landing needs, into MCAP files.

It runs in a process of its own at a low priority, subscribes without asking for delivery, and
publishes nothing but diagnostics: whatever happens to it, the landing does not notice.
"""

from __future__ import annotations

import os
import platform
import struct
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from peace_ros import __version__
from peace_ros.core.domain import Health, Level
from peace_ros.core.messages import camera_info_topic, diagnostic_values, is_rectified
from peace_ros.core.node_parameters import RECORDER, RecorderParameters, groups_of
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.runtime import run
from peace_ros.recorder.flight_file import DAMAGE, TYPESTORE, Note
from peace_ros.recorder.frames import FrameChoice
from peace_ros.recorder.setting import LandingSetting
from peace_ros.recorder.store import RecordingStore
from peace_ros.recorder.writer import FlightWriter

_NICE = 10
_SMALL_IN = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""A reader that asks for delivery could make a publisher wait."""
_LATCHED_IN = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""/tf_static: what was published before we subscribed counts too."""
_LARGE_IN = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
"""More than one, because this process gets the processor last."""
_NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
"""Events of each subscription would double what waiting for messages costs."""
_TOPICS = {
    'prompt': 'diagnostic_msgs/msg/DiagnosticArray',
    'landing/setpoint': 'geometry_msgs/msg/TwistStamped',
    'landing/site': 'geometry_msgs/msg/PointStamped',
    'landing/pose': 'geometry_msgs/msg/PoseStamped',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    '/parameter_events': 'rcl_interfaces/msg/ParameterEvent',
}
"""Recorded as they come."""
_IMAGE, _COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
_INFO, _STATUS = 'sensor_msgs/msg/CameraInfo', 'landing/status'
_TF_STATIC, _TF = '/tf_static', 'tf2_msgs/msg/TFMessage'
_STAMP = struct.Struct('<iI')
_STAMP_BYTES = slice(4, 12)
"""Of a message with a header: it follows the 4 bytes with which CDR begins."""
_INFO_AGAIN_S = 1.0
_STATE_S = 0.5
"""The state is read so often: to read a status costs more than to record it."""


class RecorderNode(PeaceNode):
    """Subscribes to the topics of one landing and hands their bytes to the writer."""

    def __init__(self, **options: Any) -> None:
        """Begin to record.

        Raises:
            ConfigurationError: a parameter cannot be used.
        """
        super().__init__(RECORDER, *groups_of(RECORDER), **options)
        self._parameters = self.filled(RecorderParameters)
        self._frames = FrameChoice(self._parameters.image_rate)
        self._folder = recordings_folder(self._parameters.recordings)
        self._store = RecordingStore(
            self._folder, self._parameters, lambda sentence: self.say('store', sentence)
        )
        self._writer = FlightWriter(self._store, self._parameters.image_quality, self.fail)
        self._info_at_s, self._info = float('-inf'), b''
        self._state_due_s = 0.0
        self._writer.describe('peace_ros', self._about())
        self._setting = LandingSetting(self, self._writer.describe)
        self._subscribe_all()
        self.diagnostics.add('recording', self._health)
        self.get_logger().info(f'recording into {self._folder}')

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()

    def _about(self) -> dict[str, str]:
        return {
            'version': __version__,
            'machine': platform.platform(),
            'python': platform.python_version(),
            'namespace': self.get_namespace(),
            'image': self.resolve_topic_name('image'),
        }

    def _subscribe_all(self) -> None:
        for topic, kind in _TOPICS.items():
            self._subscribe(topic, kind, _SMALL_IN, self._noting(self._recorded(topic), kind))
        self._subscribe(_STATUS, _TOPICS['prompt'], _SMALL_IN, self._on_status)
        self._subscribe('heatmap', _IMAGE, _LARGE_IN, self._on_heatmap)
        image = self.resolve_topic_name('image')
        # Rectified images keep the word by which they are known as such.
        self._image = '/image_rect' if is_rectified(image) else '/image'
        if self._parameters.image_transport == 'compressed':
            self._subscribe(f'{image}/compressed', _COMPRESSED, _LARGE_IN, self._on_image)
        else:
            self._subscribe(image, _IMAGE, _LARGE_IN, self._on_image)
        self._subscribe(camera_info_topic(image), _INFO, _LARGE_IN, self._on_info)
        self._subscribe(_TF_STATIC, _TF, _LATCHED_IN, self._noting(_TF_STATIC, _TF, latched=True))

    def _subscribe(
        self, topic: str, kind: str, profile: QoSProfile, callback: Callable[[bytes], None]
    ) -> None:
        package, _, name = kind.split('/')
        try:
            message = getattr(import_module(f'{package}.msg'), name)
        except ImportError:
            self.get_logger().info(f'{topic} is not recorded: {package} is not installed')
            return
        self.create_subscription(
            message, topic, callback, profile, raw=True, event_callbacks=_NO_EVENTS
        )

    def _recorded(self, topic: str) -> str:
        """Return the name in the file: that without the namespace of the vehicle."""
        return f'/{topic.lstrip("/")}'

    def _noting(self, name: str, kind: str, *, latched: bool = False) -> Callable[[bytes], None]:
        return lambda cdr: self._writer.put(Note(name, kind, self.clock_ns(), cdr, latched))

    def _on_status(self, cdr: bytes) -> None:
        kind = _TOPICS['prompt']
        self._writer.put(Note(self._recorded(_STATUS), kind, self.clock_ns(), cdr))
        now_s = time.monotonic()
        if now_s >= self._state_due_s:
            self._state_due_s = now_s + _STATE_S
            with suppress(*DAMAGE):
                values = diagnostic_values(TYPESTORE.deserialize_cdr(cdr, kind))
                self._frames.is_engaged = values.get('state', 'IDLE') != 'IDLE'

    def _on_image(self, cdr: bytes) -> None:
        if self._frames.image(_stamp_ns(cdr), cdr, time.monotonic()):
            self._put_image(cdr)

    def _on_heatmap(self, cdr: bytes) -> None:
        wanted, frame = self._frames.heatmap(_stamp_ns(cdr), time.monotonic())
        if wanted:
            self._writer.put(Note('/heatmap', _IMAGE, self.clock_ns(), cdr))
        if frame is not None:
            self._put_image(frame)

    def _put_image(self, cdr: bytes) -> None:
        if self._parameters.image_transport == 'compressed':
            self._writer.put(Note(f'{self._image}/compressed', _COMPRESSED, self.clock_ns(), cdr))
        else:
            self._writer.put_image(Note(self._image, _IMAGE, self.clock_ns(), cdr))

    def _on_info(self, cdr: bytes) -> None:
        """Record a calibration when it changes, and else once per second."""
        now_s = time.monotonic()
        content = cdr[_STAMP_BYTES.stop :]
        if content != self._info or now_s - self._info_at_s >= _INFO_AGAIN_S:
            self._info, self._info_at_s = content, now_s
            self._writer.put(Note('/camera_info', _INFO, self.clock_ns(), cdr))

    def _health(self) -> Health:
        store, writer = self._store, self._writer
        lost = store.lost + writer.dropped + writer.unusable
        values = (
            ('file', str(store.path or '')),
            ('lost', str(store.lost)),
            ('dropped', str(writer.dropped)),
            ('unusable_images', str(writer.unusable)),
        )
        if store.problem:
            return Health(Level.WARN, f'nothing is recorded: {store.problem}', values)
        if writer.dropped:
            self.say('dropped', f'{writer.dropped} messages found the disk too slow: not recorded')
        if lost:
            return Health(Level.WARN, f'{lost} messages were not recorded', values)
        return Health(Level.OK, 'recording', values)


def recordings_folder(given: str) -> Path:
    """Return the folder of the recordings; without one that of ROS, as its logs."""
    if given:
        return Path(given).expanduser()
    return Path(os.environ.get('ROS_HOME') or '~/.ros').expanduser() / 'peace_ros'


def _stamp_ns(cdr: bytes) -> int:
    """Return the header stamp of a serialised message."""
    seconds, nanoseconds = _STAMP.unpack(cdr[_STAMP_BYTES])
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    with suppress(OSError):
        os.nice(_NICE)
    return run(RecorderNode, args)


if __name__ == '__main__':
    sys.exit(main())
