# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing node: ``heatmap`` and the vehicle -> decisions, set-points, status."""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from math import inf
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, TwistStamped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from peace_ros.domain import PeaceError, Setpoint, Telemetry, VehicleError
from peace_ros.landing import Decision, LandingCore, LandingParameters, State
from peace_ros.mapping import MapParameters
from peace_ros.nodes.engagement import reason_against
from peace_ros.nodes.messages import (
    heatmap_from_image,
    setpoint_to_twist_stamped,
    site_to_message,
)
from peace_ros.nodes.options import CameraOptions, LandingOptions
from peace_ros.nodes.parameters import Group
from peace_ros.nodes.qos import IMAGE_IN, RESULT
from peace_ros.nodes.runtime import PeaceNode, run
from peace_ros.nodes.status import Situation, status_message
from peace_ros.nodes.vehicle_access import VehicleAccess
from peace_ros.vehicle import SenderParameters, SetpointSender, VehicleLink, VehicleParameters

PARAMETERS: tuple[Group, ...] = (
    ('', LandingOptions),
    ('', CameraOptions),
    ('', LandingParameters),
    ('', MapParameters),
    ('vehicle', VehicleParameters),
    ('sender', SenderParameters),
)
_STATUS_PERIOD_S = 0.1
_SILENT = frozenset({State.IDLE, State.ABORTED})
"""States in which nothing is submitted to the vehicle."""


