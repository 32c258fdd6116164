# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The choice of a site: clearance first, then near ones, and it stays chosen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing import SAFETY_THRESHOLD_FLOOR, Focus, LandingParameters, VerdictKind
from peace_ros.core.landing.sites import Search, clearance, find_site, safe_ground
from peace_ros.core.mapping import MapLayers

P = LandingParameters()
CELLS = 200
SEARCH = Search(
    pose=Pose(0, 0.0, 0.0, -80.0, (1.0, 0.0, 0.0, 0.0), 80.0),
    focus=Focus(0.0, 0.0, 100.0),
    threshold=0.8,
    required_clearance_m=3.0,
    age_limit_s=10.0,
)


def layers_with(*discs: tuple[float, float, float], score: float = 0.95) -> MapLayers:
    """100 x 100 m of unsafe ground with safe discs (north, east, radius)."""
    layers = MapLayers(
        np.full((CELLS, CELLS), 0.05, np.float32),
        np.zeros((CELLS, CELLS), np.float32),
        np.full((CELLS, CELLS), 9, np.uint16),
        0.5,
        -50.0,
        -50.0,
    )
    for disc in discs:
        layers.score[layers.disc(*disc)] = score
    return layers


def test_finds_the_middle_of_the_only_safe_ground():
    verdict = find_site(layers_with((20.0, -10.0, 8.0)), SEARCH, P)
    assert verdict.kind is VerdictKind.SITE
    site = verdict.site
    assert (site.north_m, site.east_m) == pytest.approx((20.0, -10.0), abs=2.0)
    assert site.clearance_m == pytest.approx(8.0, abs=1.5)
    assert site.area_m2 == pytest.approx(np.pi * 64.0, rel=0.15)
    assert site.confidence > 0.9


def test_clearance_reaches_to_unknown_ground_and_to_the_edge_of_the_map():
    known = np.ones((21, 41), dtype=bool)
    assert clearance(known, 0.5)[10, 20] == pytest.approx(5.25, abs=0.1)
    known[10, 24] = False
    assert clearance(known, 0.5)[10, 20] == pytest.approx(1.75, abs=0.1)


@pytest.mark.parametrize(
    'change',
    [
        {'score': np.full((CELLS, CELLS), 0.7, np.float32)},
        {'age_s': np.full((CELLS, CELLS), 11.0, np.float32)},
        {'looks': np.full((CELLS, CELLS), 2, np.uint16)},
        {'looks': np.zeros((CELLS, CELLS), np.uint16)},
    ],
    ids=['unsure', 'old', 'few looks', 'unknown'],
)
def test_no_zone_where_ground_is_not_surely_safe(change):
    layers = replace(layers_with((0.0, 0.0, 20.0)), **change)
    verdict = find_site(layers, SEARCH, P)
    assert verdict.kind is VerdictKind.NO_ZONE
    assert verdict.site is None
    assert verdict.reason


@given(threshold=st.floats(-1.0, 1.0), score=st.floats(0.0, SAFETY_THRESHOLD_FLOOR - 0.01))
def test_no_threshold_makes_ground_below_the_floor_safe(threshold, score):
    layers = layers_with((0.0, 0.0, 20.0), score=np.float32(score))
    assert not safe_ground(layers, threshold, 10.0, 2).any()


def test_a_single_unsafe_cell_is_an_obstacle_but_a_doubtful_one_is_not():
    layers = layers_with((0.0, 0.0, 15.0))
    layers.score[100, 100] = 0.7
    assert find_site(layers, SEARCH, P).site.clearance_m > 11.0
    layers.score[100, 100] = 0.3
    site = find_site(layers, SEARCH, P).site
    assert np.hypot(site.north_m, site.east_m) > site.clearance_m - 1.0


def test_says_how_much_clearance_is_missing():
    verdict = find_site(layers_with((0.0, 0.0, 2.5)), SEARCH, P)
    assert verdict.kind is VerdictKind.NO_ZONE
    assert '3.0 m are needed' in verdict.reason


def test_prefers_wide_to_near_and_near_to_far():
    wide_far = find_site(layers_with((0.0, 0.0, 4.5), (35.0, 0.0, 9.0)), SEARCH, P).site
    assert wide_far.north_m > 25.0
    near = find_site(layers_with((-12.0, 0.0, 9.0), (35.0, 0.0, 9.0)), SEARCH, P).site
    assert near.north_m < 0.0


def test_takes_the_small_one_when_there_is_no_wide_one():
    site = find_site(layers_with((5.0, 0.0, 4.5)), SEARCH, P).site
    assert site.north_m == pytest.approx(5.0, abs=2.0)


def test_stays_with_its_choice_until_another_is_clearly_better():
    chosen = Site(0.0, 20.0, 7.0, 100.0, 0.9, 0.0)
    search = replace(SEARCH, incumbent=chosen)
    similar = find_site(layers_with((0.0, 20.0, 8.0), (0.0, -18.0, 8.5)), search, P).site
    assert similar.east_m == pytest.approx(20.0, abs=2.0)
    better = find_site(layers_with((0.0, 20.0, 5.0), (0.0, -18.0, 13.0)), search, P).site
    assert better.east_m < 0.0


def test_moves_in_small_steps_with_the_ground():
    incumbent = Site(0.0, 0.0, 8.0, 200.0, 0.9, 0.0)
    path = []
    for _ in range(40):
        incumbent = find_site(
            layers_with((0.0, 2.0, 9.0)), replace(SEARCH, incumbent=incumbent), P
        ).site
        path.append(incumbent.east_m)
    assert np.abs(np.diff([0.0, *path])).max() < 0.5
    assert path[-1] > 1.0


def test_looks_only_within_the_focus():
    search = replace(SEARCH, focus=Focus(0.0, 0.0, 9.0))
    layers = layers_with((30.0, 0.0, 12.0))
    assert find_site(layers, search, P).kind is VerdictKind.NO_ZONE


def test_places_that_failed_are_left_out():
    layers = layers_with((0.0, 0.0, 6.5), (35.0, 0.0, 6.5))
    assert abs(find_site(layers, SEARCH, P).site.north_m) < 3.0
    again = find_site(layers, replace(SEARCH, failed=((0.0, 0.0, 8.0),)), P).site
    assert again.north_m > 30.0
