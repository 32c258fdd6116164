# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of states: every state against every combination of events."""

from dataclasses import replace
from itertools import product

import pytest

from peace_ros.landing import LandingParameters
from peace_ros.landing.states import STILL_STATES, TRANSITIONS, Events, State, next_state

P = LandingParameters()
PLANS = (
    'new_engagement',
    'site_known',
    'warmed_up',
    'over_site',
    'at_safe_altitude',
    'low_enough_to_land',
    'at_handover_altitude',
)
TIMES_S = (0.0, P.giveup_after_s, P.search4new_place_s, P.max_landing_s)
FLYING = Events(engaged=True)


def every_event(**fixed):
    for bits in product((False, True), repeat=len(PLANS)):
        yield Events(**{**dict(zip(PLANS, bits, strict=True)), **fixed})


@pytest.mark.parametrize('state', State)
def test_only_transitions_of_the_table_happen_and_each_has_a_reason(state):
    for troubles in product(('', 'why'), repeat=3):
        taken_over, out_of_time, bad_data = troubles
        for engaged in (False, True):
            for events in every_event(
                engaged=engaged,
                taken_over=taken_over,
                out_of_time=out_of_time,
                bad_data=bad_data,
            ):
                for time_s in TIMES_S:
                    target, reason = next_state(state, events, time_s, P)
                    assert target is state or target in TRANSITIONS[state]
                    assert reason or target is state


@pytest.mark.parametrize('state', State)
def test_every_transition_of_the_table_can_happen(state):
    reached = {
        next_state(state, events, time_s, P)[0]
        for trouble in ({}, {'taken_over': 'x'}, {'bad_data': 'x'}, {'engaged': False})
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


@pytest.mark.parametrize('state', set(State) - {State.HANDOVER, State.ABORTED})
def test_a_takeover_outranks_everything(state):
    for events in every_event(
        engaged=True, taken_over='pilot', bad_data='old', out_of_time='late', new_engagement=False
    ):
        assert next_state(state, events, 0.0, P) == (State.ABORTED, 'pilot')


@pytest.mark.parametrize('state', set(State) - {State.HANDOVER, State.ABORTED})
@pytest.mark.parametrize('trouble', ['bad_data', 'out_of_time'])
def test_bad_data_and_the_end_of_time_hold(state, trouble):
    for events in every_event(engaged=True, new_engagement=False, **{trouble: 'because'}):
        assert next_state(state, events, 1000.0, P) == (State.HOLD, 'because')


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


def test_waiting_ends_upwards_below_the_safe_altitude_and_elsewhere_above_it():
    assert next_state(State.WAITING, FLYING, P.giveup_after_s, P)[0] is State.CLIMBING
    high = replace(FLYING, at_safe_altitude=True)
    assert next_state(State.WAITING, high, P.giveup_after_s, P)[0] is State.RESTARTING
    assert next_state(State.WAITING, high, P.giveup_after_s - 0.1, P)[0] is State.WAITING


def test_states_that_stand_still():
    assert {State.IDLE, State.WAITING, State.HOLD, State.ABORTED, State.HANDOVER} == STILL_STATES
