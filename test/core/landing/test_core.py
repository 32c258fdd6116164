# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The core: what it refuses, what it says, and what holds whatever happens."""

import os
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from peace_ros.core.domain import Camera, DepthImage, Heatmap, Pose, Site, Telemetry
from peace_ros.core.landing import LandingCore, LandingParameters, State, Verdict, VerdictKind
from peace_ros.core.landing.guidance import over_site
from peace_ros.core.landing.situation import Situation
from peace_ros.core.landing.states import STILL_STATES
from peace_ros.core.mapping import MapParameters

S = 1_000_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)


def pose_at(time_s: float, altitude_m: float = 60.0) -> Pose:
    return Pose(round(time_s * S), 0.0, 0.0, -altitude_m, LEVEL, altitude_m)


def heatmap_at(time_s: float, value: float = 0.9) -> Heatmap:
    return Heatmap(np.full((64, 64), value, np.float32), round(time_s * S))


def telemetry_at(time_s: float, **changes) -> Telemetry:
    given = {'pose': pose_at(time_s), 'armed': True, 'in_control': True, 'mode': 'GUIDED'}
    return Telemetry(0, **{**given, **changes})


@pytest.fixture
def core() -> LandingCore:
    return LandingCore(LandingParameters(), Camera.from_degrees(352, 352, 73.0))


def fed(core: LandingCore, begin_s: float, end_s: float):
    """Give good poses and heatmaps at 5 Hz and step; return the last decision."""
    decision = None
    for time_s in np.arange(begin_s, end_s, 0.2):
        core.add_pose(pose_at(time_s))
        core.add_heatmap(heatmap_at(time_s))
        decision = core.step(round(time_s * S), telemetry_at(time_s), 0.1)
    return decision


def test_stands_idle_until_engaged(core):
    decision = fed(core, 1.0, 5.0)
    assert decision.state is State.IDLE
    assert decision.setpoint.is_zero
    assert decision.outcome is None


