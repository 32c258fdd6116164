# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast each state flies where, in numbers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from peace_ros.core.domain import Pose, Setpoint, Site
from peace_ros.core.landing import LandingParameters, State, Verdict
from peace_ros.core.landing.guidance import ExpandingSquare, over_site, velocity
from peace_ros.core.landing.situation import Sighting, Situation

P = LandingParameters()
LEVEL = (1.0, 0.0, 0.0, 0.0)
HOME = Pose(0, -30.0, 40.0, -80.0, LEVEL, 80.0)
NO_ZONE = Verdict.no_zone('none')


def pose_of(altitude_m: float, north_m: float = 0.0, east_m: float = 0.0) -> Pose:
    return Pose(0, north_m, east_m, -altitude_m, LEVEL, altitude_m)


def flown(
    state: State,
    altitude_m: float,
    site: Site | None = None,
    parameters: LandingParameters = P,
    *,
    fresh: bool = True,
    **changes: object,
) -> tuple[tuple[float, float, float], str]:
    sighting = Sighting(NO_ZONE, site, fresh, 0.9, 0.1, 5, 0.1, 9, 0.8)
    given = Situation(0, pose_of(altitude_m), 0.1, sighting, site, HOME)
    setpoint, note = velocity(state, replace(given, **changes), parameters)
    assert setpoint.stamp_ns == 5
    return (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s), note


def site_at(north_m: float, east_m: float, clearance_m: float = 6.0) -> Site:
    return Site(north_m, east_m, clearance_m, 100.0, 0.9, 0.1)


@pytest.mark.parametrize(('clearance_m', 'over'), [(6.4, False), (6.5, True), (6.6, True)])
def test_a_vehicle_is_over_a_site_with_its_radius(clearance_m: float, over: bool) -> None:
    assert over_site(pose_of(30.0), site_at(3.0, 4.0, clearance_m), 1.5) is over


@pytest.mark.parametrize(
    ('state', 'altitude_m', 'place', 'expected'),
    [
        (State.LANDING, 60.0, (3.0, -4.0), (1.5, -2.0)),
        (State.LANDING, 60.0, (-30.0, 40.0), (-3.0, 4.0)),
        (State.AIMING, 60.0, (3.0, -4.0), (1.05, -1.4)),
        (State.AIMING, 60.0, (30.0, 40.0), (3.0, 4.0)),
        (State.AIMING, 49.0, (30.0, 40.0), (3.0, 4.0)),
        (State.AIMING, 48.9, (30.0, 40.0), (0.0, 0.0)),
        (State.LANDING, 48.9, (3.6, 4.8), (0.9, 1.2)),
        (State.LANDING, 48.9, (3.61, 4.81), (0.0, 0.0)),
        (State.LANDING, 48.9, (0.6, 0.8), (0.3, 0.4)),
        (State.LANDING, 60.0, (0.0, 0.0), (0.0, 0.0)),
    ],
)
def test_lateral_speed_is_proportional_up_to_a_limit_and_needs_known_ground_low_down(
    state: State, altitude_m: float, place: tuple[float, float], expected: tuple[float, float]
) -> None:
    (north, east, _), _ = flown(state, altitude_m, site_at(*place))
    assert (north, east) == pytest.approx(expected)


def test_the_limit_low_down_is_the_smaller_one() -> None:
    slow = replace(P, lateral_speed_limit=0.7)
    (north, east, _), _ = flown(State.LANDING, 40.0, site_at(3.0, 4.0), slow)
    assert (north, east) == pytest.approx((0.42, 0.56))


@pytest.mark.parametrize(
    ('state', 'altitude_m', 'down'),
    [
        (State.LANDING, 90.0, 3.0),
        (State.LANDING, 30.0, 1.8),
        (State.LANDING, 22.5, 1.35),
        (State.LANDING, 20.5, 0.3),
        (State.LANDING, 20.8, 0.48),
        (State.LANDING, 20.0, 0.0),
        (State.LANDING, 19.0, 0.0),
        (State.AIMING, 90.0, 1.5),
        (State.AIMING, 55.6, 0.36),
        (State.AIMING, 55.0, 0.0),
    ],
)
def test_descent_is_proportional_to_altitude_and_slow_before_its_floor(
    state: State, altitude_m: float, down: float
) -> None:
    speed, note = flown(state, altitude_m, site_at(0.0, 0.0))
    assert speed == pytest.approx((0.0, 0.0, down))
    assert note == ''


