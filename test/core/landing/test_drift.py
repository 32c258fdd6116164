# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A velocity that nobody asked for is learned from positions, and made up for within limits."""

from __future__ import annotations

from math import exp, hypot, nan

import pytest

from peace_ros.core.domain import Pose, Setpoint
from peace_ros.core.landing.drift import Drift

S = 1_000_000_000
LAG_S, LEARN_S = 0.7, 5.0


def pose_of(time_s: float, north_m: float, east_m: float) -> Pose:
    return Pose(round(time_s * S), north_m, east_m, -40.0, (1.0, 0.0, 0.0, 0.0), 40.0)


def told(north: float, east: float) -> Setpoint:
    return Setpoint(3, north, east, 0.5)


class Axis:
    """The observer along one axis, by its equations."""

    def __init__(self, place: float, going: float) -> None:
        self.place, self.going, self.drift = place, going, 0.0

    def see(self, place: float, told: float, seconds: float) -> None:
        self.going += (told - self.going) * (1.0 - exp(-seconds / LAG_S))
        expected = self.place + (self.going + self.drift) * seconds
        error = place - expected
        self.place = expected + 2.0 / LEARN_S * error * seconds
        self.drift += error * seconds / LEARN_S**2


def test_it_learns_by_an_observer_of_five_seconds() -> None:
    drift = Drift()
    drift.see(pose_of(1.0, 5.0, -2.0), told(0.5, -0.25))
    north, east = Axis(5.0, 0.5), Axis(-2.0, -0.25)
    at_s = 1.0
    for seconds, place, wish in (
        (0.1, (5.2, -2.1), (0.5, -0.25)),
        (0.3, (5.9, -1.6), (1.0, 0.5)),
        (0.5, (6.1, -1.9), (-1.0, 0.5)),
        (0.2, (7.5, -3.9), (0.0, 0.0)),
    ):
        at_s += seconds
        drift.see(pose_of(at_s, *place), told(*wish))
        north.see(place[0], wish[0], seconds)
        east.see(place[1], wish[1], seconds)
        assert drift.velocity_m_s == pytest.approx((north.drift, east.drift), abs=1e-9)
    assert hypot(*drift.velocity_m_s) > 0.01


def drifted(
    bias: tuple[float, float], seconds: float = 40.0, wish: tuple[float, float] = (0.5, 0.0)
) -> Drift:
    """A vehicle that follows at once but for its bias."""
    drift = Drift()
    for tick in range(round(seconds * 10)):
        at_s = 0.1 * tick
        place = ((wish[0] + bias[0]) * at_s, (wish[1] + bias[1]) * at_s)
        drift.see(pose_of(at_s, *place), told(*wish))
    return drift


@pytest.mark.parametrize('bias', [(0.3, -0.2), (0.0, 0.0), (-0.5, 0.5)])
def test_it_comes_to_know_a_steady_drift(bias: tuple[float, float]) -> None:
    assert drifted(bias).velocity_m_s == pytest.approx(bias, abs=0.01)


def test_no_more_than_a_metre_per_second_is_believed() -> None:
    learned = drifted((2.0, -1.5)).velocity_m_s
    assert hypot(*learned) == pytest.approx(1.0)
    assert learned == pytest.approx((0.8, -0.6), abs=0.03)


KNOWN = (0.3, 0.4)


def known() -> Drift:
    drift = Drift()
    drift.velocity_m_s = KNOWN
    drift.see(pose_of(1.0, 0.0, 0.0), told(0.0, 0.0))
    return drift


@pytest.mark.parametrize(
    ('time_s', 'north_m', 'counts'),
    [
        (1.0, 1.0, False),
        (0.9, 1.0, False),
        (1.5, 1.0, True),
        (1.51, 1.0, False),
        (1.1, 2.99, True),
        (1.1, 3.0, True),
        (1.1, 3.01, False),
        (1.1, -3.01, False),
    ],
)
def test_gaps_and_jumps_teach_nothing_and_lose_nothing(
    time_s: float, north_m: float, counts: bool
) -> None:
    drift = known()
    drift.see(pose_of(time_s, north_m, 0.0), told(0.0, 0.0))
    assert (drift.velocity_m_s != KNOWN) == counts


