# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stops a landing: another hand, bad data, a budget that is used up."""

from __future__ import annotations

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
    bad_vehicle,
    valid_pose,
)

P = LandingParameters()
S = 1_000_000_000
POSE = Pose(0, 3.0, -4.0, -60.0, (1.0, 0.0, 0.0, 0.0), 60.0)
FLYING = Telemetry(1, POSE, armed=True, in_control=True, mode='GUIDED', landed=False)


@pytest.mark.parametrize(
    ('change', 'valid'),
    [
        ({}, True),
        ({'altitude_agl_m': 0.01}, True),
        ({'altitude_agl_m': 0.0}, False),
        ({'altitude_agl_m': -1.0}, False),
        ({'altitude_agl_m': 500.0}, True),
        ({'altitude_agl_m': 500.1}, False),
        ({'altitude_agl_m': nan}, False),
        ({'north_m': nan}, False),
        ({'east_m': inf}, False),
    ],
)
def test_a_pose_is_valid_within_its_limits(change, valid):
    pose = replace(POSE, **change)
    telemetry = replace(FLYING, pose=pose)
    assert valid_pose(telemetry, P) is (pose if valid else None)
    problem = bad_vehicle(telemetry, 0.1, P)
    assert (problem == '') == valid
    assert valid or 'altitude must lie within 0 to 500 m' in problem


def test_without_telemetry_there_is_no_pose():
    assert valid_pose(None, P) is None
    assert valid_pose(replace(FLYING, pose=None), P) is None


@pytest.mark.parametrize(('altitude_m', 'safe'), [(48.9, False), (49.0, True), (90.0, True)])
def test_the_safe_altitude_is_reached_at_98_percent(altitude_m, safe):
    assert P.safe_altitude_m == 50.0
    assert at_safe_altitude(replace(POSE, altitude_agl_m=altitude_m), P) is safe
    assert at_safe_altitude(None, P) is False


LIMIT_S = P.telemetry_age_limit_s


@pytest.mark.parametrize(
    ('telemetry', 'age_s', 'word'),
    [
        (None, 0.1, 'no telemetry: the autopilot has not said where it is'),
        (replace(FLYING, pose=None), 0.1, 'no telemetry: the autopilot'),
        (
            replace(FLYING, pose=None, position_problem='the estimator drifts'),
            0.1,
            'the estimator drifts',
        ),
        (FLYING, LIMIT_S, ''),
        (FLYING, LIMIT_S + 0.1, f'telemetry is {LIMIT_S + 0.1:.1f} s old, limit {LIMIT_S:.1f} s'),
        (FLYING, nan, 'telemetry is nan s old'),
        (replace(FLYING, armed=False), 0.1, 'the vehicle is not armed'),
        (replace(FLYING, landed=True), 0.1, 'the vehicle is on the ground'),
        (replace(FLYING, landed=None), 0.1, ''),
    ],
)
def test_a_vehicle_that_does_not_fly_at_a_known_position_is_a_problem(telemetry, age_s, word):
    problem = bad_vehicle(telemetry, age_s, P)
    assert problem.startswith(word)
    assert bool(problem) == bool(word)
    assert bad_telemetry(telemetry, age_s, P) == problem


@pytest.mark.parametrize(('mode', 'said'), [('LOITER', 'LOITER'), ('', 'unknown')])
def test_an_autopilot_that_obeys_somebody_else_is_a_problem_of_telemetry_alone(mode, said):
    telemetry = replace(FLYING, in_control=False, mode=mode)
    assert bad_vehicle(telemetry, 0.1, P) == ''
    assert bad_telemetry(telemetry, 0.1, P) == (
        f'the autopilot is in mode {said}, in which it ignores us'
    )
    assert 'not armed' in bad_telemetry(replace(telemetry, armed=False), 0.1, P)


def seen(*telemetry: Telemetry | None) -> str:
    watch = ControlWatch()
    for each in telemetry:
        watch.see(each)
    return watch.taken_over


UNARMED = replace(FLYING, armed=False)
LOITER = replace(FLYING, in_control=False, mode='LOITER')


