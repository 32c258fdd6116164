# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""SITE or NO_ZONE: the choice of a place to land in the layers of a map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, hypot, pi, sqrt
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing.decision import Focus, Verdict
from peace_ros.core.landing.memory import FailedPlace
from peace_ros.core.landing.parameters import (
    CELL_SCORE_FLOOR,
    SAFETY_THRESHOLD_FLOOR,
    LandingParameters,
)
from peace_ros.core.landing.worth import Merits, worth
from peace_ros.core.mapping import MapLayers

_KEEP_FRACTION = 0.85
"""A chosen site is kept while it has this part of the required clearance."""
_REFINE_RADIUS_M = 6.0
"""A chosen site moves towards the best place within this distance."""
_REFINE_WAY = 0.125
"""Weight of that distance: enough that a site does not drift over a large field, too little to keep
it from the middle of its ground."""


@dataclass(frozen=True)
class Search:
    """Where to look for a site, and what it needs."""

    pose: Pose
    focus: Focus
    threshold: float
    required_clearance_m: float
    age_limit_s: float
    failed: tuple[FailedPlace, ...] = ()
    incumbent: Site | None = None
    """The present choice, kept unless another is clearly better."""


@dataclass(frozen=True)
class _JudgedGround:
    """A part of the map, judged."""

    layers: MapLayers
    safe: NDArray[np.bool_]
    clearance_m: NDArray[np.float32]


def safe_ground(
    layers: MapLayers, threshold: float, age_limit_s: float, min_looks: int
) -> NDArray[np.bool_]:
    """Return which cells are known, freshly and often enough, to be safe; rows x columns.

    The threshold holds for the mean over 3 x 3 cells, so that the flicker of one cell does not
    make a hole; a cell that is itself more likely unsafe than safe is never safe. No threshold
    below the fixed floor is honoured. Of no cells (all lie outside of the map) none is safe.
    """
    if layers.score.size == 0:
        return np.zeros(layers.score.shape, np.bool_)
    threshold = max(threshold, SAFETY_THRESHOLD_FLOOR)
    known = (layers.looks >= min_looks) & (layers.age_s <= age_limit_s)
    smooth = cv2.blur(layers.score, (3, 3), borderType=cv2.BORDER_REPLICATE)
    safe: NDArray[np.bool_] = known & (smooth >= threshold) & (layers.score >= CELL_SCORE_FLOOR)
    return safe


def clearance(safe: NDArray[np.bool_], cell_m: float) -> NDArray[np.float32]:
    """Return metres from the centre of each safe cell to the nearest ground not known to be safe.

    It is never more than the truth, and at most 0.21 cells less. Other cells have 0, and beyond the
    edge of the array nothing is known.
    """
    padded = np.pad(safe, 1).astype(np.uint8)
    cells = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    # The transform runs between centres: a corner of the obstacle may be half a diagonal nearer.
    return cast('NDArray[np.float32]', np.maximum((cells - sqrt(0.5)) * cell_m, 0.0))


def confidence(score: NDArray[np.float32], radius_m: float, cell_m: float) -> NDArray[np.float32]:
    """Return the mean score within a radius around each cell; rows x columns.

    Beyond the edge of the array the scores of its edge go on.
    """
    reach = ceil(radius_m / cell_m)
    offset_m = np.arange(-reach, reach + 1) * cell_m
    disc = np.add.outer(offset_m**2, offset_m**2) <= radius_m**2
    mean = disc.astype(np.float32) / np.float32(disc.sum())
    means = cv2.filter2D(score, -1, mean, borderType=cv2.BORDER_REPLICATE)
    return cast('NDArray[np.float32]', means)


def find_site(layers: MapLayers, search: Search, parameters: LandingParameters) -> Verdict:
    """Choose a site within the focus, or say why there is none.

    The layers need to reach only as far beyond the focus as clearance counts.
    """
    p = parameters
    if layers.score.size == 0:
        return Verdict.no_zone('the focus lies outside of the map')
    safe = safe_ground(layers, search.threshold, search.age_limit_s, p.min_looks)
    inside = layers.disc(search.focus.north_m, search.focus.east_m, search.focus.radius_m)
    if not safe[inside].any():
        return Verdict.no_zone(_nothing_safe(layers, search, inside, p))
    for each in search.failed:
        inside &= ~layers.disc(each.north_m, each.east_m, each.radius_m)
    ground = _JudgedGround(layers, safe, clearance(safe, layers.cell_m))
    kept = _keep(ground, search, inside, p)
    wide = inside & (ground.clearance_m >= search.required_clearance_m)
    if not wide.any():
        if kept is not None:
            return Verdict.found(_site_at(ground, *kept))
        largest = float(ground.clearance_m[inside].max(initial=0.0))
        return Verdict.no_zone(
            f'the widest safe ground{" outside of failed sites" if search.failed else ""} is '
            + too_narrow(largest, search.required_clearance_m)
        )
    preferred = wide & (ground.clearance_m >= p.preferred_clearance_m)
    candidates = preferred if preferred.any() else wide
    merits = _merits(ground, search)
    half_width_m, compactness = shapes(candidates, layers.cell_m)
    shaped = replace(merits, half_width_m=half_width_m, compactness=compactness)
    best = _highest(worth(shaped, p), candidates)
    # Shapes stay out of this comparison: pieces of ground merge and split from frame to frame.
    value = worth(merits, p)
    kept_cell = None if kept is None else layers.cell_at(*kept)
    if kept is None or kept_cell is None or value[best] >= p.site_hysteresis * value[kept_cell]:
        kept = layers.centre_of(*best)
    return Verdict.found(_site_at(ground, *kept))


