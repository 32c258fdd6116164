# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance: towards the site, down over it, slow before the floor, never across the unknown."""

from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing import LandingParameters, State, Verdict
from peace_ros.core.landing.guidance import ExpandingSquare, velocity
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
