# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One flight of the odometry over simulated ground, and how far off it was."""

from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import hypot
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Frame, Pose
from peace_ros.core.mapping import Displacement, View, register, small_grey
from peace_ros.core.odometry import Doubt, OdometryParameters, VisualInertialOdometry
from peace_ros.lab.evaluation.odometry.motion import InertialUnit, Motion

CAMERA = Camera.from_degrees(352, 352, 73.0)
SAMPLE_HZ = 100
See = Callable[[Pose, float], NDArray[np.uint8]]
"""What the camera sees from a pose at a moment of the flight (s)."""
_PAGE_BYTES = 4096


@dataclass(frozen=True)
class Conditions:
    """What is not ideal in a flight."""

    frames_hz: float = 10.0
    grey_noise: float = 3.0
    """Standard deviation in grey levels."""
    altitude_factor: float = 1.0
    """Reported over true altitude."""
    lag_s: float = 0.0
    """Stamps of the inertial samples are late by so much."""
    flicker: float = 0.0
    """The exposure of each frame is off by up to this part."""
    dark_from_s: float = 0.0
    dark_until_s: float = 0.0
    """The lens is covered meanwhile."""


@dataclass
class FlightErrors:
    """How far off the estimates of a flight were."""

    frames: int = 0
    stamps_s: list[float] = field(default_factory=list)
    """Of the estimates."""
    errors_m_s: list[tuple[float, float]] = field(default_factory=list)
    """North and east, of each velocity that was told."""
    speeds_m_s: list[float] = field(default_factory=list)
    """True horizontal speeds of the same moments."""
    told_m_s: list[float] = field(default_factory=list)
    """Standard deviations that were told, the larger of north and east."""
    position_error_m: float = float('nan')
    """At the last estimate."""
    doubts: Counter[str] = field(default_factory=Counter)
    used_s: list[float] = field(default_factory=list)
    """Time of the processor, per frame."""

    @property
    def bias_m_s(self) -> float:
        """Length of the mean error."""
        return float(np.hypot(*np.mean(self.errors_m_s, axis=0))) if self.errors_m_s else 0.0

    @property
    def deviation_m_s(self) -> float:
        """Larger standard deviation of north and east."""
        return float(np.std(self.errors_m_s, axis=0).max()) if self.errors_m_s else 0.0

    @property
    def lengths_m_s(self) -> list[float]:
        """Lengths of the errors."""
        return [hypot(*each) for each in self.errors_m_s]


class SeenMotion:
    """Frames and inertial samples of a motion.

    Args:
        motion: The true one.
        see: What the camera sees.
        seed: Of all noise.
        conditions: What is not ideal.
    """

    def __init__(
        self, motion: Motion, see: See, seed: int, conditions: Conditions | None = None
    ) -> None:
        self.motion = motion
        self.conditions = conditions or Conditions()
        self._see = see
        self._random = np.random.default_rng(seed)
        self._unit = InertialUnit(motion, self._random)
        self._samples = 0

    def frame(self, number: int) -> Frame:
        """Return the frame of that number; the first one is 1."""
        with_noise, now = self.conditions, number / self.conditions.frames_hz
        pose = self.motion.pose(now)
        if with_noise.dark_from_s < now < with_noise.dark_until_s:
            picture = np.zeros((CAMERA.height_px, CAMERA.width_px, 3), np.float32)
        else:
            picture = self._see(pose, now).astype(np.float32)
        picture *= self._random.uniform(1.0 - with_noise.flicker, 1.0 + with_noise.flicker)
        noise = self._random.standard_normal((*picture.shape[:2], 1), np.float32)
        picture += with_noise.grey_noise * noise
        return Frame(np.clip(picture, 0.0, 255.0).astype(np.uint8), pose.stamp_ns)

    def feed(self, odometry: VisualInertialOdometry, until_s: float) -> None:
        """Give the inertial samples up to a moment, and one more."""
        lag_s = self.conditions.lag_s
        while (self._samples - 1) / SAMPLE_HZ <= until_s:
            sample = self._unit.measure(self._samples / SAMPLE_HZ - lag_s)
            late = self.motion.stamp_ns(self._samples / SAMPLE_HZ)
            odometry.add_inertial(
                type(sample)(late, sample.rates_rad_s, sample.specific_force_m_s2)
            )
            self._samples += 1


