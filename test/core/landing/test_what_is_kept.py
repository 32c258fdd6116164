# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Limits of what is remembered and believed: poses, failed places, pictures, waiting heatmaps."""

from __future__ import annotations

from dataclasses import replace
from math import cos, inf, nan, radians, sin

import numpy as np
import pytest

from peace_ros.core.domain import Camera, DepthImage, Heatmap, Pose, Site
from peace_ros.core.landing import LandingParameters
from peace_ros.core.landing.intake import HeatmapIntake
from peace_ros.core.landing.memory import FailedPlace, SiteMemory
from peace_ros.core.landing.picture_watch import EVEN, STUCK, PictureWatch
from peace_ros.core.landing.poses import Miss, PoseHistory, jump_m
from peace_ros.core.mapping import MapParameters, SafetyMap

S = 1_000_000_000
P = LandingParameters()


def turned(deg: float) -> tuple[float, float, float, float]:
    return (cos(radians(deg) / 2), 0.0, 0.0, sin(radians(deg) / 2))


def pose_of(
    time_s: float,
    north_m: float = 0.0,
    east_m: float = 0.0,
    altitude_m: float = 40.0,
    yaw: float = 0.0,
) -> Pose:
    return Pose(round(time_s * S), north_m, east_m, -altitude_m, turned(yaw), altitude_m)


# --- poses


