# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing policy that DOVESEI published, for comparison over the same heatmaps.

It has no map: it remembers one filtered heatmap, chooses a place in each frame anew, lowers its
threshold until a tenth of the image can be landed on, and commands a velocity only when a heatmap
comes. It is not for real vehicles. Values are those of the released parameter file; the hand-over
at 20 m is the paper's.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import cos, exp, hypot, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Heatmap, Pose, Setpoint, Telemetry
from peace_ros.core.domain.geometry import yaw_from_quaternion
from peace_ros.lab.experiment.policies import Command


@dataclass(frozen=True)
class DoveseiParameters:
    """As released, besides the altitude of the hand-over."""

    beta: float = 1.0 / 20.0
    """Weight of a new heatmap in the filtered one."""
    gain: float = 0.5
    aiming_gain: float = 0.5
    """Multiplies the gain in AIMING."""
    integrator_limit: float = 1.0
    z_speed_landing: float = 3.0
    z_gain_landing: float = 0.02
    z_min_speed_landing: float = 0.5
    z_speed_climbing: float = 6.0
    lateral_limit_m_s: float = 15.0
    vertical_limit_m_s: float = 5.0
    safe_altitude_m: float = 50.0
    handover_altitude_m: float = 20.0
    aiming_floor: float = 1.1
    """AIMING descends to this many safe altitudes."""
    safety_radius_m: float = 1.5
    aiming_focus: float = 6.0
    """Radius of the mask, in safety radii."""
    landing_focus: float = 2.0
    focus_step: float = 0.1
    safety_threshold: float = 0.8
    dynamic_threshold: float = 0.10
    """Share of the image that must be landable, whatever the threshold."""
    threshold_steps: int = 100
    distance_threshold: float = 0.6
    """On the normalised distance to unsafe ground, before contours are found."""
    blur_px: int = 15
    giveup_after_s: float = 5.0
    search4new_place_s: float = 60.0
    max_landing_s: float = 300.0
    min_conservative_gain: float = 0.5
    warm_up: int = 5


class DoveseiState(str, Enum):
    """The states that move the vehicle, as published."""

    SEARCHING = 'SEARCHING'
    AIMING = 'AIMING'
    LANDING = 'LANDING'
    WAITING = 'WAITING'
    CLIMBING = 'CLIMBING'
    RESTARTING = 'RESTARTING'
    LANDED = 'LANDED'


@dataclass(frozen=True)
class _Sight:
    """What one frame shows."""

    targets_m: tuple[tuple[float, float], ...]
    """(forward, right) of the places in view, the best first."""
    clear_below: bool
    """The circle of the safety radius around the middle of the image can be landed on."""


