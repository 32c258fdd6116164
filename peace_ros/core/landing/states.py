# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states of a landing and the rules of their transitions: a pure function over data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from peace_ros.core.landing.parameters import LandingParameters


class State(str, Enum):
    """The states of DOVESEI, and those that a real vehicle needs besides."""

    IDLE = 'IDLE'
    """Not engaged."""
    SEARCHING = 'SEARCHING'
    """Looks for a site; at and above the safe altitude it also flies an expanding square."""
    AIMING = 'AIMING'
    """Moves over the site."""
    LANDING = 'LANDING'
    """Descends over the site."""
    WAITING = 'WAITING'
    """The site is lost: hovers."""
    CLIMBING = 'CLIMBING'
    """Climbs to the safe altitude."""
    RESTARTING = 'RESTARTING'
    """Looks for another site than the one that failed."""
    RETURNING = 'RETURNING'
    """A budget is used up: flies back to where the landing began, without descending."""
    HANDOVER = 'HANDOVER'
    """Done: hovers over a safe site at the hand-over altitude."""
    HOLD = 'HOLD'
    """Data are missing, old or wrong, or a budget is used up: hovers."""
    ABORTED = 'ABORTED'
    """A pilot or a failsafe is in control; final until engaged again."""


STILL_STATES = frozenset({State.IDLE, State.WAITING, State.HANDOVER, State.HOLD, State.ABORTED})
"""States in which the set-point is zero."""
SILENT_STATES = frozenset({State.IDLE, State.ABORTED})
CONCERNING_STATES = frozenset(
    {State.WAITING, State.CLIMBING, State.RESTARTING, State.RETURNING, State.HOLD}
)
"""The landing goes on, but not as hoped."""
"""States in which nothing is sent to the vehicle."""
LOOKING = frozenset({State.SEARCHING, State.RESTARTING})
"""States that look for a site."""


@dataclass(frozen=True)
class Events:
    """Everything that the rules may use, for one step."""

    engaged: bool = False
    new_engagement: bool = False
    """Engaged since the last step."""
    taken_over: str = ''
    """Why we are no longer in control of the vehicle; empty while we are."""
    out_of_budget: str = ''
    """Which budget is used up; empty while there is time, battery, way and attempts."""
    policy_open: bool = False
    """The policy for a used-up budget still has something to do before it holds."""
    blocked: str = ''
    """Why the vehicle does not get farther: a fence of the autopilot; empty while it may."""
    bad_data: str = ''
    """What is missing, old or wrong; empty when data can be trusted."""
    site_known: bool = False
    """There is a SITE that can be reached from here."""
    warmed_up: bool = False
    """Enough heatmaps were seen since the state began."""
    looked_long: bool = False
    """So many that WAITING may give up."""
    over_site: bool = False
    """The vehicle and its radius lie within the clearance of the site, on ground just seen."""
    centred: bool = False
    """The vehicle is near enough to the middle of the site to be handed over."""
    at_safe_altitude: bool = False
    low_enough_to_land: bool = False
    """AIMING has descended as far as it may."""
    at_handover_altitude: bool = False


Condition = Callable[[State, Events, float, LandingParameters], bool]
"""Of the state, the events, the seconds in the state, the parameters."""


class Rule(NamedTuple):
    """One row of the table."""

    when: str
    """The condition in words, for the documentation; braces name parameters."""
    holds: Condition
    target: State
    reason: str
    """What the status says; braces name events."""


_ALWAYS = frozenset({State.IDLE, State.ABORTED, State.HOLD, State.SEARCHING, State.RETURNING})
"""Disengaged, taken over, data or budget gone, engaged anew."""