def test_descent_low_down_has_a_lowest_speed() -> None:
    low = replace(P, handover_altitude_m=1.5, z_speed_landing=1.0)
    assert flown(State.LANDING, 6.0, site_at(0.0, 0.0), low)[0][2] == 0.5
    assert flown(State.LANDING, 40.0, site_at(0.0, 0.0), low)[0][2] == pytest.approx(0.8)


@pytest.mark.parametrize(
    ('state', 'clearance_m', 'aside_m', 'share'),
    [
        # Within (6 - 1.5) / 2 m in LANDING, 6 - 1.5 m in AIMING.
        (State.LANDING, 6.0, 1.125, 1.0),
        (State.LANDING, 6.0, 1.6875, 0.5),
        (State.LANDING, 6.0, 2.24, 0.00889),
        (State.LANDING, 6.0, 2.25, None),
        (State.AIMING, 6.0, 2.25, 1.0),
        (State.AIMING, 6.0, 3.375, 0.5),
        (State.AIMING, 6.0, 4.5, None),
        (State.LANDING, 2.3, 0.375, 0.5),
        (State.LANDING, 2.3, 0.5, None),
        (State.LANDING, 1.9, 0.3, 0.5),
        (State.LANDING, 1.9, 0.4, None),
        (State.LANDING, 1.5, 0.0, None),
        (State.AIMING, 1.5, 0.0, None),
        (State.AIMING, 1.0, 0.0, None),
    ],
)
def test_descent_slows_down_aside_and_waits_farther_out(
    state: State, clearance_m: float, aside_m: float, share: float | None
) -> None:
    (_, _, down), note = flown(state, 90.0, site_at(aside_m, 0.0, clearance_m))
    if share is None:
        assert down == 0.0
        assert f'{aside_m:.1f} m beside the site: descends within' in note
    else:
        full = 3.0 if state is State.LANDING else 1.5
        assert down == pytest.approx(share * full, rel=0.01)
        assert note == ''


@pytest.mark.parametrize(
    ('clearance_m', 'within'), [(6.0, '2.2'), (2.3, '0.5'), (1.9, '0.4'), (1.0, '0.0')]
)
def test_what_a_descent_waits_for_is_told(clearance_m: float, within: str) -> None:
    _, note = flown(State.LANDING, 90.0, site_at(9.0, 0.0, clearance_m))
    assert note == f'9.0 m beside the site: descends within {within} m'
    _, note = flown(State.LANDING, 90.0, site_at(0.0, 0.0), fresh=False)
    assert note == 'waiting for a fresh look at the ground below'
    assert flown(State.LANDING, 20.0, site_at(0.0, 0.0), fresh=False)[1] == ''
    assert flown(State.LANDING, 90.0) == ((0.0, 0.0, 0.0), '')
    assert flown(State.AIMING, 90.0) == ((0.0, 0.0, 0.0), '')


@pytest.mark.parametrize(
    ('altitude_m', 'home_m', 'up'),
    [
        (80.0, 80.0, 0.0),
        (79.0, 80.0, 0.0),
        (78.8, 80.0, 0.6),
        (70.0, 80.0, 3.0),
        (49.0, 80.0, 3.0),
        (48.9, 80.0, 0.0),
        (117.0, 150.0, 1.5),
        (120.0, 150.0, 0.0),
        (90.0, 80.0, 0.0),
    ],
)
@pytest.mark.parametrize('state', [State.SEARCHING, State.RESTARTING])
def test_a_search_climbs_to_where_it_began_up_to_120_m(
    state: State, altitude_m: float, home_m: float, up: float
) -> None:
    home = replace(HOME, altitude_agl_m=home_m)
    speed, note = flown(state, altitude_m, home=home)
    assert speed == pytest.approx((0.0, 0.0, -up))
    assert note == 'looking'


def test_a_search_flies_to_its_target_where_nothing_is_in_the_way() -> None:
    speed, note = flown(State.SEARCHING, 70.0, search_target=(30.0, -40.0))
    assert speed == pytest.approx((2.4, -3.2, -3.0))
    assert note == 'flying an expanding square'
    speed, note = flown(State.SEARCHING, 70.0, search_target=(3.0, -4.0), home=None)
    assert speed == pytest.approx((1.5, -2.0, 0.0))
    for altitude_m, site in ((48.0, None), (70.0, site_at(0.0, 0.0))):
        speed, note = flown(State.SEARCHING, altitude_m, site, search_target=(30.0, -40.0))
        assert speed == (0.0, 0.0, 0.0)
        assert note == 'looking'


