# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the landing node reaches its vehicle: MAVLink, or a pose topic and a velocity topic."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from geometry_msgs.msg import PoseStamped, Twist
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rclpy.clock import Clock, ClockType

from peace_ros.core.domain import ConfigurationError, PeaceError, Pose, VehicleError
from peace_ros.core.landing import Decision, State
from peace_ros.core.messages import pose_from_message, pose_from_transform, stamp_ns_of
from peace_ros.core.node_parameters import LandingOptions
from peace_ros.core.vehicle import VehicleLink, VehicleParameters, check_access, open_vehicle
from peace_ros.nodes.connection import Connection
from peace_ros.nodes.handover import AfterHandover
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import COMMAND, POSE_IN
from peace_ros.nodes.tf import TfTree
from peace_ros.nodes.twist_link import TwistLink

_TRY_S = 3.0
"""One attempt to hear an autopilot; between attempts the node says that it hears none."""
_LAST_ZEROS = 3
_STOP_S = 0.6
"""How long a vehicle that does not show its hold mode is asked for it again."""
_STOP_PERIOD_S = 0.05
_HEALTH: dict[State, int] = {
    State.IDLE: mavlink.MAV_STATE_STANDBY,
    State.ABORTED: mavlink.MAV_STATE_STANDBY,
    State.HOLD: mavlink.MAV_STATE_CRITICAL,
}
"""MAV_STATE of our HEARTBEAT; in every other state ACTIVE."""


class VehicleAccess:
    """The link once there is one, and otherwise the reason why not."""

    def __init__(
        self, node: PeaceNode, options: LandingOptions, parameters: VehicleParameters
    ) -> None:
        """Begin to reach the vehicle.

        Raises:
            ConfigurationError: the signing key cannot be read, or tf is not installed.
            VehicleError: the connection or the dialect is not understood.

        """
        self._node = node
        self._parameters = parameters
        self._after = AfterHandover(
            parameters.after_handover, lambda sentence: node.say('handover', sentence), node.fail
        )
        self._connection: Connection | None = None
        self._twist: TwistLink | None = None
        self._warned = ''
        if options.interface == 'twist':
            self.name = 'topics pose and cmd_vel'
            self._twist = TwistLink(node.create_publisher(Twist, 'cmd_vel', COMMAND).publish)
            self._subscribe_pose(options)
            return
        self.name = options.mavlink
        key_file, system_id = parameters.signing_key_file, parameters.system_id
        check_access(options.mavlink, options.dialect, key_file, system_id)
        timeout_s = min(_TRY_S, parameters.connect_timeout_s)
        open_link = partial(
            open_vehicle,
            *(options.mavlink, options.dialect, node.clock_ns, parameters, timeout_s, node.fail),
        )
        self._connection = Connection(
            open_link, lambda sentence: node.say('vehicle', sentence), node.fail
        )

    @property
    def link(self) -> VehicleLink | None:
        """The vehicle, None until it is reached."""
        if self._connection is None:
            return self._twist
        return self._connection.link

    @property
    def problem(self) -> str:
        """Why there is no vehicle, empty when there is."""
        return '' if self._connection is None else self._connection.problem

    @property
    def vehicle_problem(self) -> str:
        """Why a landing cannot begin as far as the vehicle is concerned, empty when it can."""
        link = self.link
        if link is None:
            return self.problem
        return link.problem or link.position_problem

    @property
    def stage(self) -> str:
        """What the vehicle does since the hand-over, empty before it."""
        return self._after.stage

    def follow(self, decision: Decision) -> None:
        """Report our health to the vehicle, and do what follows a hand-over; once per step."""
        link = self.link
        if link is None:
            return
        if link.problem:
            self._node.say('vehicle', link.problem)
        if link.warning not in {'', self._warned}:
            self._warned = link.warning
            self._node.say('line', self._warned)
        link.report_health(int(_HEALTH.get(decision.state, mavlink.MAV_STATE_ACTIVE)))
        handed_over = decision.state is State.HANDOVER
        self._after.follow(link, decision.site, handed_over=handed_over)

    def hold_level(self) -> str:
        """Hold level without a position where that was chosen; return the result.

        Empty when it was not chosen, or when there is a position or no flying vehicle.
        """
        link = self.link
        if link is None or not self._parameters.attitude_fallback:
            return ''
        told = link.telemetry()
        if not link.position_problem or not told.armed or told.landed:
            return ''
        try:
            result = link.request_level_hold()
        except VehicleError as error:
            return str(error)
        if result:
            return 'instead it holds level, height and heading, and drifts with the wind'
        return f'holding level {result.answer.value}: {result.reason}'

    def stop_vehicle(self) -> None:
        """Send zero velocity and ask for the hold mode, if the vehicle still obeys us."""
        link = self.link
        try:
            for _ in range(_LAST_ZEROS):
                if link is None or not link.stop_at_once():
                    return
        except VehicleError as error:
            self._node.say('vehicle', str(error))

    def stop_at_once(self) -> None:
        """Ask for zero velocity and hold until the vehicle holds; for a node that has failed."""
        self._after.end()
        link, until_s = self.link, time.monotonic() + _STOP_S
        while link is not None and time.monotonic() < until_s:
            try:
                if not link.stop_at_once():
                    return
            except VehicleError:
                pass  # the next try may find the line open again
            time.sleep(_STOP_PERIOD_S)

    def close(self) -> None:
        """Release the line."""
        self._after.end()
        if self._connection is not None:
            self._connection.close()

    def _subscribe_pose(self, options: LandingOptions) -> None:
        if options.pose_source == 'topic':
            self._pose_arrived = self._node.diagnostics.watch('pose')
            self._node.create_subscription(PoseStamped, 'pose', self._on_pose, POSE_IN)
            return
        look_up = partial(TfTree(self._node, 'pose_source').look_up, *options.tf_frames)
        self._node.create_timer(
            1.0 / options.rate,
            lambda: self._take(lambda: pose_from_transform(look_up())),
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )

    def _on_pose(self, message: PoseStamped) -> None:
        self._pose_arrived(stamp_ns_of(message))
        self._take(partial(pose_from_message, message))

    def _take(self, read: Callable[[], Pose]) -> None:
        if self._twist is None:
            return
        try:
            self._twist.add_pose(read())
        except PeaceError as error:
            self._node.say('pose', str(error))
            if isinstance(error, ConfigurationError):
                self._twist.position_problem = str(error)
