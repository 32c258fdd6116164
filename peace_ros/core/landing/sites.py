# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""SITE or NO_ZONE: the choice of a place to land from the layers of a map."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, hypot, isfinite, pi
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing.decision import Focus, Verdict
from peace_ros.core.landing.parameters import (
    CELL_SCORE_FLOOR,
    SAFETY_THRESHOLD_FLOOR,
    LandingParameters,
)
from peace_ros.core.mapping import MapLayers

_KEEP_FRACTION = 0.85
"""A chosen site may lose this part of the required clearance before it is given up."""
_REFINE_RADIUS_M = 6.0
"""A chosen site moves towards the best place within this distance."""


@dataclass(frozen=True)
class Search:
    """What a search looks for."""

    pose: Pose
    focus: Focus
    threshold: float
    required_clearance_m: float
    age_limit_s: float
    failed: tuple[tuple[float, float, float], ...] = ()
    """North, east and radius in metres of places that failed."""
    incumbent: Site | None = None
    """The present choice, kept unless another is clearly better."""


@dataclass(frozen=True)
class _Ground:
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
    """Return metres from each safe cell to the nearest ground not known to be safe, else 0.

    Beyond the edge of the array nothing is known.
    """
    padded = np.pad(safe, 1).astype(np.uint8)
    cells = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1]
    # The transform runs between centres: the edge of the obstacle is half a cell nearer.
    return cast('NDArray[np.float32]', np.maximum(cells * cell_m - 0.5 * cell_m, 0.0))


def find_site(layers: MapLayers, search: Search, parameters: LandingParameters) -> Verdict:
    """Choose a site within the focus, or say why there is none.

    The layers need to reach only as far beyond the focus as clearance counts.
    """
    if layers.score.size == 0:
        return Verdict.no_zone('the focus lies outside of the map')
    safe = safe_ground(layers, search.threshold, search.age_limit_s, parameters.min_looks)
    ground = _Ground(layers, safe, clearance(safe, layers.cell_m))
    inside = layers.disc(search.focus.north_m, search.focus.east_m, search.focus.radius_m)
    if not safe[inside].any():
        known = bool((layers.looks[inside] > 0).any())
        return Verdict.no_zone(
            'no ground in the focus is safe' if known else 'nothing is known yet'
        )
    for north, east, radius in search.failed:
        inside &= ~layers.disc(north, east, radius)
    kept = _keep(ground, search, inside, parameters)
    wide = inside & (ground.clearance_m >= search.required_clearance_m)
    if not wide.any():
        if kept is not None:
            return Verdict.found(_site_at(ground, *kept))
        largest = float(ground.clearance_m[inside].max(initial=0.0))
        return Verdict.no_zone(
            f'the widest safe ground has {largest:.1f} m of clearance and '
            f'{search.required_clearance_m:.1f} m are needed'
            + (', sites that failed left out' if search.failed else '')
        )
    preferred = wide & (ground.clearance_m >= parameters.preferred_clearance_m)
    value = _value(ground, preferred if preferred.any() else wide, search, parameters)
    best = cast('tuple[int, int]', np.unravel_index(int(np.argmax(value)), value.shape))
    best_at = layers.centre_of(*best)
    if kept is not None:
        kept_cell = layers.cell_at(*kept)
        reference = 0.0 if kept_cell is None else _worth(ground, kept_cell, search, parameters)
        challenger = _worth(ground, best, search, parameters)
        if challenger < parameters.site_hysteresis * reference:
            return Verdict.found(_site_at(ground, *kept))
    return Verdict.found(_site_at(ground, *best_at))


def _value(
    ground: _Ground,
    candidates: NDArray[np.bool_],
    search: Search,
    parameters: LandingParameters,
) -> NDArray[np.float32]:
    """Return the worth of every candidate cell, 0 elsewhere.

    In the spirit of DOVESEI's area / perimeter / (distance + 1) per contour: large and compact
    components rather than small and thin ones, near ones rather than far ones, and within them
    clearance up to what is ample, and confidence.
    """
    _, labels = cv2.connectedComponents(candidates.astype(np.uint8), connectivity=4)
    north, east = ground.layers.distances_m(search.pose.north_m, search.pose.east_m)
    distance = np.sqrt(north * north + east * east)
    worth = np.minimum(ground.clearance_m, parameters.ample_clearance_m)
    worth = worth * _shapes(candidates, labels, ground.layers.cell_m)[labels]
    worth = worth * _confidence(ground.layers, search.required_clearance_m)
    worth = worth / (1.0 + distance / parameters.distance_scale_m)
    result: NDArray[np.float32] = np.where(candidates, worth, np.float32(0.0)).astype(np.float32)
    return result


