# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How nodes subscribe to images, and what the landing node hears."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CompressedImage, Image

from peace_ros.core.domain import PeaceError
from peace_ros.core.landing import LandingCore
from peace_ros.core.messages import (
    depth_from_image,
    frame_from_message,
    heatmap_from_image,
    stamp_ns_of,
)
from peace_ros.core.node_parameters import LandingOptions
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import IMAGE_IN

_WAITING = 4
"""Messages that are kept until the next step; older ones are dropped."""

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


class LandingInputs:
    """Heatmaps, and where they are given depth images and pictures: callbacks only store.

    Args:
        node: Subscribes, and says what is refused.
        options: Whether pictures are asked for.
    """

    def __init__(self, node: PeaceNode, options: LandingOptions) -> None:
        self._node = node
        self._heatmaps: deque[Image] = deque(maxlen=_WAITING)
        self._depths: deque[Image] = deque(maxlen=_WAITING)
        self._images: deque[ImageMessage] = deque(maxlen=_WAITING)
        self._heatmap_arrived = node.diagnostics.watch('heatmap')
        node.create_subscription(Image, 'heatmap', self._on_heatmap, IMAGE_IN)
        node.create_subscription(Image, 'depth', self._on_depth, IMAGE_IN)
        if options.registration:
            subscribe_images(node, options.image_transport, self._on_image)

    def _on_heatmap(self, message: Image) -> None:
        self._heatmap_arrived(stamp_ns_of(message))
        self._heatmaps.append(message)

    def _on_depth(self, message: Image) -> None:
        self._depths.append(message)

    def _on_image(self, message: ImageMessage) -> None:
        self._images.append(message)

    def feed(self, core: LandingCore) -> None:
        """Hand on what has come since the last call; what cannot be read is said and dropped."""
        inputs: tuple[tuple[str, deque[Any], Callable[[Any], None]], ...] = (
            ('image', self._images, lambda each: core.add_view(frame_from_message(each))),
            ('depth', self._depths, lambda each: core.add_depth(depth_from_image(each))),
            ('heatmap', self._heatmaps, lambda each: core.add_heatmap(heatmap_from_image(each))),
        )
        for name, waiting, hand_on in inputs:
            while waiting:
                self._hand_on(name, waiting.popleft(), hand_on)

    def _hand_on(self, name: str, message: Any, hand_on: Callable[[Any], None]) -> None:
        try:
            hand_on(message)
        except PeaceError as error:
            self._node.say(name, f'{name} refused: {error}')
