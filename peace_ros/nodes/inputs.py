# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How nodes subscribe to images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CompressedImage, Image

from peace_ros.nodes.qos import IMAGE_IN

ImageMessage = Any
"""An Image or a CompressedImage; rclpy's messages have no types to check."""


def subscribe_images(node: Node, transport: str, callback: Callable[[ImageMessage], None]) -> None:
    """Subscribe to ``image`` (transport raw) or ``image/compressed`` (transport compressed).

    The reliability may be overridden by the ROS parameters ``qos_overrides.<topic>...``.
    """
    kind, topic = (
        (CompressedImage, 'image/compressed') if transport == 'compressed' else (Image, 'image')
    )
    node.create_subscription(
        kind,
        topic,
        callback,
        IMAGE_IN,
        qos_overriding_options=QoSOverridingOptions.with_default_policies(),
    )
