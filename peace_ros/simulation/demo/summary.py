# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The summary of a run, judged from the ground truth and not from what the landing node says."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from math import hypot
from pathlib import Path
from typing import Any

from peace_ros.core.domain import Pose
from peace_ros.recording.run_folder import write_whole
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.demo.history import History
from peace_ros.simulation.demo.truth import NO_TRUTH, GroundVerdict, judge

OUTCOMES = ('handover', 'no_zone', 'timeout', 'battery', 'aborted', 'error')
_MIRROR_SAMPLES = 100
REACHED_TOLERANCE_M = 2.0
"""A hand-over counts when the vehicle truly is at most this far from its altitude."""


@dataclass(frozen=True)
class StateTime:
    """One visit of a state."""

    name: str
    seconds: float


@dataclass(frozen=True)
class Summary:
    """What ``summary.json`` holds."""

    outcome: str
    """One of :data:`OUTCOMES`."""
    safe: bool | None
    """Ground truth within the safety radius of the hand-over point; null where there is none."""
    reached: bool
    """The vehicle truly was at the altitude of the hand-over."""
    altitude_agl_m: float | None
    """True altitude at the hand-over, otherwise at the end."""
    duration_s: float
    """From the engagement to the outcome, node clock."""
    horizontal_distance_m: float | None
    """Straight line over ground from the engagement to the outcome."""
    clearance_m: float | None
    """From the hand-over point to the nearest ground that is unsafe by the ground truth."""
    frames: int
    """Heatmaps since the engagement."""
    heatmap_hz: float
    """Heatmaps per second of the node clock."""
    prompts: tuple[str, ...]
    """Distinct prompt templates, in order."""
    states: tuple[StateTime, ...]
    reason: str
    """Why it ended, in a sentence."""
    seed: int | None
    config: str
    speed: float
    world: str
    mirrored: bool
    """The camera saw beyond the edge of the world, which was continued by mirroring."""
    hand_over: dict[str, float] | None
    """East and north of the hand-over point, metres from the centre of the world."""

    @property
    def succeeded(self) -> bool:
        """At the altitude of the hand-over, and not over a place known to be unsafe."""
        return self.outcome == 'handover' and self.reached and self.safe is not False

    def headline(self) -> str:
        """Return the result in one sentence."""
        if self.outcome != 'handover':
            names = {
                'no_zone': 'No safe place was found',
                'timeout': 'Time ran out',
                'aborted': 'The landing was aborted',
                'battery': 'The battery ran low',
                'error': 'The demo failed',
            }
            return f'{names[self.outcome]}: {self.reason}' if self.reason else names[self.outcome]
        place = {
            True: 'a place that the ground truth calls safe',
            False: 'a place that the ground truth calls UNSAFE',
            None: 'a place for which there is no ground truth',
        }[self.safe]
        altitude = 'an unknown altitude'
        if self.altitude_agl_m is not None:
            altitude = f'{self.altitude_agl_m:.1f} m'
        return f'Handed over at {altitude} over {place}'

    def as_json(self) -> str:
        """Return the text of ``summary.json``."""
        return json.dumps(_rounded(asdict(self)), indent=2) + '\n'

    def write(self, path: Path) -> None:
        """Write ``summary.json``, whole or not at all.

        Raises:
            RecordingError: the place cannot be written to.
        """
        write_whole(path, self.as_json(), 'summary')


@dataclass(frozen=True)
class Truth:
    """The world as the judge knows it, in the local frame of the vehicle."""

    camera: NadirCamera
    safety_radius_m: float

    def in_world(self, pose: Pose) -> tuple[float, float]:
        """Return (east, north) of a local pose, in metres from the centre of the world."""
        world = self.camera.world
        return pose.east_m - world.centre_east_m, pose.north_m - world.centre_north_m

    def was_mirrored(self, poses: list[Pose]) -> bool:
        """Tell whether the camera saw beyond the edge of the world, by a sample of the poses."""
        step = max(1, len(poses) // _MIRROR_SAMPLES)
        return any(self.camera.view(pose).mirrored for pose in poses[::step])

    def judge(self, pose: Pose) -> GroundVerdict:
        """Judge the ground under a pose."""
        return judge(self.camera, pose, self.safety_radius_m)


@dataclass(frozen=True)
class Setting:
    """What the run was asked to do."""

    seed: int | None
    config: str
    speed: float
    world: str
    handover_altitude_m: float = 20.0


@dataclass(frozen=True)
class Ending:
    """How a run ended."""

    outcome: str
    """One of :data:`OUTCOMES`."""
    reason: str
    """Why, in a sentence."""
    stamp_ns: int | None
    """Node clock of the outcome; None when nothing had begun."""


def summarise(history: History, ending: Ending, setting: Setting, truth: Truth) -> Summary:
    """Put together what the topics told and what the ground truth says of it."""
    outcome, end_ns = ending.outcome, ending.stamp_ns
    begin = history.pose_at(history.engaged_ns) if history.engaged_ns is not None else None
    end = history.pose_at(end_ns) if end_ns is not None else None
    handed_over = outcome == 'handover' and end is not None
    verdict = truth.judge(end) if handed_over and end is not None else NO_TRUTH
    duration_s = 0.0
    if end_ns is not None and history.engaged_ns is not None:
        duration_s = max(0.0, (end_ns - history.engaged_ns) * 1e-9)
    frames = history.frames_until(end_ns)
    distance = None
    if begin is not None and end is not None:
        distance = hypot(end.north_m - begin.north_m, end.east_m - begin.east_m)
    place = truth.in_world(end) if handed_over and end is not None else None
    return Summary(
        outcome=outcome,
        safe=verdict.safe,
        reached=end is not None
        and abs(end.altitude_agl_m - setting.handover_altitude_m) <= REACHED_TOLERANCE_M,
        altitude_agl_m=end.altitude_agl_m if end is not None else None,
        duration_s=duration_s,
        horizontal_distance_m=distance,
        clearance_m=verdict.clearance_m,
        frames=frames,
        heatmap_hz=frames / duration_s if duration_s > 0.0 else 0.0,
        prompts=tuple(history.prompts),
        states=tuple(StateTime(span.name, span.seconds) for span in history.engaged_spans()),
        reason=ending.reason,
        seed=setting.seed,
        config=setting.config,
        speed=setting.speed,
        world=setting.world,
        mirrored=truth.was_mirrored(_flown(history)),
        hand_over={'east_m': place[0], 'north_m': place[1]} if place is not None else None,
    )


def _flown(history: History) -> list[Pose]:
    """Return the poses since the engagement."""
    since = history.engaged_ns
    return [] if since is None else [pose for pose in history.poses if pose.stamp_ns >= since]


def _rounded(value: Any) -> Any:
    """Round floats for people; three decimals are millimetres and milliseconds."""
    if isinstance(value, float):
        return round(value, 3)
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each) for each in value]
    return value
