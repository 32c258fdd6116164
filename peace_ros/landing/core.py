# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing in one object: poses, heatmaps and telemetry in, decisions out; no clock, no thread.

The order of a step is that of responsibility: data, site, state, guidance, guard.
"""

from __future__ import annotations

from dataclasses import replace
from math import hypot, inf

from peace_ros.domain import Camera, Heatmap, Pose, Setpoint, Site, Telemetry
from peace_ros.landing.decision import Decision, Focus, Verdict, VerdictKind
from peace_ros.landing.guard import Guard, GuardInput
from peace_ros.landing.guidance import ExpandingSquare, Situation, over_site, velocity
from peace_ros.landing.intake import HeatmapIntake
from peace_ros.landing.parameters import SAFETY_THRESHOLD_FLOOR, LandingParameters
from peace_ros.landing.sites import Search, find_site, safe_ground
from peace_ros.landing.states import STILL_STATES, Events, State, next_state
from peace_ros.landing.watch import (
    ControlWatch,
    TimeBudget,
    bad_map,
    bad_telemetry,
    valid_pose,
)
from peace_ros.mapping import MapLayers, MapParameters, SafetyMap

_NS = 1e-9
_AT_ALTITUDE = 0.98
"""An altitude counts as reached at this part of it."""
_AIMED_M = 1.0
"""AIMING has descended enough this close to its floor."""
_RENEW_S = 0.5
"""Without a new heatmap the map is judged again after this, because it ages."""
_LOOKING = frozenset({State.SEARCHING, State.RESTARTING})
_HIGHEST_SEARCH_M = 120.0


class LandingCore:
    """Brings a vehicle down over safe ground; not thread-safe.

    Times are nanoseconds of one clock, that of the stamps of poses and heatmaps.
    """

    def __init__(
        self,
        parameters: LandingParameters,
        camera: Camera,
        map_parameters: MapParameters | None = None,
    ) -> None:
        self.parameters = parameters
        self.safety_map = SafetyMap(map_parameters)
        self._intake = HeatmapIntake(parameters, camera, self.safety_map)
        self._engaged = self._new_engagement = False
        self._state, self._reason = State.IDLE, 'not engaged'
        self._since_ns = 0
        self._last_ns: int | None = None
        self._begin()

    def _begin(self) -> None:
        """Forget everything that belongs to an engagement."""
        self._guard = Guard(self.parameters)
        self._control = ControlWatch()
        self._budget = TimeBudget(self.parameters)
        self._home: Pose | None = None
        self._square: ExpandingSquare | None = None
        self._failed: list[tuple[int, Site]] = []
        self._anchor: Site | None = None
        self._aimed_at: Site | None = None
        self._outcome: str | None = None
        self._used_at_state = self.safety_map.revision
        self._threshold = self.parameters.safety_threshold
        self._forget_choice()

    def _forget_choice(self) -> None:
        self._verdict = Verdict.no_zone('nothing is known yet')
        self._focus: Focus | None = None
        self._judged = (-1, 0)
        self._ground_is_fresh = False

    def add_pose(self, pose: Pose) -> None:
        """Keep a pose for the heatmaps of its time; poses come in the order of their stamps."""
        self._intake.add_pose(pose)

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """Put a heatmap into the map with the pose at its stamp, or count why not."""
        self._intake.add_heatmap(heatmap)

    def engage(self) -> None:
        """Begin a landing, also after one that ended in ABORTED, HANDOVER or HOLD."""
        self._engaged = self._new_engagement = True
        self._begin()

    def disengage(self) -> None:
        """Stop: the set-point is zero and the state IDLE from the next step on."""
        self._engaged = self._new_engagement = False

    def step(self, now_ns: int, telemetry: Telemetry | None, telemetry_age_s: float) -> Decision:
        """Decide what to do now.

        :param now_ns: the clock of the stamps.
        :param telemetry: what the autopilot last said, None before it said anything.
        :param telemetry_age_s: since it was received, by a steady clock.
        """
        self._keep_time(now_ns)
        self._intake.tick(now_ns)
        p = self.parameters
        pose = valid_pose(telemetry, p)
        map_age_s = self._map_age_s(now_ns)
        bad_data = bad_telemetry(telemetry, telemetry_age_s, p)
        bad_data = bad_data or bad_map(map_age_s, self._intake.last_rejection, p)
        if self._engaged:
            self._control.see(telemetry)
            if self._home is None and pose is not None:
                self._home = pose
        if pose is not None:
            self._judge(now_ns, pose)
        site = self._reachable_site(pose) if not bad_data else None
        self._advance(now_ns, self._events(pose, site, bad_data))
        wish, note = self._guide(pose, site)
        home = None if self._home is None else (self._home.north_m, self._home.east_m)
        given = GuardInput(now_ns, pose, telemetry_age_s, map_age_s, home)
        setpoint, guard_notes = self._guard.limit(wish, given)
        return Decision(
            state=self._state,
            reason=f'{self._reason}; {note}' if note else self._reason,
            setpoint=setpoint,
            verdict=self._verdict,
            site=self._verdict.site,
            effective_threshold=self._threshold,
            map_age_s=map_age_s,
            focus=self._focus,
            guard_notes=guard_notes,
            counts=dict(self._intake.counts),
            outcome=self._outcome,
            time_in_state_s=self._time_in_state_s(now_ns),
            failed_sites=len(self._failed),
        )

    # --- data

    def _keep_time(self, now_ns: int) -> None:
        """A clock that jumps back (a simulation begun anew) makes everything known worthless."""
        if self._last_ns is None:
            self._since_ns = now_ns
        elif now_ns < self._last_ns - round(1e9):
            self.safety_map.clear()
            self._intake.clear()
            self._forget_choice()
            self._since_ns = now_ns
        self._last_ns = now_ns

    def _map_age_s(self, now_ns: int) -> float:
        stamp_ns = self.safety_map.stamp_ns
        return inf if stamp_ns is None else max(0.0, (now_ns - stamp_ns) * _NS)

    def _time_in_state_s(self, now_ns: int) -> float:
        return max(0.0, (now_ns - self._since_ns) * _NS)

    def _at_safe_altitude(self, pose: Pose | None) -> bool:
        if pose is None:
            return False
        return pose.altitude_agl_m >= _AT_ALTITUDE * self.parameters.safe_altitude_m

    # --- site

    def _judge(self, now_ns: int, pose: Pose) -> None:
        """Renew verdict, focus and threshold when the map has changed or aged."""
        revision, judged_ns = self._judged
        is_new = revision != self.safety_map.revision
        if not is_new and (now_ns - judged_ns) * _NS < _RENEW_S:
            return
        self._judged = (self.safety_map.revision, now_ns)
        p = self.parameters
        focus = self._moved_focus(pose, is_new=is_new)
        self._focus = focus
        reach_m = focus.radius_m + 1.2 * p.ample_clearance_m
        layers = self.safety_map.layers(now_ns, (focus.north_m, focus.east_m, reach_m))
        self._failed = [(until_ns, site) for until_ns, site in self._failed if until_ns > now_ns]
        low = self._state is State.LANDING or not self._at_safe_altitude(pose)
        age_limit_s = p.landing_site_age_limit_s if low else p.site_age_limit_s
        self._choose_threshold(layers, age_limit_s)
        search = Search(
            pose=pose,
            focus=focus,
            threshold=self._threshold,
            required_clearance_m=p.required_clearance_m(pose.altitude_agl_m),
            age_limit_s=age_limit_s,
            failed=tuple((site.north_m, site.east_m) for _, site in self._failed),
            incumbent=self._verdict.site or self._anchor,
        )
        self._verdict = self._anchored(find_site(layers, search, p))
        self._ground_is_fresh = self._fresh_below(now_ns, pose)

    def _moved_focus(self, pose: Pose, *, is_new: bool) -> Focus:
        """Narrow the circle of the search step by step, widen it at once."""
        p = self.parameters
        whole_m = self.safety_map.parameters.map_size_m
        radius_m = {
            State.AIMING: p.aiming_focus * p.safety_radius_m,
            State.LANDING: p.landing_focus * p.safety_radius_m,
        }.get(self._state, whole_m)
        old, site = self._focus, self._verdict.site
        if self._state is State.WAITING and old is not None:
            return old
        if radius_m >= whole_m and not self._at_safe_altitude(pose):
            # Low down only the ground below can be reached.
            return Focus(pose.north_m, pose.east_m, p.aiming_focus * p.safety_radius_m)
        if old is None or radius_m >= whole_m:
            return Focus(pose.north_m, pose.east_m, whole_m)
        if site is None or not is_new:
            return old
        step = p.focus_step
        return Focus(
            old.north_m + step * (site.north_m - old.north_m),
            old.east_m + step * (site.east_m - old.east_m),
            old.radius_m + step * (radius_m - old.radius_m),
        )

    def _choose_threshold(self, layers: MapLayers, age_limit_s: float) -> None:
        """Let the threshold sink slowly while nothing is found, never below the floor."""
        p = self.parameters
        if self._state not in _LOOKING:
            return
        sunk = min(1.0, self._budget.without_site_s / p.relax_after_s)
        wanted = p.safety_threshold - sunk * (p.safety_threshold - p.relaxed_threshold)
        wanted = max(wanted, SAFETY_THRESHOLD_FLOOR)
        if wanted < self._threshold:
            known = layers.age_s <= age_limit_s
            safe = safe_ground(layers, self._threshold, age_limit_s, p.min_looks)
            if safe.sum() > p.dynamic_threshold * max(1, int(known.sum())):
                return
        self._threshold = wanted

    def _anchored(self, verdict: Verdict) -> Verdict:
        """Below the safe altitude the site may not wander farther than it was wide."""
        anchor, site = self._anchor, verdict.site
        if anchor is None or site is None:
            return verdict
        moved_m = hypot(site.north_m - anchor.north_m, site.east_m - anchor.east_m)
        if moved_m <= anchor.clearance_m:
            return verdict
        return Verdict.no_zone(
            f'the safe place moved by {moved_m:.1f} m, more than its clearance of '
            f'{anchor.clearance_m:.1f} m'
        )

    def _fresh_below(self, now_ns: int, pose: Pose) -> bool:
        p = self.parameters
        around = (pose.north_m, pose.east_m, p.safety_radius_m + 2.0)
        layers = self.safety_map.layers(now_ns, around)
        below = layers.disc(pose.north_m, pose.east_m, p.safety_radius_m)
        safe = safe_ground(layers, self._threshold, p.descent_heatmap_age_limit_s, p.min_looks)
        return bool(below.any() and safe[below].all())

    def _reachable_site(self, pose: Pose | None) -> Site | None:
        """Return the site of the verdict unless the way to it is not known to be free."""
        site = self._verdict.site
        if site is None or pose is None or self._at_safe_altitude(pose):
            return site
        return site if site.distance_m(pose) <= site.clearance_m else None

    # --- state

    def _events(self, pose: Pose | None, site: Site | None, bad_data: str) -> Events:
        p = self.parameters
        altitude_m = inf if pose is None else pose.altitude_agl_m
        return Events(
            engaged=self._engaged,
            new_engagement=self._new_engagement,
            taken_over=self._control.taken_over,
            out_of_time=self._budget.reason,
            bad_data=bad_data,
            site_known=site is not None,
            warmed_up=self.safety_map.revision - self._used_at_state >= p.sensor_warm_up_cycles,
            over_site=(
                pose is not None
                and site is not None
                and self._ground_is_fresh
                and over_site(pose, site, p.safety_radius_m)
            ),
            at_safe_altitude=self._at_safe_altitude(pose),
            low_enough_to_land=altitude_m <= p.aiming_floor * p.safe_altitude_m + _AIMED_M,
            at_handover_altitude=altitude_m <= p.handover_altitude_m + p.handover_tolerance_m,
        )

    def _advance(self, now_ns: int, events: Events) -> None:
        if self._engaged:
            looking = self._state in _LOOKING and not events.bad_data
            self._budget.spend(now_ns, looking=looking, site_known=events.site_known)
            events = replace(events, out_of_time=self._budget.reason)
        before = self._state
        state, reason = next_state(before, events, self._time_in_state_s(now_ns), self.parameters)
        self._new_engagement = False
        self._reason = reason or self._reason
        self._outcome = self._outcome or {
            State.HANDOVER: 'handover',
            State.ABORTED: 'aborted',
            State.HOLD: self._budget.outcome or None,
        }.get(state)
        if state is before:
            return
        self._state, self._since_ns = state, now_ns
        self._used_at_state = self.safety_map.revision
        self._judged = (-1, now_ns)
        self._on_change(before, state, now_ns)

    def _on_change(self, before: State, state: State, now_ns: int) -> None:
        site = self._verdict.site
        if state is State.LANDING:
            self._anchor = site
        if state is State.AIMING:
            self._aimed_at = site
        if state in {State.CLIMBING, State.RESTARTING} and before is not State.CLIMBING:
            self._remember_failure(now_ns)
        if state in _LOOKING:
            self._anchor = None

    def _remember_failure(self, now_ns: int) -> None:
        site = self._anchor or self._aimed_at
        if site is not None:
            until_ns = now_ns + round(self.parameters.failed_site_memory_s * 1e9)
            self._failed.append((until_ns, site))
        self._verdict = Verdict.no_zone('the site failed')
        self._anchor = self._aimed_at = None

    # --- motion

    def _guide(self, pose: Pose | None, site: Site | None) -> tuple[Setpoint, str]:
        stamp_ns = self.safety_map.stamp_ns or 0
        if pose is None or self._state in STILL_STATES:
            return Setpoint(stamp_ns), ''
        home = self._home or pose
        situation = Situation(
            stamp_ns=stamp_ns,
            pose=pose,
            site=site if self._verdict.kind is VerdictKind.SITE else None,
            at_safe_altitude=self._at_safe_altitude(pose),
            ground_is_fresh=self._ground_is_fresh,
            search_target=self._search_target(pose, home),
            search_altitude_m=min(home.altitude_agl_m, _HIGHEST_SEARCH_M),
        )
        return velocity(self._state, situation, self.parameters)

    def _search_target(self, pose: Pose, home: Pose) -> tuple[float, float] | None:
        p = self.parameters
        if self._state not in _LOOKING:
            return None
        if (self._last_ns or 0) - self._since_ns < p.search_hold_s * 1e9:
            return None
        if self._square is None:
            around = (home.north_m, home.east_m)
            self._square = ExpandingSquare(around, p.search_spacing_m, p.search_radius_m)
        return self._square.target(pose)
