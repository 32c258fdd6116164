# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The guard: only ever makes motion smaller, whatever is asked for."""

from dataclasses import replace
from math import copysign, hypot, inf, isfinite, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import Pose, Setpoint, Site
from peace_ros.core.landing import LandingParameters, Verdict
from peace_ros.core.landing.guard import Guard
from peace_ros.core.landing.situation import Sighting, Situation

LEVEL = (1.0, 0.0, 0.0, 0.0)
P = LandingParameters(geofence_radius_m=50.0)
HOME = Pose(0, 0.0, 0.0, -60.0, LEVEL, 60.0)
NO_SITE = Verdict.no_zone('none')
ASIDE = Verdict.found(Site(0.0, 4.6, 6.0, 100.0, 0.9, 0.1))


def seen(altitude_m=60.0, north_m=0.0, now_ns=0, telemetry_age_s=0.1, **changes) -> Situation:
    """Everything good, over a site at 0, 0; changes are those of the sighting."""
    pose = Pose(0, north_m, 0.0, -altitude_m, LEVEL, altitude_m)
    known = {
        'verdict': Verdict.found(Site(north_m, 0.0, 6.0, 100.0, 0.9, 0.1)),
        'reachable': None,
        'ground_is_fresh': True,
        'ground_score': 0.9,
        'ground_age_s': changes.get('map_age_s', 0.1),
        'stamp_ns': 0,
        'map_age_s': 0.1,
        'revision': 0,
        'threshold': 0.8,
    }
    sighting = Sighting(**{**known, **changes})
    return Situation(now_ns, pose, telemetry_age_s, sighting, home=HOME)


def limited(wish: Setpoint, given_input: Situation, parameters=P):
    """Ask often enough that the limit of growth is spent."""
    guard = Guard(parameters)
    for step in range(40):
        now_ns = given_input.now_ns + step * 500_000_000
        given_now = replace(given_input, now_ns=now_ns)
        result, notes = guard.limit(wish, given_now)
    return result, notes


ANY = st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.floats(-10.0, 10.0))


@given(
    wishes=st.lists(st.tuples(ANY, ANY, ANY), min_size=1, max_size=5),
    altitude_m=ANY,
    north_m=st.floats(-100.0, 100.0),
    telemetry_age_s=ANY,
    map_age_s=ANY,
    step_ns=st.integers(-(10**9), 10**10),
)
def test_every_component_shrinks_towards_zero_and_limits_hold(
    *, wishes, altitude_m, north_m, telemetry_age_s, map_age_s, step_ns
):
    guard, last, now_ns = Guard(P), (0.0, 0.0, 0.0), 0
    for number, wish in enumerate(wishes):
        before_ns, now_ns = now_ns, now_ns + step_ns
        given_input = seen(altitude_m, north_m, now_ns, telemetry_age_s, map_age_s=map_age_s)
        out, notes = guard.limit(Setpoint(7, *wish), given_input)
        flown = (out.v_north_m_s, out.v_east_m_s, out.v_down_m_s)
        elapsed_s = 0.1 if number == 0 else min(0.5, max(0.0, (now_ns - before_ns) * 1e-9))
        for asked, given_out, previous in zip(wish, flown, last, strict=True):
            assert isfinite(given_out)
            if given_out != 0.0:
                assert copysign(1.0, given_out) == copysign(1.0, asked)
                assert abs(given_out) <= abs(asked)
                grown = abs(given_out) - (abs(previous) if previous * given_out > 0.0 else 0.0)
                assert grown <= P.acceleration_limit * elapsed_s + 1e-9
        assert hypot(out.v_north_m_s, out.v_east_m_s) <= P.lateral_speed_limit + 1e-9
        assert -P.z_speed_climbing <= out.v_down_m_s <= P.z_speed_landing
        if out.v_down_m_s > 0.0:
            assert altitude_m > P.handover_altitude_m
            assert map_age_s <= P.descent_heatmap_age_limit_s
        if not telemetry_age_s <= P.telemetry_age_limit_s:
            assert out.is_zero
        assert out.stamp_ns == 7
        assert notes or flown == wish
        last = flown


