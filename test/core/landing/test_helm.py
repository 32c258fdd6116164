# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The helm without a map: budgets and their policies, the search, and a way out of every state."""

from dataclasses import dataclass, field, replace
from math import hypot

import pytest

from peace_ros.core.domain import Pose, Setpoint, Site, Telemetry
from peace_ros.core.landing import Decision, LandingParameters, State, Verdict
from peace_ros.core.landing.helm import Helm
from peace_ros.core.landing.situation import Sighting
from peace_ros.core.landing.states import STILL_STATES

LEVEL = (1.0, 0.0, 0.0, 0.0)
STEP_S = 0.1
LAWN = Site(20.0, -10.0, 8.0, 200.0, 0.9, 0.2)
FINAL = {State.IDLE, State.ABORTED, State.HANDOVER}


@dataclass
class Trip:
    """A vehicle that does at once what it is told, over a lawn or over nothing."""

    parameters: LandingParameters = field(default_factory=LandingParameters)
    lawn: Site | None = None
    best: Site | None = None
    altitude_m: float = 70.0
    north_m: float = 0.0
    east_m: float = 0.0
    battery: float | None = None
    state: State | None = None
    time_s: float = 0.0
    log: list[Decision] = field(default_factory=list)
    lowest_m: float = 1e9

    def __post_init__(self) -> None:
        self.helm = Helm(self.parameters)
        if self.state is None:
            self.helm.engage()
        else:
            self.helm = Helm.engaged_in(self.parameters, self.state)

    @property
    def home_m(self) -> float:
        return hypot(self.north_m, self.east_m)

    def sighting(self, pose: Pose) -> Sighting:
        lawn = self.lawn
        high = pose.altitude_agl_m >= 49.0
        near = lawn is not None and lawn.distance_m(pose) <= lawn.clearance_m
        return Sighting(
            verdict=Verdict.no_zone('nothing') if lawn is None else Verdict.found(lawn),
            reachable=lawn if high or near else None,
            ground_is_fresh=near,
            ground_score=0.9 if near else 0.0,
            ground_age_s=0.2,
            stamp_ns=1,
            map_age_s=0.2,
            revision=int(self.time_s / 0.2),
            threshold=0.8,
            best=self.best,
        )

    def step(self, **changes) -> Decision:
        now_ns = round((100.0 + self.time_s) * 1e9)
        pose = Pose(now_ns, self.north_m, self.east_m, -self.altitude_m, LEVEL, self.altitude_m)
        told = Telemetry(
            1, pose, armed=True, in_control=True, mode='GUIDED', battery_remaining=self.battery
        )
        told = replace(told, **changes)
        command = self.helm.decide(now_ns, told, 0.05, self.sighting(pose))
        self.log.append(command)
        self.fly(command.setpoint)
        return command

    def fly(self, setpoint: Setpoint) -> None:
        self.north_m += setpoint.v_north_m_s * STEP_S
        self.east_m += setpoint.v_east_m_s * STEP_S
        self.altitude_m -= setpoint.v_down_m_s * STEP_S
        self.lowest_m = min(self.lowest_m, self.altitude_m)
        self.time_s += STEP_S

    def run(self, limit_s: float) -> Decision:
        command = self.step()
        while self.time_s < limit_s and command.outcome is None:
            command = self.step()
        return command

    @property
    def states(self) -> list[State]:
        found: list[State] = []
        for command in self.log:
            if not found or found[-1] is not command.state:
                found.append(command.state)
        return found


@pytest.mark.parametrize('altitude_m', [30.0, 70.0])
@pytest.mark.parametrize('state', State)
def test_from_every_state_good_data_lead_to_the_handover(state, altitude_m):
    lawn = replace(LAWN, north_m=2.0, east_m=1.0)
    trip = Trip(lawn=lawn, altitude_m=altitude_m, state=state)
    if state in FINAL:
        assert trip.step().state in {state, State.SEARCHING}
        trip.helm.engage()
        trip.log.clear()
    assert trip.run(120.0).outcome == 'handover', trip.states
    assert 20.0 <= trip.lowest_m <= 20.4


@pytest.mark.parametrize('policy', ['hold', 'return', 'best_site'])
@pytest.mark.parametrize('state', sorted(set(State) - FINAL))
def test_from_every_state_nothing_safe_leads_to_an_end(state, policy):
    parameters = LandingParameters(budget_policy=policy, max_search_s=20.0, max_total_s=60.0)
    trip = Trip(parameters, altitude_m=45.0, state=state)
    command = trip.run(300.0)
    assert command.outcome == 'no_zone', trip.states
    assert command.state is State.HOLD
    assert trip.lowest_m >= 45.0


