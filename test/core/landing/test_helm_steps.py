# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The helm step by step: what a decision tells, and at which limits its events begin."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from peace_ros.core.domain import Pose, Site, Telemetry
from peace_ros.core.landing import Decision, Focus, LandingParameters, State, Verdict
from peace_ros.core.landing.heights import NO_OTHER_HEIGHT, HeightSight
from peace_ros.core.landing.helm import Helm
from peace_ros.core.landing.situation import Sighting

S = 1_000_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)
P = LandingParameters(sensor_warm_up_cycles=5)
NONE = Verdict.no_zone('nothing is known yet')


def pose_of(altitude_m: float = 60.0, north_m: float = 0.0, east_m: float = 0.0) -> Pose:
    return Pose(0, north_m, east_m, -altitude_m, LEVEL, altitude_m)


def site_at(north_m: float = 0.0, east_m: float = 0.0, clearance_m: float = 6.0) -> Site:
    return Site(north_m, east_m, clearance_m, 200.0, 0.9, 0.2)


class Steps:
    """A helm, and what it is told; everything good over no site."""

    def __init__(self, parameters: LandingParameters = P, state: State | None = None) -> None:
        self.helm = Helm(parameters) if state is None else Helm.engaged_in(parameters, state)
        self.at_s = 100.0
        self.revision = 10
        self.telemetry = Telemetry(1, pose_of(), armed=True, in_control=True, mode='GUIDED')
        self.age_s = 0.1
        self.sighting = Sighting(NONE, None, True, 0.9, 0.1, 5, 0.1, 10, 0.8)

    def step(
        self,
        pose: Pose | None = None,
        site: Site | None = None,
        *,
        later_s: float = 0.1,
        frames: int = 0,
        rejection: str = '',
        heights: HeightSight = NO_OTHER_HEIGHT,
        **sighting: object,
    ) -> Decision:
        self.at_s += later_s
        self.revision += frames
        self.sighting = replace(
            self.sighting,
            verdict=NONE if site is None else Verdict.found(site),
            reachable=site,
            revision=self.revision,
            **sighting,
        )
        telemetry = replace(self.telemetry, pose=pose or pose_of())
        return self.helm.decide(
            round(self.at_s * S), telemetry, self.age_s, self.sighting, rejection, heights
        )


def test_before_engaging_it_stands_idle() -> None:
    steps = Steps()
    assert steps.helm.state is State.IDLE
    decision = steps.step(focus=Focus(1.0, 2.0, 3.0))
    assert decision.state is State.IDLE
    assert decision.reason == 'not engaged'
    assert decision.setpoint.is_zero
    assert decision.setpoint.stamp_ns == 5
    assert decision.verdict is NONE
    assert decision.effective_threshold == 0.8
    assert decision.map_age_s == 0.1
    assert decision.focus == Focus(1.0, 2.0, 3.0)
    assert decision.guard_notes == ()
    assert decision.outcome is None
    assert decision.time_in_state_s == 0.0
    assert decision.relaxed is False
    assert steps.step(later_s=2.5).time_in_state_s == pytest.approx(2.5)


def test_engaging_begins_a_search_and_disengaging_ends_it() -> None:
    steps = Steps()
    steps.step()
    steps.helm.engage()
    decision = steps.step(later_s=0.5)
    assert (decision.state, decision.reason) == (State.SEARCHING, 'engaged: searching; looking')
    assert decision.time_in_state_s == 0.0
    assert steps.step(later_s=1.5).time_in_state_s == pytest.approx(1.5)
    steps.helm.disengage()
    decision = steps.step()
    assert (decision.state, decision.reason) == (State.IDLE, 'not engaged')
    steps.helm.engage()
    assert steps.step().state is State.SEARCHING


