# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the simulated camera is: three sources that all end in a callback with a Pose."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from geometry_msgs.msg import PoseStamped, Twist
from rclpy.clock import Clock, ClockType

from peace_ros.core.domain import Pose, VehicleError
from peace_ros.core.messages import pose_from_message
from peace_ros.core.vehicle import VehicleLink, VehicleParameters, open_vehicle
from peace_ros.nodes.connection import Connection
from peace_ros.nodes.messages import pose_to_message
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import COMMAND, POSE, POSE_IN
from peace_ros.simulation.nodes.messages import BODY_FRAME, transform_from_pose
from peace_ros.simulation.nodes.options import CAMERA_SYSTEM_ID
from peace_ros.simulation.nodes.twist_vehicle import TwistVehicle
from peace_ros.simulation.positions import why_no_position

_POLL_S = 0.02
_INTEGRATION_HZ = 50.0
_TRY_S = 3.0

Sink = Callable[[Pose], None]


class TopicSource:
    """PoseStamped (ENU, FLU) on ``ground_truth/pose``."""

    def __init__(self, node: PeaceNode, sink: Sink) -> None:
        self._node, self._sink = node, sink
        node.create_subscription(PoseStamped, 'ground_truth/pose', self._on_pose, POSE_IN)

    def _on_pose(self, message: PoseStamped) -> None:
        try:
            self._sink(pose_from_message(message))
        except VehicleError as error:
            self._node.say('pose', str(error))

    @property
    def problem(self) -> str:
        """Why no pose comes."""
        return 'nothing publishes ground_truth/pose: is the simulated autopilot running?'

    def close(self) -> None:
        """Nothing to release."""


class MavlinkSource:
    """Position and attitude that an autopilot reports, on a connection of our own."""

    def __init__(self, node: PeaceNode, sink: Sink, url: str, signing_key_file: str = '') -> None:
        self._sink = sink
        self._output = _PoseOutput(node)
        parameters = VehicleParameters(
            system_id=CAMERA_SYSTEM_ID, signing_key_file=signing_key_file
        )

        def open_link() -> VehicleLink:
            return open_vehicle(url, 'auto', node.clock_ns, parameters, _TRY_S, on_defect=node.fail)

        self._connection = Connection(
            open_link, lambda sentence: node.say('vehicle', sentence), node.fail
        )
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(_POLL_S, self._poll, clock=self._steady)

    def _poll(self) -> None:
        link = self._connection.link
        for pose in () if link is None else link.take_poses():
            if not pose.has_position:
                continue  # it is not known over which ground the vehicle is
            # On the topic the ground is at z = 0, wherever the autopilot has its origin.
            self._output.publish(replace(pose, down_m=-pose.altitude_agl_m))
            self._sink(pose)

    @property
    def problem(self) -> str:
        """Why no pose comes."""
        link = self._connection.link
        return self._connection.problem if link is None else why_no_position(link)

    def close(self) -> None:
        """Release the line."""
        self._connection.close()


class TwistSource:
    """Velocities on ``cmd_vel``, integrated here."""

    def __init__(self, node: PeaceNode, sink: Sink, altitude_m: float, timeout_s: float) -> None:
        self._node, self._sink = node, sink
        self._output = _PoseOutput(node)
        self._vehicle = TwistVehicle(altitude_m, timeout_s)
        node.create_subscription(Twist, 'cmd_vel', self._on_twist, COMMAND)
        node.create_timer(1.0 / _INTEGRATION_HZ, self._advance)

    def _on_twist(self, message: Twist) -> None:
        linear, turn = message.linear, message.angular
        try:
            self._vehicle.command(linear.x, linear.y, linear.z, turn.z, time.monotonic())
        except VehicleError as error:
            self._node.say('cmd_vel', str(error))

    @property
    def problem(self) -> str:
        """Why no pose comes."""
        return 'the clock stands still'

    def _advance(self) -> None:
        pose = self._vehicle.advance(self._node.clock_ns(), time.monotonic())
        self._output.publish(pose)
        self._sink(pose)

    def close(self) -> None:
        """Nothing to release."""


class _PoseOutput:
    """A pose that no topic carries yet: on ``pose`` (ENU, FLU), and on tf where there is tf."""

    def __init__(self, node: PeaceNode) -> None:
        self._pose_out = node.create_publisher(PoseStamped, 'pose', POSE)
        self._tf_message = _tf_message()
        self._tf_out = None
        if self._tf_message is not None:
            self._tf_out = node.create_publisher(self._tf_message, '/tf', POSE)

    def publish(self, pose: Pose) -> None:
        self._pose_out.publish(pose_to_message(pose))
        if self._tf_out is not None and self._tf_message is not None:
            transforms = [transform_from_pose(pose, BODY_FRAME)]
            self._tf_out.publish(self._tf_message(transforms=transforms))


PoseSource = TopicSource | MavlinkSource | TwistSource


def _tf_message() -> Any:
    """Return the message type of tf, None where tf2_msgs is not installed."""
    try:
        return importlib.import_module('tf2_msgs.msg').TFMessage
    except ImportError:
        return None
