# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance: towards the site, down over it, slow before the floor, never across the unknown."""

from dataclasses import replace
from math import hypot, inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing import LandingParameters, State, Verdict
from peace_ros.core.landing.guidance import ExpandingSquare, over_site, velocity
from peace_ros.core.landing.situation import Sighting, Situation
from peace_ros.core.landing.states import STILL_STATES

P = LandingParameters()
LEVEL = (1.0, 0.0, 0.0, 0.0)


SAFE_M = 0.98 * P.safe_altitude_m
"""From here on an altitude counts as the safe one."""


def situation(altitude_m=60.0, offset_m=0.0, clearance_m=6.0, **changes) -> Situation:
    site = Site(offset_m, 0.0, clearance_m, 100.0, 0.9, 0.1)
    fresh = changes.pop('ground_is_fresh', True)
    sighting = Sighting(Verdict.found(site), site, fresh, 0.9, 0.1, 5, 0.1, 9, 0.8)
    given_values = {
        'now_ns': 0,
        'pose': Pose(0, 0.0, 0.0, -altitude_m, LEVEL, altitude_m),
        'telemetry_age_s': 0.1,
        'sighting': sighting,
        'site': site,
        'home': Pose(0, -30.0, 40.0, -60.0, LEVEL, 60.0),
    }
    return Situation(**{**given_values, **changes})


@given(
    altitude_m=st.floats(1.0, 120.0),
    offset_m=st.floats(-80.0, 80.0),
    clearance_m=st.floats(0.0, 20.0),
    ground_is_fresh=st.booleans(),
    has_site=st.booleans(),
    state=st.sampled_from(State),
)
def test_descends_only_over_a_fresh_site_and_not_below_the_floor(
    *, altitude_m, offset_m, clearance_m, ground_is_fresh, has_site, state
):
    here = situation(altitude_m, offset_m, clearance_m, ground_is_fresh=ground_is_fresh)
    if not has_site:
        here = situation(altitude_m, site=None)
    setpoint, _ = velocity(state, here, P)
    if state in STILL_STATES:
        assert setpoint.is_zero
    if setpoint.v_down_m_s > 0.0:
        assert state in {State.AIMING, State.LANDING}
        assert has_site
        assert ground_is_fresh
        assert abs(offset_m) < clearance_m
        assert altitude_m > P.handover_altitude_m
    lateral = hypot(setpoint.v_north_m_s, setpoint.v_east_m_s)
    if altitude_m < SAFE_M and lateral > 0.0 and state is not State.RETURNING:
        assert abs(offset_m) <= clearance_m
        assert lateral <= P.landing_lateral_speed_limit + 1e-9


@pytest.mark.parametrize(('altitude_m', 'speed'), [(100.0, 1.5), (56.0, 0.6), (55.0, 0.0)])
def test_aiming_descends_at_half_speed_to_a_tenth_above_the_safe_altitude(altitude_m, speed):
    setpoint, _ = velocity(State.AIMING, situation(altitude_m), P)
    assert setpoint.v_down_m_s == pytest.approx(speed)


@pytest.mark.parametrize(
    ('altitude_m', 'speed'), [(50.0, 3.0), (30.0, 1.8), (21.0, 0.6), (20.4, 0.3), (20.0, 0.0)]
)
def test_landing_slows_down_before_the_floor(altitude_m, speed):
    setpoint, _ = velocity(State.LANDING, situation(altitude_m), P)
    assert setpoint.v_down_m_s == pytest.approx(speed)


def test_landing_corrects_laterally_while_it_descends():
    setpoint, note = velocity(State.LANDING, situation(40.0, offset_m=1.0), P)
    assert setpoint.v_north_m_s == pytest.approx(0.5)
    assert setpoint.v_down_m_s > 0.0
    assert note == ''


def test_landing_says_what_it_waits_for():
    setpoint, note = velocity(State.LANDING, situation(40.0, offset_m=3.0), P)
    assert setpoint.v_down_m_s == 0.0
    assert setpoint.v_north_m_s == pytest.approx(P.landing_lateral_speed_limit)
    assert '3.0 m beside' in note
    setpoint, note = velocity(State.LANDING, situation(40.0, ground_is_fresh=False), P)
    assert setpoint.v_down_m_s == 0.0
    assert 'fresh' in note


def test_speed_leaves_room_to_stop_before_the_site():
    # Measured distances of stopping of the autopilot, by speed.
    for speed_m_s, stop_m in ((1.0, 0.75), (2.0, 1.8), (3.0, 3.1), (5.0, 7.0)):
        setpoint, _ = velocity(State.LANDING, situation(60.0, offset_m=stop_m), P)
        assert setpoint.v_north_m_s < speed_m_s


