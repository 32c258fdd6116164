# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Judges the map in each step: verdict, focus, threshold, and the ground under the vehicle."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, inf

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing.decision import Focus, RefusedPlace, Verdict
from peace_ros.core.landing.memory import SiteMemory
from peace_ros.core.landing.parameters import SAFETY_THRESHOLD_FLOOR, LandingParameters
from peace_ros.core.landing.refusals import refused_places
from peace_ros.core.landing.sites import Search, find_site, safe_ground
from peace_ros.core.landing.situation import Sighting
from peace_ros.core.landing.states import LOOKING, State
from peace_ros.core.landing.watch import at_safe_altitude
from peace_ros.core.mapping import MapLayers, SafetyMap

_NS = 1e-9
_RENEW_S = 0.5
"""Without a new heatmap the map is judged again after this time, because it ages."""
_EXPLAIN_S = 1.0
"""Refused places are looked for at most this often: they are for people."""
_EXPLAIN_M = 60.0
"""They are looked for up to this far to the north, south, east and west of the vehicle."""


class Lookout:
    """Judges the map for the state of the landing, and remembers which sites failed."""

    def __init__(self, parameters: LandingParameters, safety_map: SafetyMap) -> None:
        self._p = parameters
        self._map = safety_map
        self.begin()

    @property
    def failed_sites(self) -> int:
        """Number of places that are excluded because they failed."""
        return len(self.memory.failed)

    def begin(self) -> None:
        """Forget everything that belongs to an engagement."""
        self.memory = SiteMemory(self._p)
        """Places of this engagement."""
        self._anchor: Site | None = None
        self._aimed_at: Site | None = None
        self._threshold = self._p.safety_threshold
        self.forget_choice()

    def forget_choice(self) -> None:
        """Forget every conclusion from the map."""
        self._verdict = Verdict.no_zone('nothing is known yet')
        self._focus: Focus | None = None
        self._judged = (-1, 0)
        self._ground_is_fresh = False
        self.refused: tuple[RefusedPlace, ...] = ()
        """The best places around the vehicle that are no sites, as of the last second."""
        self._explained_ns: int | None = None

    def look(
        self,
        now_ns: int,
        pose: Pose | None,
        state: State,
        without_site_s: float,
        above_lowest_m: float = 0.0,
    ) -> Sighting:
        """Return what is known now.

        Args:
            now_ns: The clock of the heatmaps' stamps.
            pose: Of the vehicle; None while it is not known, and then nothing is judged anew.
            state: Of the landing; it decides where to look, and how strictly.
            without_site_s: How long a site has been searched without success.
            above_lowest_m: Altitude of the pose minus the lowest height that is believed.
        """
        self.memory.forgive(now_ns)
        score, age_s = 0.0, inf
        if pose is not None:
            low = state is State.LANDING or not at_safe_altitude(pose, self._p, above_lowest_m)
            self._judge(now_ns, pose, state, without_site_s, low=low)
            score, age_s = self._map.score_around(
                pose.north_m, pose.east_m, self._p.safety_radius_m, now_ns
            )
        stamp_ns = self._map.stamp_ns
        return Sighting(
            verdict=self._verdict,
            reachable=self.reachable(pose, above_lowest_m),
            ground_is_fresh=self._ground_is_fresh and pose is not None,
            ground_score=score,
            ground_age_s=age_s,
            stamp_ns=stamp_ns or 0,
            map_age_s=inf if stamp_ns is None else max(0.0, (now_ns - stamp_ns) * _NS),
            revision=self._map.revision,
            threshold=self._threshold,
            focus=self._focus,
            best=self.memory.best(),
        )

    def follow(self, before: State, state: State, now_ns: int) -> bool:
        """Follow a change of state; return whether it means that a descent has failed."""
        self._judged = (-1, now_ns)
        site, failed_descent = self._verdict.site, False
        if state is State.LANDING and self._anchor is None:
            self._anchor = site
        if state is State.AIMING:
            self._aimed_at = site
        if state in {State.CLIMBING, State.RESTARTING} and before is not State.CLIMBING:
            failed_descent = self._remember_failure(now_ns)
        if state in LOOKING or state is State.RETURNING:
            self._anchor = None
        return failed_descent

    def _remember_failure(self, now_ns: int) -> bool:
        site, descended = self._anchor or self._aimed_at, self._anchor is not None
        if site is not None:
            self.memory.fail(site, now_ns)
        self._verdict = Verdict.no_zone('the site failed')
        self._anchor = self._aimed_at = None
        return descended

    def reachable(self, pose: Pose | None, above_lowest_m: float = 0.0) -> Site | None:
        """Return the site of the verdict, None when lateral motion to it may meet an obstacle."""
        site = self._verdict.site
        if site is None or pose is None or at_safe_altitude(pose, self._p, above_lowest_m):
            return site
        return site if site.distance_m(pose) <= site.clearance_m else None

    def _judge(
        self, now_ns: int, pose: Pose, state: State, without_site_s: float, *, low: bool
    ) -> None:
        """Renew verdict, focus and threshold when the map has changed or aged."""
        revision, judged_ns = self._judged
        is_new = revision != self._map.revision
        if not is_new and (now_ns - judged_ns) * _NS < _RENEW_S:
            return
        self._judged = (self._map.revision, now_ns)
        focus = self._moved_focus(pose, state, is_new=is_new)
        self._focus = focus
        age_limit_s = self._p.landing_site_age_limit_s if low else self._p.site_age_limit_s
        reach_m = focus.radius_m + 1.2 * self._p.ample_clearance_m
        layers = self._map.layers(now_ns, (focus.north_m, focus.east_m, reach_m))
        if state in LOOKING:
            self._choose_threshold(layers, age_limit_s, without_site_s)
        search = self._search(focus, pose, age_limit_s)
        self._verdict = self.anchored(find_site(layers, search, self._p))
        if self._verdict.site is not None:
            self.memory.see(self._verdict.site)
        self._ground_is_fresh = self._fresh_below(now_ns, pose)
        self._explain(now_ns, replace(search, incumbent=self._verdict.site))

    def _explain(self, now_ns: int, search: Search) -> None:
        """Renew the refused places, once per second."""
        if self._explained_ns is not None and now_ns - self._explained_ns < _EXPLAIN_S / _NS:
            return
        self._explained_ns = now_ns
        around = (search.pose.north_m, search.pose.east_m, _EXPLAIN_M)
        layers = self._map.layers(now_ns, around)
        self.refused = refused_places(layers, search, self._p, now_ns)

    def _search(self, focus: Focus, pose: Pose, age_limit_s: float) -> Search:
        return Search(
            pose=pose,
            focus=focus,
            threshold=self._threshold,
            required_clearance_m=self._p.required_clearance_m(pose.altitude_agl_m),
            age_limit_s=age_limit_s,
            failed=self.memory.failed,
            incumbent=self._verdict.site or self._anchor,
        )

    def _moved_focus(self, pose: Pose, state: State, *, is_new: bool) -> Focus:
        """Return the new circle of the search: it shrinks in steps and grows at once."""
        p = self._p
        whole_m = self._map.parameters.map_size_m
        radius_m = {
            State.AIMING: p.aiming_focus * p.safety_radius_m,
            State.LANDING: p.landing_focus * p.safety_radius_m,
        }.get(state, whole_m)
        old, site = self._focus, self._verdict.site
        if state is State.WAITING and old is not None:
            return old
        if radius_m >= whole_m and not at_safe_altitude(pose, p):
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

    def _choose_threshold(
        self, layers: MapLayers, age_limit_s: float, without_site_s: float
    ) -> None:
        """Lower the threshold slowly while no site is found, where relaxation allows it."""
        p = self._p
        sunk = min(1.0, without_site_s / p.relax_after_s) if p.relaxation else 0.0
        wanted = p.safety_threshold - sunk * (p.safety_threshold - p.relaxed_threshold)
        wanted = max(wanted, SAFETY_THRESHOLD_FLOOR)
        if wanted < self._threshold:
            known = layers.age_s <= age_limit_s
            safe = safe_ground(layers, self._threshold, age_limit_s, p.min_looks)
            if safe.sum() > p.dynamic_threshold * max(1, int(known.sum())):
                return
        self._threshold = wanted

    def anchored(self, verdict: Verdict) -> Verdict:
        """Return NO_ZONE when the site has moved too far since the descent began."""
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
        p = self._p
        around = (pose.north_m, pose.east_m, p.safety_radius_m + 2.0)
        layers = self._map.layers(now_ns, around)
        below = layers.disc(pose.north_m, pose.east_m, p.safety_radius_m)
        safe = safe_ground(layers, self._threshold, p.descent_heatmap_age_limit_s, p.min_looks)
        return bool(below.any() and safe[below].all())
