# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ledger says what was heard, how old it is, and what is missing."""

import json

import pytest

from peace_ros.core.landing import State
from peace_ros.watch.ledger import Ledger, TaskReport
from peace_ros.watch.timeline import KEPT_S
from peace_ros.watch.words import STATES, STOPS, in_words


@pytest.fixture
def ledger():
    return Ledger('/')


def test_every_state_has_its_words():
    assert set(STATES) == set(STOPS) == {each.value for each in State} | {'FAILED'}
    assert in_words('SOMETHING_NEW') == 'SOMETHING_NEW'


def test_before_the_first_status_it_says_what_to_do(ledger):
    seen = ledger.snapshot(5.0)
    assert seen['silent']
    assert 'start the landing node' in seen['problem']
    assert (seen['site'], seen['refused'], seen['altitude_agl_m']) == (None, [], None)


def test_a_status_that_stops_is_old_and_says_for_how_long(ledger, scenes):
    ledger.hear_status(scenes.status_of('aiming'), 0, 10.0)
    assert ledger.snapshot(10.5)['problem'] == ''
    seen = ledger.snapshot(14.0)
    assert seen['silent']
    assert 'silent for 4 s' in seen['problem']


def test_tells_site_refused_places_and_distance(ledger, scenes):
    ledger.hear_status(scenes.status_of('aiming'), 0, 10.0)
    seen = ledger.snapshot(10.0)
    assert seen['site']['clearance_m'] == 9.3
    assert seen['site']['distance_m'] == pytest.approx(32.8, abs=0.1)
    assert [each['distance_m'] for each in seen['refused']] == [10.0, 25.2]
    assert 'too narrow by 1.2 m' in seen['refused'][0]['reason']
    assert [each['kind'] for each in ledger.circles()] == [
        'focus',
        'refused 1',
        'refused 2',
        'site',
    ]


def test_a_number_that_is_not_finite_is_not_known_and_all_is_json(ledger, scenes):
    ledger.hear_status({**scenes.status_of('idle'), 'map_age_s': 'inf', 'north_m': 'nan'}, 0, 1.0)
    seen = ledger.snapshot(1.0)
    assert (seen['map_age_s'], seen['north_m']) == (None, None)
    json.dumps([seen, ledger.history(1.0)], allow_nan=False)


def test_where_the_landing_began_is_known_only_when_it_was_seen(ledger, scenes):
    ledger.hear_status(scenes.status_of('landing'), 0, 1.0)
    assert ledger.snapshot(1.0)['home'] is None
    ledger.hear_status(scenes.status_of('idle'), 0, 2.0)
    ledger.hear_status(scenes.status_of('searching'), 0, 3.0)
    assert ledger.snapshot(3.0)['home'] == (12.0, -4.0)


def test_the_past_is_kept_for_ten_minutes_and_no_longer(ledger, scenes):
    for second in range(700):
        ledger.hear_status(scenes.status_of('idle'), 0, float(second))
    history = ledger.history(700.0)
    assert history['samples'][0]['time_s'] >= -KEPT_S - 1.0
    assert len(history['samples']) > 590
    assert [each['reason'] for each in history['samples'][:2]] == ['not engaged', None]


def test_events_are_changes_and_a_number_that_counts_up_is_none(ledger, scenes):
    for second in range(4):
        reason = f'telemetry is {second}.2 s old'
        ledger.hear_status({**scenes.status_of('hold'), 'reason': reason}, 1, float(second))
    kinds = [each['kind'] for each in ledger.history(4.0)['events']]
    assert kinds == ['state', 'reason', 'site']


def test_a_node_that_no_longer_reports_is_silent_whatever_it_said_last(ledger):
    ledger.hear_findings([TaskReport('landing: landing', 0, 'ready', {}, 10.0)])
    assert ledger.snapshot(11.0)['findings'][0]['level'] == 0
    (found,) = ledger.snapshot(20.0)['findings']
    assert found['level'] == 3
    assert 'silent for 10 s' in found['sentence']
