# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The watch: control, telemetry, heatmaps and budgets, each exactly at its bounds."""

from dataclasses import replace
from math import inf, nan

import pytest

from peace_ros.core.domain import Pose, Telemetry
from peace_ros.core.landing import LandingParameters
from peace_ros.core.landing.watch import (
    Budget,
    ControlWatch,
    at_safe_altitude,
    bad_map,
    bad_telemetry,
    valid_pose,
)

P = LandingParameters()
S = 1_000_000_000
POSE = Pose(0, 1.0, 2.0, -60.0, (1.0, 0.0, 0.0, 0.0), 60.0)
LOITERING = Telemetry(1, POSE, armed=True, in_control=False, mode='LOITER', landed=False)
GOOD = Telemetry(1, POSE, armed=True, in_control=True, mode='GUIDED', landed=False)


@pytest.mark.parametrize(
    ('changes', 'is_valid'),
    [
        ({}, True),
        ({'altitude_agl_m': 0.1}, True),
        ({'altitude_agl_m': 500.0}, True),
        ({'altitude_agl_m': 0.0}, False),
        ({'altitude_agl_m': 500.1}, False),
        ({'altitude_agl_m': inf}, False),
        ({'altitude_agl_m': nan}, False),
        ({'north_m': nan}, False),
        ({'east_m': -inf}, False),
    ],
)
def test_a_valid_pose_has_a_position_and_an_altitude_within_bounds(changes, is_valid):
    pose = replace(POSE, **changes)
    assert valid_pose(replace(GOOD, pose=pose), P) is (pose if is_valid else None)
    assert bool(bad_telemetry(replace(GOOD, pose=pose), 0.1, P)) is not is_valid
    assert valid_pose(None, P) is None


@pytest.mark.parametrize(('altitude_m', 'is_safe'), [(49.0, True), (48.9, False)])
def test_the_safe_altitude_is_reached_at_98_percent_of_it(altitude_m, is_safe):
    assert at_safe_altitude(replace(POSE, altitude_agl_m=altitude_m), P) is is_safe
    assert at_safe_altitude(None, P) is False


@pytest.mark.parametrize(('above_lowest_m', 'is_safe'), [(0.0, True), (10.0, True), (12.0, False)])
def test_the_safe_altitude_counts_from_the_lowest_height_that_is_believed(above_lowest_m, is_safe):
    pose = replace(POSE, altitude_agl_m=60.0)
    assert at_safe_altitude(pose, P, above_lowest_m) is is_safe


@pytest.mark.parametrize(
    ('changes', 'age_s', 'sentence'),
    [
        ({}, 0.7, ''),
        ({'landed': None}, 0.1, ''),
        ({}, 0.8, 'telemetry is 0.8 s old, limit 0.7 s: check the connection'),
        ({'in_control': False}, 0.1, 'the autopilot is in mode GUIDED, in which it ignores us'),
        ({'in_control': False, 'mode': ''}, 0.1, 'mode unknown'),
        ({'in_control': False, 'landed': True}, 0.1, 'on the ground'),
        ({'in_control': False, 'armed': False}, 0.1, 'not armed'),
    ],
)
def test_telemetry_is_good_in_the_air_fresh_and_in_control(changes, age_s, sentence):
    problem = bad_telemetry(replace(GOOD, **changes), age_s, P)
    assert sentence in problem
    assert bool(problem) == bool(sentence)


@pytest.mark.parametrize(
    ('age_s', 'rejected', 'sentence'),
    [
        (2.0, 'x', ''),
        (2.1, '', 'the newest heatmap is 2.1 s old, limit 2.0 s: is segmentation running?'),
        (2.1, 'too tilted', 'limit 2.0 s: the last one was rejected: too tilted'),
        (inf, '', 'no heatmap yet: is segmentation running, with the same clock?'),
        (inf, 'too tilted', 'no heatmap yet: the last one was rejected: too tilted'),
    ],
)
def test_heatmaps_are_good_up_to_their_age(age_s, rejected, sentence):
    problem = bad_map(age_s, rejected, P)
    assert problem.endswith(sentence)
    assert bool(problem) == bool(sentence)


@pytest.mark.parametrize(
    ('told', 'word'),
    [
        ([GOOD, replace(GOOD, in_control=False, mode='LOITER')], 'LOITER'),
        ([GOOD, replace(GOOD, in_control=False, mode='')], 'unknown'),
        ([GOOD, None, GOOD], ''),
        ([replace(GOOD, in_control=False), GOOD], ''),
        ([replace(GOOD, in_control=False)] * 2, ''),
        # In the mode before it is armed is not yet in control.
        ([replace(GOOD, armed=False), replace(GOOD, in_control=False)], ''),
        ([GOOD, replace(GOOD, armed=False)], 'disarmed'),
        (
            [replace(GOOD, in_control=False), replace(GOOD, in_control=False, armed=False)],
            'disarmed',
        ),
        ([replace(GOOD, armed=False), GOOD], ''),
    ],
)
def test_control_is_lost_by_whoever_had_it_and_for_good(told, word):
    watch = ControlWatch()
    for each in told:
        watch.see(each)
    assert word in watch.taken_over
    assert bool(watch.taken_over) == bool(word)
    before = watch.taken_over
    watch.see(GOOD)
    assert watch.taken_over == before


