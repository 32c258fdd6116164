# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""For people who look: the map, places, pose and path of a landing, at a low rate.

Nothing that flies depends on it. What nobody subscribes to is not made.
"""

from __future__ import annotations

import time
from array import array
from collections import deque
from importlib import import_module
from math import isfinite
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from rclpy.node import Node

from peace_ros.core.domain import Pose, Site, Telemetry
from peace_ros.core.domain.geometry import ned_to_enu
from peace_ros.core.landing import Decision, LandingCore
from peace_ros.core.mapping import MapLayers
from peace_ros.core.node_parameters import LandingOptions
from peace_ros.nodes.messages import LOCAL_FRAME, header, pose_to_message
from peace_ros.nodes.qos import LATCHED, RESULT

_PERIOD_S = 1.0
_PATH_POSES = 1200
"""Twenty minutes."""
_HEIGHT_M = 0.2
_COLOURS = {
    'site': (0.0, 0.8, 0.2, 0.8),
    'candidate': (0.1, 0.4, 1.0, 0.5),
    'failed': (0.9, 0.1, 0.1, 0.5),
    'focus': (1.0, 1.0, 1.0, 0.1),
}
"""Red, green, blue, opacity, each 0 to 1."""
_Circle = tuple[str, float, float, float]
"""Kind, north and east of the middle, radius; metres."""


class LandingView:
    """Topics ``landing/map``, ``landing/markers``, ``landing/pose``, ``landing/path``, and tf."""

    def __init__(self, node: Node, options: LandingOptions) -> None:
        self._node, self._options = node, options
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
            self._markers_out.publish(markers_message(circles(decision, core), at_ns, up_m))

    @staticmethod
    def _is_watched(publisher: Any) -> bool:
        return publisher is not None and publisher.get_subscription_count() > 0

    def _show_pose(self, pose: Pose) -> None:
        if not self._is_watched(self._pose_out) and self._tf_out is None:
            return
        message = pose_to_message(pose)
        self._pose_out.publish(message)
        if self._tf_out is not None:
            transform = TransformStamped(
                header=header(pose.stamp_ns, self._options.tf_parent),
                child_frame_id=self._options.tf_child,
            )
            at, place = message.pose.position, transform.transform.translation
            place.x, place.y, place.z = at.x, at.y, at.z
            transform.transform.rotation = message.pose.orientation
            self._tf_out.publish(self._tf_out.msg_type(transforms=[transform]))

    def _show_path(self, at_ns: int, pose: Pose) -> None:
        self._path.append(pose_to_message(pose))
        if self._is_watched(self._path_out):
            frame = header(at_ns, LOCAL_FRAME)
            self._path_out.publish(self._path_out.msg_type(header=frame, poses=list(self._path)))


def circles(decision: Decision, core: LandingCore) -> list[_Circle]:
    """Return what the landing knows of places: site, candidates, failed places, focus."""

    def of_site(kind: str, site: Site) -> _Circle:
        return kind, site.north_m, site.east_m, site.clearance_m

    found = [of_site('candidate', each) for each in core.seen_sites]
    found += [('failed', each.north_m, each.east_m, each.radius_m) for each in core.failed_places]
    if decision.site is not None:
        found.append(of_site('site', decision.site))
    if decision.focus is not None:
        focus = decision.focus
        found.append(('focus', focus.north_m, focus.east_m, focus.radius_m))
    return found


def grid_message(layers: MapLayers, at_ns: int, up_m: float) -> Any:
    """Return the nav_msgs/OccupancyGrid of a map: 0 safe, 100 unsafe, -1 unknown.

    Args:
        layers: rows x columns, to the north and to the east.
        at_ns: stamp.
        up_m: height of the ground in the local frame.
    """
    message = import_module('nav_msgs.msg').OccupancyGrid(header=header(at_ns, LOCAL_FRAME))
    cells = np.rint(100.0 * (1.0 - layers.score)).astype(np.int8)
    cells[~np.isfinite(layers.age_s)] = -1
    message.info.map_load_time = message.header.stamp
    message.info.resolution = layers.cell_m
    message.info.height, message.info.width = cells.shape
    origin = message.info.origin.position
    origin.x, origin.y, origin.z = layers.west_m, layers.south_m, up_m
    message.data = array('b', cells.tobytes())
    return message


def markers_message(places: list[_Circle], at_ns: int, up_m: float) -> Any:
    """Return the visualization_msgs/MarkerArray of circles on the ground, and of no other."""
    messages = import_module('visualization_msgs.msg')
    markers = [messages.Marker(header=header(at_ns, LOCAL_FRAME), action=messages.Marker.DELETEALL)]
    for number, (kind, north_m, east_m, radius_m) in enumerate(places):
        marker = messages.Marker(header=header(at_ns, LOCAL_FRAME), ns=kind, id=number)
        marker.type = messages.Marker.CYLINDER
        at = marker.pose.position
        at.x, at.y, at.z = ned_to_enu(north_m, east_m, -up_m)
        marker.scale.x = marker.scale.y = 2.0 * radius_m
        marker.scale.z = _HEIGHT_M
        colour = marker.color
        colour.r, colour.g, colour.b, colour.a = _COLOURS[kind]
        markers.append(marker)
    return messages.MarkerArray(markers=markers)