def _shapes(
    candidates: NDArray[np.bool_], labels: NDArray[np.int32], cell_m: float
) -> NDArray[np.float32]:
    """Return a factor below 1 per component: half width (area / perimeter) and compactness.

    Compactness is the isoperimetric quotient, 1 for a disc; it weighs little, since a long lawn
    is as safe as a round one of its width.
    """
    inner = cv2.erode(candidates.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    area = np.bincount(labels.ravel())
    rim = np.maximum(np.bincount(labels[candidates & ~inner], minlength=area.size), 1)
    half_width_m = area / rim * cell_m
    compact = np.minimum(1.0, 4.0 * pi * area / (rim * rim))
    factor = (half_width_m + 1.0) / (half_width_m + 4.0) * (0.8 + 0.2 * compact)
    return cast('NDArray[np.float32]', factor.astype(np.float32))


def _confidence(layers: MapLayers, radius_m: float) -> NDArray[np.float32]:
    """Return the mean safety score around every cell, squared: doubt costs more than distance."""
    size = 2 * ceil(radius_m / layers.cell_m) + 1
    mean = cv2.blur(layers.score, (size, size), borderType=cv2.BORDER_REPLICATE)
    return cast('NDArray[np.float32]', mean * mean)


def _worth(
    ground: _Ground, cell: tuple[int, int], search: Search, parameters: LandingParameters
) -> float:
    """Return the worth of one cell without the shape of its component, to compare two choices."""
    north, east = ground.layers.centre_of(*cell)
    distance = hypot(north - search.pose.north_m, east - search.pose.east_m)
    enough = min(float(ground.clearance_m[cell]), parameters.ample_clearance_m)
    near = ground.layers.disc(north, east, search.required_clearance_m)
    confidence = float(ground.layers.score[near].mean())
    return enough * confidence**2 / (1.0 + distance / parameters.distance_scale_m)


def _keep(
    ground: _Ground, search: Search, inside: NDArray[np.bool_], parameters: LandingParameters
) -> tuple[float, float] | None:
    """Return where the present choice is now (north, east), None when it is lost.

    It moves a part of the way towards the widest place near by, so that it follows the map
    without jumping.
    """
    site = search.incumbent
    if site is None:
        return None
    required = _KEEP_FRACTION * search.required_clearance_m
    near = inside & ground.layers.disc(site.north_m, site.east_m, _REFINE_RADIUS_M)
    if not near.any():
        return None
    enough = np.minimum(ground.clearance_m, parameters.ample_clearance_m)
    # Among equally wide places the nearest one: no drift over a large field.
    north, east = ground.layers.distances_m(site.north_m, site.east_m)
    value = np.where(near, enough - 0.05 * np.sqrt(north * north + east * east), -1.0)
    best = np.unravel_index(int(np.argmax(value)), value.shape)
    best_north, best_east = ground.layers.centre_of(int(best[0]), int(best[1]))
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


def _site_at(ground: _Ground, north_m: float, east_m: float) -> Site:
    layers = ground.layers
    cell = layers.cell_at(north_m, east_m) or (0, 0)
    radius = float(ground.clearance_m[cell])
    disc = layers.disc(north_m, east_m, max(radius, layers.cell_m))
    _, labels = cv2.connectedComponents(ground.safe.astype(np.uint8), connectivity=4)
    area = int(np.count_nonzero(labels == labels[cell])) * layers.cell_m**2
    age = float(layers.age_s[cell])
    return Site(
        north_m=float(north_m),
        east_m=float(east_m),
        clearance_m=radius,
        area_m2=area,
        confidence=float(layers.score[disc].mean()),
        age_s=age if isfinite(age) else 0.0,
    )
