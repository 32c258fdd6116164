# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a vehicle of the evaluation moves, and what its sensors measure of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import InertialSample, Pose
from peace_ros.core.domain.geometry import (
    GRAVITY_M_S2,
    quaternion_from_euler,
    rotation_matrix,
)

_STEP_S = 1e-3
_RATES_NOISE_RAD_S = radians(0.1)
_RATES_BIAS_RAD_S = radians(0.03)
_FORCE_NOISE_M_S2 = 0.15
_FORCE_BIAS_M_S2 = 0.05
_START_NS = 1_000_000_000


@dataclass(frozen=True)
class Motion:
    """A flight with constant velocity, to which swaying and leaning are added."""

    height_m: float
    """At the start."""
    speed_m_s: float = 0.0
    course_rad: float = 0.0
    climb_m_s: float = 0.0
    sway_m_s: float = 0.0
    """The velocity to the right of the course swings by so much."""
    sway_period_s: float = 4.0
    lean_deg: float = 0.0
    """Roll and pitch swing by so much."""
    lean_period_s: float = 3.0
    yaw_deg: float = 0.0
    yaw_rate_deg_s: float = 0.0
    north_m: float = 0.0
    east_m: float = 0.0

    def stamp_ns(self, time_s: float) -> int:
        """Return the stamp of a moment of the flight."""
        return _START_NS + round(time_s * 1e9)

    def time_s(self, stamp_ns: int) -> float:
        """Return the moment of a stamp."""
        return (stamp_ns - _START_NS) * 1e-9

    def pose(self, time_s: float) -> Pose:
        """Return the true pose."""
        swing = 2.0 * pi / self.sway_period_s
        aside_m = self.sway_m_s / swing * (1.0 - cos(swing * time_s))
        along_m, course = self.speed_m_s * time_s, self.course_rad
        lean, phase = radians(self.lean_deg), 2.0 * pi * time_s / self.lean_period_s
        height_m = self.height_m + self.climb_m_s * time_s
        return Pose(
            self.stamp_ns(time_s),
            self.north_m + along_m * cos(course) - aside_m * sin(course),
            self.east_m + along_m * sin(course) + aside_m * cos(course),
            -height_m,
            quaternion_from_euler(
                lean * sin(phase),
                lean * cos(0.8 * phase),
                radians(self.yaw_deg + self.yaw_rate_deg_s * time_s),
            ),
            height_m,
        )

    def velocity(self, time_s: float) -> NDArray[np.float64]:
        """Return the true velocity (3,): north, east, down."""
        return (self._at(time_s + _STEP_S) - self._at(time_s - _STEP_S)) / (2.0 * _STEP_S)

    def _at(self, time_s: float) -> NDArray[np.float64]:
        pose = self.pose(time_s)
        return np.array([pose.north_m, pose.east_m, pose.down_m])

    def _turned(self, time_s: float) -> NDArray[np.float64]:
        return rotation_matrix(self.pose(time_s).quaternion_ned_frd)

    def rates_and_force(self, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return true body rates (3,) in rad/s and specific force (3,) in m/s^2."""
        before, now, after = (self._turned(time_s + step * _STEP_S) for step in (-1, 0, 1))
        spin = now.T @ (after - before) / (2.0 * _STEP_S)
        around = 10.0 * _STEP_S
        ends = self._at(time_s + around) + self._at(time_s - around)
        acceleration = (ends - 2.0 * self._at(time_s)) / around**2
        force = now.T @ (acceleration - np.array([0.0, 0.0, GRAVITY_M_S2]))
        return np.array([spin[2, 1], spin[0, 2], spin[1, 0]]), force


class InertialUnit:
    """Measures a motion with noise and bias.

    Args:
        motion: The true one.
        random: Source of noise.
        error: Multiplies noise and bias.
    """

    def __init__(self, motion: Motion, random: np.random.Generator, error: float = 1.0) -> None:
        self._motion = motion
        self._random = random
        self._error = error
        self._rates_bias = error * random.normal(0.0, _RATES_BIAS_RAD_S, 3)
        self._force_bias = error * random.normal(0.0, _FORCE_BIAS_M_S2, 3)

    def measure(self, time_s: float) -> InertialSample:
        """Return what is measured at a moment."""
        rates, force = self._motion.rates_and_force(time_s)
        noise = self._error * self._random.standard_normal((2, 3))
        rates = rates + self._rates_bias + noise[0] * _RATES_NOISE_RAD_S
        force = force + self._force_bias + noise[1] * _FORCE_NOISE_M_S2
        return InertialSample(
            self._motion.stamp_ns(time_s),
            (float(rates[0]), float(rates[1]), float(rates[2])),
            (float(force[0]), float(force[1]), float(force[2])),
        )
