# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A decision is told in full, and what is not known is not told."""

from dataclasses import replace
from math import inf

from peace_ros.core.domain import Pose, Setpoint, Site
from peace_ros.core.landing import Decision, Focus, State, Verdict
from peace_ros.core.landing.decision import RefusedPlace
from peace_ros.core.landing.pairs import decision_pairs

SITE = Site(5.0, -3.0, clearance_m=6.25, area_m2=200.0, confidence=0.9, age_s=0.4)
NOTHING = Decision(
    state=State.HOLD,
    reason='no map',
    setpoint=Setpoint(0),
    verdict=Verdict.no_zone('nothing is known yet'),
    effective_threshold=0.5,
    map_age_s=inf,
    focus=None,
)


def test_tells_site_focus_motion_and_counts():
    decision = replace(
        NOTHING,
        state=State.LANDING,
        setpoint=Setpoint(7, 1.0, -0.5, 0.25),
        verdict=Verdict.found(SITE),
        focus=Focus(1.0, 2.0, 30.0),
        guard_notes=('slower', 'lower'),
        counts={'used': 4, 'not finite': 1},
    )
    pairs = decision_pairs(decision, Pose(7, 10.0, 20.0, -42.0, (1.0, 0.0, 0.0, 0.0), 42.0))
    told = {
        'state': 'LANDING',
        'verdict': 'SITE',
        'site_clearance_m': '6.250',
        'site_age_s': '0.400',
        'focus_radius_m': '30.000',
        'v_down_m_s': '0.250',
        'guard': 'slower; lower',
        'heatmaps/used': '4',
        'heatmaps/not finite': '1',
        'north_m': '10.000',
        'altitude_agl_m': '42.000',
    }
    assert told.items() <= pairs.items()


def test_what_is_not_known_has_no_key():
    pairs = decision_pairs(NOTHING, None)
    assert pairs['outcome'] == ''
    assert pairs['map_age_s'] == 'inf'
    assert not [key for key in pairs if key.startswith(('site_', 'focus_', 'north', 'heatmaps'))]


def test_every_pair_of_a_decision_has_its_key():
    decision = replace(
        NOTHING,
        state=State.AIMING,
        reason='moving over it',
        setpoint=Setpoint(7, 1.0, -0.5, 0.25),
        verdict=Verdict.found(SITE),
        effective_threshold=0.75,
        map_age_s=0.125,
        focus=Focus(1.0, 2.0, 30.0),
        outcome='handover',
        time_in_state_s=3.5,
        failed_sites=2,
        attempts=1,
        counts={'used': 4},
        refused=(RefusedPlace(1.0, -2.0, 2.5, 30.0, 'too narrow'),),
    )
    assert decision_pairs(decision, Pose(7, 10.0, 20.0, -42.0, (1.0, 0.0, 0.0, 0.0), 42.0)) == {
        'state': 'AIMING',
        'reason': 'moving over it',
        'outcome': 'handover',
        'verdict': 'SITE',
        'verdict_reason': 'site with 6.2 m of clearance',
        'guard': '',
        'failed_sites': '2',
        'attempts': '1',
        'effective_threshold': '0.750',
        'map_age_s': '0.125',
        'v_north_m_s': '1.000',
        'v_east_m_s': '-0.500',
        'v_down_m_s': '0.250',
        'time_in_state_s': '3.500',
        'north_m': '10.000',
        'east_m': '20.000',
        'altitude_agl_m': '42.000',
        'site_north_m': '5.000',
        'site_east_m': '-3.000',
        'site_clearance_m': '6.250',
        'site_area_m2': '200.000',
        'site_confidence': '0.900',
        'site_age_s': '0.400',
        'focus_north_m': '1.000',
        'focus_east_m': '2.000',
        'focus_radius_m': '30.000',
        'heatmaps/used': '4',
        'refused/1/north_m': '1.000',
        'refused/1/east_m': '-2.000',
        'refused/1/clearance_m': '2.500',
        'refused/1/distance_m': '30.000',
        'refused/1/reason': 'too narrow',
    }
