# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states of a landing, and when one follows another: a pure function over data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from peace_ros.landing.parameters import LandingParameters


class State(str, Enum):
    """DOVESEI's states, and those of a vehicle that can be told to stop."""

    IDLE = 'IDLE'
    """Not engaged."""
    SEARCHING = 'SEARCHING'
    """Looks for a site, at and above the safe altitude also by flying a square."""
    AIMING = 'AIMING'
    """Moves over the site."""
    LANDING = 'LANDING'
    """Descends over the site."""
    WAITING = 'WAITING'
    """The site is lost: stands still."""
    CLIMBING = 'CLIMBING'
    """Back to the safe altitude."""
    RESTARTING = 'RESTARTING'
    """Looks for another site than the one that failed."""
    HANDOVER = 'HANDOVER'
    """Done: stands over a safe site at the altitude of the hand-over."""
    HOLD = 'HOLD'
    """Data are missing or old, or time has run out: stands still."""
    ABORTED = 'ABORTED'
    """Somebody else flies; final until engaged again."""


STILL_STATES = frozenset({State.IDLE, State.WAITING, State.HANDOVER, State.HOLD, State.ABORTED})
"""States in which the set-point is zero."""


@dataclass(frozen=True)
class Events:
    """What the state machine may know; everything about one moment."""

    engaged: bool = False
    new_engagement: bool = False
    """Engaged since the last step."""
    taken_over: str = ''
    """Why the vehicle is no longer ours; empty while it is."""
    out_of_time: str = ''
    """Why nothing more is tried; empty while there is time."""
    bad_data: str = ''
    """What is missing, old or wrong; empty when data can be trusted."""
    site_known: bool = False
    """There is a SITE that can be reached from here."""
    warmed_up: bool = False
    """Enough heatmaps were seen since the state began."""
    over_site: bool = False
    """The vehicle and its radius lie within the clearance of the site."""
    at_safe_altitude: bool = False
    low_enough_to_land: bool = False
    """AIMING has nothing more to descend."""
    at_handover_altitude: bool = False


Rule = tuple[Callable[[Events, float, LandingParameters], bool], State, str]

_ALWAYS = frozenset({State.IDLE, State.ABORTED, State.HOLD, State.SEARCHING})
"""Disengaged, taken over, data or time gone, engaged anew."""

TRANSITIONS: dict[State, frozenset[State]] = {
    State.IDLE: _ALWAYS,
    State.SEARCHING: _ALWAYS | {State.AIMING, State.CLIMBING},
    State.AIMING: _ALWAYS | {State.LANDING, State.WAITING, State.CLIMBING, State.RESTARTING},
    State.LANDING: _ALWAYS | {State.WAITING, State.CLIMBING, State.HANDOVER},
    State.WAITING: _ALWAYS | {State.AIMING, State.CLIMBING, State.RESTARTING},
    State.CLIMBING: _ALWAYS | {State.RESTARTING},
    State.RESTARTING: _ALWAYS | {State.AIMING},
    State.HANDOVER: frozenset({State.IDLE, State.SEARCHING}),
    State.HOLD: _ALWAYS,
    State.ABORTED: frozenset({State.SEARCHING}),
}
"""Which states may follow which, besides itself."""

_RULES: dict[State, tuple[Rule, ...]] = {
    State.SEARCHING: (
        (
            lambda e, _t, _p: e.site_known and e.warmed_up,
            State.AIMING,
            'a site is known: moving over it',
        ),
        (
            lambda e, t, p: not e.site_known and not e.at_safe_altitude and t >= p.giveup_after_s,
            State.CLIMBING,
            'no site below the safe altitude: climbing to look around',
        ),
    ),
    State.AIMING: (
        (lambda e, _t, _p: not e.site_known, State.WAITING, 'the site is lost: waiting for it'),
        (
            lambda e, _t, _p: e.over_site and e.low_enough_to_land,
            State.LANDING,
            'over the site: descending',
        ),
        (
            lambda e, t, p: t >= p.max_aiming_s and not e.at_safe_altitude,
            State.CLIMBING,
            'the site cannot be reached: climbing to the safe altitude',
        ),
        (
            lambda _e, t, p: t >= p.max_aiming_s,
            State.RESTARTING,
            'the site cannot be reached: looking for another',
        ),
    ),
    State.LANDING: (
        (
            lambda e, _t, _p: e.at_handover_altitude and not e.site_known,
            State.CLIMBING,
            'at the altitude of the hand-over the ground is no longer safe: climbing',
        ),
        (lambda e, _t, _p: not e.site_known, State.WAITING, 'the site is lost: waiting for it'),
        (
            lambda e, _t, _p: e.at_handover_altitude and e.over_site,
            State.HANDOVER,
            'at the altitude of the hand-over over a safe site',
        ),
        (
            lambda _e, t, p: t >= p.max_landing_s,
            State.CLIMBING,
            'the descent takes too long: climbing to look for another site',
        ),
    ),
    State.WAITING: (
        (
            lambda e, _t, _p: e.site_known and e.warmed_up,
            State.AIMING,
            'the site is safe again: moving over it',
        ),
        (
            lambda e, t, p: t >= p.giveup_after_s and not e.at_safe_altitude,
            State.CLIMBING,
            'the site stays lost: climbing to the safe altitude',
        ),
        (
            lambda _e, t, p: t >= p.giveup_after_s,
            State.RESTARTING,
            'the site stays lost: looking for another',
        ),
    ),
    State.CLIMBING: (
        (
            lambda e, _t, _p: e.at_safe_altitude,
            State.RESTARTING,
            'at the safe altitude: looking for another site',
        ),
    ),
    State.RESTARTING: (
        (
            lambda e, _t, _p: e.site_known and e.warmed_up,
            State.AIMING,
            'another site is known: moving over it',
        ),
        (
            lambda _e, t, p: t >= p.search4new_place_s,
            State.SEARCHING,
            'no other site near by: searching farther',
        ),
    ),
    State.HOLD: ((lambda _e, _t, _p: True, State.SEARCHING, 'data are good again: searching'),),
}


_GUARDS: tuple[tuple[Callable[[State, Events], bool], State, str], ...] = (
    (lambda _s, e: e.new_engagement and e.engaged, State.SEARCHING, 'engaged: searching'),
    (lambda s, _e: s is State.ABORTED, State.ABORTED, 'aborted: engage again to continue'),
    (lambda _s, e: not e.engaged, State.IDLE, 'not engaged'),
    (lambda s, _e: s is State.HANDOVER, State.HANDOVER, 'handed over: standing over a safe site'),
    (lambda _s, e: bool(e.taken_over), State.ABORTED, '{taken_over}'),
    (lambda _s, e: bool(e.out_of_time), State.HOLD, '{out_of_time}'),
    (lambda _s, e: bool(e.bad_data), State.HOLD, '{bad_data}'),
)
"""What outranks every plan, the most dangerous first; the braces name fields of the events."""


def next_state(
    state: State, events: Events, time_in_state_s: float, parameters: LandingParameters
) -> tuple[State, str]:
    """Return the state that follows, with a sentence that says why; an empty one when it stays."""
    for holds, target, reason in _GUARDS:
        if holds(state, events):
            return target, reason.format_map(vars(events))
    if state is State.IDLE:
        return State.SEARCHING, 'engaged: searching'
    for applies, target, reason in _RULES[state]:
        if applies(events, time_in_state_s, parameters):
            return target, reason
    return state, ''