def too_narrow(clearance_m: float, required_m: float) -> str:
    """Return how much clearance is missing, rounded up to 0.1 m: what is refused misses some."""
    missing_m = ceil(10.0 * (required_m - clearance_m) - 1e-6) / 10.0
    return (
        f'too narrow by {missing_m:.1f} m: {clearance_m:.1f} m of clearance, '
        f'{required_m:.1f} m are needed from this altitude'
    )


def _nothing_safe(
    layers: MapLayers, search: Search, inside: NDArray[np.bool_], parameters: LandingParameters
) -> str:
    """Return what the ground in the focus misses most: looks, a fresh look, or a higher score."""
    looks, limit_s = parameters.min_looks, search.age_limit_s
    most = int(layers.looks[inside].max(initial=0))
    if most == 0:
        return 'nothing is known yet'
    if most < looks:
        return f'the ground in the focus was seen in {most} frames at most, {looks} are needed'
    age_s = float(layers.age_s[inside & (layers.looks >= looks)].min())
    if age_s > limit_s:
        return (
            f'the ground in the focus was last seen {age_s:.0f} s ago, at most {limit_s:.0f} s '
            'are allowed'
        )
    score = float(layers.score[inside].max())
    return (
        f'no ground in the focus is safe: the best score is {score:.2f}, '
        f'{search.threshold:.2f} is needed around it'
    )


def _highest(value: NDArray[np.float32], candidates: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the candidate cell of the highest value."""
    index = int(np.argmax(np.where(candidates, value, np.float32(-1.0))))
    return cast('tuple[int, int]', np.unravel_index(index, value.shape))


def _merits(ground: _JudgedGround, search: Search) -> Merits:
    """Return the merits of every cell by itself, as seen from the vehicle."""
    layers = ground.layers
    return Merits(
        clearance_m=ground.clearance_m,
        confidence=confidence(layers.score, search.required_clearance_m, layers.cell_m),
        distance_m=np.hypot(*layers.distances_m(search.pose.north_m, search.pose.east_m)),
    )


def shapes(
    candidates: NDArray[np.bool_], cell_m: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return half width (m) and compactness of the connected piece around each candidate cell.

    Cells are connected by their sides. What is returned for other cells means nothing.
    """
    _, labels = cv2.connectedComponents(candidates.astype(np.uint8), connectivity=4)
    inner = cv2.erode(candidates.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    area = np.bincount(labels.ravel())
    rim = np.maximum(np.bincount(labels[candidates & ~inner], minlength=area.size), 1)
    compactness = np.minimum(1.0, 4.0 * pi * area / (rim * rim))
    half_width_m = area / rim * cell_m
    return half_width_m.astype(np.float32)[labels], compactness.astype(np.float32)[labels]


def _keep(
    ground: _JudgedGround, search: Search, inside: NDArray[np.bool_], parameters: LandingParameters
) -> tuple[float, float] | None:
    """Return where the present choice is now (north, east), None when it is lost.

    It moves a part of the way towards the best place near by, so that it follows the map without
    jumping. All of that is the same safe ground: width and nearness decide.
    """
    site = search.incumbent
    if site is None:
        return None
    required = _KEEP_FRACTION * search.required_clearance_m
    near = inside & ground.layers.disc(site.north_m, site.east_m, _REFINE_RADIUS_M)
    if not near.any():
        return None
    way_m = np.hypot(*ground.layers.distances_m(site.north_m, site.east_m))
    value = worth(Merits(ground.clearance_m, distance_m=_REFINE_WAY * way_m), parameters)
    best_north, best_east = ground.layers.centre_of(*_highest(value, near))
    step = parameters.focus_step
    moved = (
        site.north_m + step * (best_north - site.north_m),
        site.east_m + step * (best_east - site.east_m),
    )
    for place in (moved, (site.north_m, site.east_m), (best_north, best_east)):
        cell = ground.layers.cell_at(*place)
        if cell is not None and ground.clearance_m[cell] >= required:
            return place
    return None


def _site_at(ground: _JudgedGround, north_m: float, east_m: float) -> Site:
    layers = ground.layers
    cell = layers.cell_at(north_m, east_m) or (0, 0)
    centre_north, centre_east = layers.centre_of(*cell)
    off_m = hypot(north_m - centre_north, east_m - centre_east)
    radius = max(0.0, float(ground.clearance_m[cell]) - off_m)
    disc = layers.disc(north_m, east_m, max(radius, layers.cell_m))
    _, labels = cv2.connectedComponents(ground.safe.astype(np.uint8), connectivity=4)
    area = int(np.count_nonzero(labels == labels[cell])) * layers.cell_m**2
    return Site(
        north_m=float(north_m),
        east_m=float(east_m),
        clearance_m=radius,
        area_m2=area,
        confidence=float(layers.score[disc].mean()),
        age_s=float(layers.age_s[cell]),
    )
