# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A closed loop in simulated time: a point-mass vehicle over painted ground, seen by a camera."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import atan, exp, hypot

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, Heatmap, Pose, Setpoint, Telemetry
from peace_ros.core.domain.geometry import ground_to_image, quaternion_from_euler
from peace_ros.core.landing import Decision, LandingCore, LandingParameters, State
from peace_ros.core.mapping import MapParameters

cv2.setNumThreads(1)  # one of two cores; the pictures are small

STEP_S = 0.1
PAINT_M = 0.5
PAINT_HALF_M = 150.0


@dataclass
class Vehicle:
    """Answers as the measured autopilot: a delay, then first order; tilts with acceleration."""

    north_m: float = 0.0
    east_m: float = 0.0
    altitude_m: float = 70.0
    yaw_rad: float = 0.7
    wind_tilt_rad: float = 0.0
    drift_m_s: float = 0.0
    v: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    a_north: float = 0.0
    a_east: float = 0.0
    queue: deque = field(default_factory=lambda: deque([(0.0, 0.0, 0.0)] * 3))

    def fly(self, setpoint: Setpoint) -> None:
        self.queue.append((setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s))
        wish = self.queue.popleft()
        before = list(self.v)
        for axis, time_constant in enumerate((0.55, 0.55, 0.5)):
            self.v[axis] += (wish[axis] - self.v[axis]) * (1.0 - exp(-STEP_S / time_constant))
        self.a_north = (self.v[0] - before[0]) / STEP_S
        self.a_east = (self.v[1] - before[1]) / STEP_S
        self.north_m += (self.v[0] + self.drift_m_s) * STEP_S
        self.east_m += self.v[1] * STEP_S
        self.altitude_m -= self.v[2] * STEP_S

    def pose(self, stamp_ns: int) -> Pose:
        # Acceleration forward needs the nose down, to the right the right wing down.
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        forward = self.a_north * c + self.a_east * s
        right = -self.a_north * s + self.a_east * c
        attitude = quaternion_from_euler(
            atan(right / 9.81), -atan(forward / 9.81) + self.wind_tilt_rad, self.yaw_rad
        )
        return Pose(
            stamp_ns, self.north_m, self.east_m, -self.altitude_m, attitude, self.altitude_m
        )


class WindyVehicle(Vehicle):
    """Holds velocity with a PI loop against wind and gusts, and leans into them.

    0.5 m/s^2 per m/s of wind is the lean of 22 degrees that was measured at 8 m/s. The gusts are
    first-order noise of 2 s, as a Dryden spectrum has low above ground.
    """

    def __init__(self, wind_m_s: float, gust_m_s: float, seed: int, **given) -> None:
        super().__init__(**given)
        self.wind = np.array([wind_m_s, 0.0])
        self.gust_m_s = gust_m_s
        self.gust = np.zeros(2)
        self.trim = -0.5 * self.wind  # it has hovered here for a while
        self.random = np.random.default_rng(seed)

    def fly(self, setpoint: Setpoint) -> None:
        self.queue.append((setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s))
        wish = self.queue.popleft()
        kept = exp(-STEP_S / 2.0)
        noise = self.random.standard_normal(2)
        self.gust = kept * self.gust + self.gust_m_s * (1.0 - kept * kept) ** 0.5 * noise
        v = np.array(self.v[:2])
        error = np.array(wish[:2]) - v
        self.trim = self.trim + 0.5 * error * STEP_S
        thrust = np.clip(error / 0.55 + self.trim, -5.0, 5.0)
        v = v + (thrust + 0.5 * (self.wind + self.gust)) * STEP_S
        self.a_north, self.a_east = float(thrust[0]), float(thrust[1])
        vertical = self.v[2] + (wish[2] - self.v[2]) * (1.0 - exp(-STEP_S / 0.5))
        self.v = [float(v[0]), float(v[1]), vertical]
        self.north_m += self.v[0] * STEP_S
        self.east_m += self.v[1] * STEP_S
        self.altitude_m -= self.v[2] * STEP_S


