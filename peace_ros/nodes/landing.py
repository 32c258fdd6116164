# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing node: ``heatmap`` and the vehicle -> decisions, set-points, status."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Sequence
from math import inf
from typing import Any

from rclpy.clock import Clock, ClockType

from peace_ros.core.domain import Setpoint, Telemetry, VehicleError
from peace_ros.core.landing import (
    SILENT_STATES,
    Decision,
    LandingCore,
    LandingParameters,
    State,
    engagement_problem,
)
from peace_ros.core.mapping import MapParameters
from peace_ros.core.node_parameters import CameraOptions, LandingOptions, groups_of
from peace_ros.core.vehicle import SenderParameters, SetpointSender, VehicleParameters
from peace_ros.nodes.engagement import EngagementServices
from peace_ros.nodes.inputs import LandingInputs
from peace_ros.nodes.runtime import PeaceNode, run
from peace_ros.nodes.status import DecisionPublisher, VehicleSituation
from peace_ros.nodes.vehicle_access import VehicleAccess


class LandingNode(PeaceNode):
    """Steps the landing core on the steady clock and hands its set-points to the timed sender."""

    def __init__(self, **options: Any) -> None:
        """Subscribe, and begin to reach the vehicle.

        Raises:
            PeaceError: parameters, connection or signing key cannot be used.

        """
        super().__init__('landing', *groups_of('landing'), **options)
        self._options = self.filled(LandingOptions)
        self._landing = self.filled(LandingParameters)
        camera = self.filled(CameraOptions)
        mount = None if self._options.mount_source == 'tf' else camera.mount
        self._core = LandingCore(self._landing, camera.camera, self.filled(MapParameters), mount)
        self._lock = threading.RLock()
        """Guards the core: the engage service runs beside the timer."""
        self._sender: SetpointSender | None = None
        self._closed = False
        self._state = State.IDLE
        self._publisher = DecisionPublisher(self)
        self._access = VehicleAccess(self, self._options, self.filled(VehicleParameters))
        self._inputs = LandingInputs(self, self._options)
        self._engagement = EngagementServices(self, self._access, auto=self._options.auto_engage)
        # A ROS-time timer would stand still with a clock that stops or jumps.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / self._options.rate, self._step, clock=self._steady)
        self.get_logger().info(f'waiting for the vehicle: {self._access.name}')

    def _step(self) -> None:
        if self.failure is not None:
            return
        at_ns = self.clock_ns()
        with self._lock:
            link = self._access.link
            for pose in () if link is None else link.take_poses():
                self._core.add_pose(pose)
            self._inputs.feed(self._core)
            told, age_s = self._telemetry()
            decision = self._core.step(at_ns, told, age_s)
            self._submit(decision)
        sender = '' if self._sender is None else self._sender.statistics().state.value
        access = self._access
        situation = VehicleSituation(told, age_s, access.problem, sender, access.stage, link)
        self._publisher.publish(decision, situation, at_ns)
        access.follow(decision)
        self._engagement.engage_when_ready()

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
        if decision.relaxed:
            self.say('relaxation', f'threshold relaxed to {decision.effective_threshold:.2f}')
        if self._sender is None or decision.state in SILENT_STATES:
            return
        try:
            self._sender.submit(decision.setpoint)
        except VehicleError as error:
            self.say('sender', str(error))

    def check_engagement(self) -> str:
        """Return why a landing cannot begin now, empty when it can."""
        told, age_s = self._telemetry()
        with self._lock:
            stamp_ns = self._core.safety_map.stamp_ns
            map_age_s = inf if stamp_ns is None else (self.clock_ns() - stamp_ns) / 1e9
            return self._access.vehicle_problem or engagement_problem(
                self._state, told, age_s, map_age_s, self._landing, self._core.last_rejection
            )

    def begin(self) -> str:
        """Begin the landing of a vehicle that obeys; return what speaks against it, or nothing."""
        with self._lock:
            link = self._access.link
            if self._closed or self.failure is not None:
                return 'the node is ending'
            if link is None:
                return self._access.problem or 'the vehicle is not reached yet'
            if self._sender is None:
                self._sender = SetpointSender(
                    link, parameters=self.filled(SenderParameters), on_defect=self.fail
                )
                self._sender.start()
            self._sender.resume()
            self._core.engage()
        return ''

    def end_landing(self) -> bool:
        """Stop the vehicle; return whether it was flown by us."""
        with self._lock:
            was_flying = self._state not in SILENT_STATES
            self._core.disengage()
            if was_flying and self._sender is not None:
                # Zero goes out, then the dead-man asks for the autopilot's own hold mode.
                self._sender.submit(Setpoint(stamp_ns=0))
        return was_flying

    def close(self) -> None:
        """Stop the vehicle: zero velocity, then no further set-point."""
        with self._lock:
            self._closed = True
            if self._sender is not None:
                self._sender.stop()
                self._access.stop_vehicle()
        self._access.close()
        self._engagement.close()

    def watch(self) -> None:
        """Raise when the thread of the sender does not run."""
        if self._sender is not None:
            self._sender.watch()

    def last_steps(self, sentence: str) -> tuple[Callable[[], None], ...]:
        """Stop the vehicle, and publish why."""
        return self._stop_at_once, lambda: self._publisher.publish_failure(
            sentence, self.clock_ns()
        )

    def _stop_at_once(self) -> None:
        if self._sender is not None:
            self._sender.halt()
        if self._state not in SILENT_STATES:
            self._access.stop_at_once()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(LandingNode, args)


if __name__ == '__main__':
    sys.exit(main())