def test_holding_is_the_end_of_every_budget_unless_told_otherwise():
    trip = Trip(LandingParameters(max_total_s=10.0), LAWN)
    command = trip.run(20.0)
    assert command.state is State.HOLD
    assert command.outcome == 'timeout'
    assert 'not landed within 10 s: holding' in command.reason
    assert all(trip.step().setpoint.is_zero for _ in range(20))


def test_returns_to_where_the_landing_began_and_holds_there():
    parameters = LandingParameters(max_search_s=30.0, budget_policy='return')
    trip = Trip(parameters, altitude_m=60.0)
    while trip.helm.state is not State.RETURNING:
        command = trip.step()
        assert trip.time_s < 60.0
    assert command.outcome is None
    assert 'returning' in command.reason
    assert trip.home_m > 20.0
    command = trip.run(120.0)
    assert command.outcome == 'no_zone'
    assert command.state is State.HOLD
    assert trip.home_m < 4.0
    assert trip.lowest_m >= 60.0


def test_a_return_from_below_climbs_before_it_moves():
    parameters = LandingParameters(max_total_s=10.0, budget_policy='return')
    trip = Trip(parameters, altitude_m=30.0, north_m=50.0, state=State.HOLD)
    trip.step()
    trip.helm._home = Pose(0, 0.0, 0.0, -30.0, LEVEL, 30.0)
    for _ in range(100):
        trip.step()
    trip.altitude_m = 30.0
    command = trip.step()
    assert command.state is State.RETURNING
    assert command.setpoint.v_down_m_s < 0.0
    assert (command.setpoint.v_north_m_s, command.setpoint.v_east_m_s) == (0.0, 0.0)
    trip.run(200.0)
    assert trip.home_m < 4.0


def test_a_return_that_cannot_be_flown_ends_too():
    parameters = LandingParameters(max_total_s=10.0, budget_policy='return', policy_time_s=5.0)
    trip = Trip(parameters)
    for _ in range(95):
        trip.step()
    trip.fly = lambda _setpoint: setattr(trip, 'time_s', trip.time_s + STEP_S)
    trip.north_m = 80.0
    assert trip.run(40.0).outcome == 'no_zone'
    assert 14.0 < trip.time_s < 17.0


def test_without_a_position_there_is_no_return():
    parameters = LandingParameters(max_total_s=10.0, budget_policy='return')
    trip = Trip(parameters)
    for _ in range(150):
        command = trip.step(pose=None)
        assert command.setpoint.is_zero
    assert command.state is State.HOLD


def test_the_last_attempt_goes_to_the_best_place_and_lands_by_the_usual_checks():
    parameters = LandingParameters(max_total_s=10.0, budget_policy='best_site')
    trip = Trip(parameters, lawn=LAWN)
    assert trip.run(120.0).outcome == 'handover'
    assert trip.time_s > 20.0
    assert hypot(trip.north_m - LAWN.north_m, trip.east_m - LAWN.east_m) < 1.0


def test_the_last_attempt_flies_to_a_place_out_of_view_and_never_down_without_a_site():
    parameters = LandingParameters(max_search_s=8.0, budget_policy='best_site', policy_time_s=60.0)
    trip = Trip(parameters, best=replace(LAWN, north_m=40.0))
    command = trip.run(200.0)
    assert command.outcome == 'no_zone'
    assert command.state is State.HOLD
    assert hypot(trip.north_m - 40.0, trip.east_m - LAWN.east_m) < 5.0
    assert trip.lowest_m >= 70.0


def test_a_last_attempt_that_fails_is_the_last():
    parameters = LandingParameters(max_total_s=10.0, budget_policy='best_site')
    trip = Trip(parameters, lawn=LAWN, best=LAWN)
    for _ in range(110):
        trip.step()
    trip.helm.fail_attempt()
    command = trip.step()
    assert command.state is State.HOLD
    assert command.outcome == 'timeout'


def test_failed_descents_are_limited():
    trip = Trip(LandingParameters(max_attempts=2), lawn=LAWN)
    trip.step()
    trip.helm.fail_attempt()
    assert trip.step().outcome is None
    trip.helm.fail_attempt()
    command = trip.step()
    assert command.outcome == 'no_zone'
    assert '2 descents failed, limit 2' in command.reason


