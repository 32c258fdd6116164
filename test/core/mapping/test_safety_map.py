# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The map: things lie where they are, evidence gathers and fades, unsafe outlives safe."""

from math import inf, nan, radians

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Heatmap, ImageError, Pose, VehicleError
from peace_ros.core.domain.geometry import ground_to_image, quaternion_from_euler
from peace_ros.core.mapping import MapParameters, SafetyMap

S = 1_000_000_000
CAMERA = Camera.from_degrees(352, 352, 73.0)
SMALL = MapParameters(map_size_m=160.0)
LEANING = MapParameters(map_size_m=160.0, tilt_limit_deg=80.0)


def pose_of(altitude_m=60.0, north_m=0.0, east_m=0.0, *, roll=0.0, pitch=0.0, yaw=0.0) -> Pose:
    attitude = quaternion_from_euler(radians(roll), radians(pitch), radians(yaw))
    return Pose(0, north_m, east_m, -altitude_m, attitude, altitude_m)


def even(value: float, time_s: float, size: int = 64) -> Heatmap:
    return Heatmap(np.full((size, size), value, np.float32), round(time_s * S))


def looked(values, altitude_m=60.0, step_s=0.2) -> SafetyMap:
    """A map after even heatmaps of these values."""
    safety_map = SafetyMap(SMALL)
    for number, value in enumerate(values):
        safety_map.add(even(value, 1.0 + number * step_s), CAMERA, pose_of(altitude_m))
    return safety_map


def score_below(safety_map: SafetyMap, after_s: float = 0.0) -> float:
    now_ns = (safety_map.stamp_ns or 0) + round(after_s * S)
    layers = safety_map.layers(now_ns)
    return float(layers.score[layers.cell_at(0.0, 0.0)])


@pytest.mark.parametrize('size_wh', [(352, 352), (176, 176), (352, 176)])
@pytest.mark.parametrize(
    'attitude', [{}, {'yaw': 70.0}, {'pitch': -16.0, 'yaw': 200.0}, {'roll': 16.0, 'yaw': 30.0}]
)
def test_safe_ground_lies_where_it_is_whatever_the_attitude(attitude, size_wh):
    pose = pose_of(60.0, 7.0, -4.0, **attitude)
    spot = (12.0, -9.0)
    u, v, w = ground_to_image(CAMERA, pose) @ (*spot, 1.0)
    width, height = size_wh
    rows, columns = np.mgrid[0:height, 0:width]
    # The heatmap is the frame, stretched to its own size.
    du = (columns + 0.5) * 352 / width - 0.5 - u / w
    dv = (rows + 0.5) * 352 / height - 0.5 - v / w
    safety = np.where(np.hypot(du, dv) < 12.0, 0.95, 0.05).astype(np.float32)
    safety_map = SafetyMap(SMALL)
    for number in range(5):
        safety_map.add(Heatmap(safety, (number + 1) * S), CAMERA, pose)
    layers = safety_map.layers(5 * S)
    found = np.argwhere(layers.score > 0.8)
    assert len(found) > 10
    assert layers.centre_of(*found.mean(axis=0)) == pytest.approx(spot, abs=0.6)
    assert layers.cell_at(*layers.centre_of(3, 5)) == (3, 5)


def test_unknown_ground_scores_zero_and_is_infinitely_old():
    layers = looked([0.9] * 5).layers(2 * S)
    assert layers.score[0, 0] == 0.0
    assert layers.age_s[0, 0] == inf
    assert layers.looks[0, 0] == 0
    assert SafetyMap(SMALL).score_around(0.0, 0.0, 2.0, 0) == (0.0, inf)


def test_evidence_gathers_over_frames():
    scores = [score_below(looked([0.9] * count)) for count in (1, 3, 6)]
    assert scores == sorted(scores)
    assert scores[-1] > 0.95


def test_weak_evidence_never_adds_up_to_certainty():
    assert score_below(looked([0.55] * 60)) < 0.8
    assert score_below(looked([0.65] * 60)) > 0.9


def test_evidence_of_frames_close_in_time_counts_less():
    slow, quick = looked([0.9] * 4, step_s=0.4), looked([0.9] * 4, step_s=0.02)
    assert score_below(quick) < score_below(slow)


def test_unsafe_outweighs_safe():
    assert score_below(looked([0.5, *[0.9, 0.1] * 10])) < 0.3
    person = looked([0.95] * 20 + [0.05] * 3)
    assert score_below(person) < 0.65, 'three frames take safe ground back'


def test_safe_is_forgotten_sooner_than_unsafe():
    safe, unsafe = looked([0.95] * 20), looked([0.05] * 20)
    fresh = score_below(safe), score_below(unsafe)
    old = score_below(safe, 40.0), score_below(unsafe, 40.0)
    assert fresh[0] > 0.95
    assert old[0] < 0.8
    assert old[1] < 0.15
    layers = safe.layers((safe.stamp_ns or 0) + 40 * S)
    assert layers.age_s[layers.cell_at(0.0, 0.0)] == pytest.approx(40.0, abs=0.01)