def test_engaging_anew_begins_a_search_in_any_state() -> None:
    for state in (State.LANDING, State.HANDOVER, State.ABORTED, State.HOLD):
        steps = Steps(state=state)
        steps.helm.engage()
        assert steps.step(pose_of(30.0), site_at()).state is State.SEARCHING
        assert steps.step(pose_of(30.0), site_at()).state is State.SEARCHING, 'once'


def test_a_clock_that_begins_anew_begins_the_state_anew() -> None:
    steps = Steps(state=State.SEARCHING)
    steps.step()
    steps.step(later_s=50.0)
    steps.at_s = 3.0
    steps.helm.restart_clock(3 * S)
    assert steps.step(later_s=0.5).time_in_state_s == pytest.approx(0.5)


def test_a_site_is_chosen_once_enough_was_seen_since_the_state_began() -> None:
    steps = Steps()
    steps.helm.engage()
    assert steps.step(site=site_at(), frames=3).state is State.SEARCHING
    for _ in range(4):
        assert steps.step(site=site_at(), frames=1).state is State.SEARCHING
    assert steps.step(site=site_at(), frames=1).state is State.AIMING
    again = Steps(state=State.WAITING)
    again.revision = 4
    assert again.step(site=site_at()).state is State.WAITING, 'counted from zero in a trial'
    assert again.step(site=site_at(), frames=1).state is State.AIMING


@pytest.mark.parametrize(
    ('altitude_m', 'aside_m', 'fresh', 'state'),
    [
        (56.0, 0.0, True, State.LANDING),
        (56.1, 0.0, True, State.AIMING),
        (56.0, 4.5, True, State.LANDING),
        (56.0, 4.6, True, State.AIMING),
        (56.0, 0.0, False, State.AIMING),
    ],
)
def test_a_descent_begins_over_the_site_near_the_floor_of_aiming(
    altitude_m: float, aside_m: float, fresh: bool, state: State
) -> None:
    steps = Steps(state=State.AIMING)
    decision = steps.step(pose_of(altitude_m, aside_m), site_at(), ground_is_fresh=fresh)
    assert decision.state is state


@pytest.mark.parametrize(
    ('altitude_m', 'aside_m', 'fresh', 'state'),
    [
        (20.3, 0.0, True, State.HANDOVER),
        (20.31, 0.0, True, State.LANDING),
        (20.3, 1.0, True, State.HANDOVER),
        (20.3, 1.01, True, State.LANDING),
        (20.3, 0.0, False, State.LANDING),
    ],
)
def test_it_is_handed_over_low_and_in_the_middle(
    altitude_m: float, aside_m: float, fresh: bool, state: State
) -> None:
    steps = Steps(state=State.LANDING)
    decision = steps.step(pose_of(altitude_m, aside_m), site_at(), ground_is_fresh=fresh)
    assert decision.state is state
    assert decision.outcome == ('handover' if state is State.HANDOVER else None)


def test_bad_data_hold_and_their_site_does_not_count() -> None:
    steps = Steps(state=State.LANDING)
    steps.age_s = 0.8
    decision = steps.step(pose_of(30.0), site_at(2.0))
    assert decision.state is State.HOLD
    assert decision.reason == 'telemetry is 0.8 s old, limit 0.7 s: check the connection'
    assert decision.setpoint.is_zero
    assert decision.outcome is None
    steps.age_s = 0.1
    assert steps.step(map_age_s=2.1, rejection='too dark').reason == (
        'the newest heatmap is 2.1 s old, limit 2.0 s: the last one was rejected: too dark'
    )
    assert steps.step(map_age_s=inf).state is State.HOLD
    assert steps.step(map_age_s=0.1).state is State.SEARCHING


def test_heights_that_disagree_hold_with_their_sentence() -> None:
    steps = Steps(state=State.LANDING)
    doubt = HeightSight('20.2 m by the autopilot and 12.2 m by pictures', heights_m={'GNSS': 13.0})
    decision = steps.step(pose_of(30.0), site_at(), heights=doubt)
    assert decision.state is State.HOLD
    assert decision.reason == doubt.problem
    assert decision.setpoint.is_zero
    assert decision.heights_m == {'GNSS': 13.0}
    assert steps.step(pose_of(30.0), site_at()).state is State.SEARCHING