TRANSITIONS: dict[State, frozenset[State]] = {
    State.IDLE: _ALWAYS,
    State.SEARCHING: _ALWAYS | {State.AIMING, State.CLIMBING},
    State.AIMING: _ALWAYS | {State.LANDING, State.WAITING, State.CLIMBING, State.RESTARTING},
    State.LANDING: _ALWAYS | {State.WAITING, State.CLIMBING, State.HANDOVER},
    State.WAITING: _ALWAYS | {State.AIMING, State.CLIMBING, State.RESTARTING},
    State.CLIMBING: _ALWAYS | {State.RESTARTING},
    State.RESTARTING: _ALWAYS | {State.AIMING, State.CLIMBING},
    State.RETURNING: _ALWAYS,
    State.HANDOVER: frozenset({State.IDLE, State.SEARCHING}),
    State.HOLD: _ALWAYS,
    State.ABORTED: frozenset({State.SEARCHING}),
}
"""Which states may follow which, besides itself."""

GUARDS: tuple[Rule, ...] = (
    Rule(
        'a person (or `auto_engage`, once) engages',
        lambda _s, e, _t, _p: e.new_engagement and e.engaged,
        State.SEARCHING,
        'engaged: searching',
    ),
    Rule(
        'in ABORTED, in every case',
        lambda s, _e, _t, _p: s is State.ABORTED,
        State.ABORTED,
        'aborted, engage again to continue: {taken_over}',
    ),
    Rule('disengaged', lambda _s, e, _t, _p: not e.engaged, State.IDLE, 'not engaged'),
    Rule(
        'in HANDOVER, in every case',
        lambda s, _e, _t, _p: s is State.HANDOVER,
        State.HANDOVER,
        'handed over: hovering over a safe site',
    ),
    Rule(
        'the autopilot left the mode that follows our set-points, or the vehicle was disarmed',
        lambda _s, e, _t, _p: bool(e.taken_over),
        State.ABORTED,
        '{taken_over}',
    ),
    Rule(
        'a budget is used up, and `budget_policy` is hold or has nothing more to do',
        lambda _s, e, _t, _p: bool(e.out_of_budget) and not e.policy_open,
        State.HOLD,
        '{out_of_budget}: holding',
    ),
    Rule(
        'telemetry or heatmaps are missing, old or wrong',
        lambda _s, e, _t, _p: bool(e.bad_data),
        State.HOLD,
        '{bad_data}',
    ),
    Rule(
        'a budget is used up, and `budget_policy` is return',
        lambda _s, e, _t, p: bool(e.out_of_budget) and p.budget_policy == 'return',
        State.RETURNING,
        '{out_of_budget}: returning to where the landing began',
    ),
)
"""Rules for every state, checked before those of the state, in this order."""

_LOST = Rule(
    'the SITE is lost',
    lambda _s, e, _t, _p: not e.site_known,
    State.WAITING,
    'the site is lost: waiting for it',
)
_FENCED = Rule(
    'a fence of the autopilot stops the vehicle',
    lambda _s, e, _t, _p: bool(e.blocked),
    State.CLIMBING,
    '{blocked}: climbing to look for another site',
)
_NO_SITE_BELOW = Rule(
    'no SITE below the safe altitude for {giveup_after_s} s',
    lambda _s, e, t, p: not e.site_known and not e.at_safe_altitude and t >= p.giveup_after_s,
    State.CLIMBING,
    'no site below the safe altitude: climbing to look around',
)

