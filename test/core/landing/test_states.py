# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of states: every state against every combination of events."""

from dataclasses import replace
from itertools import product

import pytest

from peace_ros.core.landing import LandingParameters
from peace_ros.core.landing.states import STILL_STATES, TRANSITIONS, Events, State, next_state

P = LandingParameters()
RETURN = LandingParameters(budget_policy='return')
BEST_SITE = LandingParameters(budget_policy='best_site')
PLANS = (
    'new_engagement',
    'site_known',
    'warmed_up',
    'looked_long',
    'over_site',
    'centred',
    'at_safe_altitude',
    'low_enough_to_land',
    'at_handover_altitude',
)
TIMES_S = (0.0, P.giveup_after_s, P.search4new_place_s, P.max_landing_s)
FLYING = Events(engaged=True)


def every_event(**fixed):
    for bits in product((False, True), repeat=len(PLANS)):
        yield Events(**{**dict(zip(PLANS, bits, strict=True)), **fixed})


@pytest.mark.parametrize('parameters', [P, RETURN, BEST_SITE], ids=['hold', 'return', 'best_site'])
@pytest.mark.parametrize('state', State)
def test_only_transitions_of_the_table_happen_and_each_has_a_reason(state, parameters):
    for taken_over, out_of_budget, bad_data in product(('', 'why'), repeat=3):
        for engaged, policy_open in product((False, True), repeat=2):
            for events in every_event(
                engaged=engaged,
                taken_over=taken_over,
                out_of_budget=out_of_budget,
                policy_open=policy_open,
                bad_data=bad_data,
            ):
                for time_s in TIMES_S:
                    target, reason = next_state(state, events, time_s, parameters)
                    assert target is state or target in TRANSITIONS[state]
                    assert reason or target is state


TROUBLES = (
    {},
    {'taken_over': 'x'},
    {'bad_data': 'x'},
    {'engaged': False},
    {'out_of_budget': 'x', 'policy_open': True},
)


@pytest.mark.parametrize('state', State)
def test_every_transition_of_the_table_can_happen(state):
    reached = {
        next_state(state, events, time_s, RETURN)[0]
        for trouble in TROUBLES
        for events in every_event(**{'engaged': True, **trouble})
        for time_s in TIMES_S
    }
    assert reached >= TRANSITIONS[state] - {state}


@pytest.mark.parametrize('state', State)
def test_every_state_has_a_way_out_and_a_way_to_the_handover(state):
    reachable, frontier = {state}, {state}
    while frontier:
        frontier = {after for each in frontier for after in TRANSITIONS[each]} - reachable
        reachable |= frontier
    assert TRANSITIONS[state]
    assert State.HANDOVER in reachable


@pytest.mark.parametrize('state', sorted(set(State) - {State.HANDOVER, State.ABORTED}))
def test_a_takeover_outranks_everything(state):
    for events in every_event(
        engaged=True, taken_over='pilot', bad_data='old', out_of_budget='late', new_engagement=False
    ):
        assert next_state(state, events, 0.0, P) == (State.ABORTED, 'pilot')


@pytest.mark.parametrize('state', sorted(set(State) - {State.HANDOVER, State.ABORTED}))
@pytest.mark.parametrize('trouble', ['bad_data', 'out_of_budget'])
def test_bad_data_and_the_end_of_time_hold(state, trouble):
    for events in every_event(engaged=True, new_engagement=False, **{trouble: 'because'}):
        target, reason = next_state(state, events, 1000.0, P)
        assert target is State.HOLD
        assert reason.startswith('because')


@pytest.mark.parametrize('state', [State.ABORTED, State.HANDOVER])
def test_the_ends_are_final_until_engaged_anew(state):
    for events in every_event(engaged=True, new_engagement=False):
        assert next_state(state, events, 1000.0, P)[0] is state
    anew = replace(FLYING, new_engagement=True)
    assert next_state(state, anew, 0.0, P)[0] is State.SEARCHING


def test_never_lands_or_hands_over_without_a_site_below():
    for state in State:
        for events in every_event(engaged=True):
            target, _ = next_state(state, events, 1000.0, P)
            if target in {State.LANDING, State.HANDOVER} and target is not state:
                assert events.site_known
                assert events.over_site
                assert events.centred or target is State.LANDING


BROKE = replace(FLYING, out_of_budget='time is up', policy_open=True)