def test_the_lowest_height_decides_on_hand_over_and_the_end_of_aiming() -> None:
    above = HeightSight(above_lowest_m=2.0)
    steps = Steps(state=State.LANDING)
    assert steps.step(pose_of(22.4), site_at(), heights=above).state is State.LANDING
    waits = replace(above, may_hand_over=False)
    assert steps.step(pose_of(22.3), site_at(), heights=waits).state is State.LANDING
    assert steps.step(pose_of(22.3), site_at(), heights=above).state is State.HANDOVER
    steps = Steps(state=State.AIMING)
    assert steps.step(pose_of(58.1), site_at(), heights=above).state is State.AIMING
    assert steps.step(pose_of(57.9), site_at(), heights=above).state is State.LANDING


def test_a_climb_ends_where_the_lowest_height_is_safe() -> None:
    steps = Steps(state=State.CLIMBING)
    above = HeightSight(above_lowest_m=5.0)
    assert steps.step(pose_of(53.9), heights=above).state is State.CLIMBING
    assert steps.step(pose_of(54.0), heights=above).state is State.RESTARTING


def test_a_takeover_aborts_for_good() -> None:
    steps = Steps(state=State.LANDING)
    steps.step(pose_of(30.0), site_at())
    steps.telemetry = replace(steps.telemetry, in_control=False, mode='LOITER')
    decision = steps.step(pose_of(30.0), site_at())
    assert decision.state is State.ABORTED
    assert 'mode LOITER without our request' in decision.reason
    assert decision.outcome == 'aborted'
    steps.telemetry = replace(steps.telemetry, in_control=True)
    assert steps.step(pose_of(30.0), site_at()).state is State.ABORTED


def test_what_was_engaged_before_is_no_takeover_of_now() -> None:
    steps = Steps()
    steps.step()
    steps.telemetry = replace(steps.telemetry, in_control=False, mode='LOITER')
    steps.step()
    steps.helm.engage()
    steps.step()
    assert steps.step().state is State.HOLD, 'nobody took over what was not engaged'


def test_a_relaxed_threshold_is_told() -> None:
    steps = Steps(state=State.SEARCHING)
    decision = steps.step(threshold=0.74)
    assert decision.relaxed is True
    assert decision.effective_threshold == 0.74
    assert decision.reason.endswith('; looking; threshold relaxed to 0.74')


def test_what_motion_waits_for_and_what_limits_it_are_told() -> None:
    steps = Steps(state=State.LANDING)
    decision = steps.step(pose_of(40.0, 4.0), site_at())
    assert decision.reason == (
        'the trial begins in LANDING; 4.0 m beside the site: descends within 2.2 m'
    )
    assert decision.guard_notes == ('acceleration limited',)


@pytest.mark.parametrize(('hold_s', 'moves'), [(5.9, False), (6.0, True)])
def test_a_search_looks_before_it_moves(hold_s: float, moves: bool) -> None:
    steps = Steps(state=State.SEARCHING)
    steps.step(later_s=0.0)
    assert steps.step(later_s=hold_s).reason.endswith('square' if moves else 'looking')


def flown_to(steps: Steps, *, frames: int = 60) -> tuple[float, float]:
    """Follow the set-points of a search; return the farthest it went to the north and east."""
    north = east = far_north = far_east = 0.0
    for _ in range(frames):
        decision = steps.step(pose_of(60.0, north, east), later_s=0.5)
        north += 0.5 * decision.setpoint.v_north_m_s
        east += 0.5 * decision.setpoint.v_east_m_s
        far_north, far_east = max(far_north, north), max(far_east, east)
    return far_north, far_east


