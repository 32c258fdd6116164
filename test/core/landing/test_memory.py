# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Failed places are left out with their clearance, longer and wider where failures repeat."""

import pytest

from peace_ros.core.domain import Site
from peace_ros.core.landing import LandingParameters
from peace_ros.core.landing.memory import SiteMemory

S = 1_000_000_000
P = LandingParameters()


def site(
    north_m: float, clearance_m: float = 6.0, confidence: float = 0.9, east_m: float = 0.0
) -> Site:
    return Site(north_m, east_m, clearance_m, 100.0, confidence, 0.1)


@pytest.mark.parametrize(('clearance_m', 'radius_m'), [(3.0, 8.0), (10.0, 10.0), (50.0, 12.0)])
def test_a_failed_place_reaches_as_far_as_it_was_wide(clearance_m, radius_m):
    memory = SiteMemory(P)
    assert memory.fail(site(0.0, clearance_m), 0).radius_m == radius_m


def test_a_failure_near_another_grows_and_takes_its_place():
    memory = SiteMemory(P)
    memory.fail(site(0.0, 10.0), 0)
    assert memory.fail(site(4.0, 10.0), S).radius_m == pytest.approx(15.0)
    assert len(memory.failed) == 1
    assert memory.fail(site(5.0, 10.0), 2 * S).radius_m == pytest.approx(22.5)
    memory.fail(site(100.0), 3 * S)
    assert [each.failures for each in memory.failed] == [3, 1]


def test_growth_has_a_limit():
    memory = SiteMemory(P)
    for number in range(12):
        radius_m = memory.fail(site(0.0), number * S).radius_m
    assert radius_m == P.failed_site_radius_limit_m


def test_what_was_left_out_stays_left_out_when_another_place_fails():
    memory = SiteMemory(LandingParameters(failed_site_growth=1.0))
    memory.fail(site(0.0, 10.0), 0)
    memory.fail(site(9.0, 10.0), S)
    for north_m in (-9.0, 0.0, 18.0):
        assert any(each.covers(site(north_m)) for each in memory.failed)


def test_forgives_after_its_time_and_not_before():
    memory = SiteMemory(LandingParameters(failed_site_memory_s=100.0))
    memory.fail(site(0.0), 10 * S)
    memory.forgive(109 * S)
    assert len(memory.failed) == 1
    memory.forgive(111 * S)
    assert memory.failed == ()


def test_a_failure_outlasts_a_whole_landing_by_default():
    assert P.failed_site_memory_s >= P.max_total_s


def test_the_best_place_is_wide_sure_and_has_not_failed():
    memory = SiteMemory(P)
    assert memory.best() is None
    for each in (site(0.0, 5.0), site(50.0, 11.0), site(100.0, 12.0, 0.7)):
        memory.see(each)
    assert memory.best().north_m == 50.0
    memory.fail(site(50.0, 11.0), 0)
    assert memory.best().north_m == 100.0


def test_a_place_is_remembered_as_it_was_last_seen():
    memory = SiteMemory(P)
    memory.see(site(0.0, 11.0))
    memory.see(site(30.0, 7.0))
    memory.see(site(1.0, 4.0))
    assert memory.best().north_m == 30.0


def test_a_place_far_from_the_origin_is_known_again():
    memory = SiteMemory(P)
    memory.see(site(700.0, 11.0, east_m=-900.0))
    memory.see(site(0.0, 9.0))
    memory.see(site(703.0, 4.0, east_m=-904.0))
    assert memory.best().north_m == 0.0


@pytest.mark.parametrize(('apart_m', 'north_m'), [(10.0, 1000.0), (10.1, 0.0)])
def test_a_place_within_10_m_is_the_same_place(apart_m, north_m):
    memory = SiteMemory(P)
    memory.see(site(0.0, 11.0))
    memory.see(site(1000.0, 9.0))
    memory.see(site(apart_m, 4.0))
    assert memory.best().north_m == north_m


def test_the_oldest_of_many_places_is_forgotten():
    memory = SiteMemory(P)
    memory.see(site(0.0, 11.0))
    for number in range(1, 33):
        memory.see(site(100.0 * number, 5.0))
        assert (memory.best().north_m == 0.0) is (number <= 32)
    memory.see(site(9000.0, 4.0))
    assert memory.best().north_m == 100.0


def test_a_failed_place_covers_its_rim():
    memory = SiteMemory(P)
    place = memory.fail(site(0.0, 10.0), 5 * S)
    assert place.covers(site(10.0))
    assert not place.covers(site(10.1))
    assert place.until_ns == 5 * S + round(P.failed_site_memory_s * S)
    memory.forgive(place.until_ns - 1)
    assert memory.failed == (place,)
    memory.forgive(place.until_ns)
    assert memory.failed == ()


def test_doubt_weighs_squared_as_in_the_choice_of_a_site():
    memory = SiteMemory(P)
    memory.see(site(0.0, 10.0, 0.9))
    memory.see(site(50.0, 12.0, 0.8))
    assert memory.best().north_m == 0.0


def test_a_failure_at_the_same_place_and_of_the_same_radius_takes_its_place():
    memory = SiteMemory(LandingParameters(failed_site_growth=1.0))
    for _ in range(2):
        memory.fail(site(0.0, 10.0), 0)
    assert [each.failures for each in memory.failed] == [2]
