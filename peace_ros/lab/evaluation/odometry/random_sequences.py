# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Short flights drawn at random: how often is a velocity told that is wrong?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import exp, log, pi

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Pose
from peace_ros.lab.evaluation.odometry.flight import (
    CAMERA,
    Conditions,
    FlightErrors,
    See,
    SeenMotion,
    fly,
)
from peace_ros.lab.evaluation.odometry.ground import HillCamera, draw_hills
from peace_ros.lab.evaluation.odometry.motion import Motion
from peace_ros.simulation import NadirCamera, World, draw_world

SECONDS = 2.0
WRONG_M_S, WRONG_PART, LEAST_WRONG_M_S = 1.0, 0.2, 0.3
"""A velocity is wrong when it is off by more than the first; or by more than the second of the
speed, and more than the third."""
_SIZE_M, _GSD_M = 300.0, 0.15
_PATTERN_GSD_M = 0.2
TOWNS = ('mixed', 'industrial', 'farmland')
MOVING = 'moving ground'


def is_wrong(error_m_s: float, speed_m_s: float) -> bool:
    """Tell whether a velocity that was told is wrong."""
    return error_m_s > WRONG_M_S or error_m_s > max(WRONG_PART * speed_m_s, LEAST_WRONG_M_S)


@dataclass
class Count:
    """Sequences of one kind of ground."""

    sequences: int = 0
    frames: int = 0
    told: int = 0
    """Frames with a velocity."""
    wrong: list[int] = field(default_factory=list)
    """Numbers of the sequences in which one of them was wrong."""
    largest_m_s: float = 0.0
    doubts: Counter[str] = field(default_factory=Counter)

    def add(self, number: int, found: FlightErrors) -> None:
        """Count a sequence."""
        self.sequences += 1
        self.frames += found.frames
        self.told += len(found.errors_m_s)
        pairs = list(zip(found.lengths_m_s, found.speeds_m_s, strict=True))
        if any(is_wrong(*each) for each in pairs):
            self.wrong.append(number)
        self.largest_m_s = max([self.largest_m_s, *found.lengths_m_s])
        self.doubts.update(found.doubts)


class Grounds:
    """The grounds over which sequences are flown; drawn once."""

    def __init__(self) -> None:
        self._towns = [
            draw_world(seed, _SIZE_M, _GSD_M, district)
            for seed, district in enumerate(TOWNS, start=1)
        ]
        self._flat = [NadirCamera(each, CAMERA) for each in self._towns]
        self._hills = [
            HillCamera(each, CAMERA, draw_hills(_SIZE_M, 3.0, seed))
            for seed, each in enumerate(self._towns, start=1)
        ]
        self._patterns = {
            name: NadirCamera(World(image, None, _PATTERN_GSD_M, name), CAMERA)
            for name, image in _patterns()
        }

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the kinds of ground."""
        return ('flat', 'hills', *self._patterns, MOVING)

    def see(self, kind: str, random: np.random.Generator) -> See:
        """Return what a camera sees over ground of a kind."""
        number = int(random.integers(len(self._towns)))
        if kind == 'hills':
            hills = self._hills[number]
            return lambda pose, _: hills.view(pose)
        eye = self._patterns.get(kind, self._flat[number])
        drift_m_s, course = 0.0, 0.0
        if kind == MOVING:
            drift_m_s, course = random.uniform(1.0, 3.0), random.uniform(0.0, 2.0 * pi)
        drift = drift_m_s * np.array([np.cos(course), np.sin(course)])
        return lambda pose, now_s: eye.view(drifted(pose, drift, now_s)).image_rgb


def drifted(pose: Pose, drift_m_s: NDArray[np.float64], time_s: float) -> Pose:
    """Return from where ground at rest would look like ground that moves with a velocity."""
    north_m, east_m = (float(each) for each in drift_m_s * time_s)
    return replace(pose, north_m=pose.north_m - north_m, east_m=pose.east_m - east_m)


def _patterns() -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield ground on which motion shows badly or not at all, 800 x 800 pixels."""
    random = np.random.default_rng(9)
    along = np.arange(800)
    wave = 60.0 * np.sin(2.0 * pi * along / 15.0)
    speckle = random.normal(0.0, 2.0, (800, 800))
    for name, levels in (
        ('blank', 120.0 + 0.0 * speckle),
        ('nearly blank', 120.0 + speckle),
        ('stripes', 120.0 + np.tile(wave, (800, 1)) + 0.5 * speckle),
        ('grid', 120.0 + wave[None, :] + wave[:, None]),
    ):
        grey = np.clip(levels, 0.0, 255.0).astype(np.uint8)
        yield name, np.repeat(grey[..., None], 3, axis=2)


def draw_flight(random: np.random.Generator) -> tuple[Motion, Conditions]:
    """Draw how a sequence is flown, and what is not ideal."""
    motion = Motion(
        height_m=exp(random.uniform(log(10.0), log(120.0))),
        speed_m_s=random.uniform(0.0, 8.0),
        course_rad=random.uniform(0.0, 2.0 * pi),
        climb_m_s=random.uniform(-2.0, 2.0),
        sway_m_s=random.uniform(0.0, 1.0),
        sway_period_s=random.uniform(3.0, 8.0),
        lean_deg=random.uniform(0.0, 20.0),
        lean_period_s=random.uniform(2.0, 6.0),
        yaw_deg=random.uniform(0.0, 360.0),
        yaw_rate_deg_s=random.uniform(-30.0, 30.0),
        north_m=random.uniform(-100.0, 100.0),
        east_m=random.uniform(-100.0, 100.0),
    )
    covered_s = random.uniform(0.3, 1.2) if random.random() < 0.2 else 0.0
    dark_s = random.uniform(0.2, 1.2)
    return motion, Conditions(
        frames_hz=float(random.choice([5.0, 10.0, 20.0])),
        grey_noise=random.uniform(1.0, 6.0),
        altitude_factor=random.uniform(0.97, 1.03),
        lag_s=random.uniform(-0.01, 0.01),
        flicker=random.uniform(0.0, 0.1),
        dark_from_s=dark_s,
        dark_until_s=dark_s + covered_s,
    )


def run_sequence(grounds: Grounds, number: int, seed: int) -> tuple[str, FlightErrors]:
    """Fly the sequence of a number; return the kind of its ground."""
    random = np.random.default_rng([seed, number])
    # Half of the sequences are over towns, flat or with hills.
    kinds = grounds.kinds
    kind = kinds[int(random.integers(2))] if random.random() < 0.5 else str(random.choice(kinds))
    motion, conditions = draw_flight(random)
    see = grounds.see(kind, random)
    return kind, fly(SeenMotion(motion, see, number, conditions), SECONDS)
