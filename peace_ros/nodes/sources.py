# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of a landing that must have one publisher at most: whose data decide must be known."""

from __future__ import annotations

from rclpy.node import Node

from peace_ros.core.health import too_many
from peace_ros.core.messages import camera_info_topic
from peace_ros.nodes.images import FRAME_INFO


class Sources:
    """Counts the publishers of each topic that a landing rests on, by their full names.

    Args:
        node: resolves the names as they are remapped, and counts.
        poses: the pose of the vehicle comes over the topic ``pose``.
    """

    def __init__(self, node: Node, *, poses: bool) -> None:
        self._node = node
        image = node.resolve_topic_name('image')
        topics = [image, f'{image}/compressed', camera_info_topic(image)]
        topics += ['prompt', 'heatmap', FRAME_INFO, *(['pose'] if poses else [])]
        self._data = tuple(dict.fromkeys(map(node.resolve_topic_name, topics)))
        self._status = node.resolve_topic_name('landing/status')

    @property
    def problem(self) -> str:
        """Which topic has several publishers, so that its data must not be used; else empty."""
        return self._several(*self._data)

    @property
    def engagement_problem(self) -> str:
        """The same, or that another landing node is there; empty when a landing may begin."""
        return self._several(*self._data, self._status)

    def _several(self, *topics: str) -> str:
        for topic in topics:
            if (count := self._node.count_publishers(topic)) > 1:
                return too_many(topic, count)
        return ''
