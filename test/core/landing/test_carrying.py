# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a position is carried from picture to picture, with pictures whose shifts are given."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Frame, Heatmap, Pose
from peace_ros.core.landing import LandingParameters, odometry
from peace_ros.core.landing.intake import HeatmapIntake
from peace_ros.core.landing.odometry import PositionCarrier, VisualOdometry
from peace_ros.core.landing.poses import Miss, PoseHistory
from peace_ros.core.mapping import Displacement, MapParameters, Mismatch, SafetyMap, View

S = 1_000_000_000
CAMERA = Camera.from_degrees(256, 256, 73.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
NEW_KEY_M = 0.2 * 2.0 * 40.0 * np.tan(np.radians(36.5))


def pose_of(
    time_s: float = 0.0, north_m: float = 0.0, east_m: float = 0.0, altitude_m: float = 40.0
) -> Pose:
    return Pose(round(time_s * S), north_m, east_m, -altitude_m, LEVEL, altitude_m)


def view_of(number: int, pose: Pose | None = None) -> View:
    return View(np.full((8, 8), number, np.uint8), pose or pose_of())


class Shifts:
    """Stands in for the comparison of pictures; notes what was compared."""

    def __init__(self) -> None:
        self.known: dict[tuple[int, int], Displacement | Mismatch] = {}
        self.asked: list[tuple[int, int]] = []

    def __call__(self, before: View, after: View, camera: Camera) -> Displacement | Mismatch:
        assert camera is CAMERA
        pair = int(before.grey[0, 0]), int(after.grey[0, 0])
        self.asked.append(pair)
        return self.known.get(pair, Mismatch.DIFFERENT)

    def set(self, before: int, after: int, north: float, east: float, error: float) -> None:
        self.known[before, after] = Displacement(north, east, error, 0.9)


@pytest.fixture
def shifts(monkeypatch: pytest.MonkeyPatch) -> Shifts:
    shifts = Shifts()
    monkeypatch.setattr(odometry, 'register', shifts)
    return shifts


@pytest.fixture
def way() -> VisualOdometry:
    way = VisualOdometry(CAMERA)
    way.anchor(view_of(1, pose_of(0.0, 10.0, 20.0)))
    return way


def test_a_way_begins_where_the_position_was_known() -> None:
    way = VisualOdometry(CAMERA)
    assert not way.is_anchored
    assert way.drift_m == 0.0
    with pytest.raises(ValueError, match='call anchor first'):
        way.follow(view_of(1))
    way.anchor(view_of(1))
    assert way.is_anchored
    assert way.drift_m == 0.0
    way.clear()
    assert not way.is_anchored
    assert way.drift_m == 0.0


def test_a_picture_leads_on_from_the_key(way: VisualOdometry, shifts: Shifts) -> None:
    shifts.set(1, 2, 3.0, -4.0, 0.25)
    shifts.set(1, 3, 5.0, 1.0, 0.5)
    here = pose_of(7.0, 99.0, 99.0, 41.0)
    assert way.follow(view_of(2, here)) == replace(here, north_m=13.0, east_m=16.0)
    assert way.drift_m == 0.25
    assert way.follow(view_of(3, here)) == replace(here, north_m=15.0, east_m=21.0)
    assert way.drift_m == 0.5, 'the drift of one comparison'
    assert shifts.asked == [(1, 2), (1, 3)]


def test_the_same_picture_again_tells_nothing(way: VisualOdometry, shifts: Shifts) -> None:
    shifts.set(1, 2, 3.0, -4.0, 0.25)
    assert way.follow(view_of(1)) is Mismatch.SAME
    way.follow(view_of(2))
    assert way.follow(view_of(2)) is Mismatch.SAME
    assert shifts.asked == [(1, 2)]


@pytest.mark.parametrize(
    ('north_m', 'east_m', 'altitude_m', 'left'),
    [
        (0.999 * NEW_KEY_M, 0.0, 40.0, False),
        (1.001 * NEW_KEY_M, 0.0, 40.0, True),
        (0.0, -1.001 * NEW_KEY_M, 40.0, True),
        (0.71 * NEW_KEY_M, 0.71 * NEW_KEY_M, 40.0, True),
        (0.7 * NEW_KEY_M, 0.7 * NEW_KEY_M, 40.0, False),
        (0.0, 0.0, 48.0, False),
        (0.0, 0.0, 48.1, True),
        (0.0, 0.0, 33.4, False),
        (0.0, 0.0, 33.3, True),
    ],
)
def test_a_key_is_left_once_little_of_it_is_in_view(
    way: VisualOdometry,
    shifts: Shifts,
    north_m: float,
    east_m: float,
    altitude_m: float,
    left: bool,
) -> None:
    shifts.set(1, 2, north_m, east_m, 0.25)
    way.follow(view_of(2, pose_of(1.0, altitude_m=altitude_m)))
    for key in (1, 2):
        shifts.set(key, 3, 1.0, 2.0, 0.5)
    found = way.follow(view_of(3))
    assert isinstance(found, Pose)
    assert shifts.asked[-1] == ((2, 3) if left else (1, 3))
    assert way.drift_m == (0.75 if left else 0.5)
    expected = (11.0 + north_m, 22.0 + east_m) if left else (11.0, 22.0)
    assert (found.north_m, found.east_m) == pytest.approx(expected)


def test_where_the_key_does_not_match_the_last_picture_may(
    way: VisualOdometry, shifts: Shifts
) -> None:
    shifts.set(1, 2, 3.0, -4.0, 0.25)
    shifts.set(2, 4, 1.0, 1.0, 0.5)
    assert way.follow(view_of(3)) is Mismatch.DIFFERENT
    assert shifts.asked == [(1, 3)], 'the key is the last one'
    way.follow(view_of(2))
    shifts.known[2, 3] = Mismatch.TEXTURE
    assert way.follow(view_of(3)) is Mismatch.TEXTURE
    assert way.drift_m == 0.25, 'what did not match changes nothing'
    found = way.follow(view_of(4))
    assert isinstance(found, Pose)
    assert (found.north_m, found.east_m) == (14.0, 17.0)
    assert way.drift_m == 0.75
    assert shifts.asked[-2:] == [(1, 4), (2, 4)]


class Map:
    parameters = MapParameters(map_cell_m=0.5)

    def __init__(self) -> None:
        self.widened: list[float] = []

    def widen_unsafe(self, distance_m: float) -> None:
        self.widened.append(distance_m)


class Trip:
    """Pictures and attitudes every quarter of a second; a position until it is lost."""

    def __init__(self) -> None:
        self.map = Map()
        self.carrier = PositionCarrier(CAMERA, 0.5, self.map)
        self.positions = PoseHistory(0.5)
        self.time_s = 0.0

    def see(self, number: int, position: tuple[float, float] | None = None) -> str:
        """Return why the map is lost, if it is."""
        self.time_s += 0.25
        pose = pose_of(self.time_s, *(position or (nan, nan)))
        assert self.carrier.add_pose(pose)
        if position is not None:
            assert self.positions.add(pose)
        image = np.full((8, 8, 3), number, np.uint8)
        assert self.carrier.add_view(Frame(image, pose.stamp_ns))
        return self.carrier.settle(self.positions)

    @property
    def now_ns(self) -> int:
        return round(self.time_s * S)


@pytest.fixture
def trip(shifts: Shifts) -> Trip:
    trip = Trip()
    assert trip.see(1, (10.0, 20.0)) == ''
    return trip


def test_a_known_position_is_not_carried(trip: Trip) -> None:
    assert not trip.carrier.is_carrying
    assert trip.carrier.newest_ns is None
    assert trip.carrier.at(trip.now_ns) is Miss.NOT_YET


def test_without_position_pictures_carry_it_on(trip: Trip, shifts: Shifts) -> None:
    shifts.set(1, 2, 1.0, -2.0, 0.3)
    assert trip.see(2) == ''
    assert trip.carrier.is_carrying
    assert trip.carrier.newest_ns == trip.now_ns
    carried = trip.carrier.at(trip.now_ns)
    assert isinstance(carried, Pose)
    assert (carried.north_m, carried.east_m) == (11.0, 18.0)
    assert carried.altitude_agl_m == 40.0


def test_the_map_loses_accuracy_by_whole_cells_of_drift(trip: Trip, shifts: Shifts) -> None:
    for number, drift_m in enumerate((0.3, 0.6, 0.9, 1.7, 1.8), start=2):
        shifts.set(1, number, 1.0, 1.0, drift_m)
        assert trip.see(number) == ''
    assert trip.map.widened == [0.5, 1.0]


def test_nothing_is_carried_from_nowhere(shifts: Shifts) -> None:
    trip = Trip()
    shifts.set(1, 2, 1.0, 1.0, 0.3)
    assert trip.see(1) == ''
    assert trip.see(2) == ''
    assert not trip.carrier.is_carrying
    assert shifts.asked == []


def test_a_position_that_comes_back_near_by_goes_on(trip: Trip, shifts: Shifts) -> None:
    shifts.set(1, 2, 1.0, 0.0, 0.75)
    shifts.set(1, 3, 2.0, 0.0, 0.75)
    trip.see(2)
    assert trip.map.widened == [0.5]
    # 3 m and the drift of 0.75 m from where pictures led, (12, 20).
    assert trip.see(3, (12.0, 23.74)) == ''
    assert trip.map.widened == [0.5, 3.5], 'by how far it was off'
    assert not trip.carrier.is_carrying
    assert trip.carrier.newest_ns is None
    shifts.set(3, 4, 1.0, 0.0, 0.25)
    assert trip.see(4) == ''
    carried = trip.carrier.at(trip.now_ns)
    assert isinstance(carried, Pose)
    assert (carried.north_m, carried.east_m) == (13.0, 23.74)
    assert trip.map.widened == [0.5, 3.5], 'drift begins anew'


def test_a_position_that_comes_back_elsewhere_makes_the_map_worthless(
    trip: Trip, shifts: Shifts
) -> None:
    shifts.set(1, 2, 1.0, 0.0, 0.75)
    shifts.set(1, 3, 2.0, 0.0, 0.75)
    trip.see(2)
    assert trip.see(3, (12.0, 23.76)) == 'position is back, 3.8 m from the estimate by pictures'
    assert not trip.carrier.is_carrying
    assert trip.see(4) == '', 'and the way is forgotten'
    assert not trip.carrier.is_carrying


def test_a_position_that_comes_back_unconfirmed_makes_the_map_worthless(
    trip: Trip, shifts: Shifts
) -> None:
    shifts.set(1, 2, 1.0, 0.0, 0.75)
    trip.see(2)
    assert trip.see(3, (12.0, 20.0)) == (
        f'position is back, and pictures do not confirm it: {Mismatch.DIFFERENT.value}'
    )


def test_pictures_may_fail_for_a_second(trip: Trip, shifts: Shifts) -> None:
    shifts.set(1, 2, 1.0, 0.0, 0.1)
    trip.see(2)
    for number in range(3, 7):
        assert trip.see(number) == ''
    assert trip.see(7) == (f'no position, and pictures do not give one: {Mismatch.DIFFERENT.value}')
    assert not trip.carrier.is_carrying
    assert trip.carrier.newest_ns is None


def test_a_second_counts_from_the_last_known_position_too(trip: Trip) -> None:
    assert [trip.see(number) for number in range(2, 6)] == [''] * 4
    assert trip.see(6) != ''


def test_pictures_wait_for_an_attitude_after_them(trip: Trip, shifts: Shifts) -> None:
    shifts.set(1, 2, 1.0, 0.0, 0.1)
    image = np.full((8, 8, 3), 2, np.uint8)
    stamp_ns = trip.now_ns + S // 8
    assert trip.carrier.add_view(Frame(image, stamp_ns))
    assert not trip.carrier.add_view(Frame(image, stamp_ns))
    assert not trip.carrier.add_view(Frame(image, stamp_ns - 1))
    assert trip.carrier.settle(trip.positions) == ''
    assert not trip.carrier.is_carrying
    assert trip.carrier.add_pose(pose_of(trip.time_s + 0.25, nan, nan))
    assert trip.carrier.settle(trip.positions) == ''
    assert trip.carrier.newest_ns == stamp_ns


def test_pictures_without_an_attitude_are_left_out(trip: Trip, shifts: Shifts) -> None:
    trip.carrier.add_view(Frame(np.full((8, 8, 3), 2, np.uint8), trip.now_ns + S))
    trip.carrier.add_pose(pose_of(trip.time_s + 2.0, nan, nan))
    trip.time_s += 2.0
    assert trip.carrier.settle(trip.positions) == ''
    assert shifts.asked == [], 'attitudes are two seconds apart'
    shifts.set(1, 3, 1.0, 0.0, 0.1)
    assert trip.see(3) == ''
    assert trip.carrier.is_carrying


def test_a_picture_without_an_attitude_does_not_delay_the_next(trip: Trip, shifts: Shifts) -> None:
    shifts.set(1, 3, 1.0, 0.0, 0.1)
    for number, later_s in ((2, 0.6), (3, 2.0)):
        image = np.full((8, 8, 3), number, np.uint8)
        trip.carrier.add_view(Frame(image, trip.now_ns + round(later_s * S)))
    trip.carrier.add_pose(pose_of(trip.time_s + 2.0, nan, nan))
    assert trip.carrier.settle(trip.positions) == ''
    assert trip.carrier.newest_ns == trip.now_ns + 2 * S


def test_of_pictures_the_newest_eight_wait(trip: Trip, shifts: Shifts) -> None:
    for number in range(2, 12):
        image = np.full((8, 8, 3), number, np.uint8)
        trip.carrier.add_view(Frame(image, trip.now_ns + number * S // 100))
        shifts.set(1, number, 0.1 * number, 0.0, 0.1)
    trip.carrier.add_pose(pose_of(trip.time_s + 0.25, nan, nan))
    trip.carrier.settle(trip.positions)
    assert [after for _, after in shifts.asked] == list(range(4, 12))


def test_clearing_forgets_the_way_and_lets_the_clock_begin_anew(trip: Trip, shifts: Shifts) -> None:
    shifts.set(1, 2, 1.0, 0.0, 0.1)
    trip.see(2)
    trip.carrier.clear()
    assert not trip.carrier.is_carrying
    assert trip.carrier.newest_ns is None
    trip.time_s = -0.2
    assert trip.see(3) == '', 'earlier stamps are taken'
    assert not trip.carrier.is_carrying


class NotedMap(SafetyMap):
    """Notes from where each heatmap was seen: stamp in seconds and metres to the north."""

    def __init__(self) -> None:
        super().__init__(MapParameters(map_size_m=120.0))
        self.seen_from: list[tuple[float, float]] = []

    def add(self, heatmap: Heatmap, camera: Camera, pose: Pose) -> None:
        self.seen_from.append((heatmap.stamp_ns / S, pose.north_m))
        super().add(heatmap, camera, pose)


def test_heatmaps_are_seen_from_told_positions_before_a_gap_and_from_carried_ones_in_it(
    shifts: Shifts,
) -> None:
    noted = NotedMap()
    intake = HeatmapIntake(LandingParameters(), CAMERA, noted)
    shifts.set(2, 3, 1.0, 0.0, 0.1)
    for number, time_s, north_m in ((1, 1.0, 0.0), (2, 1.25, 0.0), (3, 1.5, nan)):
        intake.add_pose(pose_of(time_s, north_m, north_m))
        image = np.full((8, 8, 3), number, np.uint8)
        intake.add_view(Frame(image, round(time_s * S)))
    # A position is back, but no picture has confirmed it.
    intake.add_pose(pose_of(1.75, 3.0))
    for value, time_s in ((0.7, 1.2), (0.8, 1.5), (0.9, 1.75)):
        intake.add_heatmap(Heatmap(np.full((48, 48), value, np.float32), round(time_s * S)))
    assert noted.seen_from == [(1.2, 0.0), (1.5, 1.0)]
    assert intake.counts == {'used': 2}, 'the third waits'
    shifts.set(2, 4, 2.0, 0.0, 0.1)
    intake.add_view(Frame(np.full((8, 8, 3), 4, np.uint8), round(1.75 * S)))
    assert noted.seen_from[2:] == [(1.75, 3.0)]