def test_a_search_is_flown_around_where_the_landing_began() -> None:
    steps = Steps(state=State.SEARCHING)
    steps.step()
    decision = steps.step(pose_of(60.0, 200.0, 0.0), later_s=6.0)
    assert decision.setpoint.v_north_m_s < 0.0


@pytest.mark.parametrize(('fence_m', 'flies'), [(0.0, True), (66.0, True), (64.0, False)])
def test_a_search_turns_five_metres_before_the_fence(fence_m: float, flies: bool) -> None:
    parameters = replace(P, geofence_radius_m=fence_m)
    steps = Steps(parameters, State.SEARCHING)
    far_north, _ = flown_to(steps)
    assert (far_north > 50.0) == flies


def test_a_budget_that_is_used_up_ends_the_landing() -> None:
    steps = Steps(replace(P, max_total_s=10.0), State.SEARCHING)
    steps.step()
    assert steps.step(later_s=9.0).outcome is None
    decision = steps.step(later_s=1.2)
    assert decision.state is State.HOLD
    assert decision.reason == 'not landed within 10 s: holding'
    assert decision.outcome == 'no_zone'


def test_a_site_seen_with_bad_data_is_no_site() -> None:
    steps = Steps(replace(P, max_total_s=10.0), State.SEARCHING)
    steps.age_s = 0.8
    for _ in range(3):
        steps.step(site=site_at())
    steps.age_s = 0.1
    assert steps.step(later_s=11.0).outcome == 'no_zone', 'and not "timeout": none was known'


@pytest.mark.parametrize(
    ('state', 'age_s', 'counted_s'),
    [(State.SEARCHING, 0.1, 4.0), (State.SEARCHING, 0.8, 0.0), (State.WAITING, 0.1, 0.0)],
)
def test_time_without_a_site_counts_in_a_search_with_good_data(
    state: State, age_s: float, counted_s: float
) -> None:
    steps = Steps(state=state)
    steps.step(later_s=0.0)
    steps.age_s = age_s
    steps.step(later_s=4.0)
    assert steps.helm.without_site_s == pytest.approx(counted_s)


def test_bad_data_during_a_return_end_nothing() -> None:
    steps = Steps(replace(P, max_total_s=10.0, budget_policy='return'), State.SEARCHING)
    steps.step(pose_of(60.0, 50.0))
    assert steps.step(pose_of(60.0, 90.0), later_s=11.0).state is State.RETURNING
    steps.age_s = 0.8
    decision = steps.step(pose_of(60.0, 90.0))
    assert decision.state is State.HOLD
    assert decision.outcome is None
    steps.age_s = 0.1
    assert steps.step(pose_of(60.0, 90.0)).state is State.RETURNING


@pytest.mark.parametrize(('aside_m', 'state'), [(3.1, State.RETURNING), (2.9, State.HOLD)])
def test_a_return_ends_within_three_metres(aside_m: float, state: State) -> None:
    parameters = replace(P, max_total_s=10.0, budget_policy='return')
    steps = Steps(parameters, State.SEARCHING)
    steps.step(pose_of(60.0, 50.0, 40.0))
    decision = steps.step(pose_of(60.0, 90.0, 40.0), later_s=11.0)
    assert decision.state is State.RETURNING
    assert decision.outcome is None
    decision = steps.step(pose_of(60.0, 50.0, 40.0 + aside_m))
    assert decision.state is state
    assert decision.outcome == (None if state is State.RETURNING else 'no_zone')


def test_home_is_where_it_was_engaged() -> None:
    parameters = replace(P, max_total_s=10.0, budget_policy='return')
    steps = Steps(parameters)
    steps.step(pose_of(60.0, -500.0, 0.0))
    steps.helm.engage()
    steps.step(pose_of(60.0, 0.0, 30.0))
    steps.step(pose_of(60.0, 0.0, 60.0), later_s=11.0)
    for _ in range(20):
        decision = steps.step(pose_of(60.0, 0.0, 60.0), later_s=0.4)
    assert decision.setpoint.v_north_m_s == 0.0
    assert decision.setpoint.v_east_m_s == pytest.approx(-4.0)


