# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why the best of the other places are no sites: for people, nothing that flies depends on it."""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.landing.decision import RefusedPlace
from peace_ros.core.landing.parameters import CELL_SCORE_FLOOR, LandingParameters
from peace_ros.core.landing.sites import Search, clearance, confidence, safe_ground, too_narrow
from peace_ros.core.landing.worth import Merits, worth
from peace_ros.core.mapping import MapLayers

MOST_REFUSED = 5
_THING_M = 3.0
"""Vetoed ground wider than this is unsafe itself (a road, a river), narrower is a thing on it."""
_NS = 1e-9


def refused_places(
    layers: MapLayers, search: Search, parameters: LandingParameters, now_ns: int
) -> tuple[RefusedPlace, ...]:
    """Return the refused places of the highest worth, at most five, the best first.

    A place is refused when its ground may be safe (a score of 0.5, or a veto for something
    narrow on it), is as wide as the vehicle, and no site may be chosen within the clearance
    that a site needs.

    Args:
        layers: Of all ground that a person wants to be told about; the focus does not count.
        search: What a site needs, and what failed.
        parameters: Of the landing.
        now_ns: The clock of the failed places.
    """
    p, required_m = parameters, search.required_clearance_m
    if layers.score.size == 0:
        return ()
    thing = _things(layers)
    possible = (layers.looks > 0) & (thing | (layers.score >= CELL_SCORE_FLOOR))
    possible_m = clearance(possible, layers.cell_m)
    value = worth(
        Merits(
            clearance_m=possible_m,
            # A veto makes the score zero; without it the ground would be doubtful at least.
            confidence=confidence(
                np.where(thing, np.float32(CELL_SCORE_FLOOR), layers.score),
                required_m,
                layers.cell_m,
            ),
            distance_m=np.hypot(*layers.distances_m(search.pose.north_m, search.pose.east_m)),
        ),
        p,
    )
    value[(possible_m < p.safety_radius_m) | _near_a_site(layers, search, p)] = 0.0
    found: list[RefusedPlace] = []
    while len(found) < MOST_REFUSED and value.max() > 0.0:
        row, column = np.unravel_index(int(np.argmax(value)), value.shape)
        north_m, east_m = layers.centre_of(int(row), int(column))
        wide_m = float(possible_m[row, column])
        reason = _why_failed(search, north_m, east_m, now_ns)
        if reason := reason or _why_unsafe(layers, search, p, (north_m, east_m, wide_m)):
            north_way_m, east_way_m = north_m - search.pose.north_m, east_m - search.pose.east_m
            away_m = float(np.hypot(north_way_m, east_way_m))
            found.append(RefusedPlace(north_m, east_m, wide_m, away_m, reason))
        value[layers.disc(north_m, east_m, wide_m + required_m)] = 0.0
    return tuple(found)


def _things(layers: MapLayers) -> NDArray[np.bool_]:
    """Return the vetoed cells that are narrow enough to be a person, a car, or the like."""
    vetoed = np.isfinite(layers.unsafe_age_s)
    cells = max(1, round(_THING_M / layers.cell_m))
    kernel = cast('NDArray[np.uint8]', cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (cells, cells)))
    wide = cv2.morphologyEx(vetoed.astype(np.uint8), cv2.MORPH_OPEN, kernel)
    return cast('NDArray[np.bool_]', vetoed & (wide == 0))


def _near_a_site(layers: MapLayers, search: Search, p: LandingParameters) -> NDArray[np.bool_]:
    """Return the cells from which a possible site is nearer than the clearance it needs."""
    safe = safe_ground(layers, search.threshold, search.age_limit_s, p.min_looks)
    sites = clearance(safe, layers.cell_m) >= search.required_clearance_m
    for each in search.failed:
        sites &= ~layers.disc(each.north_m, each.east_m, each.radius_m)
    if search.incumbent is not None:
        chosen = search.incumbent
        sites |= layers.disc(chosen.north_m, chosen.east_m, layers.cell_m)
    if not sites.any():
        return sites
    away = cv2.distanceTransform((~sites).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return cast('NDArray[np.bool_]', away * layers.cell_m <= search.required_clearance_m)


def _why_failed(search: Search, north_m: float, east_m: float, now_ns: int) -> str:
    """Return that a place lies where a descent failed, or nothing."""
    for each in search.failed:
        if np.hypot(each.north_m - north_m, each.east_m - east_m) <= each.radius_m:
            left_s = max(0.0, (each.until_ns - now_ns) * _NS)
            times = 'once' if each.failures == 1 else f'{each.failures} times'
            return f'failed before ({times}): left out for {left_s:.0f} s more'
    return ''


def _why_unsafe(
    layers: MapLayers, search: Search, p: LandingParameters, place: tuple[float, float, float]
) -> str:
    """Return what the ground of a place (north, east, clearance) misses for a site, or nothing."""
    north_m, east_m, wide_m = place
    required_m = search.required_clearance_m
    if wide_m < required_m:
        return too_narrow(wide_m, required_m)
    disc = layers.disc(north_m, east_m, required_m)
    unsafe_s = float(layers.unsafe_age_s[disc].min())
    if np.isfinite(unsafe_s):
        return f'something clearly unsafe was seen there {unsafe_s:.0f} s ago'
    looks = int(layers.looks[disc].min())
    if looks < p.min_looks:
        return f'seen {looks} times, {p.min_looks} are needed'
    age_s = float(layers.age_s[disc].max())
    if age_s > search.age_limit_s:
        return f'last seen {age_s:.0f} s ago, at most {search.age_limit_s:.0f} s are allowed'
    smooth = cv2.blur(layers.score, (3, 3), borderType=cv2.BORDER_REPLICATE)
    score = float(smooth[disc].min())
    if score < search.threshold:
        return f'not clearly safe: a score of {score:.2f}, {search.threshold:.2f} is needed'
    return ''