@pytest.mark.parametrize(
    ('battery', 'ends'),
    [(0.31, False), (0.3, True), (0.0, True), (float('nan'), True), (None, False)],
)
def test_a_battery_at_its_reserve_ends_the_landing(battery, ends):
    trip = Trip(LandingParameters(battery_reserve=0.3), lawn=LAWN, battery=battery)
    command = trip.run(3.0)
    assert (command.outcome == 'battery') is ends
    assert ('reserve 30%' in command.reason) is ends


def test_the_battery_is_left_to_the_autopilot_unless_a_reserve_is_given():
    assert Trip(lawn=LAWN, battery=0.0).run(3.0).outcome is None


def test_the_way_of_a_search_is_limited():
    trip = Trip(LandingParameters(search_distance_m=50.0))
    command = trip.run(100.0)
    assert command.outcome == 'no_zone'
    assert '50 m of searching' in command.reason
    assert 11.0 < trip.time_s < 30.0


def test_the_search_stays_within_the_fence():
    trip = Trip(
        LandingParameters(geofence_radius_m=50.0, search_spacing_m=30.0, max_search_s=120.0)
    )
    farthest_m = 0.0
    for _ in range(1100):
        command = trip.step()
        farthest_m = max(farthest_m, trip.home_m)
        assert not command.guard_notes or 'fence' not in ' '.join(command.guard_notes)
    assert 30.0 < farthest_m < 50.0


def test_zero_in_every_state_that_stands():
    for state in STILL_STATES - FINAL:
        trip = Trip(LandingParameters(giveup_after_s=60.0), state=state)
        command = trip.step(landed=True)
        assert command.setpoint.is_zero


BELOW = Site(0.0, 0.0, 8.0, 200.0, 0.9, 0.2)


def decided(helm, *, time_s=0.0, altitude_m=70.0, north_m=0.0, revision=100, **seen) -> Decision:
    """One step with everything good over a site, but for what is given."""
    now_ns = round((1000.0 + time_s) * 1e9)
    pose = Pose(now_ns, north_m, 0.0, -altitude_m, LEVEL, altitude_m)
    told = Telemetry(1, pose, armed=True, in_control=True, mode='GUIDED')
    site = seen.pop('site', BELOW)
    known = {
        'verdict': Verdict.no_zone('none') if site is None else Verdict.found(site),
        'reachable': site,
        'ground_is_fresh': True,
        'ground_score': 0.9,
        'ground_age_s': 0.2,
        'stamp_ns': now_ns,
        'map_age_s': 0.2,
        'revision': revision,
        'threshold': 0.8,
    }
    return helm.decide(now_ns, told, 0.05, Sighting(**{**known, **seen}))


def test_a_site_is_chosen_after_the_warm_up_counted_from_the_begin_of_the_state():
    helm = Helm(LandingParameters())
    helm.engage()
    assert decided(helm, revision=100).state is State.SEARCHING
    assert decided(helm, time_s=0.1, revision=104).state is State.SEARCHING
    assert decided(helm, time_s=0.2, revision=105).state is State.AIMING
    assert decided(helm, time_s=0.3, revision=106, site=None).state is State.WAITING
    assert decided(helm, time_s=0.4, revision=110).state is State.WAITING
    assert decided(helm, time_s=0.5, revision=111).state is State.AIMING


@pytest.mark.parametrize(
    ('changes', 'state'),
    [
        ({'altitude_m': 56.0}, State.LANDING),
        ({'altitude_m': 56.1}, State.AIMING),
        ({'altitude_m': 56.0, 'north_m': 6.5}, State.LANDING),
        ({'altitude_m': 56.0, 'north_m': 6.6}, State.AIMING),
        ({'altitude_m': 56.0, 'ground_is_fresh': False}, State.AIMING),
    ],
)
def test_aiming_ends_low_enough_over_the_site_on_ground_just_seen(changes, state):
    helm = Helm.engaged_in(LandingParameters(), State.AIMING)
    assert decided(helm, **changes).state is state


def test_aiming_ends_at_exactly_a_metre_above_its_floor():
    helm = Helm.engaged_in(LandingParameters(safe_altitude_m=40.0), State.AIMING)
    assert decided(helm, altitude_m=45.0).state is State.LANDING


def test_without_a_rejection_an_old_map_asks_for_the_segmentation():
    decision = decided(Helm.engaged_in(LandingParameters(), State.SEARCHING), map_age_s=2.1)
    assert decision.reason.endswith('limit 2.0 s: is segmentation running?')