def test_the_way_home_goes_up_first() -> None:
    assert flown(State.RETURNING, 48.9) == ((0.0, 0.0, -3.0), '')
    speed, note = flown(State.RETURNING, 60.0)
    assert speed == pytest.approx((-2.4, 3.2, 0.0))
    assert note == ''
    speed, note = flown(State.RETURNING, 60.0, home=None)
    assert speed == (0.0, 0.0, 0.0)
    assert note == 'where the landing began is not known'
    assert flown(State.CLIMBING, 30.0, site_at(5.0, 0.0)) == ((0.0, 0.0, -3.0), '')


@pytest.mark.parametrize('state', [State.HOLD, State.WAITING, State.HANDOVER, State.IDLE])
def test_other_states_stand_still(state: State) -> None:
    assert flown(state, 60.0, site_at(3.0, 4.0), search_target=(9.0, 9.0)) == ((0, 0, 0), '')


def test_without_a_pose_nothing_moves() -> None:
    assert flown(State.LANDING, 60.0, site_at(3.0, 4.0), pose=None) == ((0.0, 0.0, 0.0), '')
    assert Setpoint(0).is_zero


def test_a_way_point_is_reached_within_five_metres() -> None:
    square = ExpandingSquare((0.0, 0.0), 60.0, 300.0)
    assert square.target(pose_of(60.0, 54.9, 0.0)) == (60.0, 0.0)
    assert square.target(pose_of(60.0, 60.0, 4.9)) == (60.0, 60.0)
    assert square.target(pose_of(60.0, 60.0, 55.0)) == (-60.0, 60.0)


def test_an_expanding_square_turns_right_and_grows_every_second_leg() -> None:
    square = ExpandingSquare((10.0, -20.0), 10.0, 1000.0)
    found, at = [], (10.0, -20.0)
    for _ in range(9):
        at = square.target(pose_of(60.0, *at))
        found.append((at[0] - 10.0, at[1] + 20.0))
    assert found == [
        (10.0, 0.0),
        (10.0, 10.0),
        (-10.0, 10.0),
        (-10.0, -10.0),
        (20.0, -10.0),
        (20.0, 20.0),
        (-20.0, 20.0),
        (-20.0, -20.0),
        (30.0, -20.0),
    ]


def test_beyond_its_radius_a_square_begins_anew() -> None:
    square = ExpandingSquare((0.0, 0.0), 30.0, 42.0)
    assert square.target(pose_of(60.0)) == (30.0, 0.0)
    assert square.target(pose_of(60.0, 30.0, 0.0)) == (30.0, 0.0), '(30, 30) lies too far'
    wide = ExpandingSquare((0.0, 0.0), 30.0, 43.0)
    assert wide.target(pose_of(60.0, 30.0, 0.0)) == (30.0, 30.0)
    nowhere = ExpandingSquare((7.0, 8.0), 50.0, 49.0)
    assert nowhere.target(pose_of(60.0)) == (7.0, 8.0)
    just = ExpandingSquare((7.0, 8.0), 50.0, 50.0)
    assert just.target(pose_of(60.0)) == (57.0, 8.0)


def test_the_way_of_a_square_is_known_before_it_is_flown() -> None:
    square = ExpandingSquare((0.0, 0.0), 30.0, 43.0)
    assert square.way == ((0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (-30.0, 30.0), (-30.0, -30.0))
    assert ExpandingSquare((7.0, 8.0), 50.0, 49.0).way == ((7.0, 8.0),)


def test_a_descent_ends_where_the_lowest_height_does() -> None:
    site = site_at(0.0, 0.0)
    alone, _ = flown(State.LANDING, 21.0, site)
    assert flown(State.LANDING, 25.0, site, above_lowest_m=4.0)[0] == pytest.approx(alone)
    assert flown(State.LANDING, 25.0, site, above_lowest_m=5.0)[0] == (0.0, 0.0, 0.0)


def test_sideways_counts_the_lowest_height_that_is_believed() -> None:
    far = site_at(40.0, 0.0)
    assert flown(State.AIMING, 60.0, far, above_lowest_m=11.0)[0][0] > 1.0
    assert flown(State.AIMING, 60.0, far, above_lowest_m=11.1)[0] == (0.0, 0.0, 0.0)