def test_a_lower_look_outweighs_a_higher_one():
    safety_map = looked([0.95] * 20, altitude_m=100.0)
    stamp_s = safety_map.stamp_ns / S
    safety_map.add(even(0.1, stamp_s + 0.2), CAMERA, pose_of(30.0))
    assert score_below(safety_map) < 0.6


def test_a_higher_look_hardly_turns_a_lower_one_safe():
    safety_map = looked([0.1] * 6, altitude_m=20.0)
    before, stamp_s = score_below(safety_map), safety_map.stamp_ns / S
    for number in range(3):
        safety_map.add(even(0.9, stamp_s + 0.2 * (number + 1)), CAMERA, pose_of(100.0))
    assert score_below(safety_map) < before + 0.1


def test_a_person_seen_from_low_is_not_averaged_away():
    safety = np.full((352, 352), 0.95, np.float32)
    safety[170:175, 170:175] = 0.0  # 0.4 m at 20 m
    safety_map = SafetyMap(SMALL)
    for number in range(10):
        safety_map.add(Heatmap(safety, (number + 1) * S), CAMERA, pose_of(20.0))
    assert safety_map.score_around(0.0, 0.0, 1.0, 10 * S)[0] < 0.5
    assert safety_map.score_around(4.0, 4.0, 1.0, 10 * S)[0] > 0.9


def test_slanted_rays_and_the_border_of_the_image_are_not_believed():
    safety_map = looked([0.9] * 3)
    layers = safety_map.layers(2 * S)
    half_footprint_m = 60.0 * np.tan(radians(73.0 / 2.0))
    seen_m = np.count_nonzero(layers.looks.max(axis=0)) * layers.cell_m / 2.0
    assert 0.9 * half_footprint_m < seen_m < 0.97 * half_footprint_m
    tilted = SafetyMap(LEANING)
    tilted.add(even(0.9, 1.0), CAMERA, pose_of(20.0, pitch=50.0))
    layers = tilted.layers(S)
    north, _ = np.nonzero(layers.looks)
    assert layers.centre_of(int(north.max()), 0)[0] < 20.0 * np.tan(radians(61.0))


def test_a_camera_that_looks_at_the_horizon_maps_nothing_behind_it():
    safety_map = SafetyMap(LEANING)
    safety_map.add(even(0.9, 1.0), CAMERA, pose_of(20.0, pitch=79.0))
    layers = safety_map.layers(S)
    rows, _ = np.nonzero(layers.looks)
    assert all(layers.centre_of(int(row), 0)[0] > 0.0 for row in set(rows))


def test_the_window_follows_and_keeps_what_it_still_covers():
    safety_map = looked([0.95] * 10)
    stamp_s = safety_map.stamp_ns / S
    before = score_below(safety_map)
    safety_map.add(even(0.95, stamp_s + 0.2), CAMERA, pose_of(20.0, 60.3, -33.7))
    layers = safety_map.layers(safety_map.stamp_ns)
    assert layers.cell_at(110.0, -33.7) is not None
    assert layers.cell_at(-60.0, 0.0) is None
    assert score_below(safety_map) == pytest.approx(before, abs=0.02)
    assert safety_map.score_around(-60.0, 0.0, 2.0, safety_map.stamp_ns) == (0.0, inf)


def test_a_part_of_the_layers_equals_the_whole():
    safety_map = looked([0.9] * 4)
    whole = safety_map.layers(3 * S)
    part = safety_map.layers(3 * S, (10.0, -5.0, 6.0))
    row, column = whole.cell_at(*part.centre_of(0, 0))
    rows, columns = part.score.shape
    assert 24 <= rows <= 26
    same = whole.score[row : row + rows, column : column + columns]
    np.testing.assert_array_equal(part.score, same)
    assert safety_map.layers(3 * S, (5000.0, 0.0, 6.0)).score.size == 0


@pytest.mark.parametrize('value', [nan, inf, -0.1, 1.1])
def test_heatmaps_out_of_range_are_refused_and_change_nothing(value):
    safety_map = looked([0.9])
    with pytest.raises(ImageError, match='within 0 to 1'):
        safety_map.add(even(value, 5.0), CAMERA, pose_of())
    assert safety_map.stamp_ns == S
    assert safety_map.revision == 1


def test_stamps_must_grow():
    safety_map = looked([0.9])
    with pytest.raises(ImageError, match='newer'):
        safety_map.add(even(0.9, 1.0), CAMERA, pose_of())


@pytest.mark.parametrize('altitude_m', [nan, 0.0, -2.0])
def test_poses_that_are_not_above_ground_are_refused(altitude_m):
    with pytest.raises(VehicleError, match='above ground'):
        SafetyMap(SMALL).add(even(0.9, 1.0), CAMERA, pose_of(altitude_m))


@pytest.mark.parametrize('altitude_m', [1e-6, 0.01, 0.5])
def test_a_frame_taken_on_the_ground_is_refused_and_the_map_stays_usable(altitude_m):
    safety_map = looked([0.9] * 5)
    with pytest.raises(VehicleError, match='above ground'):
        safety_map.add(even(0.9, 10.0, 352), CAMERA, pose_of(altitude_m))
    safety_map.add(even(0.9, 11.0, 352), CAMERA, pose_of(1.0))
