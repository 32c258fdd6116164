# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that is a pose topic and a velocity topic: what simulators without MAVLink offer."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from math import isfinite

from geometry_msgs.msg import Twist

from peace_ros.core.domain import Pose, Setpoint, Telemetry, VehicleError
from peace_ros.core.vehicle import Answer, LineCounts, RequestResult
from peace_ros.nodes.messages import setpoint_to_body_twist

_POSES = 256
_RESTART_NS = 1_000_000_000
"""A clock that goes back by more than this was restarted."""
_NO_MODES = RequestResult(Answer.REFUSED, 'a vehicle with a velocity topic has no modes')


class TwistLink:
    """A VehicleLink that always obeys: there is no pilot and no mode in such a simulator."""

    taken_over = False
    """Nobody else commands."""
    problem = ''
    """Nothing: a topic is always there, and the age of the pose is looked at elsewhere."""
    position_problem = ''
    """Why the newest pose cannot be used, until one that can; whoever reads the poses sets it."""
    warning = ''
    """Nothing."""
    counts = LineCounts()
    """Nothing is counted here."""

    def __init__(self, publish: Callable[[Twist], None]) -> None:
        self._publish = publish
        self._lock = threading.Lock()
        self._poses: deque[Pose] = deque(maxlen=_POSES)
        self._newest: Pose | None = None
        self._received_ns = 0

    def add_pose(self, pose: Pose) -> None:
        """Take a pose that came over a topic; one that is not newer is no sign of life."""
        with self._lock:
            newest = self._newest
            if newest is not None and 0 <= newest.stamp_ns - pose.stamp_ns <= _RESTART_NS:
                return
            self._poses.append(pose)
            self.position_problem = ''
            self._newest, self._received_ns = pose, time.monotonic_ns()

    def telemetry(self) -> Telemetry:
        """Return the newest pose as telemetry of an armed, obedient, flying vehicle."""
        with self._lock:
            problem = self.position_problem
            return Telemetry(
                time.monotonic_ns() if problem else self._received_ns,
                None if problem else self._newest,
                position_problem=problem,
                armed=True,
                in_control=True,
                mode='TWIST',
                landed=False,
            )

    def take_poses(self) -> list[Pose]:
        """Return the poses since the last call, oldest first."""
        with self._lock:
            poses = list(self._poses)
            self._poses.clear()
            return poses

    def send_velocity(self, setpoint: Setpoint) -> None:
        """Publish the set-point along the axes of the image; without a pose only zero goes out."""
        v = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
        if not all(map(isfinite, v)):
            raise VehicleError(f'velocity set-point {v} m/s: all components must be finite')
        with self._lock:
            pose = self._newest
        self._publish(Twist() if pose is None else setpoint_to_body_twist(setpoint, pose))

    def send_landing_target(
        self,
        site_ned_m: tuple[float, float, float],  # noqa: ARG002
        pose: Pose,  # noqa: ARG002
    ) -> None:
        """Raise VehicleError: there is nobody to tell."""
        raise VehicleError('a vehicle with a velocity topic takes no LANDING_TARGET: choose hold')

    def report_health(self, mav_state: int) -> None:
        """Do nothing: nobody listens."""

    def request_control(self, *, by_person: bool = False) -> RequestResult:  # noqa: ARG002
        """Accept: there is nobody to ask."""
        return RequestResult(Answer.ACCEPTED)

    def request_hold(self) -> RequestResult:
        """Stop; the simulator holds by itself."""
        self._publish(Twist())
        return RequestResult(Answer.ACCEPTED)

    def request_land(self, _wanted: Callable[[], bool] = lambda: True) -> RequestResult:
        """Refuse: such a vehicle has no modes."""
        return _NO_MODES

    def request_level_hold(self) -> RequestResult:
        """Refuse: such a vehicle has no modes."""
        return _NO_MODES

    def stop_at_once(self) -> bool:
        """Stop the vehicle."""
        self._publish(Twist())
        return True

    def close(self) -> None:
        """Stop the vehicle."""
        self._publish(Twist())
