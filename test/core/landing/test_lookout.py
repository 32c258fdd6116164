# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lookout: where it looks, how strictly, and what a failure means; over a map of layers."""

from dataclasses import dataclass, field, replace
from math import inf

import numpy as np
import pytest

from peace_ros.core.domain import Pose, Site
from peace_ros.core.landing import LandingParameters, State, Verdict, VerdictKind
from peace_ros.core.landing.lookout import Lookout
from peace_ros.core.mapping import MapLayers, MapParameters

S = 1_000_000_000
P = LandingParameters()
HIGH = Pose(0, 0.0, 0.0, -60.0, (1.0, 0.0, 0.0, 0.0), 60.0)
LOW = replace(HIGH, altitude_agl_m=30.0)


@dataclass
class PaintedMap:
    """A map of 100 x 100 m with one score everywhere, but for what is painted."""

    parameters: MapParameters = field(default_factory=lambda: MapParameters(map_size_m=100.0))
    stamp_ns: int | None = None
    revision: int = 0
    score: float = 0.95
    age_s: float = 0.1
    asked: list[tuple[float, float, float]] = field(default_factory=list)
    discs: list[tuple[float, float, float, float]] = field(default_factory=list)

    def layers(self, now_ns: int, around: tuple[float, float, float]) -> MapLayers:
        self.asked.append(around)
        shape = (200, 200)
        layers = MapLayers(
            np.full(shape, self.score, np.float32),
            np.full(shape, self.age_s + (now_ns - (self.stamp_ns or 0)) / S, np.float32),
            np.full(shape, 9, np.uint16),
            0.5,
            -50.0,
            -50.0,
            np.full(shape, np.inf, np.float32),
        )
        for north_m, east_m, radius_m, score in self.discs:
            layers.score[layers.disc(north_m, east_m, radius_m)] = score
        return layers

    def score_around(self, north_m, east_m, radius_m, now_ns) -> tuple[float, float]:
        return north_m + east_m + radius_m, now_ns * 1e-9

    def see(self) -> None:
        self.revision += 1
        self.stamp_ns = self.revision * S


@pytest.fixture
def painted() -> PaintedMap:
    painted = PaintedMap()
    painted.see()
    return painted


def look(lookout, painted, state, pose=HIGH, without_site_s=0.0, *, is_new=True):
    """Look once, at a new heatmap."""
    if is_new:
        painted.see()
    return lookout.look(painted.stamp_ns, pose, state, without_site_s)


