# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Input of one step of the landing: what the map says, and everything else."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing.decision import Focus, Verdict


@dataclass(frozen=True)
class Sighting:
    """What the map says; the helm knows nothing else of it."""

    verdict: Verdict
    reachable: Site | None
    """The site of the verdict, unless the way to it is not known to be free."""
    ground_is_fresh: bool
    """The ground under the vehicle and its radius was safe when last judged, a moment ago."""
    ground_score: float
    """Worst score of the map under the vehicle and its radius now; 0 is unknown."""
    ground_age_s: float
    """Age of the oldest look at it."""
    stamp_ns: int
    """Of the newest heatmap in the map, 0 without one."""
    map_age_s: float
    """Its age, infinite without one."""
    revision: int
    """Number of heatmaps in the map."""
    threshold: float
    """Score from which ground counts as safe."""
    focus: Focus | None = None
    best: Site | None = None
    """The best site of the engagement that has not failed, maybe out of view."""


@dataclass(frozen=True)
class Situation:
    """Everything known in one step; guidance makes a wish of it, and the guard checks the wish."""

    now_ns: int
    pose: Pose | None
    """Of the vehicle, None unless it is valid."""
    telemetry_age_s: float
    sighting: Sighting
    site: Site | None = None
    """Where to fly: reachable, and known by data that can be trusted."""
    home: Pose | None = None
    """Where the landing began."""
    above_lowest_m: float = 0.0
    """Altitude of the pose minus the lowest height that is believed; the floor counts from it."""
    search_target: tuple[float, float] | None = None
    """Where the search goes next (north, east); None while it stays and looks."""
    search_floor_m: float | None = None
    """Altitude that a search without success may descend to; None: it does not."""