def fly(
    seen: SeenMotion, seconds: float, parameters: OdometryParameters | None = None
) -> FlightErrors:
    """Show a motion to the odometry and compare what it says with the truth."""
    motion, conditions, found = seen.motion, seen.conditions, FlightErrors()
    odometry = VisualInertialOdometry(CAMERA, parameters=parameters)
    north, east, down = (float(each) for each in motion.velocity(0.0))
    odometry.align(motion.pose(0.0), (north, east, down))
    for number in range(1, int(seconds * conditions.frames_hz) + 1):
        now_s = number / conditions.frames_hz
        seen.feed(odometry, now_s)
        frame, pose = seen.frame(number), motion.pose(now_s)
        begun_s = process_time()
        said = odometry.add_frame(frame, conditions.altitude_factor * pose.altitude_agl_m)
        found.used_s.append(process_time() - begun_s)
        found.frames += 1
        if isinstance(said, Doubt):
            found.doubts[said.name] += 1
            continue
        true = motion.velocity(motion.time_s(said.velocity_stamp_ns))
        off = said.velocity_m_s - true
        found.stamps_s.append(now_s)
        found.errors_m_s.append((float(off[0]), float(off[1])))
        found.speeds_m_s.append(hypot(true[0], true[1]))
        told = np.diag(said.velocity_covariance_m2_s2)[:2].max()
        found.told_m_s.append(float(np.sqrt(told)))
        found.position_error_m = hypot(
            said.pose.north_m - pose.north_m, said.pose.east_m - pose.east_m
        )
    return found


def register_along(seen: SeenMotion, seconds: float) -> FlightErrors:
    """Compare frames 0.4 s apart by registration, with the true attitude."""
    motion, hz, found = seen.motion, seen.conditions.frames_hz, FlightErrors()
    views: list[View] = []
    for number in range(1, int(seconds * hz) + 1):
        frame = seen.frame(number)
        views.append(View(small_grey(frame.image_rgb), motion.pose(number / hz)))
        apart = round(0.4 * hz)
        if len(views) <= apart:
            continue
        begun_s = process_time()
        moved = register(views[-1 - apart], views[-1], CAMERA)
        found.used_s.append(process_time() - begun_s)
        found.frames += 1
        if isinstance(moved, Displacement):
            true = motion.velocity((number - 0.5 * apart) / hz)
            span_s = apart / hz
            found.errors_m_s.append(
                (moved.north_m / span_s - true[0], moved.east_m / span_s - true[1])
            )
        else:
            found.doubts[moved.name] += 1
    return found


def memory_mb(seen: SeenMotion, frames: int) -> float:
    """Return by how much the process grows while the odometry runs, at most (MB, 10^6 bytes)."""
    shown = [seen.frame(number) for number in range(1, frames + 1)]
    gc.collect()
    before = largest = _resident_bytes()
    odometry = VisualInertialOdometry(CAMERA)
    north, east, down = (float(each) for each in seen.motion.velocity(0.0))
    odometry.align(seen.motion.pose(0.0), (north, east, down))
    for number, frame in enumerate(shown, start=1):
        now_s = number / seen.conditions.frames_hz
        seen.feed(odometry, now_s)
        odometry.add_frame(frame, seen.motion.pose(now_s).altitude_agl_m)
        largest = max(largest, _resident_bytes())
    return (largest - before) * 1e-6


def _resident_bytes() -> int:
    return int(Path('/proc/self/statm').read_text().split()[1]) * _PAGE_BYTES


def times_ms(flights: Sequence[FlightErrors]) -> str:
    """Return mean, median and 95th percentile of the time of the processor per frame."""
    times = 1e3 * np.array([each for one in flights for each in one.used_s])
    median, late = np.percentile(times, (50, 95))
    return f'mean {times.mean():.1f} ms, median {median:.1f} ms, 95 % {late:.1f} ms'