def test_the_last_attempt_flies_to_the_best_place_seen() -> None:
    parameters = replace(P, max_total_s=10.0, budget_policy='best_site')
    steps = Steps(parameters, State.SEARCHING)
    steps.step()
    best = site_at(30.0, -40.0)
    decision = steps.step(later_s=11.0, best=best)
    assert decision.state is State.SEARCHING
    for _ in range(20):
        decision = steps.step(later_s=0.4, best=best)
    assert decision.setpoint.v_north_m_s == pytest.approx(2.4)
    assert decision.setpoint.v_east_m_s == pytest.approx(-3.2)
    decision = steps.step(best=None)
    assert decision.state is State.HOLD, 'there is no place left'
    assert decision.outcome == 'no_zone'


def test_failed_descents_are_counted_and_time_without_a_site_is_told() -> None:
    steps = Steps(replace(P, max_attempts=2), State.SEARCHING)
    steps.step()
    steps.step(later_s=4.0)
    assert steps.helm.without_site_s == pytest.approx(4.0)
    assert steps.helm.attempts == 0
    steps.helm.fail_attempt()
    steps.helm.fail_attempt()
    assert steps.helm.attempts == 2
    assert steps.step().reason == (
        '2 descents failed, limit 2 (the last: the trial begins in SEARCHING): holding'
    )
    steps.helm.engage()
    assert steps.helm.attempts == 0
    assert steps.helm.without_site_s == 0.0


def test_a_reason_is_told_as_it_began_while_only_its_numbers_change() -> None:
    steps = Steps(state=State.LANDING)
    steps.age_s = 0.8
    first = steps.step(pose_of(30.0)).reason
    assert 'telemetry is 0.8 s old' in first
    steps.age_s = 12.3
    assert steps.step(pose_of(30.0)).reason == first
    steps.age_s = 0.1
    assert 'heatmap is 9.9 s old' in steps.step(pose_of(30.0), map_age_s=9.9).reason
    assert 'searching' in steps.step(pose_of(30.0), map_age_s=0.1).reason


def led(altitude_m: float, aside_m: float, bias_m_s: float) -> tuple[float, float]:
    """Hold the vehicle beside its site, drifting; return north and east speed at the end."""
    steps = Steps(state=State.AIMING)
    north = 0.0
    for _ in range(300):
        stamp_ns = round((steps.at_s + 0.1) * S)
        pose = replace(pose_of(altitude_m, north), stamp_ns=stamp_ns)
        decision = steps.step(pose, site_at(north + aside_m, 0.0, 40.0))
        told = decision.setpoint.v_north_m_s
        north += 0.1 * (told + bias_m_s)
    return decision.setpoint.v_north_m_s, decision.setpoint.v_east_m_s


@pytest.mark.parametrize(
    ('altitude_m', 'aside_m', 'bias_m_s', 'speed'),
    [
        # 0.35/s of the error (0.5/s low down), and all but 0.1 m/s of a drift of 0.5 m/s.
        (60.0, 2.0, 0.0, 0.7),
        (60.0, 2.0, 0.5, 0.3),
        (60.0, 2.0, -0.5, 1.1),
        (60.0, 4.0, -0.5, 1.8),
        (60.0, 20.0, -0.5, 5.0),
        (40.0, 20.0, -0.5, 1.5),
        (40.0, 2.0, -0.5, 1.4),
    ],
)
def test_a_drift_is_made_up_for_up_to_the_limit_of_the_altitude(
    altitude_m: float, aside_m: float, bias_m_s: float, speed: float
) -> None:
    north, east = led(altitude_m, aside_m, bias_m_s)
    assert north == pytest.approx(speed, abs=0.03)
    assert east == pytest.approx(0.0, abs=1e-6)