def test_a_sighting_tells_what_the_map_says(painted):
    pose = replace(HIGH, north_m=0.2, east_m=0.3)
    painted.age_s = 0.0
    lookout = Lookout(P, painted)
    seen = lookout.look(painted.stamp_ns + 3 * S // 2, pose, State.SEARCHING, 0.0)
    assert seen.ground_score == pytest.approx(0.5 + P.safety_radius_m)
    assert seen.ground_age_s == pytest.approx(2.5)
    assert seen.map_age_s == pytest.approx(1.5)
    assert (seen.stamp_ns, seen.revision) == (painted.stamp_ns, painted.revision)
    assert seen.threshold == P.safety_threshold
    assert seen.ground_is_fresh
    assert seen.reachable == seen.verdict.site == seen.best
    early = lookout.look(painted.stamp_ns - S, pose, State.SEARCHING, 0.0)
    assert early.map_age_s == 0.0


def test_refused_places_are_found_once_per_second_and_forgotten_with_the_choice(painted):
    lookout = Lookout(P, painted)
    painted.score = 0.05
    painted.discs = [(20.0, 0.0, 3.0, 0.95)]
    lookout.look(painted.stamp_ns, HIGH, State.SEARCHING, 0.0)
    (place,) = lookout.refused
    assert (place.north_m, place.east_m) == pytest.approx((20.0, 0.0), abs=1.0)
    assert 'too narrow by' in place.reason
    painted.discs = []
    painted.revision += 1
    lookout.look(painted.stamp_ns + S // 2, HIGH, State.SEARCHING, 0.0)
    assert lookout.refused == (place,)
    painted.revision += 1
    lookout.look(painted.stamp_ns + S, HIGH, State.SEARCHING, 0.0)
    assert lookout.refused == ()
    painted.discs = [(20.0, 0.0, 3.0, 0.95)]
    look(lookout, painted, State.SEARCHING)
    lookout.forget_choice()
    assert lookout.refused == ()


def test_without_a_pose_nothing_is_judged_and_without_a_heatmap_the_map_has_no_age():
    seen = Lookout(P, PaintedMap()).look(S, None, State.SEARCHING, 0.0)
    assert seen.verdict.kind is VerdictKind.NO_ZONE
    assert seen.verdict.reason == 'nothing is known yet'
    assert (seen.ground_score, seen.ground_age_s, seen.map_age_s) == (0.0, inf, inf)
    assert (seen.stamp_ns, seen.focus, seen.best) == (0, None, None)
    assert not seen.ground_is_fresh


def test_a_pose_that_is_lost_keeps_the_verdict_but_not_the_ground_below(painted):
    lookout = Lookout(P, painted)
    site = look(lookout, painted, State.AIMING).verdict.site
    seen = look(lookout, painted, State.AIMING, None)
    assert seen.verdict.site is site
    assert not seen.ground_is_fresh


@pytest.mark.parametrize(('later_s', 'is_judged'), [(0.4, False), (0.5, True)])
def test_the_map_is_judged_again_when_it_is_new_or_has_aged_for_half_a_second(
    painted, later_s, is_judged
):
    lookout = Lookout(P, painted)
    look(lookout, painted, State.SEARCHING)
    painted.asked.clear()
    lookout.look(painted.stamp_ns + round(later_s * S), HIGH, State.SEARCHING, 0.0)
    assert bool(painted.asked) is is_judged
    painted.asked.clear()
    look(lookout, painted, State.SEARCHING)
    assert painted.asked


def test_the_search_looks_at_the_whole_window_around_the_vehicle(painted):
    lookout = Lookout(P, painted)
    for north_m in (5.0, -7.0):
        pose = replace(HIGH, north_m=north_m, east_m=3.0)
        focus = look(lookout, painted, State.SEARCHING, pose).focus
        assert (focus.north_m, focus.east_m, focus.radius_m) == (north_m, 3.0, 100.0)
    assert painted.asked[0] == (5.0, 3.0, pytest.approx(100.0 + 1.2 * 12.0))


@pytest.mark.parametrize(
    ('state', 'radius_m'), [(State.AIMING, 6.0 * 1.5), (State.LANDING, 2.0 * 1.5)]
)
def test_the_focus_closes_in_on_the_site_by_steps(painted, state, radius_m):
    painted.score = 0.1
    painted.discs = [(20.25, 10.25, 14.0, 0.95)]
    lookout = Lookout(P, painted)
    site = look(lookout, painted, State.SEARCHING).verdict.site
    focus = look(lookout, painted, state).focus
    assert focus.radius_m == pytest.approx(100.0 + 0.1 * (radius_m - 100.0))
    assert focus.north_m == pytest.approx(0.1 * site.north_m)
    assert focus.east_m == pytest.approx(0.1 * site.east_m)
    lookout._judged = (painted.revision, 0)
    assert look(lookout, painted, state, is_new=False).focus == focus, 'not without a new heatmap'
    for _ in range(200):
        seen = look(lookout, painted, state)
    assert seen.focus.radius_m == pytest.approx(radius_m)
    # It waits where it was, and opens at once to search.
    assert look(lookout, painted, State.WAITING).focus == seen.focus
    assert look(lookout, painted, State.RESTARTING).focus.radius_m == 100.0


def test_low_down_only_the_ground_below_is_searched(painted):
    lookout = Lookout(P, painted)
    pose = replace(LOW, north_m=4.0)
    focus = look(lookout, painted, State.SEARCHING, pose).focus
    assert (focus.north_m, focus.east_m, focus.radius_m) == (4.0, 0.0, 9.0)


@pytest.mark.parametrize(
    ('state', 'altitude_m', 'age_s', 'kind'),
    [
        (State.SEARCHING, 60.0, 20.0, VerdictKind.SITE),
        (State.SEARCHING, 60.0, 20.1, VerdictKind.NO_ZONE),
        (State.AIMING, 49.0, 20.0, VerdictKind.SITE),
        (State.AIMING, 48.9, 5.1, VerdictKind.NO_ZONE),
        (State.AIMING, 48.9, 5.0, VerdictKind.SITE),
        (State.LANDING, 60.0, 5.1, VerdictKind.NO_ZONE),
        (State.LANDING, 60.0, 5.0, VerdictKind.SITE),
    ],
)
def test_ground_must_be_newer_to_land_than_to_search(painted, state, altitude_m, age_s, kind):
    painted.age_s = age_s
    pose = replace(HIGH, altitude_agl_m=altitude_m)
    assert look(Lookout(P, painted), painted, state, pose).verdict.kind is kind


@pytest.mark.parametrize(
    ('age_s', 'disc', 'is_fresh'),
    [
        (1.5, None, True),
        (1.6, None, False),
        (0.1, (0.0, 0.0, 0.6, 0.3), False),
        (0.1, (0.0, 3.0, 0.6, 0.3), True),
    ],
)
def test_the_ground_below_is_fresh_when_every_cell_of_it_was_just_seen_safe(
    painted, age_s, disc, is_fresh
):
    painted.age_s = age_s
    painted.discs = [disc] if disc else []
    assert look(Lookout(P, painted), painted, State.LANDING).ground_is_fresh is is_fresh


@pytest.mark.parametrize(
    ('without_site_s', 'threshold'), [(0.0, 0.8), (30.0, 0.75), (60.0, 0.7), (999.0, 0.7)]
)
def test_the_threshold_sinks_with_the_time_without_a_site(painted, without_site_s, threshold):
    painted.score = 0.1
    relaxing = replace(P, relaxation=True)
    lookout = Lookout(relaxing, painted)
    seen = look(lookout, painted, State.SEARCHING, without_site_s=without_site_s)
    assert seen.threshold == pytest.approx(threshold)
    # Not in the other states, and not at all unless asked for; a new engagement begins anew.
    assert look(lookout, painted, State.AIMING).threshold == seen.threshold
    firm = look(Lookout(P, painted), painted, State.SEARCHING, without_site_s=without_site_s)
    assert firm.threshold == 0.8
    assert look(lookout, painted, State.SEARCHING).threshold == 0.8
    lookout.begin()
    assert look(lookout, painted, State.AIMING).threshold == 0.8


@pytest.mark.parametrize('age_s', [0.1, 20.0])
@pytest.mark.parametrize(('safe_share', 'threshold'), [(0.2, 0.8), (0.05, 0.7)])
def test_the_threshold_does_not_sink_where_enough_ground_is_safe(
    painted, safe_share, threshold, age_s
):
    painted.score = 0.1
    painted.age_s = age_s
    painted.discs = [(0.0, 0.0, 100.0 * (safe_share / np.pi) ** 0.5, 0.95)]
    lookout = Lookout(replace(P, relaxation=True), painted)
    seen = look(lookout, painted, State.SEARCHING, without_site_s=60.0)
    assert seen.threshold == pytest.approx(threshold)


def test_a_descent_that_fails_closes_the_place_where_it_began(painted):
    lookout = Lookout(P, painted)
    site = look(lookout, painted, State.SEARCHING).verdict.site
    assert not lookout.follow(State.SEARCHING, State.AIMING, 10 * S)
    assert not lookout.follow(State.AIMING, State.LANDING, 11 * S)
    assert not lookout.follow(State.LANDING, State.WAITING, 12 * S)
    assert lookout.follow(State.WAITING, State.CLIMBING, 13 * S)
    assert lookout.failed_sites == 1
    (failed,) = lookout.memory.failed
    assert (failed.north_m, failed.east_m) == (site.north_m, site.east_m)
    assert failed.until_ns == 13 * S + round(P.failed_site_memory_s * S)
    seen = lookout.look(painted.stamp_ns, None, State.CLIMBING, 0.0)
    assert seen.verdict.reason == 'the site failed'
    assert not lookout.follow(State.CLIMBING, State.RESTARTING, 14 * S), 'counted once'
    assert lookout.failed_sites == 1
    other = look(lookout, painted, State.RESTARTING).verdict.site
    assert np.hypot(other.north_m - site.north_m, other.east_m - site.east_m) > failed.radius_m
    lookout.begin()
    assert lookout.failed_sites == 0


def test_an_approach_that_fails_closes_the_place_but_is_no_descent(painted):
    lookout = Lookout(P, painted)
    look(lookout, painted, State.SEARCHING)
    lookout.follow(State.SEARCHING, State.AIMING, 10 * S)
    assert not lookout.follow(State.AIMING, State.RESTARTING, 11 * S)
    assert lookout.failed_sites == 1


def test_an_approach_whose_site_got_lost_closes_the_place_that_it_aimed_at(painted):
    lookout = Lookout(P, painted)
    site = look(lookout, painted, State.SEARCHING).verdict.site
    lookout.follow(State.SEARCHING, State.AIMING, 10 * S)
    painted.score = 0.1
    assert look(lookout, painted, State.AIMING).verdict.site is None
    lookout.follow(State.AIMING, State.WAITING, 11 * S)
    lookout.follow(State.WAITING, State.RESTARTING, 12 * S)
    (failed,) = lookout.memory.failed
    assert (failed.north_m, failed.east_m) == (site.north_m, site.east_m)


def test_the_present_choice_stays_while_the_vehicle_flies_past_an_equal_one(painted):
    painted.score = 0.1
    painted.discs = [(20.0, 0.0, 9.0, 0.95), (-20.0, 0.0, 9.0, 0.95)]
    lookout = Lookout(P, painted)
    for north_m in (5.0, -5.0):
        pose = replace(HIGH, north_m=north_m)
        assert look(lookout, painted, State.SEARCHING, pose).verdict.site.north_m > 10.0
    fresh = look(Lookout(P, painted), painted, State.SEARCHING, pose)
    assert fresh.verdict.site.north_m < -10.0


@pytest.mark.parametrize(
    ('north_m', 'east_m', 'moved'),
    [
        (16.0, 30.0, ''),
        (10.0, 24.0, ''),
        (13.6, 34.8, ''),
        (16.1, 30.0, '6.1'),
        (14.0, 35.0, '6.4'),
    ],
)
def test_a_site_may_move_by_its_clearance_during_a_descent(painted, north_m, east_m, moved):
    lookout = Lookout(P, painted)
    lookout._verdict = Verdict.found(Site(10.0, 30.0, 6.0, 100.0, 0.9, 0.1))
    now = Verdict.found(Site(north_m, east_m, 7.0, 100.0, 0.9, 0.1))
    assert lookout.anchored(now) is now, 'no descent has begun'
    lookout.follow(State.AIMING, State.LANDING, 10 * S)
    lost = Verdict.no_zone('fog')
    assert lookout.anchored(lost) is lost
    found = lookout.anchored(now)
    if moved:
        assert found.site is None
        assert found.reason == (
            f'the safe place moved by {moved} m, more than its clearance of 6.0 m'
        )
    else:
        assert found is now


def test_the_first_heatmap_is_judged_at_once_and_after_each_change_of_state(painted):
    painted.stamp_ns = S // 10
    lookout = Lookout(P, painted)
    assert lookout.look(S // 10, HIGH, State.SEARCHING, 0.0).verdict.site is not None
    lookout.follow(State.SEARCHING, State.AIMING, S // 10)
    painted.asked.clear()
    lookout.look(S // 10, HIGH, State.AIMING, 0.0)
    assert painted.asked


def test_the_ground_below_is_asked_for_around_the_vehicle(painted):
    look(Lookout(P, painted), painted, State.LANDING, replace(HIGH, north_m=3.0, east_m=-4.0))
    assert (3.0, -4.0, P.safety_radius_m + 2.0) in painted.asked


@pytest.mark.parametrize('state', [State.SEARCHING, State.RESTARTING, State.RETURNING])
def test_a_search_or_a_return_frees_the_site_from_where_it_was(painted, state):
    lookout = Lookout(P, painted)
    look(lookout, painted, State.SEARCHING)
    lookout.follow(State.SEARCHING, State.AIMING, 10 * S)
    lookout.follow(State.AIMING, State.LANDING, 10 * S)
    assert lookout._anchor is not None
    lookout.follow(State.HOLD, state, 11 * S)
    assert lookout._anchor is None


def test_the_best_place_is_remembered_when_it_is_out_of_view(painted):
    painted.score = 0.1
    painted.discs = [(20.25, 10.25, 14.0, 0.95)]
    lookout = Lookout(P, painted)
    site = look(lookout, painted, State.SEARCHING).verdict.site
    painted.discs = []
    seen = look(lookout, painted, State.SEARCHING)
    assert seen.verdict.site is None
    assert seen.best == site


@pytest.mark.parametrize(
    ('pose', 'east_m', 'is_reachable'),
    [(HIGH, 40.0, True), (LOW, 6.0, True), (LOW, 6.1, False), (None, 40.0, True)],
)
def test_low_down_a_site_is_reachable_within_its_clearance(painted, pose, east_m, is_reachable):
    lookout = Lookout(P, painted)
    look(lookout, painted, State.SEARCHING)
    site = Site(0.0, east_m, 6.0, 100.0, 0.9, 0.1)
    lookout._verdict = replace(lookout._verdict, site=site)
    assert lookout.reachable(pose) is (site if is_reachable else None)
    seen = look(lookout, painted, State.AIMING, pose, is_new=False)
    assert seen.reachable is (site if is_reachable else None)
    if pose is HIGH:
        assert lookout.reachable(pose, HIGH.altitude_agl_m - 48.9) is None, 'it may be lower'