@pytest.mark.parametrize(
    ('time_s', 'north_m', 'east_m'), [(9.0, 50.0, 60.0), (1.1, 50.0, 0.0), (1.1, 0.0, 60.0)]
)
def test_after_a_gap_it_goes_on_from_where_the_vehicle_is(
    time_s: float, north_m: float, east_m: float
) -> None:
    drift = known()
    drift.see(pose_of(time_s, north_m, east_m), told(1.0, -1.0))
    assert drift.velocity_m_s == KNOWN
    # It flies on as told and as it drifts: nothing is to be learned.
    place = (north_m + 0.1 * (1.0 + KNOWN[0]), east_m + 0.1 * (-1.0 + KNOWN[1]))
    drift.see(pose_of(time_s + 0.1, *place), told(1.0, -1.0))
    assert drift.velocity_m_s == pytest.approx(KNOWN)


@pytest.mark.parametrize('unknown', [None, pose_of(1.1, nan, nan)])
def test_without_a_position_it_waits_and_begins_anew(unknown: Pose | None) -> None:
    drift = known()
    drift.see(unknown, told(0.0, 0.0))
    drift.see(pose_of(1.2, 2.0, 0.0), told(0.0, 0.0))
    assert drift.velocity_m_s == KNOWN
    drift.see(pose_of(1.3, 2.0 + 0.1 * KNOWN[0], 0.1 * KNOWN[1]), told(0.0, 0.0))
    assert drift.velocity_m_s == pytest.approx(KNOWN)


def made_up(
    drift_m_s: tuple[float, float], wish: tuple[float, float], limit_m_s: float
) -> tuple[float, float]:
    drift = Drift()
    drift.velocity_m_s = drift_m_s
    result = drift.made_up(told(*wish), limit_m_s)
    assert (result.stamp_ns, result.v_down_m_s) == (3, 0.5)
    return result.v_north_m_s, result.v_east_m_s


@pytest.mark.parametrize(
    ('drift_m_s', 'wish', 'limit_m_s', 'expected'),
    [
        ((0.3, 0.4), (0.0, 0.0), 5.0, (0.0, 0.0)),  # zero stays zero
        ((0.06, 0.08), (1.0, 0.5), 5.0, (1.0, 0.5)),
        ((0.0, 0.0), (1.0, 0.5), 5.0, (1.0, 0.5)),
        # Of 0.5 m/s all but 0.1 is made up for.
        ((0.3, 0.4), (1.0, 0.0), 5.0, (0.76, -0.32)),
        ((0.3, 0.4), (0.0, 0.05), 5.0, (-0.24, -0.27)),
        # (1.24, 0.32) is 1.2806 m/s: as much as the limit allows, or the wish itself had.
        ((-0.3, -0.4), (1.0, 0.0), 1.2806, (1.24, 0.32)),
        ((-0.3, -0.4), (1.0, 0.0), 1.1, (1.0651, 0.2749)),
        ((-0.3, -0.4), (1.0, 0.0), 0.2, (0.9683, 0.2499)),
        ((0.3, 0.4), (0.24, 0.32), 5.0, (0.0, 0.0)),
    ],
)
def test_a_drift_is_made_up_for_within_the_limit(
    drift_m_s: tuple[float, float],
    wish: tuple[float, float],
    limit_m_s: float,
    expected: tuple[float, float],
) -> None:
    assert made_up(drift_m_s, wish, limit_m_s) == pytest.approx(expected, abs=1e-3)


def test_a_new_observer_knows_nothing() -> None:
    drift = Drift()
    assert drift.velocity_m_s == (0.0, 0.0)
    drift.see(pose_of(0.1, 1.0, 1.0), told(1.0, 1.0))
    assert drift.velocity_m_s == (0.0, 0.0), 'one position tells nothing'