@pytest.mark.parametrize(
    ('telemetry', 'word'),
    [
        ((), ''),
        ((None, FLYING, None), ''),
        ((FLYING, FLYING), ''),
        ((FLYING, LOITER), 'mode LOITER without our request'),
        ((FLYING, replace(LOITER, mode='')), 'mode unknown without our request'),
        ((FLYING, LOITER, FLYING), 'mode LOITER without our request'),
        ((LOITER, FLYING), ''),
        ((FLYING, UNARMED), 'the vehicle was disarmed'),
        ((FLYING, UNARMED, LOITER), 'the vehicle was disarmed'),
        ((FLYING, replace(LOITER, armed=False)), 'mode LOITER without our request'),
        # Our mode on the ground, unarmed, is no control that somebody could take.
        ((UNARMED, LOITER), ''),
        ((UNARMED, replace(LOITER, armed=False)), ''),
        ((UNARMED, UNARMED), ''),
        # Armed in another mode, then disarmed: over, though it was never ours.
        ((LOITER, replace(LOITER, armed=False)), 'the vehicle was disarmed'),
        ((LOITER, UNARMED), 'the vehicle was disarmed'),
    ],
)
def test_another_hand_is_noticed_and_stays_noticed(telemetry, word):
    found = seen(*telemetry)
    assert word in found
    assert bool(found) == bool(word)
    assert 'disarmed' not in word or found == word


MAP_S = P.heatmap_age_limit_s
OLD = f'the newest heatmap is {MAP_S + 1.0:.1f} s old, limit {MAP_S:.1f} s: '


@pytest.mark.parametrize(
    ('age_s', 'rejection', 'expected'),
    [
        (MAP_S, '', ''),
        (MAP_S, 'too dark', ''),
        (
            MAP_S + 1.0,
            '',
            f'{OLD}is segmentation running?',
        ),
        (
            MAP_S + 1.0,
            'too dark',
            f'{OLD}the last one was rejected: too dark',
        ),
        (inf, '', 'no heatmap yet: is segmentation running, with the same clock?'),
        (inf, 'too dark', 'no heatmap yet: the last one was rejected: too dark'),
        (nan, '', 'no heatmap yet: is segmentation running, with the same clock?'),
    ],
)
def test_an_old_map_is_a_problem_with_its_reason(age_s, rejection, expected):
    assert bad_map(age_s, rejection, P) == expected


SHORT = LandingParameters(
    max_total_s=100.0,
    max_search_s=20.0,
    search_distance_m=150.0,
    max_attempts=2,
    battery_reserve=0.3,
    budget_policy='return',
    policy_time_s=30.0,
)


class Engagement:
    """A budget and the seconds that pass."""

    def __init__(self, parameters: LandingParameters = SHORT) -> None:
        self.budget = Budget(parameters)
        self.at_s = 1000.0

    def spend(
        self,
        seconds: float,
        telemetry: Telemetry | None = FLYING,
        *,
        looking: bool = False,
        site_known: bool = True,
    ) -> str | None:
        self.at_s += seconds
        self.budget.spend(round(self.at_s * S), telemetry, looking=looking, site_known=site_known)
        return self.budget.outcome


def test_nothing_is_used_up_at_the_begin():
    budget = Budget(SHORT)
    assert (budget.outcome, budget.reason) == ('', '')
    assert (budget.without_site_s, budget.search_m, budget.attempts) == (0.0, 0.0, 0)
    assert budget.policy_open is False


def test_time_begins_with_the_first_step_and_is_used_up_after_the_last():
    engagement = Engagement()
    assert engagement.spend(0.0) == ''
    assert engagement.spend(100.0) == ''
    assert engagement.spend(0.1) == 'timeout'
    assert engagement.budget.reason == 'not landed within 100 s'
    never = Engagement()
    never.spend(0.0, site_known=False)
    assert never.spend(100.1, site_known=False) == 'no_zone'


def test_a_clock_that_goes_back_gives_no_time_back():
    engagement = Engagement()
    engagement.spend(0.0, looking=True, site_known=False)
    engagement.spend(15.0, looking=True, site_known=False)
    engagement.spend(-12.0, looking=True, site_known=False)
    assert engagement.budget.without_site_s == pytest.approx(15.0)
    engagement.spend(14.0, looking=True, site_known=False)
    assert engagement.budget.without_site_s == pytest.approx(17.0)