@pytest.mark.parametrize(
    ('changes', 'state'),
    [
        ({'altitude_m': 20.3}, State.HANDOVER),
        ({'altitude_m': 20.4}, State.LANDING),
        ({'altitude_m': 20.3, 'north_m': 1.0}, State.HANDOVER),
        ({'altitude_m': 20.3, 'north_m': 1.1}, State.LANDING),
        ({'altitude_m': 20.3, 'ground_is_fresh': False}, State.LANDING),
        ({'altitude_m': 20.3, 'site': None}, State.WAITING),
        ({'altitude_m': 20.3, 'map_age_s': 2.1}, State.HOLD),
    ],
)
def test_a_landing_ends_low_and_centred_on_ground_just_seen(changes, state):
    helm = Helm.engaged_in(LandingParameters(), State.LANDING)
    decision = decided(helm, **changes)
    assert decision.state is state
    assert decision.outcome == ('handover' if state is State.HANDOVER else None)


def test_a_decision_tells_the_sighting_and_the_time_in_its_state():
    helm = Helm(LandingParameters())
    helm.engage()
    decided(helm)
    decision = decided(helm, time_s=2.5, site=None, threshold=0.7, map_age_s=0.4)
    assert decision.time_in_state_s == pytest.approx(2.5)
    assert decision.verdict.reason == 'none'
    assert decision.site is None
    assert (decision.effective_threshold, decision.map_age_s) == (0.7, 0.4)
    assert decision.relaxed
    assert decision.reason == 'engaged: searching; looking; threshold relaxed to 0.70'
    firm = decided(helm, time_s=2.6, threshold=0.8)
    assert not firm.relaxed
    assert firm.reason == 'engaged: searching; looking'
    assert firm.site is BELOW
    helm.restart_clock(round(900e9))
    assert decided(helm, time_s=-99.0).time_in_state_s == pytest.approx(1.0)


def test_the_search_looks_first_and_then_flies():
    helm = Helm(LandingParameters())
    helm.engage()
    for time_s, moves in ((0.0, False), (5.9, False), (6.0, True)):
        decision = decided(helm, time_s=time_s, site=None)
        assert (decision.setpoint.v_north_m_s > 0.0) is moves
        assert decision.reason.endswith('expanding square') is moves


@pytest.mark.parametrize(('north_m', 'state'), [(3.0, State.HOLD), (3.1, State.RETURNING)])
def test_a_return_ends_within_3_m_of_where_the_landing_began(north_m, state):
    helm = Helm(LandingParameters(max_total_s=10.0, budget_policy='return'))
    helm.engage()
    decided(helm, site=None)
    decided(helm, time_s=9.0, north_m=50.0, site=None)
    assert decided(helm, time_s=11.0, north_m=50.0, site=None).state is State.RETURNING
    assert decided(helm, time_s=12.0, north_m=north_m, site=None).state is state


@pytest.mark.parametrize(
    ('fence_m', 'farthest_m'), [(0.0, 60.0), (70.0, 60.0), (64.0, 0.0), (3.0, 0.0)]
)
def test_the_square_turns_5_m_before_the_fence(fence_m, farthest_m):
    helm = Helm(LandingParameters(geofence_radius_m=fence_m))
    helm.engage()
    for time_s in (0.0, 7.0, 8.0):
        setpoint = decided(helm, time_s=time_s, site=None).setpoint
    assert (setpoint.v_north_m_s > 0.0) is (farthest_m > 0.0)


def test_a_disengaged_helm_counts_nothing_and_an_engaged_one_begins_at_its_first_position():
    helm = Helm(LandingParameters(max_total_s=10.0))
    for time_s in (0.0, 20.0, 40.0):
        assert decided(helm, time_s=time_s).outcome is None
    assert helm._home is None
    helm.engage()
    decided(helm, time_s=41.0, north_m=7.0)
    decided(helm, time_s=42.0, north_m=9.0)
    assert helm._home.north_m == 7.0
    assert decided(helm, time_s=52.0).outcome == 'timeout'
    helm.disengage()
    assert decided(helm, time_s=53.0).state is State.IDLE


def test_a_last_attempt_is_over_when_no_place_is_known_and_none_is_in_view():
    for site, state in ((None, State.HOLD), (BELOW, State.AIMING)):
        helm = Helm(LandingParameters(max_total_s=10.0, budget_policy='best_site'))
        helm.engage()
        decided(helm, site=None)
        decision = decided(helm, time_s=11.0, revision=200, site=site, best=None)
        assert decision.state is state


def test_an_age_that_grows_is_no_new_reason():
    trip = Trip()
    trip.step()
    problems = [f'HEARTBEAT is {age / 10} s old' for age in range(36, 46)]
    told = {
        trip.step(pose=None, position_problem=problem).reason for problem in (*problems, 'jumped')
    }
    assert len(told) == 2
    assert any('3.6 s old' in reason for reason in told)
    assert any('jumped' in reason for reason in told)