def lost(seconds, explanation, first='') -> str:
    """Who has control after it was lost, explained first at once and then so much later."""
    watch = ControlWatch()
    watch.see(GOOD)
    gone = replace(GOOD, in_control=False, mode='RTL', received_ns=10 * S)
    watch.see(replace(gone, explanation=first))
    watch.see(replace(gone, explanation=explanation, received_ns=round((10 + seconds) * S)))
    return watch.taken_over


def test_what_the_autopilot_reports_of_a_takeover_stands_beside_it():
    assert lost(0.1, '', 'the battery is low').endswith(
        '(the autopilot reports: the battery is low)'
    )
    assert lost(1.9, 'the battery is low').endswith('(the autopilot reports: the battery is low)')
    assert 'battery' not in lost(2.1, 'the battery is low'), 'too late to explain it'
    assert 'fence' not in lost(0.1, 'a fence', 'the battery is low'), 'the first one stays'
    assert 'reports' not in lost(0.1, '')


def spent(parameters, *steps, attempts=0) -> Budget:
    """A budget after steps of (time in s, north in m, looking, site known)."""
    budget = Budget(parameters)
    for _ in range(attempts):
        budget.fail_attempt()
    for time_s, north_m, looking, known in steps:
        told = replace(GOOD, pose=replace(POSE, north_m=north_m))
        budget.spend(round(time_s * S), told, looking=looking, site_known=known)
    return budget


def test_time_without_a_site_counts_only_while_one_is_looked_for():
    budget = spent(P, (10, 0, True, False), (12, 0, True, False), (15, 0, False, False))
    assert budget.without_site_s == pytest.approx(2.0)
    assert budget.search_m == 0.0
    assert spent(P, (10, 0, True, False), (12, 0, True, True)).without_site_s == 0.0
    # A clock that goes back takes nothing away.
    back = spent(P, (10, 0, True, False), (12, 0, True, False), (9, 0, True, False))
    assert back.without_site_s == pytest.approx(2.0)


def test_the_way_counts_from_step_to_step_of_a_search():
    steps = [(1, 0, True, False), (2, 3, True, False), (3, 9, False, False), (4, 20, True, False)]
    assert spent(P, *steps, (5, 24, True, False)).search_m == pytest.approx(7.0)


@pytest.mark.parametrize(
    ('parameters', 'last_s', 'known', 'outcome', 'sentence'),
    [
        ({'max_search_s': 30.0}, 29.9, False, '', ''),
        ({'max_search_s': 30.0}, 30.1, False, 'no_zone', 'no safe place was found in 30 s'),
        ({'max_total_s': 30.0}, 29.9, False, '', ''),
        ({'max_total_s': 30.0}, 30.1, False, 'no_zone', 'not landed within 30 s'),
        ({'max_total_s': 30.0}, 30.1, True, 'timeout', 'not landed within 30 s'),
    ],
)
def test_time_is_used_up_after_its_limit(parameters, last_s, known, outcome, sentence):
    steps = [(100.0, 0.0, True, known), (100.0 + last_s, 0.0, True, False)]
    budget = spent(replace(P, **parameters), *steps)
    assert budget.outcome == outcome
    assert budget.reason.startswith(sentence)
    assert bool(budget.reason) == bool(sentence)


@pytest.mark.parametrize(('north_m', 'outcome'), [(50.0, ''), (50.1, 'no_zone')])
def test_the_way_is_used_up_after_its_limit(north_m, outcome):
    budget = spent(
        replace(P, search_distance_m=50.0), (1, 0, True, False), (2, north_m, True, False)
    )
    assert budget.outcome == outcome


@pytest.mark.parametrize(('attempts', 'outcome'), [(3, ''), (4, 'no_zone')])
def test_attempts_are_used_up_at_their_limit(attempts, outcome):
    assert spent(P, (1, 0, False, True), attempts=attempts).outcome == outcome


@pytest.mark.parametrize('policy', ['hold', 'return', 'best_site'])
def test_a_policy_is_open_until_its_time_or_its_work_is_over(policy):
    parameters = replace(P, max_total_s=10.0, budget_policy=policy, policy_time_s=20.0)
    steps = [(0, 0, False, True), (10.5, 0, False, True)]
    assert spent(parameters, steps[0]).policy_open is False
    budget = spent(parameters, *steps)
    assert budget.policy_open is (policy != 'hold')
    assert spent(parameters, *steps, (30.5, 0, False, True)).policy_open is (policy != 'hold')
    assert spent(parameters, *steps, (30.6, 0, False, True)).policy_open is False
    budget.fail_attempt()
    assert budget.policy_open is False
    before = spent(parameters, steps[0], attempts=1)
    before.spend(round(10.5 * S), GOOD, looking=False, site_known=True)
    assert before.policy_open is (policy != 'hold'), 'a failure before the end is not the last'


def test_the_first_budget_that_is_used_up_gives_the_outcome():
    parameters = replace(P, max_total_s=10.0)
    budget = spent(parameters, (0, 0, False, True), (11, 0, False, True))
    for _ in range(9):
        budget.fail_attempt()
    budget.spend(12 * S, GOOD, looking=False, site_known=True)
    assert budget.outcome == 'timeout'
