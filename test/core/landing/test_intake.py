# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heatmaps meet the pose of their stamp; a map whose place is not known is dropped."""

from dataclasses import replace
from math import nan, radians

import numpy as np
import pytest

from peace_ros.core.domain import Camera, DepthImage, Frame, Heatmap, Pose
from peace_ros.core.domain.geometry import mount_from_degrees, quaternion_from_euler
from peace_ros.core.landing import LandingParameters, odometry, picture_height
from peace_ros.core.landing.intake import HeatmapIntake
from peace_ros.core.mapping import MapParameters, Mismatch, SafetyMap

S = 1_000_000_000
CAMERA = Camera.from_degrees(352, 352, 73.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def pose_of(time_s, north_m=0.0, altitude_m=50.0, quaternion=LEVEL) -> Pose:
    return Pose(round(time_s * S), north_m, 0.0, -altitude_m, quaternion, altitude_m)


def heatmap_of(time_s, value=0.9) -> Heatmap:
    return Heatmap(np.full((48, 48), value, np.float32), round(time_s * S))


@pytest.fixture
def safety_map():
    return SafetyMap(MapParameters(map_size_m=120.0))


@pytest.fixture
def intake(safety_map):
    """An intake with poses at 10 Hz and a heatmap on each, up to the second second."""
    intake = HeatmapIntake(LandingParameters(), CAMERA, safety_map)
    for tick in range(1, 21):
        intake.add_pose(pose_of(0.1 * tick))
        intake.add_heatmap(heatmap_of(0.1 * tick))
        intake.tick(round(0.1 * tick * S))
    assert intake.counts == {'used': 20}
    return intake


def test_a_heatmap_is_laid_where_the_vehicle_was_at_its_stamp_not_where_it_is(intake, safety_map):
    """Half a second of inference at 5 m/s is 2.5 m, and a lean of 15 degrees is 13 m."""
    lean = quaternion_from_euler(0.0, radians(-15.0), 0.0)
    for tick in range(21, 31):
        quaternion = lean if tick > 25 else LEVEL
        intake.add_pose(pose_of(0.1 * tick, 0.5 * (tick - 20), quaternion=quaternion))
    safety = np.full((352, 352), 0.05, np.float32)
    safety[166:186, 166:186] = 0.95
    safety_map.clear()
    for number in range(4):
        intake.add_heatmap(Heatmap(safety, round((2.1 + 0.01 * number) * S)))
    layers = safety_map.layers(3 * S)
    north, east = layers.centre_of(*np.argwhere(layers.score > 0.5).mean(axis=0))
    assert (north, east) == pytest.approx((0.58, 0.0), abs=0.3)


@pytest.mark.parametrize(
    ('pose', 'fate'),
    [
        (pose_of(2.1, quaternion=quaternion_from_euler(radians(19), 0.0, 0.0)), 'used'),
        (
            pose_of(2.1, quaternion=quaternion_from_euler(radians(30), 0.0, 0.0)),
            'the vehicle turned too far between the poses around it',
        ),
        (
            pose_of(2.1, altitude_m=70.0),
            'position or altitude jumped between the poses around it',
        ),
        (pose_of(2.9), 'poses around it are too far apart'),
    ],
)
def test_what_cannot_be_placed_is_counted_with_its_reason(intake, pose, fate):
    used = intake.counts['used']
    intake.add_pose(pose)
    intake.add_heatmap(heatmap_of(2.05))
    assert intake.counts[fate] == (used + 1 if fate == 'used' else 1)


def test_a_frame_at_too_much_tilt_is_counted(intake):
    intake.add_pose(pose_of(2.1, quaternion=quaternion_from_euler(radians(45), 0.0, 0.0)))
    intake.add_heatmap(heatmap_of(2.1))
    assert intake.counts['taken at too much tilt'] == 1


def test_a_position_that_jumps_drops_the_map_and_all_that_is_under_way(intake, safety_map):
    intake.add_heatmap(heatmap_of(2.05))
    intake.add_pose(pose_of(2.1, 15.0))
    assert safety_map.stamp_ns is None
    assert intake.drops == 1
    assert 'jumped by 15.0 m' in intake.last_rejection
    intake.add_heatmap(heatmap_of(2.08))
    assert safety_map.stamp_ns is None, 'taken before the jump'
    intake.add_pose(pose_of(2.2, 15.0))
    intake.add_heatmap(heatmap_of(2.15))
    assert safety_map.stamp_ns == round(2.15 * S)


def test_the_map_outlives_a_short_silence_of_the_position_but_not_a_long_one(intake, safety_map):
    intake.tick(round(4.9 * S))
    assert safety_map.stamp_ns is not None
    intake.tick(round(5.1 * S))
    assert safety_map.stamp_ns is None
    assert (intake.drops, intake.counts['map dropped']) == (1, 1)
    assert 'no position for 3.1 s' in intake.last_rejection
    intake.tick(round(6.0 * S))
    assert intake.drops == 1
    intake.add_pose(pose_of(6.0))
    intake.add_heatmap(heatmap_of(6.0))
    intake.tick(round(6.0 * S))
    assert safety_map.stamp_ns == 6 * S


def test_attitude_without_position_places_nothing(intake, safety_map):
    for tick in range(21, 26):
        intake.add_pose(replace(pose_of(0.1 * tick), north_m=nan, east_m=nan))
        intake.add_heatmap(heatmap_of(0.1 * tick))
        intake.tick(round(0.1 * tick * S))
    assert safety_map.stamp_ns == 2 * S
    assert intake.counts['pose rejected'] == 0
    assert intake.counts['used'] == 20


@pytest.mark.parametrize(
    'change', [{'altitude_agl_m': nan}, {'altitude_agl_m': 2e6}, {'quaternion_ned_frd': (0.0,) * 4}]
)
def test_an_attitude_that_cannot_be_is_rejected(intake, change):
    intake.add_pose(replace(pose_of(2.1), north_m=nan, east_m=nan, **change))
    assert intake.counts['pose rejected'] == 1


def test_a_heatmap_waits_for_its_pose_no_longer_than_its_limit(intake):
    intake.add_heatmap(heatmap_of(2.05))
    for now_s, is_lost in ((2.1, False), (3.1, False), (3.1 + 1e-9, True)):
        intake.tick(round(now_s * S))
        assert bool(intake.counts['no pose after its stamp']) is is_lost
    assert intake.last_rejection == 'no pose after its stamp'


def test_each_heatmap_has_its_own_wait(intake):
    intake.add_heatmap(heatmap_of(2.05))
    intake.tick(round(2.1 * S))
    intake.add_heatmap(heatmap_of(2.06))
    intake.tick(round(3.2 * S))
    assert intake.counts['no pose after its stamp'] == 1, 'the second waits since now'
    intake.tick(round(4.2 * S))
    assert intake.counts['no pose after its stamp'] == 1
    intake.tick(round(4.3 * S))
    assert intake.counts['no pose after its stamp'] == 2


def test_four_heatmaps_wait_and_the_oldest_makes_room(intake):
    for number in range(1, 6):
        intake.add_heatmap(heatmap_of(2.0 + 0.01 * number))
    assert intake.counts['overtaken while it waited for a pose'] == 1
    intake.add_pose(pose_of(2.1))
    assert intake.counts['used'] == 24


@pytest.mark.parametrize(('ahead_s', 'is_taken'), [(0.5, True), (0.5 + 1e-9, False)])
def test_a_stamp_may_lie_ahead_of_the_clock_up_to_the_tolerance(intake, ahead_s, is_taken):
    intake.add_heatmap(heatmap_of(2.0 + ahead_s))
    intake.add_pose(pose_of(2.0 + ahead_s))
    assert (intake.counts['used'] == 21) is is_taken
    assert (intake.counts['stamp in the future'] == 1) is not is_taken


def test_a_heatmap_that_waits_ahead_of_a_clock_that_went_back_is_rejected(intake):
    intake.add_heatmap(heatmap_of(2.4))
    intake.tick(round(1.9 * S))
    assert intake.counts['stamp in the future'] == 0
    intake.tick(round(1.8 * S))
    assert intake.counts['stamp in the future'] == 1


def test_a_used_heatmap_ends_the_reason_of_a_dropped_map(intake):
    intake.add_pose(pose_of(2.1, 15.0))
    intake.add_pose(pose_of(2.2, 15.0))
    assert intake.last_rejection.endswith('so the map was dropped')
    intake.add_heatmap(heatmap_of(2.15))
    assert intake.last_rejection == ''
    intake.add_heatmap(heatmap_of(2.15))
    assert intake.last_rejection == 'not newer than the last'


def test_after_it_was_cleared_old_stamps_are_new_again(intake, safety_map):
    intake.add_heatmap(heatmap_of(2.05))
    intake.clear()
    safety_map.clear()
    intake.add_pose(pose_of(0.5))
    intake.add_heatmap(heatmap_of(0.5))
    assert intake.counts['used'] == 21
    assert safety_map.stamp_ns == S // 2


@pytest.mark.parametrize(
    ('value', 'fate'), [(1.01, 'values outside of 0 to 1'), (nan, 'not finite')]
)
def test_values_that_are_no_safety_are_rejected(intake, value, fate):
    intake.add_pose(pose_of(2.1))
    intake.add_heatmap(heatmap_of(2.1, value))
    assert intake.counts[fate] == 1
    assert intake.last_rejection == fate


def seen_by(heatmap: Heatmap, size_px=None, camera=None) -> Heatmap:
    return replace(heatmap, frame_size_px=size_px, camera=camera)


WIDE = Camera.from_degrees(640, 360, 90.0)


@pytest.mark.parametrize('size_px', [(640, 360), (704, 704), (640, 480)])
def test_frames_of_another_size_than_the_parameters_say_are_not_used(intake, safety_map, size_px):
    before = safety_map.stamp_ns
    intake.add_pose(pose_of(2.1))
    intake.add_heatmap(seen_by(heatmap_of(2.1), size_px))
    assert safety_map.stamp_ns == before
    assert f'{size_px[0]} x {size_px[1]} px' in intake.last_rejection
    assert '352 x 352 px' in intake.last_rejection
    intake.add_pose(pose_of(2.2))
    intake.add_heatmap(seen_by(heatmap_of(2.2), (352, 352)))
    assert safety_map.stamp_ns == round(2.2 * S)


def test_a_heatmap_that_names_no_frame_is_taken_for_one_by_its_shape(intake, safety_map):
    before = safety_map.stamp_ns
    intake.add_pose(pose_of(2.1))
    intake.add_heatmap(Heatmap(np.full((48, 64), 0.9, np.float32), round(2.1 * S)))
    assert safety_map.stamp_ns == before
    assert 'a heatmap of 64 x 48 px' in intake.last_rejection


def test_a_calibrated_frame_is_projected_with_its_own_camera(intake, safety_map):
    """The parameters would let it end 37 m to each side, its own camera shows 50 m by 28 m."""
    safety_map.clear()
    intake.add_pose(pose_of(2.1))
    intake.add_heatmap(seen_by(heatmap_of(2.1), (640, 360), WIDE))
    seen = np.argwhere(safety_map.layers(round(2.1 * S)).looks)
    assert np.ptp(seen, axis=0) * 0.5 == pytest.approx([53.0, 94.0], abs=1.5)


def test_another_calibration_drops_the_map_that_was_seen_with_the_first(intake, safety_map):
    for tick in (21, 22):
        intake.add_pose(pose_of(0.1 * tick))
        intake.add_heatmap(seen_by(heatmap_of(0.1 * tick), (640, 360), WIDE))
    assert intake.drops == 1
    assert safety_map.layers(round(2.2 * S)).looks.max() == 2


def test_a_map_that_another_calibration_dropped_is_missed_for_that_reason(intake):
    intake.add_pose(pose_of(2.1, quaternion=quaternion_from_euler(radians(45), 0.0, 0.0)))
    intake.add_heatmap(seen_by(heatmap_of(2.1), (640, 360), WIDE))
    assert intake.drops == 1
    assert intake.last_rejection == 'the camera has another calibration, so the map was dropped'


def test_pictures_are_compared_with_the_camera_of_the_newest_calibration(intake, monkeypatch):
    used = []

    def compare(before, after, camera, *_):
        used.append(camera)
        return Mismatch.DIFFERENT

    monkeypatch.setattr(picture_height, 'height_change', compare)
    monkeypatch.setattr(odometry, 'register', compare)
    intake.add_pose(pose_of(2.1))
    intake.add_heatmap(seen_by(heatmap_of(2.1), (640, 360), WIDE))
    for tick in range(22, 40):
        known = pose_of(0.1 * tick)
        intake.add_pose(known if tick < 30 else replace(known, north_m=nan, east_m=nan))
        intake.add_view(Frame(np.full((360, 640, 3), tick, np.uint8), round(0.1 * tick * S)))
        intake.tick(round(0.1 * tick * S))
    assert len(used) > 10
    assert {id(each) for each in used} == {id(WIDE)}


def test_after_calibrated_frames_one_without_calibration_is_not_used(intake, safety_map):
    intake.add_pose(pose_of(2.1))
    intake.add_heatmap(seen_by(heatmap_of(2.1), (352, 352), CAMERA))
    intake.add_pose(pose_of(2.2))
    intake.add_heatmap(seen_by(heatmap_of(2.2), (352, 352)))
    assert safety_map.stamp_ns == round(2.1 * S)
    assert 'camera_info is missing' in intake.last_rejection


def test_a_camera_that_looks_ahead_sees_what_is_ahead(safety_map):
    mount = mount_from_degrees((0.0, 15.0, 0.0), (0.0, 0.0, 0.0))
    intake = HeatmapIntake(LandingParameters(), CAMERA, safety_map, mount)
    for tick in range(1, 5):
        intake.add_pose(pose_of(0.1 * tick))
        intake.add_heatmap(heatmap_of(0.1 * tick))
    layers = safety_map.layers(round(0.4 * S))
    north, east = layers.centre_of(*np.argwhere(layers.looks).mean(axis=0))
    assert north > 10.0
    assert east == pytest.approx(0.0, abs=0.3)


def test_a_mount_that_moves_counts_at_its_own_pose(safety_map):
    intake = HeatmapIntake(LandingParameters(), CAMERA, safety_map)
    for tick in range(1, 5):
        ahead = mount_from_degrees((0.0, 5.0 * tick, 0.0), (0.0, 0.0, 0.0))
        intake.add_pose(pose_of(0.1 * tick), ahead)
    intake.add_heatmap(heatmap_of(0.3))
    layers = safety_map.layers(round(0.4 * S))
    north, _ = layers.centre_of(*np.argwhere(layers.looks).mean(axis=0))
    assert north > 10.0


def test_pictures_and_depth_of_another_shape_are_counted_and_not_used(intake):
    for _ in range(2):
        intake.add_view(Frame(np.full((36, 64, 3), 9, np.uint8), round(2.0 * S)))
    intake.add_depth(DepthImage(np.full((36, 64), 9.0, np.float32), round(2.0 * S)))
    assert intake.counts['picture of another shape than the frames'] == 2
    assert intake.counts['depth of another shape than the frames'] == 1


def test_inputs_of_unknown_sources_are_not_used_and_those_of_before_dropped(intake, safety_map):
    intake.distrust('two of them')
    assert safety_map.stamp_ns is None
    assert intake.drops == 1
    for tick in (21, 22):
        intake.add_pose(pose_of(0.1 * tick))
        intake.add_heatmap(heatmap_of(0.1 * tick))
    assert safety_map.stamp_ns is None
    assert intake.counts['two of them'] == 2
    intake.distrust('')
    for tick in (23, 24):
        intake.add_pose(pose_of(0.1 * tick))
        intake.add_heatmap(heatmap_of(0.1 * tick))
    assert safety_map.stamp_ns == round(2.4 * S)
    assert intake.last_rejection == 'two of them'


def test_reasons_without_end_do_not_fill_the_memory(intake):
    for number in range(1000):
        intake.reject(f'the frames have {number} px')
    assert len(intake.counts) == 65
    assert intake.counts['other reasons'] == 1000 - 63
    assert intake.counts['the frames have 0 px'] == 1
    assert sum(intake.counts.values()) == 20 + 1000
    assert intake.last_rejection == 'the frames have 999 px'