class DoveseiPolicy:
    """See the module.

    Args:
        camera: of the frames; the heatmaps cover them.
        parameters: of the policy.
    """

    def __init__(self, camera: Camera, parameters: DoveseiParameters | None = None) -> None:
        self._p = parameters or DoveseiParameters()
        self._camera = camera
        self._filtered: NDArray[np.float32] | None = None
        self._focus_px: float | None = None
        self._state = DoveseiState.SEARCHING
        self._since_s: float | None = None
        self._begin_s: float | None = None
        self._integral = np.zeros(2)
        self._heatmaps = self._attempts = 0
        self._command = Setpoint(0)
        self._pending: Heatmap | None = None
        self._second: tuple[float, float] | None = None

    def add_pose(self, _pose: Pose) -> None:
        """Poses of the past are not used: a frame is steered by where the vehicle is now."""

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """Keep the newest heatmap for the next step."""
        self._pending = heatmap

    def step(self, now_ns: int, telemetry: Telemetry, _age_s: float) -> Command:
        """Decide on a new heatmap; between heatmaps the last velocity is repeated."""
        now_s, pose = now_ns * 1e-9, telemetry.pose
        if self._begin_s is None or self._since_s is None:
            self._begin_s = self._since_s = now_s
        if pose is not None and pose.altitude_agl_m <= self._p.handover_altitude_m:
            self._enter(DoveseiState.LANDED, now_s)
            self._command = Setpoint(0)
        elif self._pending is not None and pose is not None:
            heatmap, self._pending = self._pending, None
            self._heatmaps += 1
            sight = self._look(heatmap, pose.altitude_agl_m, now_s)
            self._advance(sight, pose.altitude_agl_m, now_s)
            self._command = self._steer(sight, pose, heatmap.stamp_ns)
        return Command(
            state=self._state.value,
            reason=f'DOVESEI: {self._state.value}',
            setpoint=self._command,
            outcome='handover' if self._state is DoveseiState.LANDED else None,
            attempts=self._attempts,
        )

    def _conservative_gain(self, now_s: float) -> float:
        elapsed_s = max(now_s - (self._begin_s or 0.0), 1e-3)
        return max(
            self._p.min_conservative_gain,
            1.0 - exp(min(0.0, 1.0 - self._p.max_landing_s / elapsed_s)),
        )

    def _look(self, heatmap: Heatmap, altitude_m: float, now_s: float) -> _Sight:
        p = self._p
        if self._filtered is None:
            self._filtered = np.zeros_like(heatmap.safety)
        self._filtered += np.float32(p.beta) * (heatmap.safety - self._filtered)
        score = cv2.blur(self._filtered, (p.blur_px, p.blur_px))
        height, width = score.shape
        metres_per_px = altitude_m / self._camera.resized(width, height).focal_px
        middle = ((width - 1) / 2.0, (height - 1) / 2.0)
        away_px = np.hypot(
            np.arange(width)[None, :] - middle[0], np.arange(height)[:, None] - middle[1]
        )
        focus = away_px <= self._moved_focus(float(away_px.max()), metres_per_px)
        landable = focus & (score >= self._threshold(score, focus, now_s))
        below = landable[away_px <= max(p.safety_radius_m / metres_per_px, 1.0)]
        targets = [
            ((middle[1] - row) * metres_per_px, (column - middle[0]) * metres_per_px)
            for column, row in self._places(landable, middle)
        ]
        return _Sight(tuple(targets), bool(below.all()))

    def _moved_focus(self, whole_px: float, metres_per_px: float) -> float:
        """Return the radius of the mask, which moves a part of its way with each frame."""
        radii = {
            DoveseiState.AIMING: self._p.aiming_focus,
            DoveseiState.LANDING: self._p.landing_focus,
        }.get(self._state)
        wanted = whole_px
        if radii is not None:
            wanted = min(whole_px, radii * self._p.safety_radius_m / metres_per_px)
        before = whole_px if self._focus_px is None else self._focus_px
        self._focus_px = before + self._p.focus_step * (wanted - before)
        return self._focus_px

    def _threshold(
        self, score: NDArray[np.float32], focus: NDArray[np.bool_], now_s: float
    ) -> float:
        """Return the threshold, which sinks until enough of what is in focus can be landed on."""
        p = self._p
        highest = p.safety_threshold * self._conservative_gain(now_s)
        least = p.dynamic_threshold * np.count_nonzero(focus)
        for step in range(p.threshold_steps):
            threshold = highest * (1.0 - step / p.threshold_steps)
            if np.count_nonzero(focus & (score >= threshold)) >= least:
                return threshold
        return highest / p.threshold_steps

    def _places(
        self, landable: NDArray[np.bool_], middle: tuple[float, float]
    ) -> list[tuple[int, int]]:
        """Return (column, row) of the places, the one with the best objective first."""
        mask = landable.astype(np.uint8)
        mask[[0, -1], :] = mask[:, [0, -1]] = 0
        distance = cv2.distanceTransform(mask, cv2.DIST_L2, 5)
        if distance.max() <= 0.0:
            return []
        inner = (distance / distance.max() > self._p.distance_threshold).astype(np.uint8)
        contours, _ = cv2.findContours(inner, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        places = []
        for contour in contours:
            area, perimeter = cv2.contourArea(contour), cv2.arcLength(contour, True)
            if area == 0.0 or perimeter == 0.0:
                continue
            within = cv2.drawContours(np.zeros_like(inner), [contour], -1, 1, cv2.FILLED)
            row, column = np.unravel_index(np.argmax(distance * within), distance.shape)
            away = hypot(column - middle[0], row - middle[1])
            places.append((area / perimeter / (away + 1.0), (int(column), int(row))))
        return [place for _, place in sorted(places, reverse=True)]

    def _advance(self, sight: _Sight, altitude_m: float, now_s: float) -> None:
        p, state = self._p, self._state
        in_state_s = now_s - (self._since_s or 0.0)
        high = altitude_m >= p.safe_altitude_m
        target = sight.targets_m[0] if sight.targets_m else None
        over = target is not None and hypot(*target) <= p.safety_radius_m and sight.clear_below
        if state is DoveseiState.SEARCHING and self._heatmaps >= p.warm_up and target is not None:
            self._enter(DoveseiState.AIMING, now_s)
        elif state is DoveseiState.AIMING:
            if target is None:
                self._enter(DoveseiState.WAITING, now_s)
            elif over and altitude_m <= p.aiming_floor * p.safe_altitude_m + 1.0:
                self._enter(DoveseiState.LANDING, now_s)
        elif state is DoveseiState.LANDING and not sight.clear_below:
            self._enter(DoveseiState.WAITING, now_s)
        elif state is DoveseiState.WAITING:
            if sight.clear_below:
                self._enter(DoveseiState.AIMING if high else DoveseiState.LANDING, now_s)
            elif in_state_s > p.giveup_after_s:
                self._attempts += 1
                self._second = sight.targets_m[1] if len(sight.targets_m) > 1 else None
                self._enter(DoveseiState.RESTARTING if high else DoveseiState.CLIMBING, now_s)
        elif state is DoveseiState.CLIMBING and high:
            self._enter(DoveseiState.RESTARTING, now_s)
        elif state is DoveseiState.RESTARTING and in_state_s > p.search4new_place_s:
            self._enter(DoveseiState.SEARCHING, now_s)

    def _enter(self, state: DoveseiState, now_s: float) -> None:
        if state is self._state:
            return
        self._state, self._since_s = state, now_s
        self._integral[:] = 0.0
        if state is DoveseiState.SEARCHING:
            self._heatmaps = 0

    def _steer(self, sight: _Sight, pose: Pose, stamp_ns: int) -> Setpoint:
        p, state, altitude_m = self._p, self._state, pose.altitude_agl_m
        error = np.array(sight.targets_m[0] if sight.targets_m else (0.0, 0.0))
        body, down = np.zeros(2), 0.0
        descent = min(
            max(p.z_min_speed_landing, p.z_gain_landing * p.z_speed_landing * altitude_m),
            p.vertical_limit_m_s,
        )
        if state is DoveseiState.SEARCHING:
            body = p.gain * error
        elif state is DoveseiState.AIMING:
            self._integral = np.clip(
                self._integral + error, -p.integrator_limit, p.integrator_limit
            )
            body = p.gain * p.aiming_gain * error + self._integral
            if altitude_m > p.aiming_floor * p.safe_altitude_m:
                down = 0.5 * descent
        elif state is DoveseiState.LANDING:
            body, down = p.gain * error, descent
        elif state is DoveseiState.CLIMBING:
            down = -min(p.z_speed_climbing, p.vertical_limit_m_s)
        elif state is DoveseiState.RESTARTING and self._second is not None:
            body = p.gain * np.array(self._second)
        speed = float(np.hypot(*body))
        if speed > p.lateral_limit_m_s:
            body *= p.lateral_limit_m_s / speed
        yaw = yaw_from_quaternion(pose.quaternion_ned_frd)
        forward, right = float(body[0]), float(body[1])
        return Setpoint(
            stamp_ns,
            forward * cos(yaw) - right * sin(yaw),
            forward * sin(yaw) + right * cos(yaw),
            down,
        )