class LandingNode(PeaceNode):
    """Steps the landing core on the steady clock and hands its set-points to the timed sender."""

    def __init__(self, **options: Any) -> None:
        """Subscribe, and begin to reach the vehicle.

        Raises:
            ConfigurationError: parameters cannot be used.

        """
        super().__init__('landing', *PARAMETERS, **options)
        self._options = self.filled(LandingOptions)
        self._landing = self.filled(LandingParameters)
        self._core = LandingCore(
            self._landing, self.filled(CameraOptions).camera, self.filled(MapParameters)
        )
        self._lock = threading.RLock()
        """Guards the core: the engage service runs beside the timer."""
        self._heatmaps: deque[Image] = deque(maxlen=4)
        self._sender: SetpointSender | None = None
        self._closed = False
        self._state = State.IDLE
        self._status_due_s = 0.0
        self._auto_engage_due = self._options.auto_engage
        self._status_out = self.create_publisher(DiagnosticArray, 'landing/status', RESULT)
        self._setpoint_out = self.create_publisher(TwistStamped, 'landing/setpoint', RESULT)
        self._site_out = self.create_publisher(PointStamped, 'landing/site', RESULT)
        self._access = VehicleAccess(self, self._options, self.filled(VehicleParameters))
        self.create_subscription(Image, 'heatmap', self._on_heatmap, IMAGE_IN)
        # Asking for control may take seconds, in which steps and heatmaps must go on.
        beside = MutuallyExclusiveCallbackGroup()
        for name, callback in (('engage', self._on_engage), ('disengage', self._on_disengage)):
            self.create_service(Trigger, f'~/{name}', callback, callback_group=beside)
        # A ROS-time timer would stand still with a clock that stops or jumps.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / self._options.rate, self._step, clock=self._steady)
        self.get_logger().info(f'waiting for the vehicle: {self._access.name}')

    def _on_heatmap(self, message: Image) -> None:
        self._heatmaps.append(message)

    def _step(self) -> None:
        at_ns = self.clock_ns()
        with self._lock:
            self._take_heatmaps()
            told, age_s = self._telemetry()
            decision = self._core.step(at_ns, told, age_s)
            self._submit(decision)
        self._publish(decision, told, age_s, at_ns)
        if self._auto_engage_due and not self._reason_against():
            self._auto_engage_due = False
            threading.Thread(target=self._auto_engage, name='auto_engage', daemon=True).start()

    def _take_heatmaps(self) -> None:
        link = self._access.link
        for pose in () if link is None else link.take_poses():
            self._core.add_pose(pose)
        while self._heatmaps:
            self._take_heatmap(self._heatmaps.popleft())

    def _take_heatmap(self, message: Image) -> None:
        try:
            self._core.add_heatmap(heatmap_from_image(message))
        except PeaceError as error:
            self.say('heatmap', f'heatmap refused: {error}')

    def _telemetry(self) -> tuple[Telemetry | None, float]:
        link = self._access.link
        told = None if link is None else link.telemetry()
        if told is None or told.received_ns == 0:
            return None, inf
        return told, (time.monotonic_ns() - told.received_ns) / 1e9

    def _submit(self, decision: Decision) -> None:
        if decision.state is not self._state:
            self.get_logger().info(f'{decision.state.value}: {decision.reason}')
            if decision.state is State.ABORTED and self._sender is not None:
                self._sender.resume()  # forgets the last set-point; nothing is sent any more
            self._state = decision.state
        if self._sender is None or decision.state in _SILENT:
            return
        try:
            self._sender.submit(decision.setpoint)
        except VehicleError as error:
            self.say('sender', str(error))

    def _publish(
        self, decision: Decision, told: Telemetry | None, age_s: float, at_ns: int
    ) -> None:
        if decision.state not in _SILENT:
            self._setpoint_out.publish(setpoint_to_twist_stamped(decision.setpoint, at_ns))
        now_s = time.monotonic()
        if now_s < self._status_due_s:
            return
        self._status_due_s = now_s + _STATUS_PERIOD_S
        sender = '' if self._sender is None else self._sender.statistics().state.value
        situation = Situation(told, age_s, self._access.problem, sender)
        self._status_out.publish(status_message(decision, situation, at_ns))
        if decision.site is not None and told is not None and told.pose is not None:
            ground_down_m = told.pose.down_m + told.pose.altitude_agl_m
            self._site_out.publish(site_to_message(decision.site, at_ns, ground_down_m))

    def _reason_against(self) -> str:
        told, age_s = self._telemetry()
        with self._lock:
            stamp_ns = self._core.safety_map.stamp_ns
            map_age_s = inf if stamp_ns is None else (self.clock_ns() - stamp_ns) / 1e9
            return self._access.problem or reason_against(
                self._state, told, age_s, map_age_s, self._landing
            )

    def _on_engage(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._engage(by_person=True)
        return response

    def _auto_engage(self) -> None:
        self._engage(by_person=False)

    def _engage(self, *, by_person: bool) -> tuple[bool, str]:
        """Ask for control once; return whether the landing began, and a sentence."""
        problem = self._reason_against()
        link = self._access.link
        if not problem and link is not None:
            problem = _ask_for_control(link, by_person=by_person)
        if problem or link is None:
            self.get_logger().warning(f'not engaged: {problem}')
            return False, problem
        with self._lock:
            if self._closed:
                return False, 'the node is ending'
            if self._sender is None:
                self._sender = SetpointSender(link, parameters=self.filled(SenderParameters))
                self._sender.start()
            self._sender.resume()
            self._core.engage()
        self.get_logger().info('engaged')
        return True, 'engaged'

    def _on_disengage(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        with self._lock:
            self._auto_engage_due = False
            was_flying = self._state not in _SILENT
            self._core.disengage()
            if was_flying and self._sender is not None:
                # Zero goes out, then the dead-man asks for the autopilot's own hold mode.
                self._sender.submit(Setpoint(stamp_ns=0))
        response.success = True
        response.message = 'disengaged: the vehicle stops and holds' if was_flying else 'was idle'
        self.get_logger().info(response.message)
        return response

    def close(self) -> None:
        """Leave the vehicle standing: zero velocity, then silence."""
        with self._lock:
            self._closed = True
            if self._sender is not None:
                self._sender.stop()
                self._access.stop_vehicle()
        self._access.close()


def _ask_for_control(link: VehicleLink, *, by_person: bool) -> str:
    """Return why the vehicle does not obey, empty when it does."""
    try:
        result = link.request_control(by_person=by_person)
    except VehicleError as error:
        return str(error)
    return '' if result else f'control {result.answer.value}: {result.reason}'


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(LandingNode, args, threads=2)


if __name__ == '__main__':
    sys.exit(main())