@given(north=st.floats(-5, 5), east=st.floats(-5, 5), down=st.floats(-3, 3))
def test_zero_is_zero_at_once_after_any_motion(north, east, down):
    guard = Guard(P)
    for step in range(5):
        guard.limit(Setpoint(0, north, east, down), seen(now_ns=step * 500_000_000))
    out, notes = guard.limit(Setpoint(0), seen(now_ns=5 * 500_000_000))
    assert out.is_zero
    assert notes == ()


def test_a_calm_wish_passes_untouched():
    wish = Setpoint(3, 1.0, -2.0, 0.5)
    assert limited(wish, seen()) == (wish, ())


SLOW_DOWN = Setpoint(0, 1.0, 0.0, 0.4)


@pytest.mark.parametrize(
    ('wish', 'given_input', 'expected', 'note'),
    [
        (Setpoint(0, 9.0, 0.0, 0.0), seen(), (5.0, 0.0, 0.0), 'speed limited'),
        (Setpoint(0, 0.0, 0.0, 9.0), seen(), (0.0, 0.0, 3.0), 'speed limited'),
        (
            Setpoint(0, 0.0, 0.0, 2.0),
            seen(altitude_m=21.0),
            (0.0, 0.0, 1.0),
            'descent limited: the floor is near',
        ),
        (
            Setpoint(0, 0.0, 0.0, 2.0),
            seen(altitude_m=19.0),
            (0.0, 0.0, 0.0),
            'descent limited: the floor is near',
        ),
        (Setpoint(0, 0.0, 0.0, -2.0), seen(altitude_m=19.0), (0.0, 0.0, -2.0), ''),
        (
            SLOW_DOWN,
            seen(altitude_m=nan),
            (1.0, 0.0, 0.0),
            'descent stopped: the altitude is not valid',
        ),
        (SLOW_DOWN, seen(map_age_s=1.6), (1.0, 0.0, 0.0), 'descent stopped: the map is old'),
        (SLOW_DOWN, seen(map_age_s=inf), (1.0, 0.0, 0.0), 'descent stopped: the map is old'),
        (
            SLOW_DOWN,
            seen(verdict=NO_SITE),
            (1.0, 0.0, 0.0),
            'descent stopped: no site under the vehicle',
        ),
        (
            SLOW_DOWN,
            seen(verdict=ASIDE),
            (1.0, 0.0, 0.0),
            'descent stopped: no site under the vehicle',
        ),
        (
            SLOW_DOWN,
            seen(ground_score=0.4),
            (1.0, 0.0, 0.0),
            'descent stopped: the ground below is not safe',
        ),
        (
            SLOW_DOWN,
            seen(ground_score=nan),
            (1.0, 0.0, 0.0),
            'descent stopped: the ground below is not safe',
        ),
        (
            SLOW_DOWN,
            seen(ground_age_s=2.0),
            (1.0, 0.0, 0.0),
            'descent stopped: the ground below is not in view',
        ),
        (Setpoint(0, 1.0, 0.0, -2.0), seen(verdict=NO_SITE), (1.0, 0.0, -2.0), ''),
        (
            Setpoint(0, 1.0, 0.0, 1.0),
            seen(north_m=nan),
            (0.0, 0.0, 0.0),
            'stopped: the position is not a number',
        ),
        (
            Setpoint(0, 1.0, 0.0, 2.0),
            seen(telemetry_age_s=0.8),
            (0.0, 0.0, 0.0),
            'stopped: telemetry is missing or old',
        ),
        (Setpoint(0, 3.0, 0.0, 0.0), seen(north_m=51.0), (0.0, 0.0, 0.0), 'stopped at the fence'),
        (
            Setpoint(0, 3.0, 0.0, 0.4),
            seen(north_m=48.5),
            (1.0, 0.0, 0.4),
            'slowed before the fence',
        ),
        (Setpoint(0, -3.0, 0.0, 0.0), seen(north_m=51.0), (-3.0, 0.0, 0.0), ''),
        (
            Setpoint(0, nan, 1.0, 1.0),
            seen(),
            (0.0, 0.0, 0.0),
            'stopped: the set-point was not finite',
        ),
    ],
)
def test_each_limit_acts_and_says_so(wish, given_input, expected, note):
    wish = replace(wish, stamp_ns=7)
    out, notes = limited(wish, given_input)
    assert (out.v_north_m_s, out.v_east_m_s, out.v_down_m_s) == pytest.approx(expected)
    assert out.stamp_ns == 7
    assert notes == ((note,) if note else ())


