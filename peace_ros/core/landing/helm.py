# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a sighting and telemetry to a decision: events, state, guidance, guard; without the map.

Tests can give it any sequence of sightings and telemetry.
"""

from __future__ import annotations

import re
from dataclasses import replace
from math import hypot, inf

from peace_ros.core.domain import Pose, Setpoint, Telemetry
from peace_ros.core.landing.blockade import Blockade
from peace_ros.core.landing.decision import Decision
from peace_ros.core.landing.drift import Drift
from peace_ros.core.landing.guard import Guard
from peace_ros.core.landing.guidance import ExpandingSquare, over_site, velocity
from peace_ros.core.landing.heights import NO_OTHER_HEIGHT, HeightSight
from peace_ros.core.landing.parameters import LandingParameters
from peace_ros.core.landing.situation import Sighting, Situation
from peace_ros.core.landing.states import LOOKING, Events, State, next_state
from peace_ros.core.landing.watch import (
    Budget,
    ControlWatch,
    at_safe_altitude,
    bad_map,
    bad_telemetry,
    valid_pose,
)

_NS = 1e-9
_AIMED_M = 1.0
"""AIMING ends this close to its floor."""
_HOME_M = 3.0
"""RETURNING ends within this distance."""
_FENCE_MARGIN_M = 5.0
"""The search turns back this far before the fence."""


class Helm:
    """Steers one vehicle; not thread-safe."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self._engaged = self._new_engagement = False
        self.state = State.IDLE
        self._reason = 'not engaged'
        self._since_ns: int | None = None
        self._revision_at_state = 0
        self._begin()

    def _begin(self) -> None:
        self._guard = Guard(self._p)
        self._control = ControlWatch()
        self._drift = Drift()
        self._blockade = Blockade()
        self._told = Setpoint(0)
        self._budget = Budget(self._p)
        self._home: Pose | None = None
        self._square: ExpandingSquare | None = None
        self._outcome: str | None = None

    @classmethod
    def engaged_in(cls, parameters: LandingParameters, state: State) -> Helm:
        """Build an engaged helm in a given state, for tests that begin in each."""
        helm = cls(parameters)
        helm.engage()
        helm.state, helm._new_engagement = state, False
        helm._reason = f'the trial begins in {state.value}'
        return helm

    def engage(self) -> None:
        """Begin a landing, also after one that ended."""
        self._engaged = self._new_engagement = True
        self._begin()

    def disengage(self) -> None:
        """Stop: zero velocity and IDLE from the next step on."""
        self._engaged = self._new_engagement = False

    def restart_clock(self, now_ns: int) -> None:
        """The clock has jumped back: the state begins now."""
        self._since_ns = now_ns

    def fail_attempt(self) -> None:
        """Count a descent that failed."""
        self._budget.fail_attempt(self._reason)

    @property
    def search_path(self) -> tuple[tuple[float, float], ...]:
        """Way-points (north, east) of the search while a site is looked for, else none."""
        return self._square.way if self._square is not None and self.state in LOOKING else ()

    @property
    def attempts(self) -> int:
        """Descents that failed in this engagement."""
        return self._budget.attempts

    @property
    def without_site_s(self) -> float:
        """How long a site has been searched without success."""
        return self._budget.without_site_s

    def decide(
        self,
        now_ns: int,
        telemetry: Telemetry | None,
        telemetry_age_s: float,
        sighting: Sighting,
        last_rejection: str = '',
        heights: HeightSight = NO_OTHER_HEIGHT,
        distrusted: str = '',
    ) -> Decision:
        """Decide what to do now.

        Args:
            now_ns: The clock of the stamps.
            telemetry: What the autopilot last said, None before it said anything.
            telemetry_age_s: Since it was received, by a steady clock.
            sighting: What the map says.
            last_rejection: Why the newest heatmap was not used, for the sentence.
            heights: What other sources say of the altitude.
            distrusted: Why inputs cannot be used, whatever they say; empty when they can.
        """
        p = self._p
        if self._since_ns is None:
            self._since_ns = now_ns
        pose = valid_pose(telemetry, p)
        # A silent vehicle reports no gimbal either: the cause comes first.
        bad_data = bad_telemetry(telemetry, telemetry_age_s, p) or distrusted
        bad_data = bad_data or bad_map(sighting.map_age_s, last_rejection, p) or heights.problem
        site = None if bad_data else sighting.reachable
        if self._engaged:
            self._home = self._home or pose
        situation = Situation(
            now_ns, pose, telemetry_age_s, sighting, site, self._home, heights.above_lowest_m
        )
        if self._engaged:
            self._keep_books(situation, telemetry, bad_data)
        self._advance(situation, self._events(situation, bad_data, heights.may_hand_over))
        situation = replace(
            situation,
            search_target=self._search_target(situation),
            search_floor_m=self._search_floor_m(),
        )
        wish, note = velocity(self.state, situation, p)
        # What a fence takes from the speed is no drift.
        fenced = telemetry is not None and telemetry.fence != ''
        self._drift.see(None if fenced else pose, self._told)
        wish = self._drift.made_up(wish, self._lateral_limit_m_s(situation))
        setpoint, guard_notes = self._guard.limit(wish, situation)
        self._told = setpoint
        relaxed = sighting.threshold < p.safety_threshold
        notes = [note, f'threshold relaxed to {sighting.threshold:.2f}' if relaxed else '']
        return Decision(
            state=self.state,
            reason='; '.join(filter(None, (self._reason, *notes))),
            setpoint=setpoint,
            verdict=sighting.verdict,
            effective_threshold=sighting.threshold,
            map_age_s=sighting.map_age_s,
            focus=sighting.focus,
            guard_notes=guard_notes,
            outcome=self._outcome,
            time_in_state_s=self._time_in_state_s(now_ns),
            relaxed=relaxed,
            heights_m=heights.heights_m,
        )

    def _lateral_limit_m_s(self, situation: Situation) -> float:
        high = at_safe_altitude(situation.pose, self._p, situation.above_lowest_m)
        return self._p.lateral_speed_limit if high else self._p.landing_lateral_speed_limit

    def _time_in_state_s(self, now_ns: int) -> float:
        since_ns = now_ns if self._since_ns is None else self._since_ns
        return max(0.0, (now_ns - since_ns) * _NS)

    def _keep_books(self, situation: Situation, telemetry: Telemetry | None, bad_data: str) -> None:
        self._control.see(telemetry)
        self._blockade.see(situation.now_ns, None if bad_data else telemetry, self._told)
        looking = self.state in LOOKING and not bad_data
        site_known = situation.site is not None
        self._budget.spend(situation.now_ns, telemetry, looking=looking, site_known=site_known)
        if self._budget.policy_open and not bad_data and self._policy_is_done(situation):
            self._budget.finish_policy()

    def _policy_is_done(self, situation: Situation) -> bool:
        """Tell whether the policy for a used-up budget has nothing more to do."""
        pose, home = situation.pose, situation.home
        if self._p.budget_policy == 'best_site':
            nothing = situation.site is None and situation.sighting.best is None
            return self.state in LOOKING and nothing
        if pose is None or home is None:
            return True
        return hypot(home.north_m - pose.north_m, home.east_m - pose.east_m) <= _HOME_M

    def _events(self, situation: Situation, bad_data: str, may_hand_over: bool = True) -> Events:
        p, pose, site = self._p, situation.pose, situation.site
        lowest_m = inf if pose is None else pose.altitude_agl_m - situation.above_lowest_m
        seen = situation.sighting.revision - self._revision_at_state
        over, error_m = False, inf
        if pose is not None and site is not None:
            over, error_m = over_site(pose, site, p.safety_radius_m), site.distance_m(pose)
        return Events(
            engaged=self._engaged,
            new_engagement=self._new_engagement,
            taken_over=self._control.taken_over,
            out_of_budget=self._budget.reason,
            policy_open=self._budget.policy_open,
            blocked=self._blockade.reason,
            bad_data=bad_data,
            site_known=site is not None,
            warmed_up=seen >= p.sensor_warm_up_cycles,
            looked_long=seen >= p.giveup_looks,
            over_site=over and situation.sighting.ground_is_fresh,
            centred=error_m <= p.handover_error_m,
            at_safe_altitude=at_safe_altitude(pose, p, situation.above_lowest_m),
            low_enough_to_land=lowest_m <= p.aiming_floor * p.safe_altitude_m + _AIMED_M,
            at_handover_altitude=lowest_m <= p.handover_altitude_m + p.handover_tolerance_m
            and may_hand_over,
        )

    def _advance(self, situation: Situation, events: Events) -> None:
        before, now_ns = self.state, situation.now_ns
        state, reason = next_state(before, events, self._time_in_state_s(now_ns), self._p)
        self._new_engagement = False
        if reason and (state is not before or _words(reason) != _words(self._reason)):
            self._reason = reason
        self._outcome = self._outcome or {
            State.HANDOVER: 'handover',
            State.ABORTED: 'aborted',
            State.HOLD: None if events.policy_open else self._budget.outcome or None,
        }.get(state)
        if state is not before:
            self.state, self._since_ns = state, now_ns
            self._revision_at_state = situation.sighting.revision
            self._blockade.forget()

    def _search_floor_m(self) -> float | None:
        """Return the altitude to search from; None: from where the landing began."""
        p, budget = self._p, self._budget
        if self.state not in LOOKING or budget.outcome:
            return None
        if budget.searched_s < p.search_low_after_s:
            return None
        return p.search_floor * p.safe_altitude_m

    def _search_target(self, situation: Situation) -> tuple[float, float] | None:
        p, pose, best = self._p, situation.pose, situation.sighting.best
        if self.state not in LOOKING or pose is None:
            return None
        if self._budget.outcome and best is not None:
            return best.north_m, best.east_m
        if self._time_in_state_s(situation.now_ns) < p.search_hold_s:
            return None
        if self._square is None:
            radius_m, home = p.search_radius_m, self._home or pose
            if p.geofence_radius_m > 0.0:
                radius_m = min(radius_m, max(0.0, p.geofence_radius_m - _FENCE_MARGIN_M))
            around = (home.north_m, home.east_m)
            self._square = ExpandingSquare(around, p.search_spacing_m, radius_m)
        if self._blockade.reason:
            self._square.advance()
            self._blockade.forget()
        return self._square.target(pose)


def _words(reason: str) -> str:
    """Return a reason without its digits: an age that grows is no new reason."""
    return re.sub(r'[\d.]+', '#', reason)