class Ground:
    """Painted truth: 0.9 safe, 0.1 unsafe; rows to the north, columns to the east."""

    def __init__(self) -> None:
        cells = int(2 * PAINT_HALF_M / PAINT_M)
        self.paint = np.full((cells, cells), 0.1, np.float32)

    def _pixel(self, north_m: float, east_m: float) -> tuple[int, int]:
        return (
            round((east_m + PAINT_HALF_M) / PAINT_M),
            round((north_m + PAINT_HALF_M) / PAINT_M),
        )

    def disc(self, north_m: float, east_m: float, radius_m: float, value: float = 0.9) -> Ground:
        centre = self._pixel(north_m, east_m)
        cv2.circle(self.paint, centre, round(radius_m / PAINT_M), value, -1)
        return self

    def box(self, low, high, value: float = 0.9) -> Ground:
        cv2.rectangle(self.paint, self._pixel(*low), self._pixel(*high), value, -1)
        return self

    def clearance_m(self, north_m: float, east_m: float) -> float:
        distance = cv2.distanceTransform((self.paint > 0.5).astype(np.uint8), cv2.DIST_L2, 5)
        column, row = self._pixel(north_m, east_m)
        return float(distance[row, column]) * PAINT_M

    def seen_by(self, camera: Camera, pose: Pose, size_px: int) -> np.ndarray:
        matrix = ground_to_image(camera.resized(size_px, size_px), pose) @ np.array(
            [
                [0.0, PAINT_M, -PAINT_HALF_M],
                [PAINT_M, 0.0, -PAINT_HALF_M],
                [0.0, 0.0, 1.0],
            ]
        )
        return cv2.warpPerspective(
            self.paint, matrix, (size_px, size_px), flags=cv2.INTER_LINEAR, borderValue=0.1
        )


@dataclass
class Flight:
    """One closed-loop run; ``run`` returns when the landing is over or time is up."""

    ground: Ground
    vehicle: Vehicle = field(default_factory=Vehicle)
    parameters: LandingParameters = field(default_factory=LandingParameters)
    heatmap_period_s: float = 0.2
    latency_s: float = 0.2
    size_px: int = 96
    map_parameters: MapParameters = field(default_factory=lambda: MapParameters(map_size_m=160.0))
    spoil: Callable[[np.ndarray, float], np.ndarray | None] = lambda safety, _t: safety
    """Turns the true heatmap at a time into the one that is sent; None sends nothing."""
    happen: Callable[[Flight], None] = lambda _flight: None
    """Called every step: changes the ground, the telemetry, the vehicle."""
    in_control: bool = True
    armed: bool = True
    telemetry_age_s: float = 0.05
    time_s: float = 0.0
    log: list[tuple[float, Pose, Decision]] = field(default_factory=list)

    def __post_init__(self) -> None:
        camera = Camera.from_degrees(352, 352, 73)
        self.camera = camera
        self.core = LandingCore(self.parameters, camera, self.map_parameters)
        self.core.engage()
        self._next_frame_s = 0.0
        self._under_way: deque = deque()

    def step(self) -> Decision:
        self.happen(self)
        now_ns = round((100.0 + self.time_s) * 1e9)
        pose = self.vehicle.pose(now_ns)
        self.core.add_pose(pose)
        if self.time_s >= self._next_frame_s - 1e-9:
            self._next_frame_s += self.heatmap_period_s
            safety = self.spoil(self.ground.seen_by(self.camera, pose, self.size_px), self.time_s)
            if safety is not None:
                heatmap = Heatmap(np.clip(safety, 0.0, 1.0).astype(np.float32), now_ns)
                self._under_way.append((self.time_s + self.latency_s, heatmap))
        while self._under_way and self._under_way[0][0] <= self.time_s:
            self.core.add_heatmap(self._under_way.popleft()[1])
        telemetry = Telemetry(
            0, pose, *self.vehicle.v, self.armed, self.in_control, mode='GUIDED', landed=False
        )
        decision = self.core.step(now_ns, telemetry, self.telemetry_age_s)
        self.log.append((self.time_s, pose, decision))
        self.vehicle.fly(decision.setpoint)
        self.time_s += STEP_S
        return decision

    def run(
        self, limit_s: float = 200.0, until: Callable[[Flight], bool] | None = None
    ) -> Decision:
        decision = self.step()
        while self.time_s < limit_s and decision.outcome is None:
            decision = self.step()
            if until is not None and until(self):
                break
        return decision

    @property
    def states(self) -> list[State]:
        """Every state once per visit, in order."""
        found: list[State] = []
        for _, _, decision in self.log:
            if not found or found[-1] is not decision.state:
                found.append(decision.state)
        return found

    @property
    def lowest_m(self) -> float:
        return min(pose.altitude_agl_m for _, pose, _ in self.log)

    def distance_to_m(self, north_m: float, east_m: float) -> float:
        return hypot(self.vehicle.north_m - north_m, self.vehicle.east_m - east_m)


@pytest.fixture
def flight_over():
    """Build a flight over painted ground."""

    def build(ground: Ground, **changes) -> Flight:
        return Flight(ground, **changes)

    return build


@pytest.fixture
def bare_ground():
    """Ground without any safe place, to paint on."""
    return Ground()


@pytest.fixture
def make_vehicle():
    return Vehicle


@pytest.fixture
def make_windy_vehicle():
    return WindyVehicle


@pytest.fixture
def make_ground():
    return Ground