def test_the_first_state_begins_with_the_first_step_also_on_the_clock_of_the_day(core):
    begin_ns = 1_795_000_000 * S
    assert core.step(begin_ns, None, inf).time_in_state_s == 0.0
    later = core.step(begin_ns + S // 2, None, inf)
    assert later.state is State.IDLE
    assert later.time_in_state_s == pytest.approx(0.5)


@pytest.mark.parametrize('place', [(-60.0, -40.0), (-12.0, 3.0), (500.0, 0.0), (0.0, -900.0)])
def test_stands_wherever_it_is_before_anything_was_seen_and_after_the_map_was_dropped(core, place):
    def there(time_s: float) -> Telemetry:
        at = replace(pose_at(time_s), north_m=place[0], east_m=place[1])
        return telemetry_at(time_s, pose=at)

    core.engage()
    assert core.step(S, there(1.0), 0.1).setpoint.is_zero
    fed(core, 2.0, 6.0)
    # The position jumps: the map of before says nothing about the ground here.
    core.add_pose(there(6.0).pose)
    decision = core.step(6 * S, there(6.0), 0.1)
    assert decision.verdict.kind is VerdictKind.NO_ZONE
    assert decision.setpoint.is_zero
    # No position for a while drops the map too.
    decision = core.step(12 * S, there(12.0), 0.1)
    assert decision.state is State.HOLD
    assert decision.setpoint.is_zero


def test_says_why_a_position_is_not_believed(core):
    fed(core, 1.0, 2.0)
    core.engage()
    told = telemetry_at(2.0, pose=None, position_problem='the reported position jumped by 20 m')
    core.step(2 * S, told, 0.1)
    decision = core.step(round(2.1 * S), told, 0.1)
    assert decision.state is State.HOLD
    assert decision.reason == 'the reported position jumped by 20 m'


def depth_at(time_s: float, step_m: float = 0.0) -> DepthImage:
    depth = np.full((64, 64), 15.0, np.float32)
    depth[:, 32:] -= step_m
    return DepthImage(depth, round(time_s * S))


def test_depth_waits_for_its_pose_and_closes_the_ground_for_good(core):
    core.engage()
    fed(core, 1.0, 6.0)
    core.add_depth(depth_at(6.1, step_m=3.0))
    core.add_depth(depth_at(6.1))
    assert core.step(round(6.0 * S), telemetry_at(6.0), 0.1).counts.get('depth used', 0) == 0
    core.add_pose(pose_at(6.2))
    decision = core.step(round(6.2 * S), telemetry_at(6.2), 0.1)
    assert decision.counts['depth used'] == 1
    assert decision.counts['depth not newer than the last'] == 1
    assert core.safety_map.score_around(0.0, 0.0, 1.5, round(6.2 * S))[0] == 0.0
    assert decision.setpoint.v_down_m_s == 0.0
    decision = fed(core, 6.4, 9.0)
    assert decision.setpoint.v_down_m_s == 0.0, 'no heatmap opens it'
    assert core.safety_map.score_around(0.0, 0.0, 1.5, 9 * S)[0] == 0.0


def test_depth_from_a_time_without_a_pose_is_counted_and_left_out(core):
    fed(core, 1.0, 3.0)
    core.add_depth(depth_at(0.5, step_m=3.0))
    decision = fed(core, 3.0, 4.0)
    assert decision.counts['depth: older than every pose'] == 1
    assert core.safety_map.score_around(0.0, 0.0, 1.5, 4 * S)[0] > 0.5


def test_holds_and_says_why_before_anything_was_seen(core):
    core.engage()
    core.step(S, None, inf)
    decision = core.step(2 * S, None, inf)
    assert decision.state is State.HOLD
    assert decision.setpoint.is_zero
    assert 'where it is' in decision.reason


def test_a_single_frame_is_never_a_site(core):
    core.engage()
    core.add_pose(pose_at(1.0))
    core.add_heatmap(heatmap_at(1.0, 1.0))
    for step in range(10):
        decision = core.step(round((1.0 + 0.1 * step) * S), telemetry_at(1.0), 0.1)
        assert decision.verdict.kind is VerdictKind.NO_ZONE
        assert decision.setpoint.is_zero


def test_setpoints_carry_the_stamp_of_the_newest_heatmap(core):
    core.engage()
    decision = fed(core, 1.0, 6.0)
    assert decision.setpoint.stamp_ns == core.safety_map.stamp_ns
    assert decision.setpoint.v_down_m_s > 0.0
    assert decision.map_age_s == pytest.approx(0.0)
    assert decision.focus is not None


def test_heatmap_waits_for_the_pose_after_its_stamp(core):
    core.add_pose(pose_at(1.0))
    core.add_heatmap(heatmap_at(1.05))
    assert core.step(round(1.06 * S), telemetry_at(1.0), 0.0).counts.get('used', 0) == 0
    core.add_pose(pose_at(1.1))
    assert core.step(round(1.11 * S), telemetry_at(1.0), 0.0).counts['used'] == 1


@pytest.mark.parametrize(
    ('heatmap', 'reason'),
    [
        (Heatmap(np.full((8, 8), np.nan, np.float32), 3 * S), 'not finite'),
        (Heatmap(np.full((8, 8), 1.5, np.float32), 3 * S), 'values outside of 0 to 1'),
        (heatmap_at(2.0), 'not newer than the last'),
        (heatmap_at(1.5), 'not newer than the last'),
        (heatmap_at(60.0), 'stamp in the future'),
    ],
)
def test_unusable_heatmaps_are_counted_with_their_reason(core, heatmap, reason):
    for time_s in np.arange(0.0, 4.0, 0.2):
        core.add_pose(pose_at(time_s))
    core.add_heatmap(heatmap_at(2.0))
    core.step(3 * S, telemetry_at(3.0), 0.0)
    core.add_heatmap(heatmap)
    counts = core.step(3 * S, telemetry_at(3.0), 0.0).counts
    assert counts[reason] == 1
    assert counts['used'] == 1


@pytest.mark.parametrize(
    ('stamps_s', 'heatmap_s', 'reason'),
    [
        ((5.0, 5.1), 4.0, 'older than every pose'),
        ((5.0, 7.0), 6.0, 'poses around it are too far apart'),
        ((5.0, 5.1), 5.5, 'no pose after its stamp'),
    ],
)
def test_heatmaps_without_a_pose_are_counted(core, stamps_s, heatmap_s, reason):
    for stamp_s in stamps_s:
        core.add_pose(pose_at(stamp_s))
    core.add_heatmap(heatmap_at(heatmap_s))
    for now_s in (7.0, 8.5):
        counts = core.step(round(now_s * S), telemetry_at(now_s), 0.0).counts
    assert counts[reason] == 1
    assert 'used' not in counts


def test_a_heatmap_from_the_future_does_not_block_those_that_follow(core):
    core.add_pose(pose_at(1.0))
    core.add_heatmap(heatmap_at(50.0))
    core.step(S, telemetry_at(1.0), 0.0)
    assert fed(core, 1.2, 2.0).counts['used'] == 4


def test_a_pose_that_is_not_finite_is_not_used(core):
    core.add_pose(Pose(S, 0.0, 0.0, -50.0, LEVEL, nan))
    assert core.step(S, telemetry_at(1.0), 0.0).counts == {'pose rejected': 1}


@pytest.mark.parametrize(
    ('changes', 'age_s', 'word'),
    [
        ({}, 3.0, 'old'),
        ({}, nan, 'old'),
        ({'pose': None}, 0.1, 'where it is'),
        ({'pose': pose_at(6.0, nan)}, 0.1, 'not valid'),
        ({'pose': pose_at(6.0, -3.0)}, 0.1, 'not valid'),
        ({'landed': True}, 0.1, 'on the ground'),
    ],
)
def test_bad_telemetry_stops_and_good_telemetry_goes_on(core, changes, age_s, word):
    core.engage()
    assert fed(core, 1.0, 5.0).state is State.AIMING
    decision = core.step(5 * S, telemetry_at(5.0, **changes), age_s)
    assert decision.state is State.HOLD
    assert decision.setpoint.is_zero
    assert word in decision.reason
    assert fed(core, 5.2, 8.0).state is State.AIMING


def test_waits_for_control_but_does_not_call_its_absence_a_takeover(core):
    core.engage()
    core.step(S, telemetry_at(1.0, in_control=False), 0.1)
    decision = core.step(2 * S, telemetry_at(2.0, in_control=False, mode='LOITER'), 0.1)
    assert decision.state is State.HOLD
    assert 'LOITER' in decision.reason
    assert fed(core, 2.2, 6.0).state is State.AIMING


def test_disengaging_stops(core):
    core.engage()
    assert not fed(core, 1.0, 6.0).setpoint.is_zero
    core.disengage()
    decision = fed(core, 6.0, 6.3)
    assert decision.state is State.IDLE
    assert decision.setpoint.is_zero


def test_a_clock_that_jumps_back_forgets_the_map(core):
    core.engage()
    assert fed(core, 100.0, 105.0).site is not None
    decision = core.step(S, telemetry_at(1.0), 0.1)
    assert decision.state is State.HOLD
    assert decision.setpoint.is_zero
    assert fed(core, 1.2, 5.0).state is State.AIMING


TROUBLES = (
    'none', 'no heatmaps', 'unsafe', 'flicker', 'old telemetry', 'no altitude', 'no position',
    'pilot', 'gust', 'lag', 'person', 'engage', 'disengage',
)  # fmt: skip
FLIGHTS = max(12, int(os.environ.get('PEACE_SEQUENCES', '5000')) // 300)


@settings(
    max_examples=FLIGHTS,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(
    altitude_m=st.floats(21.0, 60.0),
    troubles=st.lists(st.sampled_from(TROUBLES), min_size=3, max_size=8),
    island=st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0), st.floats(5.0, 14.0)),
)
def test_whatever_happens_it_is_safe(
    *, flight_over, make_vehicle, make_ground, altitude_m, troubles, island
):
    """Every trouble lasts two seconds; each step is held against the promises."""
    flight = flight_over(
        make_ground().disc(*island),
        vehicle=make_vehicle(altitude_m=altitude_m),
        size_px=48,
        map_parameters=MapParameters(map_size_m=80.0, map_cell_m=1.0),
    )
    aborted = False
    for trouble in (*troubles, 'none', 'none'):
        aborted &= trouble != 'engage'
        _begin(trouble, flight)
        for _ in range(20):
            decision = _step(trouble, flight)
            aborted |= decision.state is State.ABORTED
            _check(flight, decision, must_stand=aborted or trouble in _BLINDING)
        if trouble == 'disengage' and not aborted:
            flight.core.engage()


def _begin(trouble, flight):
    """Let a trouble begin, and the one before it end."""
    flight.spoil = _SPOILS.get(trouble, _unspoilt)
    flight.telemetry_age_s = 5.0 if trouble == 'old telemetry' else 0.05
    flight.in_control = trouble != 'pilot'
    flight.vehicle.drift_m_s = 3.0 if trouble == 'gust' else 0.0
    flight.latency_s = 1.2 if trouble == 'lag' else 0.2
    if trouble == 'person':
        flight.ground.disc(flight.vehicle.north_m, flight.vehicle.east_m, 1.0, 0.0)
    if trouble == 'engage':
        flight.core.engage()
    if trouble == 'disengage':
        flight.core.disengage()


def _step(trouble, flight):
    """Fly a step; a number that the autopilot does not know is not known for this step."""
    lost = {'no altitude': 'altitude_m', 'no position': 'north_m'}.get(trouble)
    if lost is None:
        return flight.step()
    known = getattr(flight.vehicle, lost)
    setattr(flight.vehicle, lost, nan)
    decision = flight.step()
    setattr(flight.vehicle, lost, known)
    return decision


def _check(flight, decision, *, must_stand):
    p, setpoint = flight.parameters, decision.setpoint
    _, pose, _ = flight.log[-1]
    if decision.state in STILL_STATES or must_stand:
        assert setpoint.is_zero
    if setpoint.v_down_m_s > 0.0:
        site = decision.site
        assert decision.verdict.kind is VerdictKind.SITE
        assert over_site(pose, site, p.safety_radius_m)
        assert decision.map_age_s <= p.descent_heatmap_age_limit_s
        assert pose.altitude_agl_m > p.handover_altitude_m
    assert decision.effective_threshold == p.safety_threshold
    assert flight.vehicle.altitude_m >= p.handover_altitude_m - 1.0


def _unspoilt(safety, _time_s):
    return safety


_BLINDING = {'old telemetry', 'no altitude', 'no position'}
_SPOILS = {
    'flicker': lambda safety, t: safety if round(5 * t) % 2 else 0.0 * safety,
    'no heatmaps': lambda _safety, _t: None,
    'unsafe': lambda safety, _t: 0.0 * safety,
}


def test_a_site_counts_as_below_only_when_the_ground_was_just_seen(core):
    core.engage()
    site = fed(core, 1.0, 6.0).site
    low = Pose(0, site.north_m, site.east_m, -30.0, LEVEL, 30.0)
    seen = core._lookout.look(6 * S, low, State.LANDING, 0.0)
    for is_fresh in (True, False):
        sighting = replace(seen, ground_is_fresh=is_fresh)
        known = Situation(6 * S, low, 0.1, sighting, site)
        assert core._helm._events(known, '').over_site is is_fresh


def test_below_the_safe_altitude_a_site_must_lie_around_the_vehicle(core):
    core.engage()
    site = fed(core, 1.0, 6.0).site
    aside_m = site.north_m + site.clearance_m + 1.0
    high = Pose(0, aside_m, site.east_m, -60.0, LEVEL, 60.0)
    assert core._lookout.reachable(high) is site
    assert core._lookout.reachable(replace(high, altitude_agl_m=40.0)) is None
    assert core._lookout.reachable(replace(high, north_m=site.north_m, altitude_agl_m=40.0)) is site


def test_while_it_lands_the_site_may_not_wander_beyond_its_clearance(core):
    begun = Site(0.0, 0.0, 4.0, 50.0, 0.9, 0.0)
    core._lookout._anchor = begun
    assert (
        core._lookout.anchored(Verdict.found(replace(begun, east_m=3.9))).kind is VerdictKind.SITE
    )
    wandered = core._lookout.anchored(Verdict.found(replace(begun, east_m=4.1)))
    assert wandered.kind is VerdictKind.NO_ZONE
    assert '4.0 m' in wandered.reason
