# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""For people who look: the map, places, pose and path of a landing, at a low rate.

Nothing that flies depends on it. What nobody subscribes to is not made.
"""

from __future__ import annotations

import time
from collections import deque
from importlib import import_module
from math import isfinite
from typing import Any

from geometry_msgs.msg import PoseStamped

from peace_ros.core.domain import Mount, Pose, Telemetry
from peace_ros.core.domain.geometry import optical_from_mount
from peace_ros.core.landing import Decision, LandingCore
from peace_ros.core.node_parameters import CameraOptions, LandingOptions
from peace_ros.core.vehicle import VehicleParameters
from peace_ros.nodes.messages import LOCAL_FRAME, header, pose_to_message
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import LATCHED, RESULT
from peace_ros.nodes.view_messages import (
    circles,
    grid_message,
    markers_message,
    transform_message,
)

_PERIOD_S = 1.0
_PATH_POSES = 1200
"""Twenty minutes."""


class LandingView:
    """Topics ``landing/map``, ``landing/markers``, ``landing/pose``, ``landing/path``, and tf."""

    def __init__(self, node: PeaceNode, options: LandingOptions) -> None:
        self._node, self._options = node, options
        self.camera_frame = ''
        """The frame_id of the images, empty before the first."""
        fixed = not node.filled(VehicleParameters).follow_gimbal
        self._mount: Mount | None = None
        if options.mount_source == 'parameters' and fixed:
            self._mount = node.filled(CameraOptions).mount
        self._due_s = 0.0
        self._path: deque[PoseStamped] = deque(maxlen=_PATH_POSES)
        self._map_out = self._publisher('nav_msgs', 'OccupancyGrid', 'landing/map', LATCHED)
        self._path_out = self._publisher('nav_msgs', 'Path', 'landing/path', RESULT)
        self._markers_out = self._publisher(
            'visualization_msgs', 'MarkerArray', 'landing/markers', RESULT
        )
        self._pose_out = node.create_publisher(PoseStamped, 'landing/pose', RESULT)
        self._tf_out = None
        if options.publish_tf:
            self._tf_out = self._publisher('tf2_msgs', 'TFMessage', '/tf', RESULT)

    def _publisher(self, package: str, kind: str, topic: str, profile: Any) -> Any:
        try:
            message = getattr(import_module(f'{package}.msg'), kind)
        except ImportError:
            self._node.get_logger().warning(f'{package} is not installed: {topic} is not published')
            return None
        return self._node.create_publisher(message, topic, profile)

    def show(
        self, at_ns: int, decision: Decision, telemetry: Telemetry | None, core: LandingCore
    ) -> None:
        """Publish what is known; the pose with each call, the rest once per second.

        Args:
            at_ns: the node's clock.
            decision: of this step.
            telemetry: None before there is any.
            core: has the map and the places.
        """
        pose = None if telemetry is None else telemetry.pose
        if pose is None or not isfinite(pose.north_m):
            return
        self._show_pose(pose)
        now_s = time.monotonic()
        if now_s < self._due_s:
            return
        self._due_s = now_s + _PERIOD_S
        up_m = -(pose.down_m + pose.altitude_agl_m)
        self._show_path(at_ns, pose)
        if self._is_watched(self._map_out):
            self._map_out.publish(grid_message(core.safety_map.layers(at_ns), at_ns, up_m))
        if self._is_watched(self._markers_out):
            places, search = circles(decision, core), core.search_path
            self._markers_out.publish(markers_message(places, search, at_ns, up_m))

    @staticmethod
    def _is_watched(publisher: Any) -> bool:
        return publisher is not None and publisher.get_subscription_count() > 0

    def _show_pose(self, pose: Pose) -> None:
        if not self._is_watched(self._pose_out) and self._tf_out is None:
            return
        message = pose_to_message(pose)
        self._pose_out.publish(message)
        if self._tf_out is not None:
            at, turn = message.pose.position, message.pose.orientation
            placed = (turn.w, turn.x, turn.y, turn.z), (at.x, at.y, at.z)
            stamp_ns, vehicle = pose.stamp_ns, self._options.tf_child
            found = [transform_message(stamp_ns, self._options.tf_parent, vehicle, placed)]
            if self._mount is not None and self.camera_frame:
                placed = optical_from_mount(self._mount)
                found.append(transform_message(stamp_ns, vehicle, self.camera_frame, placed))
            self._tf_out.publish(self._tf_out.msg_type(transforms=found))

    def _show_path(self, at_ns: int, pose: Pose) -> None:
        self._path.append(pose_to_message(pose))
        if self._is_watched(self._path_out):
            frame = header(at_ns, LOCAL_FRAME)
            self._path_out.publish(self._path_out.msg_type(header=frame, poses=list(self._path)))
