# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the landing node reaches its vehicle: MAVLink, or a pose topic and a velocity topic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped, Twist

from peace_ros.domain import ConfigurationError, Pose, Setpoint, VehicleError
from peace_ros.nodes.connection import Connection
from peace_ros.nodes.messages import pose_from_message, pose_from_transform
from peace_ros.nodes.options import LandingOptions
from peace_ros.nodes.qos import COMMAND, POSE_IN
from peace_ros.nodes.runtime import PeaceNode
from peace_ros.nodes.twist_link import TwistLink
from peace_ros.vehicle import VehicleLink, VehicleParameters, open_vehicle

_TRY_S = 3.0
"""One attempt to hear an autopilot; between attempts the node says that it hears none."""
_LAST_ZEROS = 3


class VehicleAccess:
    """The link once there is one, and otherwise the reason why not."""

    def __init__(
        self, node: PeaceNode, options: LandingOptions, parameters: VehicleParameters
    ) -> None:
        self._node = node
        self._connection: Connection[VehicleLink] | None = None
        self._twist: TwistLink | None = None
        if options.interface == 'twist':
            self.name = 'topics pose and cmd_vel'
            self._twist = TwistLink(node.create_publisher(Twist, 'cmd_vel', COMMAND).publish)
            self._subscribe_pose(options)
            return
        self.name = options.mavlink
        timeout_s = min(_TRY_S, parameters.connect_timeout_s)

        def open_link() -> VehicleLink:
            return open_vehicle(
                options.mavlink, options.dialect, node.clock_ns, parameters, timeout_s
            )

        self._connection = Connection(open_link, lambda sentence: node.say('vehicle', sentence))

    @property
    def link(self) -> VehicleLink | None:
        """The vehicle, None until it is reached."""
        return self._twist if self._connection is None else self._connection.link

    @property
    def problem(self) -> str:
        """Why there is no vehicle, empty when there is."""
        return '' if self._connection is None else self._connection.problem

    def stop_vehicle(self) -> None:
        """Send zero velocity, if the vehicle still obeys us."""
        link = self.link
        if link is None or link.taken_over or not link.telemetry().in_control:
            return
        try:
            for _ in range(_LAST_ZEROS):
                link.send_velocity(Setpoint(stamp_ns=0))
        except VehicleError as error:
            self._node.say('vehicle', str(error))

    def close(self) -> None:
        """Release the line."""
        if self._connection is not None:
            self._connection.close()

    def _subscribe_pose(self, options: LandingOptions) -> None:
        if options.pose_source == 'topic':
            self._node.create_subscription(PoseStamped, 'pose', self._on_pose, POSE_IN)
            return
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError as error:
            raise ConfigurationError(
                'parameter pose_source = tf needs the package tf2_msgs: install it with ROS, or '
                'choose topic'
            ) from error

        def on_tf(message: TFMessage) -> None:
            for each in message.transforms:
                names = (each.header.frame_id.lstrip('/'), each.child_frame_id.lstrip('/'))
                if names == (options.tf_parent, options.tf_child):
                    self._take(pose_from_transform, each)

        self._node.create_subscription(TFMessage, '/tf', on_tf, POSE_IN)

    def _on_pose(self, message: PoseStamped) -> None:
        self._take(pose_from_message, message)

    def _take(self, read: Callable[[Any], Pose], message: Any) -> None:
        try:
            pose = read(message)
        except VehicleError as error:
            self._node.say('pose', str(error))
            return
        if self._twist is not None:
            self._twist.add_pose(pose)