def test_a_turn_from_descent_to_climb_passes_through_no_descent():
    guard = Guard(P)
    for step in range(10):
        guard.limit(Setpoint(0, 0.0, 0.0, 2.0), seen(now_ns=step * 500_000_000))
    out, _ = guard.limit(Setpoint(0, 0.0, 0.0, -2.0), seen(now_ns=9 * 500_000_000 + 10**8))
    assert out.v_down_m_s == pytest.approx(-0.3)


@pytest.mark.parametrize(
    ('given_now', 'down_m_s'),
    [
        (seen(telemetry_age_s=0.7), 2.0),
        (seen(map_age_s=1.5, ground_age_s=0.1), 2.0),
        (seen(ground_age_s=1.5), 2.0),
        (seen(ground_score=0.5), 2.0),
        (seen(altitude_m=500.0), 2.0),
        (seen(altitude_m=500.1), 0.0),
        (seen(altitude_m=22.0), 2.0),
        (seen(altitude_m=20.5), 0.5),
        (seen(altitude_m=20.0), 0.0),
        (seen(verdict=Verdict.found(Site(0.0, 4.5, 6.0, 100.0, 0.9, 0.1))), 2.0),
        (replace(seen(), pose=None), 0.0),
    ],
)
def test_the_bounds_of_a_descent_are_inclusive(given_now, down_m_s):
    assert limited(Setpoint(0, 0.0, 0.0, 2.0), given_now)[0].v_down_m_s == pytest.approx(down_m_s)


def test_speed_is_limited_along_its_direction():
    out, notes = limited(Setpoint(0, -6.0, 8.0, -9.0), seen())
    assert (out.v_north_m_s, out.v_east_m_s, out.v_down_m_s) == pytest.approx((-3.0, 4.0, -3.0))
    assert notes == ('speed limited',)
    at_limit = Setpoint(0, 3.0, 4.0, 3.0)
    assert limited(at_limit, seen()) == (at_limit, ())


@pytest.mark.parametrize(
    ('north_m', 'wish', 'expected'),
    [
        (47.0, (2.0, 0.0), (2.0, 0.0)),
        (47.0, (4.0, 2.0), (2.0, 1.0)),
        (50.0, (4.0, 2.0), (0.0, 0.0)),
        (53.0, (4.0, 2.0), (0.0, 0.0)),
        (50.0, (0.0, 2.0), (0.0, 2.0)),
        (0.0, (3.0, 4.0), (3.0, 4.0)),
        (-47.0, (-4.0, 0.0), (-2.0, 0.0)),
        (-60.0, (4.0, 0.0), (4.0, 0.0)),
    ],
)
def test_the_fence_slows_what_leads_outwards_in_proportion_to_the_room(north_m, wish, expected):
    out, notes = limited(Setpoint(0, *wish, 0.0), seen(north_m=north_m))
    assert (out.v_north_m_s, out.v_east_m_s) == pytest.approx(expected)
    assert bool(notes) == (wish != expected)
    for free in (replace(P, geofence_radius_m=0.0), P):
        given_now = replace(seen(north_m=north_m), home=None if free is P else HOME)
        assert limited(Setpoint(0, *wish, 0.0), given_now, free) == (Setpoint(0, *wish, 0.0), ())