def test_below_the_safe_altitude_it_does_not_move_where_nothing_is_known():
    setpoint, _ = velocity(State.AIMING, situation(30.0, offset_m=10.0, clearance_m=6.0), P)
    assert setpoint.is_zero


def test_climbing_goes_straight_up():
    setpoint, _ = velocity(State.CLIMBING, situation(30.0, offset_m=5.0), P)
    assert (setpoint.v_north_m_s, setpoint.v_east_m_s) == (0.0, 0.0)
    assert setpoint.v_down_m_s == -P.z_speed_climbing


def test_searching_climbs_back_and_flies_only_at_a_safe_altitude():
    wish = {'site': None, 'search_target': (60.0, 0.0)}
    setpoint, _ = velocity(State.SEARCHING, situation(55.0, **wish), P)
    assert setpoint.v_north_m_s == pytest.approx(P.search_speed)
    assert setpoint.v_down_m_s < 0.0
    setpoint, _ = velocity(State.SEARCHING, situation(40.0, **wish), P)
    assert setpoint.is_zero


def test_expanding_square_grows_and_stays_within_its_radius():
    square = ExpandingSquare((10.0, 20.0), 30.0, 100.0)
    north, east, targets = 10.0, 20.0, []
    for _ in range(12):
        north, east = square.target(Pose(0, north, east, -60.0, LEVEL, 60.0))
        targets.append((north, east))
        assert hypot(north - 10.0, east - 20.0) <= 100.0
    assert targets[:4] == [(40.0, 20.0), (40.0, 50.0), (-20.0, 50.0), (-20.0, -10.0)]
    assert targets.count((40.0, 20.0)) > 1, 'begins anew at its limit'


@pytest.mark.parametrize(
    ('state', 'altitude_m', 'site_m', 'clearance_m', 'velocity_m_s'),
    [
        # Half of the error as speed (0.35 of it in AIMING), up to the limits.
        (State.LANDING, 60.0, (4.0, 3.0), 5.0, (2.0, 1.5, 0.0)),
        (State.LANDING, 60.0, (-80.0, 0.0), 6.0, (-5.0, 0.0, 0.0)),
        (State.AIMING, 60.0, (0.0, -10.0), 6.0, (0.0, -3.5, 0.0)),
        (State.AIMING, 60.0, (0.0, 0.0), 6.0, (0.0, 0.0, 1.5)),
        # Half speed at three quarters of the tolerance: 4.5 m in AIMING, 2.25 m in LANDING.
        (State.AIMING, 100.0, (3.375, 0.0), 6.0, (1.18125, 0.0, 0.75)),
        (State.AIMING, 100.0, (2.25, 0.0), 6.0, (0.7875, 0.0, 1.5)),
        (State.LANDING, 30.0, (1.6875, 0.0), 6.0, (0.84375, 0.0, 0.9)),
        (State.LANDING, 30.0, (1.125, 0.0), 6.0, (0.5625, 0.0, 1.8)),
        (State.LANDING, 30.0, (2.25, 0.0), 6.0, (1.125, 0.0, 0.0)),
        # With little room the tolerance is half a metre, but never more than the room.
        (State.LANDING, 30.0, (0.3, 0.0), 2.1, (0.15, 0.0, 1.44)),
        (State.LANDING, 30.0, (0.3, 0.0), 1.9, (0.15, 0.0, 0.9)),
        (State.LANDING, 30.0, (0.0, 0.0), 1.5, (0.0, 0.0, 0.0)),
        # Below the safe altitude sideways only within the clearance, and slowly.
        (State.LANDING, 40.0, (6.0, 0.0), 6.0, (1.5, 0.0, 0.0)),
        (State.LANDING, 40.0, (6.1, 0.0), 6.0, (0.0, 0.0, 0.0)),
        (State.LANDING, 49.0, (6.1, 0.0), 6.0, (3.05, 0.0, 0.0)),
        (State.CLIMBING, 30.0, (0.0, 0.0), 6.0, (0.0, 0.0, -3.0)),
    ],
)
def test_exact_velocities_over_a_site(state, altitude_m, site_m, clearance_m, velocity_m_s):
    site = Site(*site_m, clearance_m, 100.0, 0.9, 0.1)
    setpoint, _ = velocity(state, situation(altitude_m, site=site), P)
    flown = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
    assert flown == pytest.approx(velocity_m_s)
    assert setpoint.stamp_ns == 5


def test_the_slowest_descent_away_from_the_floor():
    low = LandingParameters(handover_altitude_m=2.0)
    for altitude_m, speed_m_s in ((6.0, 0.5), (8.0, 0.5), (10.0, 0.6)):
        setpoint, _ = velocity(State.LANDING, situation(altitude_m), low)
        assert setpoint.v_down_m_s == pytest.approx(speed_m_s)