class FencedTrip(Trip):
    """A vehicle that a fence keeps from where ``inside`` does not hold."""

    def inside(self) -> bool:
        return True

    def fly(self, setpoint: Setpoint) -> None:
        before = (self.north_m, self.east_m, self.altitude_m, self.lowest_m)
        super().fly(setpoint)
        self.stopped = not setpoint.is_zero and not self.inside()
        if self.stopped:
            self.north_m, self.east_m, self.altitude_m, self.lowest_m = before
        self.told = {
            'fence': 'a fence limits the speed' if self.stopped else '',
            'v_north_m_s': 0.0 if self.stopped else setpoint.v_north_m_s,
            'v_east_m_s': 0.0 if self.stopped else setpoint.v_east_m_s,
            'v_down_m_s': 0.0 if self.stopped else setpoint.v_down_m_s,
        }

    def step(self, **changes) -> Decision:
        return super().step(**{**getattr(self, 'told', {}), **changes})


class FloorTrip(FencedTrip):
    def inside(self) -> bool:
        return self.altitude_m > 36.0


class CircleTrip(FencedTrip):
    def inside(self) -> bool:
        return self.home_m < 30.0


def test_a_fence_below_ends_the_descent_and_another_attempt_is_made():
    trip = FloorTrip(lawn=replace(LAWN, north_m=1.0, east_m=0.0))
    trip.run(60.0)
    climb = next(each for each in trip.log if each.state is State.CLIMBING)
    assert 'a fence limits the speed' in climb.reason
    assert climb.setpoint.v_down_m_s < 0.0
    assert trip.states[:5] == [
        *(State.SEARCHING, State.AIMING, State.LANDING, State.CLIMBING, State.RESTARTING)
    ]
    assert State.HOLD not in trip.states
    assert trip.lowest_m > 36.0


def test_the_reason_of_the_last_failed_descent_stands_in_the_end_of_the_attempts():
    parameters = LandingParameters(max_attempts=1)
    trip = FloorTrip(parameters, lawn=replace(LAWN, north_m=1.0, east_m=0.0))
    while State.CLIMBING not in trip.states:
        trip.step()
    trip.helm.fail_attempt()
    reason = trip.step().reason
    assert '1 descents failed, limit 1 (the last: a fence limits the speed' in reason
    assert trip.helm.state is State.HOLD


def test_a_search_that_meets_a_fence_turns_to_the_next_way_point():
    trip = CircleTrip()
    trip.run(120.0)
    assert trip.states == [State.SEARCHING]
    turned = [each for each in trip.log if each.setpoint.v_east_m_s > 1.0]
    assert turned, 'the first leg leads north, into the fence'


def test_another_commander_holds_and_says_who():
    trip = Trip(lawn=replace(LAWN, north_m=1.0, east_m=0.0))
    while trip.helm.state is not State.LANDING:
        trip.step()
    decision = trip.step(other_commander='a second commander: 2 m/s')
    assert (decision.state, decision.reason) == (State.HOLD, 'a second commander: 2 m/s')
    assert decision.setpoint.is_zero
    assert trip.step().state is State.SEARCHING


def test_a_mode_that_is_not_known_holds():
    trip = Trip(lawn=LAWN)
    trip.step()
    decision = trip.step(mode_known=False)
    assert decision.state is State.HOLD
    assert 'until the autopilot reports its mode' in decision.reason


def test_a_search_without_success_goes_on_lower_down_but_above_the_safe_altitude():
    trip = Trip(LandingParameters(search_low_after_s=20.0, max_search_s=120.0), altitude_m=100.0)
    trip.run(19.0)
    assert trip.lowest_m >= 100.0
    assert trip.run(90.0).state is State.SEARCHING
    assert 60.0 < trip.lowest_m < 62.0
    assert trip.home_m > 20.0, 'it goes on along the square'


def test_a_search_stays_up_where_it_is_told_to():
    trip = Trip(LandingParameters(search_low_after_s=3600.0), altitude_m=100.0)
    assert trip.run(400.0).outcome == 'no_zone'
    assert trip.lowest_m >= 100.0


def test_a_search_that_begins_below_its_floor_does_not_go_down():
    trip = Trip(LandingParameters(search_low_after_s=0.0), altitude_m=56.0)
    trip.run(60.0)
    assert trip.lowest_m >= 56.0
    assert trip.altitude_m < 58.0