def between(one: Pose, other: Pose, gap_limit_s: float = 0.5) -> Pose | Miss:
    history = PoseHistory(gap_limit_s)
    assert history.add(one)
    assert history.add(other)
    return history.at((one.stamp_ns + other.stamp_ns) // 2)


@pytest.mark.parametrize(
    ('other', 'miss'),
    [
        (pose_of(1.5), None),
        (pose_of(1.5001), Miss.GAP),
        (pose_of(1.25, 9.4), None),
        (pose_of(1.25, 9.6), Miss.JUMP),
        (pose_of(1.25, 5.72, -7.62), Miss.JUMP),
        (pose_of(1.25, 5.64, -7.52), None),
        (pose_of(1.25, altitude_m=44.7), None),
        (pose_of(1.25, altitude_m=44.8), Miss.JUMP),
        (pose_of(1.25, altitude_m=35.3), None),
        (pose_of(1.25, altitude_m=35.2), Miss.JUMP),
        (pose_of(1.25, yaw=19.9), None),
        (pose_of(1.25, yaw=20.1), Miss.TURN),
        (pose_of(1.25, yaw=-20.1), Miss.TURN),
        (pose_of(1.25, yaw=359.0), None),
    ],
)
def test_between_two_poses_a_vehicle_flies_so_far_and_no_farther(
    other: Pose, miss: Miss | None
) -> None:
    found = between(pose_of(1.0), other)
    assert found is miss if miss else isinstance(found, Pose)


def test_how_far_a_position_jumped_is_told() -> None:
    assert jump_m(pose_of(1.0), pose_of(1.1, 30.0, 40.0)) == 50.0
    assert jump_m(pose_of(1.0, 30.0, 40.0), pose_of(1.1)) == 50.0
    assert jump_m(pose_of(1.0), pose_of(1.1, 4.9)) == 0.0
    assert jump_m(pose_of(1.0), pose_of(1.1, 5.1)) == 5.1


def test_a_pose_at_its_own_stamp_is_itself() -> None:
    first, second = pose_of(1.0), pose_of(2.0)
    history = PoseHistory(0.5)
    history.add(first)
    history.add(second)
    assert history.at(S) is first
    assert history.at(2 * S) is second
    assert history.newest is second
    assert history.at(S - 1) is Miss.TOO_OLD
    assert history.at(2 * S + 1) is Miss.NOT_YET
    history.clear()
    assert history.newest is None
    assert history.at(S) is Miss.NOT_YET
    assert history.add(first), 'a clock may begin anew'


def test_poses_are_kept_for_ten_seconds() -> None:
    history = PoseHistory(0.5)
    for tick in range(13):
        history.add(pose_of(float(tick)))
    assert isinstance(history.at(2 * S), Pose)
    assert history.at(2 * S - 1) is Miss.TOO_OLD


@pytest.mark.parametrize(
    ('length', 'kept'), [(0.985, False), (0.992, True), (1.0, True), (1.009, True), (1.012, False)]
)
def test_an_attitude_is_a_rotation(length: float, kept: bool) -> None:
    pose = replace(pose_of(1.0), quaternion_ned_frd=(0.0, length * 0.6, 0.0, length * 0.8))
    assert PoseHistory(0.5).add(pose) is kept


@pytest.mark.parametrize('name', ['north_m', 'east_m', 'down_m', 'altitude_agl_m'])
@pytest.mark.parametrize('value', [nan, inf])
def test_a_pose_is_of_numbers(name: str, value: float) -> None:
    assert not PoseHistory(0.5).add(replace(pose_of(1.0), **{name: value}))


# --- failed places


def site(
    north_m: float, east_m: float = 0.0, clearance_m: float = 6.0, confidence: float = 0.9
) -> Site:
    return Site(north_m, east_m, clearance_m, 100.0, confidence, 0.1)


def test_a_failed_place_covers_what_lies_within_its_radius() -> None:
    place = FailedPlace(10.0, -20.0, 5.0, 0)
    assert place.failures == 1
    assert place.covers(site(13.0, -16.0))
    assert not place.covers(site(13.1, -16.0))
    assert not place.covers(site(13.0, -24.1))


def test_a_failure_is_remembered_with_its_place_and_time() -> None:
    memory = SiteMemory(replace(P, failed_site_memory_s=100.5))
    place = memory.fail(site(3.0, 4.0), 7 * S)
    assert place == FailedPlace(3.0, 4.0, 8.0, 107 * S + S // 2, 1)
    memory.forgive(place.until_ns - 1)
    assert memory.failed == (place,)
    memory.forgive(place.until_ns)
    assert memory.failed == ()


def test_failures_add_up_where_circles_cover_a_site() -> None:
    memory = SiteMemory(P)
    memory.fail(site(0.0, -7.0), 0)
    memory.fail(site(0.0, 7.0), 0)
    assert [each.failures for each in memory.failed] == [1, 1], 'neither covers the other'
    both = memory.fail(site(0.0), 0)
    assert both.failures == 3
    assert both.radius_m == 8.0 * 1.5**2
    assert memory.failed == (both,), 'it covers both'


def test_a_circle_stays_unless_the_new_one_covers_all_of_it() -> None:
    memory = SiteMemory(P)
    first = memory.fail(site(0.0), 0)
    second = memory.fail(site(0.0, 5.0), 0)
    assert second.radius_m == 12.0
    assert memory.failed == (first, second), '5 + 8 m is more than 12 m'
    again = SiteMemory(P)
    again.fail(site(0.0), 0)
    covering = again.fail(site(0.0, 4.0), 0)
    assert again.failed == (covering,), '4 + 8 m is 12 m'


def test_the_radius_is_limited_but_never_smaller_than_the_site() -> None:
    memory = SiteMemory(replace(P, failed_site_radius_limit_m=10.0))
    assert memory.fail(site(0.0, clearance_m=11.0), 0).radius_m == 11.0
    assert memory.fail(site(0.0, clearance_m=9.0), 0).radius_m == 10.0


def test_places_within_ten_metres_are_one_place() -> None:
    memory = SiteMemory(P)
    memory.see(site(0.0, clearance_m=9.0))
    memory.see(site(6.0, 8.0, clearance_m=5.0))
    assert memory.best() == site(6.0, 8.0, clearance_m=5.0)
    memory.see(site(12.1, 16.0, clearance_m=4.0))
    assert memory.best() == site(6.0, 8.0, clearance_m=5.0)


def test_some_thirty_places_are_remembered() -> None:
    memory = SiteMemory(P)
    for number in range(34):
        memory.see(site(20.0 * number, clearance_m=11.0 - 0.1 * number))
    assert memory.best().north_m == 20.0, 'the first one is forgotten'
    assert len(memory._seen) == 33


# --- pictures

PICTURE = np.tile(np.linspace(0.2, 0.8, 40, dtype=np.float32), (40, 1))


def watched(later: Pose, picture: np.ndarray = PICTURE) -> str:
    watch = PictureWatch()
    assert watch.problem(Heatmap(picture, 1), pose_of(0.0)) == ''
    return watch.problem(Heatmap(picture.copy(), 2), later)


@pytest.mark.parametrize(
    ('later', 'stuck'),
    [
        (pose_of(0.0, 0.3, 0.4), False),
        (pose_of(0.0, 0.3, 0.41), True),
        (pose_of(0.0, altitude_m=40.5), False),
        (pose_of(0.0, altitude_m=40.51), True),
        (pose_of(0.0, yaw=2.9), False),
        (pose_of(0.0, yaw=3.1), True),
        (pose_of(0.0, yaw=-3.1), True),
        (pose_of(0.0, yaw=357.1), False),
    ],
)
def test_a_picture_is_stuck_once_the_vehicle_has_moved(later: Pose, stuck: bool) -> None:
    assert watched(later) == (STUCK if stuck else '')


def test_only_pictures_that_call_something_safe_can_be_stuck() -> None:
    far = pose_of(0.0, 9.0)
    assert watched(far, np.minimum(PICTURE, np.float32(0.5))) == ''
    assert watched(far, np.minimum(PICTURE, np.float32(0.51))) == STUCK
    assert watched(far, np.full((4, 4), 0.9, np.float32)) == ''
    assert PictureWatch().problem(Heatmap(np.ones((4, 4), np.float32), 1), far) == EVEN


# --- heatmaps and depth that wait

CAMERA = Camera.from_degrees(64, 64, 73.0)


class Intake:
    def __init__(self, parameters: LandingParameters = P) -> None:
        self.map = SafetyMap(MapParameters(map_size_m=40.0))
        self.intake = HeatmapIntake(parameters, CAMERA, self.map)

    def poses(self, begin_s: float, end_s: float, north_m: float = 0.0) -> None:
        for tick in range(round(begin_s * 10), round(end_s * 10) + 1):
            self.intake.add_pose(pose_of(0.1 * tick, north_m))

    def heatmap(self, time_s: float, values: np.ndarray | None = None) -> None:
        default = np.tile(np.linspace(0.6, 0.9, 32, dtype=np.float32), (32, 1))
        self.intake.add_heatmap(Heatmap(default if values is None else values, round(time_s * S)))

    def depth(self, time_s: float) -> None:
        self.intake.add_depth(DepthImage(np.full((8, 8), 9.0, np.float32), round(time_s * S)))

    def tick(self, time_s: float) -> None:
        self.intake.tick(round(time_s * S))

    @property
    def counts(self) -> dict[str, int]:
        return dict(self.intake.counts)


@pytest.fixture
def intake() -> Intake:
    intake = Intake()
    intake.poses(1.0, 2.0)
    return intake


def test_a_heatmap_waits_for_the_pose_after_it(intake: Intake) -> None:
    intake.heatmap(1.55)
    assert intake.counts == {'used': 1}
    assert intake.map.stamp_ns == round(1.55 * S)
    intake.heatmap(2.05)
    assert intake.counts == {'used': 1}
    intake.poses(2.1, 2.1)
    assert intake.counts == {'used': 2}


def test_a_heatmap_must_be_newer_than_the_last_also_of_those_that_wait(intake: Intake) -> None:
    intake.heatmap(1.5)
    intake.heatmap(1.5)
    intake.heatmap(1.4)
    assert intake.counts == {'used': 1, 'not newer than the last': 2}
    assert intake.intake.last_rejection == 'not newer than the last'
    intake.heatmap(2.5)
    intake.heatmap(2.5)
    intake.heatmap(2.2)
    assert intake.counts == {'used': 1, 'not newer than the last': 4}


def test_values_that_are_no_scores_are_rejected(intake: Intake) -> None:
    broken = np.full((32, 32), 0.5, np.float32)
    broken[3, 4] = nan
    intake.heatmap(1.5, broken)
    assert intake.counts == {'not finite': 1}
    broken[3, 4] = 1.5
    intake.heatmap(1.6, broken)
    assert intake.counts == {'not finite': 1, 'values outside of 0 to 1': 1}
    intake.heatmap(1.7, np.ones((32, 32), np.float32))
    assert intake.counts[EVEN] == 1
    assert intake.intake.last_rejection == EVEN
    assert intake.map.stamp_ns is None


def test_the_future_begins_a_little_after_now(intake: Intake) -> None:
    intake.tick(1.5)
    tolerance_s = P.future_tolerance_s
    intake.heatmap(1.5 + tolerance_s)
    assert intake.counts.get('stamp in the future', 0) == 0
    intake.heatmap(1.501 + tolerance_s)
    assert intake.counts['stamp in the future'] == 1


def test_a_heatmap_that_waits_is_rejected_when_the_clock_says_it_lies_ahead() -> None:
    intake = Intake()
    intake.poses(1.0, 1.1)
    for time_s in (2.0, 8.0, 9.0):
        intake.heatmap(time_s)
    intake.tick(2.0)
    assert intake.counts == {'stamp in the future': 2}
    intake.poses(1.2, 2.0)
    assert intake.counts == {'stamp in the future': 2, 'used': 1}


def test_a_heatmap_waits_only_so_long_since_the_clock_was_first_told(intake: Intake) -> None:
    limit_s = P.pose_wait_limit_s
    intake.heatmap(2.1)
    intake.heatmap(2.15)
    intake.tick(2.2)
    intake.tick(2.2 + limit_s)
    assert intake.counts == {}
    intake.tick(2.21 + limit_s)
    assert intake.counts == {Miss.NOT_YET.value: 1}
    assert intake.intake.last_rejection == Miss.NOT_YET.value
    intake.tick(2.23 + 2 * limit_s)
    assert intake.counts == {Miss.NOT_YET.value: 2}


def test_a_heatmap_from_before_every_pose_or_from_a_gap_is_rejected(intake: Intake) -> None:
    intake.heatmap(0.9)
    assert intake.counts == {Miss.TOO_OLD.value: 1}
    intake.poses(3.5, 3.5)
    intake.heatmap(2.5)
    assert intake.counts[Miss.GAP.value] == 1


def test_a_queue_that_is_full_loses_its_oldest(intake: Intake, monkeypatch) -> None:
    monkeypatch.setattr('peace_ros.core.landing.intake._PENDING_LIMIT', 3)
    for number in range(5):
        intake.heatmap(2.1 + 0.01 * number)
    assert intake.counts == {'overtaken while it waited for a pose': 2}
    intake.poses(2.1, 2.2)
    assert intake.counts['used'] == 3


def test_poses_that_are_not_kept_are_counted(intake: Intake) -> None:
    intake.intake.add_pose(pose_of(1.5))
    intake.intake.add_pose(replace(pose_of(2.1), altitude_agl_m=nan))
    assert intake.counts == {'pose rejected': 2}
    intake.intake.add_pose(replace(pose_of(2.1), north_m=nan, east_m=nan))
    intake.intake.add_pose(replace(pose_of(2.1), north_m=nan, east_m=nan))
    assert intake.counts == {'pose rejected': 3}


def test_a_jump_drops_the_map_and_says_so(intake: Intake) -> None:
    intake.heatmap(1.5)
    intake.heatmap(2.05)
    intake.intake.add_pose(pose_of(2.1, 30.0))
    assert intake.intake.drops == 1
    assert intake.counts == {'used': 1, 'map dropped': 1, Miss.TOO_OLD.value: 1}
    assert intake.intake.last_rejection == ('the position jumped by 30.0 m, so the map was dropped')
    assert intake.map.stamp_ns is None
    intake.intake.add_pose(pose_of(2.2, 60.0))
    assert intake.intake.drops == 1, 'there was nothing left to drop'
    intake.poses(2.3, 2.5, 60.0)
    intake.heatmap(2.4, np.tile(np.linspace(0.5, 0.8, 32, dtype=np.float32), (32, 1)))
    assert intake.counts['used'] == 2
    assert intake.intake.last_rejection == Miss.TOO_OLD.value, 'there is a newer map'


def test_a_silence_of_the_position_drops_the_map(intake: Intake) -> None:
    intake.heatmap(1.5)
    gap_s = intake.map.parameters.position_gap_limit_s
    intake.tick(2.0 + gap_s)
    assert intake.intake.drops == 0
    intake.tick(2.1 + gap_s)
    assert intake.intake.drops == 1
    assert intake.intake.last_rejection == (
        f'no position for {gap_s + 0.1:.1f} s, so the map was dropped'
    )


def test_clearing_forgets_what_waits_and_keeps_the_counts(intake: Intake) -> None:
    intake.heatmap(1.5)
    intake.heatmap(2.5)
    intake.depth(2.5)
    intake.tick(2.0)
    intake.intake.clear()
    intake.map.clear()
    assert intake.counts == {'used': 1}
    intake.poses(0.1, 1.0)
    intake.heatmap(0.5)
    intake.depth(0.5)
    assert intake.counts == {'used': 2, 'depth used': 1}
    later = Intake()
    later.tick(1.0)
    later.intake.clear()
    later.heatmap(50.0)
    assert later.counts == {}, 'the clock is not known any more'


def test_depth_waits_for_its_pose_too(intake: Intake, monkeypatch) -> None:
    intake.depth(1.55)
    assert intake.counts == {'depth used': 1}
    intake.depth(1.55)
    intake.depth(1.0)
    assert intake.counts == {'depth used': 1, 'depth not newer than the last': 2}
    intake.depth(2.05)
    intake.depth(2.1)
    assert intake.counts['depth used'] == 1
    intake.poses(2.1, 2.1)
    assert intake.counts['depth used'] == 3
    intake.intake.add_pose(pose_of(3.1))
    intake.depth(2.6)
    assert intake.counts[f'depth: {Miss.GAP.value}'] == 1
    intake.intake.add_pose(replace(pose_of(3.2), altitude_agl_m=0.5, down_m=-0.5))
    intake.intake.add_pose(replace(pose_of(3.3), altitude_agl_m=0.5, down_m=-0.5))
    intake.depth(3.3)
    assert any(fate.startswith('depth taken too low') for fate in intake.counts) or any(
        fate.startswith('depth: ') for fate in intake.counts
    )


def test_of_depth_only_the_newest_wait(intake: Intake) -> None:
    for number in range(40):
        intake.depth(2.1 + 0.01 * number)
    waiting = len(intake.intake._depths)
    assert 1 < waiting < 40
    intake.poses(2.1, 2.6)
    assert intake.counts == {'depth used': waiting}


def test_each_drop_of_the_map_is_counted(intake: Intake) -> None:
    north_m, time_s = 0.0, 2.0
    for number in range(3):
        intake.heatmap(time_s - 0.05, PICTURE[:32, :32] - 0.01 * number)
        north_m, time_s = north_m + 30.0, time_s + 0.1
        intake.intake.add_pose(pose_of(time_s, north_m))
        intake.poses(time_s + 0.1, time_s + 0.3, north_m)
        time_s += 0.3
    assert intake.intake.drops == 3
    assert intake.counts['map dropped'] == 3
    assert intake.intake.last_rejection.startswith('the position jumped by 30.0 m')


def test_stamps_begin_at_zero() -> None:
    intake = Intake()
    intake.intake.add_pose(pose_of(0.0))
    intake.heatmap(0.0)
    intake.depth(0.0)
    assert intake.counts == {'used': 1, 'depth used': 1}
    intake.intake.clear()
    intake.map.clear()
    intake.intake.add_pose(pose_of(0.0))
    intake.depth(0.0)
    assert intake.counts['depth used'] == 2


def test_a_stuck_picture_is_rejected_with_its_reason(intake: Intake) -> None:
    intake.heatmap(1.5)
    intake.poses(2.1, 2.5, 2.0)
    intake.heatmap(2.4)
    assert intake.counts == {'used': 1, STUCK: 1}
    assert intake.intake.last_rejection == STUCK