@pytest.mark.parametrize(
    ('north_m', 'wish_m_s', 'expected_m_s'),
    [(0.3, 2.0, 0.6), (0.6, 2.0, 0.4), (-0.6, 0.6, 0.6), (-0.6, 1.4, 1.4), (0.0, 0.5, 0.5)],
)
def test_a_narrow_fence_slows_near_its_middle_too(north_m, wish_m_s, expected_m_s):
    narrow = replace(P, geofence_radius_m=1.2)
    out, _ = limited(Setpoint(0, wish_m_s, 0.0, 0.0), seen(north_m=north_m), narrow)
    assert out.v_north_m_s == pytest.approx(expected_m_s)


def test_the_fence_is_around_where_the_landing_began():
    begun = Pose(0, 100.0, 30.0, -60.0, LEVEL, 60.0)
    given_now = replace(seen(north_m=100.0), home=begun)
    # 30 m to the west of home, 20 m of room.
    assert limited(Setpoint(0, 0.0, -5.0, 0.0), given_now)[0].v_east_m_s == -5.0
    near = replace(begun, east_m=47.0)
    out, _ = limited(Setpoint(0, 0.0, -5.0, 0.0), replace(given_now, home=near))
    assert out.v_east_m_s == pytest.approx(-2.0)


@pytest.mark.parametrize(
    ('elapsed_s', 'speed_m_s'),
    [(0.0, 0.3), (0.2, 0.9), (0.5, 1.8), (3.0, 1.8), (-1.0, 0.3)],
)
def test_speed_grows_with_the_time_between_two_steps_up_to_half_a_second(elapsed_s, speed_m_s):
    guard, wish = Guard(P), Setpoint(0, 4.0, 0.0, 0.0)
    first, notes = guard.limit(wish, seen(now_ns=10**12))
    assert first.v_north_m_s == pytest.approx(0.3)
    assert notes == ('acceleration limited',)
    second, _ = guard.limit(wish, seen(now_ns=10**12 + round(elapsed_s * 1e9)))
    assert second.v_north_m_s == pytest.approx(speed_m_s)


def test_a_change_of_direction_begins_at_zero():
    guard = Guard(P)
    for step in range(10):
        guard.limit(Setpoint(0, 4.0, -4.0, 0.0), seen(now_ns=step * 500_000_000))
    out, _ = guard.limit(Setpoint(0, -4.0, -2.0, 0.0), seen(now_ns=9 * 500_000_000 + 10**8))
    assert (out.v_north_m_s, out.v_east_m_s) == pytest.approx((-0.3, -2.0))


def test_the_floor_counts_from_the_lowest_height():
    down = Setpoint(7, v_down_m_s=3.0)
    low = replace(seen(26.0), above_lowest_m=4.0)
    assert limited(down, low)[0].v_down_m_s == pytest.approx(2.0)
    assert limited(down, replace(low, above_lowest_m=6.0))[0].is_zero


DOWN = Setpoint(0, v_down_m_s=1.0)


@pytest.mark.parametrize(
    ('altitude_m', 'above_lowest_m', 'down_m_s'),
    [(70.0, 0.0, 1.0), (60.1, 0.0, 1.0), (60.0, 0.0, 0.0), (70.0, 10.0, 0.0), (55.0, 0.0, 0.0)],
)
def test_a_search_goes_down_without_a_site_only_above_its_floor(
    altitude_m, above_lowest_m, down_m_s
):
    searching = replace(
        seen(altitude_m, verdict=NO_SITE), search_floor_m=60.0, above_lowest_m=above_lowest_m
    )
    assert limited(DOWN, searching)[0].v_down_m_s == down_m_s


def test_a_search_goes_down_only_by_fresh_heatmaps_and_never_below_the_safe_altitude():
    searching = replace(seen(70.0, verdict=NO_SITE), search_floor_m=60.0)
    old = replace(searching, sighting=replace(searching.sighting, map_age_s=1.6))
    assert limited(DOWN, old)[0].v_down_m_s == 0.0
    assert limited(DOWN, replace(searching, search_floor_m=None))[0].v_down_m_s == 0.0
    low = replace(seen(49.0, verdict=NO_SITE), search_floor_m=20.0)
    assert limited(DOWN, low)[0].v_down_m_s == 0.0
