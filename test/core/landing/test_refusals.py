# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A person is told of the best refused places, and of the first condition that each misses."""

import re
from dataclasses import replace

import numpy as np
import pytest

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing import Focus, LandingParameters
from peace_ros.core.landing.memory import FailedPlace
from peace_ros.core.landing.refusals import MOST_REFUSED, refused_places
from peace_ros.core.landing.sites import Search, too_narrow
from peace_ros.core.mapping import MapLayers

P = LandingParameters()
CELLS = 240
SEARCH = Search(
    pose=Pose(0, 0.0, 0.0, -80.0, (1.0, 0.0, 0.0, 0.0), 80.0),
    focus=Focus(0.0, 0.0, 100.0),
    threshold=0.8,
    required_clearance_m=4.0,
    age_limit_s=10.0,
)
LAWN = (20.0, -10.0, 9.0)


def layers_with(*discs: tuple[float, float, float], score: float = 0.95) -> MapLayers:
    """120 x 120 m of unsafe ground with discs (north, east, radius) of a score."""
    shape = (CELLS, CELLS)
    layers = MapLayers(
        score=np.full(shape, 0.05, np.float32),
        age_s=np.zeros(shape, np.float32),
        looks=np.full(shape, 9, np.uint16),
        cell_m=0.5,
        south_m=-60.0,
        west_m=-60.0,
        unsafe_age_s=np.full(shape, np.inf, np.float32),
    )
    for disc in discs:
        layers.score[layers.disc(*disc)] = score
    return layers


def the_one(layers: MapLayers, search: Search = SEARCH, now_ns: int = 0):
    (place,) = refused_places(layers, search, P, now_ns)
    return place


def test_ground_on_which_a_site_may_be_chosen_is_not_refused():
    assert refused_places(layers_with(LAWN), SEARCH, P, 0) == ()


def test_says_by_how_much_a_place_is_too_narrow():
    place = the_one(layers_with((20.0, -10.0, 3.0)))
    assert (place.north_m, place.east_m) == pytest.approx((20.0, -10.0), abs=1.0)
    assert place.distance_m == pytest.approx(22.4, abs=1.0)
    assert 2.0 < place.clearance_m < 3.3
    missing_m = float(re.search(r'too narrow by ([\d.]+) m', place.reason)[1])
    assert missing_m - 0.1 < 4.0 - place.clearance_m <= missing_m + 1e-6
    assert '4.0 m are needed' in place.reason


def test_what_is_missing_is_never_zero():
    assert too_narrow(3.36, 3.4).startswith('too narrow by 0.1 m')
    assert too_narrow(3.1, 4.3).startswith('too narrow by 1.2 m')


def test_ground_narrower_than_the_vehicle_is_no_place():
    assert refused_places(layers_with((20.0, -10.0, 1.0)), SEARCH, P, 0) == ()


@pytest.mark.parametrize(
    ('layer', 'value', 'reason'),
    [
        ('looks', 1, 'seen 1 times, 3 are needed'),
        ('age_s', 14.0, 'last seen 14 s ago, at most 10 s are allowed'),
        ('score', 0.7, 'not clearly safe: a score of 0.70, 0.80 is needed'),
    ],
)
def test_says_what_a_wide_place_is_missing(layer, value, reason):
    layers = layers_with(LAWN)
    getattr(layers, layer)[layers.disc(*LAWN)] = value
    assert reason in the_one(layers).reason


def test_a_person_on_a_lawn_refuses_the_lawn_though_the_veto_makes_its_score_zero():
    layers = layers_with((0.0, 0.0, 5.5))
    person = layers.disc(0.0, 0.0, 1.0)
    layers.score[person], layers.unsafe_age_s[person] = 0.0, 2.0
    assert 'unsafe was seen there 2 s ago' in the_one(layers).reason


def test_ground_that_is_unsafe_itself_such_as_a_river_is_no_refused_place():
    layers = layers_with()
    river = layers.disc(0.0, 0.0, 9.0)
    layers.score[river], layers.unsafe_age_s[river] = 0.0, 2.0
    assert refused_places(layers, SEARCH, P, 0) == ()


def test_a_failed_place_says_how_long_it_is_left_out():
    failed = FailedPlace(20.0, -10.0, 9.0, until_ns=50_000_000_000, failures=2)
    search = replace(SEARCH, failed=(failed,))
    place = the_one(layers_with(LAWN), search, now_ns=8_000_000_000)
    assert place.reason == 'failed before (2 times): left out for 42 s more'


def test_a_chosen_site_is_not_refused_although_it_became_a_little_too_narrow():
    search = replace(SEARCH, incumbent=Site(20.0, -10.0, 3.6, 40.0, 0.9, 0.0))
    assert refused_places(layers_with((20.0, -10.0, 3.7)), search, P, 0) == ()


def test_the_best_come_first_and_no_more_than_five():
    discs = [(north, east, 3.0) for north in (-40, -20, 20, 40) for east in (-30.0, 30.0)]
    places = refused_places(layers_with(*discs), SEARCH, P, 0)
    assert len(places) == MOST_REFUSED
    assert places[0].distance_m < places[-1].distance_m
    assert len({(each.north_m, each.east_m) for each in places}) == MOST_REFUSED


def test_nothing_is_refused_outside_of_the_map():
    empty = np.zeros((0, 0), np.float32)
    layers = MapLayers(empty, empty, empty.astype(np.uint16), 0.5, 0.0, 0.0, empty)
    assert refused_places(layers, SEARCH, P, 0) == ()