def test_time_without_a_site_counts_while_one_is_looked_for():
    engagement = Engagement()
    engagement.spend(5.0, looking=True, site_known=False)
    assert engagement.budget.without_site_s == 0.0, 'time begins now'
    engagement.spend(5.0, looking=True, site_known=False)
    engagement.spend(7.0, looking=False, site_known=False)
    assert engagement.budget.without_site_s == 5.0
    engagement.spend(1.0, looking=True, site_known=True)
    assert engagement.budget.without_site_s == 0.0
    assert engagement.spend(20.0, looking=True, site_known=False) == ''
    assert engagement.spend(0.5, looking=True, site_known=False) == 'no_zone'
    assert engagement.budget.reason == 'no safe place was found in 20 s of searching'


def at(north_m: float, east_m: float, **changes: float) -> Telemetry:
    return replace(FLYING, pose=replace(POSE, north_m=north_m, east_m=east_m, **changes))


def test_the_way_is_measured_while_a_site_is_looked_for():
    engagement = Engagement()
    engagement.spend(0.1, at(0.0, 0.0), looking=True)
    engagement.spend(0.1, at(30.0, 40.0), looking=True)
    assert engagement.budget.search_m == 50.0
    engagement.spend(0.1, at(500.0, 0.0))
    engagement.spend(0.1, at(600.0, 0.0), looking=True)
    assert engagement.budget.search_m == 50.0, 'what was flown meanwhile is no search'
    engagement.spend(0.1, None, looking=True)
    engagement.spend(0.1, at(0.0, 0.0), looking=True)
    engagement.spend(0.1, at(nan, 0.0), looking=True)
    engagement.spend(0.1, at(0.0, 0.0), looking=True)
    assert engagement.budget.search_m == 50.0
    assert engagement.spend(0.1, at(0.0, 100.0), looking=True) == ''
    assert engagement.budget.search_m == 150.0
    assert engagement.spend(0.1, at(1.0, 100.0), looking=True) == 'no_zone'
    assert engagement.budget.reason == 'no safe place was found on 150 m of searching'


def test_descents_that_fail_are_counted():
    engagement = Engagement()
    engagement.spend(0.1)
    engagement.budget.fail_attempt()
    assert engagement.spend(0.1) == ''
    engagement.budget.fail_attempt()
    assert engagement.budget.attempts == 2
    assert engagement.spend(0.1) == 'no_zone'
    assert engagement.budget.reason == '2 descents failed, limit 2'
    assert engagement.budget.policy_open
    engagement.budget.fail_attempt()
    assert not engagement.budget.policy_open, 'the last descent that the policy allows failed'


@pytest.mark.parametrize(
    ('battery', 'outcome'),
    [(None, ''), (0.31, ''), (0.3, 'battery'), (0.0, 'battery'), (nan, 'battery')],
)
def test_the_battery_has_a_reserve(battery, outcome):
    telemetry = replace(FLYING, battery_remaining=battery)
    assert Engagement().spend(0.1, telemetry) == outcome
    no_reserve = replace(SHORT, battery_reserve=0.0)
    assert Engagement(no_reserve).spend(0.1, telemetry) == ''
    assert Engagement().spend(0.1, None) == ''


def test_the_reserve_is_told():
    engagement = Engagement()
    engagement.spend(0.1, replace(FLYING, battery_remaining=0.254))
    assert engagement.budget.reason == 'battery at 25%, reserve 30%'


def test_the_first_thing_used_up_is_the_outcome():
    engagement = Engagement()
    engagement.spend(0.1)
    engagement.spend(0.1, replace(FLYING, battery_remaining=0.1))
    assert engagement.spend(200.0) == 'battery'


def test_the_policy_has_its_own_time():
    engagement = Engagement()
    assert not engagement.budget.policy_open
    engagement.spend(0.0)
    assert not engagement.budget.policy_open
    engagement.spend(101.0)
    assert engagement.budget.policy_open
    engagement.spend(29.9)
    assert engagement.budget.policy_open
    engagement.spend(0.2)
    assert not engagement.budget.policy_open


def test_a_policy_that_is_done_or_only_holds_is_not_open():
    engagement = Engagement()
    engagement.spend(0.0)
    engagement.spend(101.0)
    engagement.budget.finish_policy()
    assert not engagement.budget.policy_open
    holding = Engagement(replace(SHORT, budget_policy='hold'))
    holding.spend(0.0)
    assert holding.spend(101.0) == 'timeout'
    assert not holding.budget.policy_open


def test_a_failed_descent_before_the_budget_ends_no_policy():
    engagement = Engagement()
    engagement.spend(0.0)
    engagement.budget.fail_attempt()
    engagement.spend(101.0)
    assert engagement.budget.policy_open