RULES: dict[State, tuple[Rule, ...]] = {
    State.IDLE: (
        Rule('engaged', lambda _s, _e, _t, _p: True, State.SEARCHING, 'engaged: searching'),
    ),
    State.SEARCHING: (
        Rule(
            'a SITE is known and {sensor_warm_up_cycles} heatmaps were seen',
            lambda _s, e, _t, _p: e.site_known and e.warmed_up,
            State.AIMING,
            'a site is known: moving over it',
        ),
        _NO_SITE_BELOW,
    ),
    State.AIMING: (
        _LOST,
        Rule(
            'over the SITE on ground just seen, and at {aiming_floor} safe altitudes or below',
            lambda _s, e, _t, _p: e.over_site and e.low_enough_to_land,
            State.LANDING,
            'over the site: descending',
        ),
        Rule(
            'a fence of the autopilot stops the vehicle, at the safe altitude',
            lambda _s, e, _t, _p: bool(e.blocked) and e.at_safe_altitude,
            State.RESTARTING,
            '{blocked}: looking for another site',
        ),
        _FENCED,
        Rule(
            'for {max_aiming_s} s, below the safe altitude',
            lambda _s, e, t, p: t >= p.max_aiming_s and not e.at_safe_altitude,
            State.CLIMBING,
            'the site cannot be reached: climbing to the safe altitude',
        ),
        Rule(
            'for {max_aiming_s} s, at the safe altitude',
            lambda _s, _e, t, p: t >= p.max_aiming_s,
            State.RESTARTING,
            'the site cannot be reached: looking for another',
        ),
    ),
    State.LANDING: (
        _LOST,
        Rule(
            'at the hand-over altitude, over the SITE on ground just seen, and within '
            '{handover_error_m} m of its middle',
            lambda _s, e, _t, _p: e.at_handover_altitude and e.over_site and e.centred,
            State.HANDOVER,
            'at the hand-over altitude over a safe site',
        ),
        _FENCED,
        Rule(
            'for {max_landing_s} s',
            lambda _s, _e, t, p: t >= p.max_landing_s,
            State.CLIMBING,
            'the descent takes too long: climbing to look for another site',
        ),
    ),
    State.WAITING: (
        Rule(
            'the SITE is known again and {sensor_warm_up_cycles} heatmaps were seen',
            lambda _s, e, _t, _p: e.site_known and e.warmed_up,
            State.AIMING,
            'the site is safe again: moving over it',
        ),
        Rule(
            'for {giveup_after_s} s and {giveup_looks} heatmaps, below the safe altitude',
            lambda _s, e, t, p: t >= p.giveup_after_s and e.looked_long and not e.at_safe_altitude,
            State.CLIMBING,
            'the site was not found again: climbing to the safe altitude',
        ),
        Rule(
            'for {giveup_after_s} s and {giveup_looks} heatmaps, at the safe altitude',
            lambda _s, e, t, p: t >= p.giveup_after_s and e.looked_long,
            State.RESTARTING,
            'the site was not found again: looking for another',
        ),
    ),
    State.CLIMBING: (
        Rule(
            'at the safe altitude',
            lambda _s, e, _t, _p: e.at_safe_altitude,
            State.RESTARTING,
            'at the safe altitude: looking for another site',
        ),
        Rule(
            'a fence of the autopilot stops the vehicle',
            lambda _s, e, _t, _p: bool(e.blocked),
            State.RESTARTING,
            '{blocked}: looking for another site from here',
        ),
    ),
    State.RESTARTING: (
        Rule(
            'a SITE is known and {sensor_warm_up_cycles} heatmaps were seen',
            lambda _s, e, _t, _p: e.site_known and e.warmed_up,
            State.AIMING,
            'another site is known: moving over it',
        ),
        _NO_SITE_BELOW,
        Rule(
            'for {search4new_place_s} s',
            lambda _s, _e, t, p: t >= p.search4new_place_s,
            State.SEARCHING,
            'no other site nearby: searching farther away',
        ),
    ),
    State.RETURNING: (
        Rule(
            'the budget is no longer used up',
            lambda _s, e, _t, _p: not e.out_of_budget,
            State.SEARCHING,
            'the budget is no longer used up: searching',
        ),
    ),
    State.HOLD: (
        Rule(
            'data are good, and there is budget or a last attempt to make',
            lambda _s, _e, _t, _p: True,
            State.SEARCHING,
            'data are good again: searching',
        ),
    ),
    State.HANDOVER: (),
    State.ABORTED: (),
}
"""Rules of each state: the first that holds decides; when none holds the state stays."""


def next_state(
    state: State, events: Events, time_in_state_s: float, parameters: LandingParameters
) -> tuple[State, str]:
    """Return the next state and a sentence that says why, empty when the state stays."""
    for rule in GUARDS:
        if rule.holds(state, events, time_in_state_s, parameters):
            return rule.target, rule.reason.format_map(vars(events))
    for rule in RULES[state]:
        if rule.holds(state, events, time_in_state_s, parameters):
            return rule.target, rule.reason.format_map(vars(events))
    return state, ''
