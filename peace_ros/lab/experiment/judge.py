# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Judges a run by the ground truth, which no policy knows."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import cv2
import numpy as np

from peace_ros.core.domain import Label, Pose, is_safe
from peace_ros.core.landing import LandingParameters
from peace_ros.lab.experiment.flight import Flown
from peace_ros.simulation.camera import NadirCamera

PERSON_BELOW_M = 30.0
"""Below this altitude the distance to persons counts."""
FARTHEST_M = 30.0
"""Clearances and distances to persons are measured up to here."""
HAZARDS = (
    Label.PERSON,
    Label.VEHICLE,
    Label.BUILDING,
    Label.WATER,
    Label.OBSTACLE,
    Label.TREE,
    Label.PAVED,
)
"""Unsafe ground, the gravest first: the gravest in the footprint gives a landing its hazard."""
_LEAST_LABELLED = 0.5
"""With less of the footprint labelled, the truth has no opinion."""


@dataclass(frozen=True)
class Judgement:
    """What the ground truth says of a run."""

    result: str
    """`safe`, `unsafe`, `unknown` (too few labels), `no_zone`, `timeout` or `failed`."""
    hazard: str
    """Of an unsafe landing: the gravest label in the footprint; otherwise empty."""
    no_zone_right: bool | None
    """Of no_zone: there was no place within reach; None for other results."""
    clearance_m: float | None
    """From the hand-over point to the nearest ground not labelled safe, at most 30 m."""
    horizontal_distance_m: float
    """Straight line over the ground from the start to the end."""
    nearest_person_m: float | None
    """Over the ground, while lower than 30 m; None where none came within 30 m."""


def judge(flown: Flown, camera: NadirCamera, parameters: LandingParameters) -> Judgement:
    """Judge a run.

    Args:
        flown: the run.
        camera: over its world, in the local frame.
        parameters: of the landing: radius of the vehicle, clearance and reach of the search.
    """
    first, last = flown.track[0].pose, flown.track[-1].pose
    result, hazard, clearance_m, right = flown.outcome, '', None, None
    if flown.outcome == 'handover':
        result, hazard = _judge_footprint(camera, last, parameters.safety_radius_m)
        clearance_m = _distance_to(camera, last, safe_ground=False)
    elif flown.outcome == 'no_zone':
        right = not _has_place(camera, first, parameters)
    elif flown.outcome != 'timeout':
        result = 'failed'
    persons = [
        distance_m
        for each in flown.track
        if each.pose.altitude_agl_m < PERSON_BELOW_M
        and (distance_m := _distance_to(camera, each.pose, label=Label.PERSON)) is not None
    ]
    return Judgement(
        result=result,
        hazard=hazard,
        no_zone_right=right,
        clearance_m=clearance_m,
        horizontal_distance_m=hypot(last.north_m - first.north_m, last.east_m - first.east_m),
        nearest_person_m=min(persons, default=None),
    )


def _judge_footprint(camera: NadirCamera, pose: Pose, radius_m: float) -> tuple[str, str]:
    labels = camera.labels_at(pose.north_m, pose.east_m, radius_m)
    if labels is None or float(np.mean(labels != Label.UNLABELED)) < _LEAST_LABELLED:
        return 'unknown', ''
    found = set(labels.tolist())
    hazard = next((each for each in HAZARDS if each in found), None)
    return ('safe', '') if hazard is None else ('unsafe', hazard.name.lower())


def _distance_to(
    camera: NadirCamera, pose: Pose, *, label: Label | None = None, safe_ground: bool = True
) -> float | None:
    """Return the distance over the ground to a label, or to what is not labelled safe."""
    square = camera.labels_around(pose.north_m, pose.east_m, FARTHEST_M)
    if square is None:
        return None
    wanted = square.labels == label if label is not None else is_safe(square.labels) == safe_ground
    nearest_m = float(square.away_m[wanted].min(initial=FARTHEST_M))
    if label is not None and nearest_m >= FARTHEST_M:
        return None
    return nearest_m


def _has_place(camera: NadirCamera, start: Pose, parameters: LandingParameters) -> bool:
    """Tell whether a place within the search radius is wide enough to be chosen from above."""
    needed_m = parameters.required_clearance_m(parameters.safe_altitude_m)
    reach_m = parameters.search_radius_m
    square = camera.labels_around(start.north_m, start.east_m, reach_m + needed_m)
    if square is None:
        return False
    safe = is_safe(square.labels).astype(np.uint8)
    clearance_px = cv2.distanceTransform(safe, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    within = square.away_m <= reach_m
    return bool((clearance_px[within] * camera.world.gsd_m >= needed_m).any())
