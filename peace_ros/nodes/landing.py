# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing node: ``heatmap`` and the vehicle -> decisions, set-points, status."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rclpy.clock import Clock, ClockType

from peace_ros.core.domain import ConfigurationError, Health, Setpoint
from peace_ros.core.landing import (
    SILENT_STATES,
    Decision,
    LandingCore,
    LandingParameters,
    State,
    readiness,
)
from peace_ros.core.mapping import MapParameters
from peace_ros.core.node_parameters import CameraOptions, LandingOptions, groups_of
from peace_ros.core.vehicle import VehicleParameters
from peace_ros.nodes.connection import newest_telemetry
from peace_ros.nodes.engagement import EngagementServices
from peace_ros.nodes.inputs import LandingInputs
from peace_ros.nodes.managed import ManagedNode
from peace_ros.nodes.runtime import run
from peace_ros.nodes.sending import Sending
from peace_ros.nodes.status import DecisionPublisher, VehicleSituation
from peace_ros.nodes.vehicle_access import VehicleAccess
from peace_ros.nodes.view import LandingView


class LandingNode(ManagedNode):
    """Steps the landing core on the steady clock and hands its set-points to the timed sender.

    It does so in the state inactive, too, and reports; only an active node engages.
    """

    def __init__(self, **options: Any) -> None:
        """Subscribe, and begin to reach the vehicle.

        Raises:
            PeaceError: parameters, connection or signing key cannot be used.

        """
        super().__init__('landing', *groups_of('landing'), **options)
        self._lock = threading.RLock()
        """Guards the core: the engage service runs beside the timer."""
        self._sending = Sending(self)
        self.start()

    def configure(self) -> None:
        """Subscribe, and begin to reach the vehicle."""
        self._options = self.filled(LandingOptions)
        self._landing, self._state = self.filled(LandingParameters), State.IDLE
        self._core = self._create_core()
        self._publisher = DecisionPublisher(self)
        self._access = VehicleAccess(self, self._options, self.filled(VehicleParameters))
        self._view = LandingView(self, self._options)
        self._inputs = LandingInputs(self, self._options)
        self.diagnostics.hardware_id = self._access.name
        self.diagnostics.add('landing', self._readiness)
        self._engagement = EngagementServices(self, self._access, auto=self._options.auto_engage)
        # A ROS-time timer would stand still with a clock that stops or jumps.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / self._options.rate, self._step, clock=steady)
        self.get_logger().info(f'waiting for the vehicle: {self._access.name}')

    def deactivate(self) -> None:
        """Stop the vehicle and engage no more."""
        self.end_landing()

    def _create_core(self) -> LandingCore:
        camera, maps = self.filled(CameraOptions), self.filled(MapParameters)
        on_gimbal = self.filled(VehicleParameters).follow_gimbal
        return LandingCore(self._landing, camera.camera, maps, camera.mount, on_gimbal=on_gimbal)

    def change(self, filled: Mapping[type[Any], Any]) -> None:
        """Begin a new map with other thresholds; only while no landing is under way."""
        if filled[LandingParameters] == self._landing:
            return
        with self._lock:
            if self._state is not State.IDLE:
                raise ConfigurationError(
                    f'the landing is in state {self._state.value}: disengage before you change it'
                )
            self._landing = filled[LandingParameters]
            self._core = self._create_core()

    def _step(self) -> None:
        if self.failure is not None:
            return
        at_ns = self.clock_ns()
        with self._lock:
            link = self._access.link
            self._inputs.feed(self._core, () if link is None else link.take_poses())
            told, age_s = newest_telemetry(link)
            decision = self._core.step(at_ns, told, age_s)
            self._submit(decision)
        access, sender = self._access, self._sending.state
        situation = VehicleSituation(told, age_s, access.problem, sender, access.stage, link)
        self._publisher.publish(decision, situation, at_ns)
        self._view.camera_frame = self._inputs.camera_frame
        self._view.show(at_ns, decision, told, self._core)
        access.follow(decision)
        self._engagement.engage_when_ready()

    def _submit(self, decision: Decision) -> None:
        if decision.state is not self._state:
            self.get_logger().info(f'{decision.state.value}: {decision.reason}')
            if decision.state is State.ABORTED:
                self._sending.forget()
            self._state = decision.state
        if decision.relaxed:
            self.say('relaxation', f'threshold relaxed to {decision.effective_threshold:.2f}')
        if decision.state not in SILENT_STATES:
            self._sending.submit(decision.setpoint)

    def check_engagement(self) -> str:
        """Return why a landing cannot begin now, empty when it can."""
        told, age_s = newest_telemetry(self._access.link)
        with self._lock:
            return (
                self.diagnostics.inactive
                or self._inputs.sources.engagement_problem
                or self._access.vehicle_problem
                or self._core.engagement_problem(self.clock_ns(), told, age_s)
            )

    def _readiness(self) -> Health:
        several = self._inputs.sources.engagement_problem
        return readiness(self._state, several, self.check_engagement())

    def begin(self) -> str:
        """Begin the landing of a vehicle that obeys; return what speaks against it, or nothing."""
        with self._lock:
            link = self._access.link
            if not self.is_active or self.failure is not None:
                return 'the landing node is not active'
            if link is None:
                return self._access.problem or 'the vehicle is not reached yet'
            self._sending.begin(link)
            self._sending.submit(Setpoint(stamp_ns=0))  # from now on the dead-man watches
            self._core.engage()
        return ''

    def end_landing(self) -> bool:
        """Stop the vehicle; return whether it was flown by us."""
        with self._lock:
            was_flying = self._state not in SILENT_STATES
            self._core.disengage()
            if was_flying:
                # Zero goes out, then the dead-man asks for the autopilot's own hold mode.
                self._sending.submit(Setpoint(stamp_ns=0))
        return was_flying

    def cleanup(self) -> None:
        """Stop the vehicle (zero velocity and hold), then send nothing; release the connection."""
        with self._lock:
            if self._sending.stop():
                self._access.stop_vehicle()
        for each in ('_access', '_engagement'):
            if each in vars(self):
                vars(self)[each].close()

    def watch(self) -> None:
        """Raise when the thread of the sender does not run."""
        self._sending.watch()

    def last_steps(self, sentence: str) -> tuple[Callable[[], None], ...]:
        """Stop the vehicle, and publish why."""
        if not self.is_configured:
            return ()
        return self._stop_at_once, lambda: self._publisher.publish_failure(
            sentence, self.clock_ns()
        )

    def _stop_at_once(self) -> None:
        self._sending.halt()
        if self._state not in SILENT_STATES:
            self._access.stop_at_once()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(LandingNode, args)


if __name__ == '__main__':
    sys.exit(main())