@pytest.mark.parametrize('state', sorted(set(State) - {State.HANDOVER, State.ABORTED}))
def test_a_used_up_budget_ends_in_its_policy(state):
    for events in every_event(
        engaged=True, new_engagement=False, out_of_budget='time is up', policy_open=True
    ):
        assert next_state(state, events, 0.0, RETURN)[0] is State.RETURNING
        lost = replace(events, bad_data='no position')
        assert next_state(state, lost, 0.0, RETURN) == (State.HOLD, 'no position')
        done = replace(events, policy_open=False)
        for policy in (P, RETURN, BEST_SITE):
            target, reason = next_state(state, done, 0.0, policy)
            assert target is State.HOLD
            assert 'time is up' in reason


def test_the_last_attempt_goes_by_the_rules_of_every_attempt():
    over = replace(BROKE, site_known=True, warmed_up=True)
    assert next_state(State.SEARCHING, over, 0.0, BEST_SITE)[0] is State.AIMING
    assert next_state(State.HOLD, BROKE, 0.0, BEST_SITE)[0] is State.SEARCHING
    assert next_state(State.LANDING, BROKE, 0.0, BEST_SITE)[0] is State.WAITING
    low = replace(over, over_site=True, at_handover_altitude=True)
    assert next_state(State.LANDING, low, 0.0, BEST_SITE)[0] is State.LANDING, 'not centred yet'
    centred = replace(low, centred=True)
    assert next_state(State.LANDING, centred, 0.0, BEST_SITE)[0] is State.HANDOVER


FENCED = replace(FLYING, site_known=True, blocked='a fence is in the way')


@pytest.mark.parametrize(
    ('state', 'high', 'target'),
    [
        (State.AIMING, True, State.RESTARTING),
        (State.AIMING, False, State.CLIMBING),
        (State.LANDING, True, State.CLIMBING),
        (State.LANDING, False, State.CLIMBING),
        (State.CLIMBING, False, State.RESTARTING),
    ],
)
def test_a_fence_in_the_way_makes_another_site_be_tried_and_is_named(state, high, target):
    events = replace(FENCED, at_safe_altitude=high)
    found, reason = next_state(state, events, 0.0, P)
    assert found is target
    assert reason.startswith('a fence is in the way: ')
    assert 'another site' in reason
    assert next_state(state, replace(events, blocked=''), 0.0, P)[0] is state


def test_a_fence_outranks_neither_a_hand_over_nor_the_guards():
    done = replace(FENCED, over_site=True, centred=True, at_handover_altitude=True)
    assert next_state(State.LANDING, done, 0.0, P)[0] is State.HANDOVER
    assert next_state(State.LANDING, replace(FENCED, bad_data='old'), 0.0, P)[0] is State.HOLD
    for state in State:
        for events in every_event(engaged=True, blocked='fence'):
            target, reason = next_state(state, events, 0.0, P)
            assert target is state or target in TRANSITIONS[state]
            assert reason or target is state


def test_an_aborted_landing_goes_on_saying_why():
    told = replace(FLYING, taken_over='mode LOITER')
    assert 'mode LOITER' in next_state(State.ABORTED, told, 9.0, P)[1]


def test_waiting_ends_upwards_below_the_safe_altitude_and_elsewhere_above_it():
    looked = replace(FLYING, looked_long=True)
    assert next_state(State.WAITING, looked, P.giveup_after_s, P)[0] is State.CLIMBING
    high = replace(looked, at_safe_altitude=True)
    assert next_state(State.WAITING, high, P.giveup_after_s, P)[0] is State.RESTARTING
    assert next_state(State.WAITING, high, P.giveup_after_s - 0.1, P)[0] is State.WAITING


@pytest.mark.parametrize('high', [False, True])
def test_waiting_goes_on_until_enough_heatmaps_have_shown_the_site(high):
    seldom = replace(FLYING, at_safe_altitude=high)
    assert next_state(State.WAITING, seldom, 60.0, P)[0] is State.WAITING


@pytest.mark.parametrize('state', [State.SEARCHING, State.CLIMBING, State.RESTARTING])
def test_a_state_that_stays_gives_no_reason(state):
    assert next_state(state, FLYING, 0.0, P) == (state, '')


def test_states_that_stand_still():
    assert {State.IDLE, State.WAITING, State.HOLD, State.ABORTED, State.HANDOVER} == STILL_STATES
