# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How nodes subscribe to images, and to the ``camera_info`` beside them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.camera_infos import CameraInfos
from peace_ros.core.domain import Camera, Frame
from peace_ros.core.messages import (
    camera_info_topic,
    frame_from_message,
    is_rectified,
    stamp_ns_of,
)
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import IMAGE_IN

FRAME_INFO = 'heatmap/frame_info'
"""CameraInfo of the frame that the heatmap of this stamp covers: its size is that of the frame, and
K is 0 where the frame is not calibrated."""

ImageMessage = Any
"""An Image or a CompressedImage; rclpy's messages have no types to check."""


def subscribe_images(node: Node, transport: str, callback: Callable[[ImageMessage], None]) -> str:
    """Subscribe to ``image`` (transport raw) or its ``/compressed``; return the name of ``image``.

    As with image_transport, ``image`` is the name that is remapped, whatever the transport. The
    reliability may be overridden by the ROS parameters ``qos_overrides.<topic>...``.
    """
    base: str = node.resolve_topic_name('image')
    kind, topic = (
        (CompressedImage, f'{base}/compressed') if transport == 'compressed' else (Image, base)
    )
    node.create_subscription(
        kind,
        topic,
        callback,
        IMAGE_IN,
        qos_overriding_options=QoSOverridingOptions.with_default_policies(),
    )
    return base


class CalibratedImages:
    """Images, and the ``camera_info`` beside them.

    Args:
        node: Subscribes, and says when the camera changes.
        transport: As for :func:`subscribe_images`.
        callback: Gets each image message.
    """

    def __init__(
        self, node: PeaceNode, transport: str, callback: Callable[[ImageMessage], None]
    ) -> None:
        self._node = node
        self._camera: Camera | None = None
        self._topic = subscribe_images(node, transport, callback)
        topic = camera_info_topic(self._topic)
        self._infos = CameraInfos(node.resolve_topic_name(topic))
        self._arrived = node.diagnostics.watch(topic, unless=self._is_without)
        node.create_subscription(CameraInfo, topic, self._on_info, IMAGE_IN)

    def _is_without(self) -> str:
        return 'none: camera_width, camera_height and camera_fov count' * self._infos.is_empty

    def _on_info(self, message: CameraInfo) -> None:
        self._arrived(stamp_ns_of(message))
        self._infos.add(message, time.monotonic())

    def frame(self, message: ImageMessage) -> Frame:
        """Return the frame of an image, with its camera; PeaceError says what is wrong."""
        info = self._infos.of(stamp_ns_of(message), time.monotonic())
        frame = frame_from_message(message, info, rectified=is_rectified(self._topic))
        before, self._camera = self._camera, frame.camera
        if before is not None and frame.camera is not None and before != frame.camera:
            size, focal_px = ' x '.join(map(str, frame.size_px)), frame.camera.focal_px
            now = f'{size} px, focal length {focal_px:.1f} px'
            self._node.say('camera', f'camera_info has changed: {now}')
        return frame