@pytest.mark.parametrize(
    ('altitude_m', 'begun_m', 'up_m_s'),
    [
        (55.0, 60.0, 2.5),
        (52.0, 60.0, 3.0),
        (58.9, 60.0, 0.55),
        (59.0, 60.0, 0.0),
        (61.0, 60.0, 0.0),
        (118.0, 200.0, 1.0),
    ],
)
def test_a_search_climbs_back_to_where_it_began_but_not_above_120_m(altitude_m, begun_m, up_m_s):
    home = Pose(0, 0.0, 0.0, -begun_m, LEVEL, begun_m)
    here = situation(altitude_m, site=None, home=home)
    setpoint, note = velocity(State.RESTARTING, here, P)
    assert (setpoint.v_north_m_s, setpoint.v_east_m_s) == (0.0, 0.0)
    assert -setpoint.v_down_m_s == pytest.approx(up_m_s)
    assert note == 'looking'
    flying = replace(here, search_target=(-3.0, 4.0))
    setpoint, note = velocity(State.SEARCHING, flying, P)
    assert (setpoint.v_north_m_s, setpoint.v_east_m_s) == pytest.approx((-1.5, 2.0))
    assert note == 'flying an expanding square'


def test_a_search_stands_as_soon_as_a_site_is_known():
    setpoint, note = velocity(State.SEARCHING, situation(55.0, search_target=(60.0, 0.0)), P)
    assert setpoint.is_zero
    assert note == 'looking'


@pytest.mark.parametrize(
    ('altitude_m', 'velocity_m_s'),
    [(60.0, (-2.4, 3.2, 0.0)), (49.0, (-2.4, 3.2, 0.0)), (48.9, (0.0, 0.0, -3.0))],
)
def test_a_return_flies_straight_home_at_the_safe_altitude_and_climbs_below(
    altitude_m, velocity_m_s
):
    setpoint, note = velocity(State.RETURNING, situation(altitude_m, site=None), P)
    flown = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
    assert flown == pytest.approx(velocity_m_s)
    assert note == ''
    setpoint, note = velocity(State.RETURNING, situation(altitude_m, home=None), P)
    assert setpoint.is_zero
    assert 'not known' in note


@pytest.mark.parametrize('north_m', [nan, inf])
def test_beside_a_site_of_which_the_distance_is_not_known_nothing_descends(north_m):
    site = Site(north_m, 0.0, 6.0, 100.0, 0.9, 0.1)
    assert velocity(State.LANDING, situation(40.0, site=site), P)[0].v_down_m_s == 0.0


@pytest.mark.parametrize('state', State)
def test_nothing_moves_without_a_valid_pose(state):
    assert velocity(state, situation(pose=None), P)[0].is_zero


@pytest.mark.parametrize(('offset_m', 'is_over'), [(4.5, True), (4.6, False)])
def test_over_a_site_means_with_the_whole_vehicle(offset_m, is_over):
    here = situation(offset_m=offset_m)
    assert over_site(here.pose, here.site, 1.5) is is_over


def test_a_waypoint_is_reached_within_5_m_and_a_wide_spacing_stays_at_home():
    square = ExpandingSquare((0.0, 0.0), 30.0, 100.0)
    assert square.target(Pose(0, 24.9, 0.0, -60.0, LEVEL, 60.0)) == (30.0, 0.0)
    assert square.target(Pose(0, 25.0, 0.0, -60.0, LEVEL, 60.0)) == (30.0, 30.0)
    assert square.target(Pose(0, 30.0, 0.0, -60.0, LEVEL, 60.0)) == (30.0, 30.0), 'east too'
    just = ExpandingSquare((0.0, 0.0), 30.0, 30.0)
    assert just.target(Pose(0, 0.0, 0.0, -60.0, LEVEL, 60.0)) == (30.0, 0.0)
    narrow = ExpandingSquare((10.0, 20.0), 30.0, 20.0)
    for north_m in (10.0, 40.0):
        assert narrow.target(Pose(0, north_m, 20.0, -60.0, LEVEL, 60.0)) == (10.0, 20.0)


def test_a_square_far_from_the_origin_stays_around_its_home():
    square, north, east, targets = ExpandingSquare((-300.0, 500.0), 30.0, 100.0), -300.0, 500.0, []
    for _ in range(12):
        north, east = square.target(Pose(0, north, east, -60.0, LEVEL, 60.0))
        targets.append((north + 300.0, east - 500.0))
        assert hypot(*targets[-1]) <= 100.0
    assert targets[:4] == [(30.0, 0.0), (30.0, 30.0), (-30.0, 30.0), (-30.0, -30.0)]


def test_at_its_tolerance_beside_the_site_it_says_that_it_waits():
    setpoint, note = velocity(State.LANDING, situation(30.0, offset_m=2.25), P)
    assert setpoint.v_down_m_s == 0.0
    assert note == '2.2 m beside the site: descends within 2.2 m'
