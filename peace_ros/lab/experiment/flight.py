# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One landing in lock step: policy, eyes, camera and vehicle in simulated time, no middleware."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from peace_ros.core.domain import Heatmap, Pose, Telemetry
from peace_ros.lab.experiment.eyes import Eyes
from peace_ros.lab.experiment.places import START_ALTITUDE_M, Start
from peace_ros.lab.experiment.policies import Policy
from peace_ros.lab.experiment.seeing import SeenGround
from peace_ros.simulation.autopilot.hovering import hovering, velocity_target
from peace_ros.simulation.autopilot.physics import Physics
from peace_ros.simulation.camera import NadirCamera

LIMIT_S = 1200.0
"""Of a run, as in the paper."""
_TICK_S = 0.01
_POSE_S, _LINE_DELAY_S = 0.04, 0.04
_STEP_S = 0.04
"""The landing node decides 25 times a second."""
_TRACK_S = 1.0


@dataclass(frozen=True)
class Perception:
    """When heatmaps are made, and how late they are."""

    rate_hz: float = 0.82
    latency_s: float = 0.3
    """From the exposure of the frame to the heatmap at the landing."""


@dataclass(frozen=True)
class TrackedPose:
    """The true vehicle at one moment."""

    time_s: float
    """Since the start."""
    pose: Pose
    state: str


@dataclass
class Flown:
    """What happened in one run."""

    outcome: str = 'timeout'
    """`handover`, `no_zone`, `timeout`, `battery` or `aborted`."""
    reason: str = ''
    time_s: float = 0.0
    attempts: int = 0
    heatmaps: int = 0
    state_s: dict[str, float] = field(default_factory=dict)
    """Seconds in each state."""
    track: list[TrackedPose] = field(default_factory=list)
    """One pose a second, and the last."""
    seen: SeenGround = field(default_factory=SeenGround)


class LockStepFlight:
    """One vehicle with its landing; time passes only in here.

    Args:
        camera: over the world, in the local frame of the vehicle.
        start: where it hovers first.
        eyes: make the heatmaps.
        policy: lands it.
        perception: when heatmaps come.
        limit_s: the run is over then.
    """

    def __init__(
        self,
        camera: NadirCamera,
        start: Start,
        eyes: Eyes,
        policy: Policy,
        perception: Perception,
        limit_s: float = LIMIT_S,
    ) -> None:
        self._camera, self._eyes, self._policy = camera, eyes, policy
        self._perception, self._limit_s = perception, limit_s
        physics = Physics(heading_rad=start.heading_rad, seed=start.seed)
        self._flight = hovering(physics, START_ALTITUDE_M)
        self._begin_s = self._flight.time_s
        self._due_s = dict.fromkeys(('pose', 'frame', 'step', 'track'), self._begin_s)
        self._poses: deque[tuple[float, Telemetry]] = deque()
        self._heatmaps: deque[tuple[float, Heatmap]] = deque()
        self._telemetry = Telemetry(received_ns=0)
        self._told_s = self._begin_s
        self._state = ''
        self._flown = Flown()

    @property
    def _now_s(self) -> float:
        return self._flight.time_s

    @property
    def _elapsed_s(self) -> float:
        return self._flight.time_s - self._begin_s

    def run(self) -> Flown:
        """Fly until the policy has an outcome, or the time is over."""
        over = False
        while not over and self._elapsed_s < self._limit_s:
            if self._is_due('pose', _POSE_S):
                self._report()
            if self._is_due('frame', 1.0 / self._perception.rate_hz):
                self._look()
            self._receive()
            if self._is_due('step', _STEP_S):
                over = self._decide()
            if self._is_due('track', _TRACK_S):
                self._keep_track()
            if not over:
                self._flight.step(_TICK_S)
        self._flown.time_s = self._elapsed_s
        self._keep_track()
        return self._flown

    def _is_due(self, name: str, period_s: float) -> bool:
        if self._now_s + 1e-9 < self._due_s[name]:
            return False
        self._due_s[name] += period_s
        return True

    def _pose(self) -> Pose:
        physics = self._flight.physics
        return Pose(
            round(self._now_s * 1e9),
            physics.north_m,
            physics.east_m,
            physics.down_m,
            physics.quaternion_ned_frd,
            -physics.down_m,
        )

    def _report(self) -> None:
        telemetry = Telemetry(
            1,
            self._pose(),
            *self._flight.velocity_m_s,
            armed=self._flight.armed,
            in_control=True,
            mode='GUIDED',
            landed=self._flight.landed,
        )
        self._poses.append((self._now_s + _LINE_DELAY_S, telemetry))

    def _look(self) -> None:
        pose = self._pose()
        view = self._camera.view(pose)
        heatmap = self._eyes.see(view, pose.stamp_ns)
        if heatmap is None:
            return
        self._flown.seen.add(heatmap, view)
        self._heatmaps.append((self._now_s + self._perception.latency_s, heatmap))

    def _receive(self) -> None:
        while self._poses and self._poses[0][0] <= self._now_s:
            self._told_s, self._telemetry = self._poses.popleft()
            if self._telemetry.pose is not None:
                self._policy.add_pose(self._telemetry.pose)
        while self._heatmaps and self._heatmaps[0][0] <= self._now_s:
            self._policy.add_heatmap(self._heatmaps.popleft()[1])
            self._flown.heatmaps += 1

    def _decide(self) -> bool:
        now_ns = round(self._now_s * 1e9)
        command = self._policy.step(now_ns, self._telemetry, self._now_s - self._told_s)
        self._state = command.state
        flown = self._flown
        flown.state_s[command.state] = flown.state_s.get(command.state, 0.0) + _STEP_S
        flown.reason, flown.attempts = command.reason, command.attempts
        self._flight.take_velocity(velocity_target(command.setpoint))
        if command.outcome is None:
            return False
        flown.outcome = command.outcome
        return True

    def _keep_track(self) -> None:
        self._flown.track.append(TrackedPose(self._elapsed_s, self._pose(), self._state))
