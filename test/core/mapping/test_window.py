# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which cells a frame reaches, and what is read of it there."""

from __future__ import annotations

from dataclasses import replace
from math import cos, degrees, pi, radians, tan

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, Heatmap, Pose
from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.core.mapping import MapParameters, RefusedLookError, SafetyMap
from peace_ros.core.mapping.projection import (
    GroundGrid,
    Window,
    project,
    tilt_rad,
    visible_window,
    worst_part,
)

S = 1_000_000_000
CAMERA = Camera.from_degrees(352, 352, 73.0)
GRID = GroundGrid(-100.0, -90.0, 1.0, 200, 180)
HALF = tan(radians(36.5))
"""Half the width that the camera sees, in altitudes."""


def pose_of(altitude_m: float, north_m: float, east_m: float, **deg: float) -> Pose:
    attitude = quaternion_from_euler(
        *(radians(deg.get(name, 0.0)) for name in ('roll', 'pitch', 'yaw'))
    )
    return Pose(0, north_m, east_m, -altitude_m, attitude, altitude_m)


def window_of(pose: Pose, limit_deg: float, grid: GroundGrid = GRID) -> Window | None:
    return visible_window(CAMERA.resized(176, 88), pose, grid, limit_deg)


def test_a_part_of_a_grid_lies_where_its_window_says() -> None:
    part = GroundGrid(-100.0, -90.0, 0.5, 200, 180).part(Window(3, 8, 20, 30))
    assert part == (-98.5, -86.0, 0.5, 20, 30)
    assert Window(3, 8, 20, 30).slices == (slice(3, 23), slice(8, 38))


def test_a_level_camera_reaches_what_its_picture_shows() -> None:
    half_m = 50.5 * HALF
    assert 37.0 < half_m < 38.0
    assert window_of(pose_of(50.5, 10.3, -20.4), 60.0) == Window(72, 32, 76, 75)


def test_slanted_rays_are_left_out() -> None:
    assert 50.0 * tan(radians(30.0)) == pytest.approx(28.87, abs=0.01)
    assert window_of(pose_of(50.0, 10.0, -20.0), 30.0) == Window(81, 41, 58, 58)


@pytest.mark.parametrize(
    ('place', 'window'),
    [
        ((95.5, -85.5), Window(158, 0, 42, 42)),
        ((-95.5, 85.5), Window(0, 138, 42, 42)),
        ((300.0, 0.0), None),
        ((0.0, 300.0), None),
        ((-300.0, 0.0), None),
        ((0.0, -300.0), None),
    ],
)
def test_cells_beyond_the_grid_are_left_out(
    place: tuple[float, float], window: Window | None
) -> None:
    assert window_of(pose_of(50.5, *place), 60.0) == window


def test_a_picture_that_touches_one_row_of_cells_reaches_it() -> None:
    edge = pose_of(50.5, 100.0 + 50.5 * HALF - 0.5, 0.0)
    assert window_of(edge, 60.0) == Window(199, 52, 1, 76)
    beside = pose_of(50.5, 0.0, 90.0 + 50.5 * HALF - 0.5)
    assert window_of(beside, 60.0) == Window(62, 179, 76, 1)


def test_a_camera_that_leans_reaches_the_corners_of_its_picture() -> None:
    """Nose up by 20 deg: from -16.5 to 56.5 deg ahead."""
    window = window_of(pose_of(40.0, 0.0, 0.0, pitch=20.0), 70.0)
    assert window is not None
    far_m, near_m = 40.0 * tan(radians(56.5)), -40.0 * tan(radians(16.5))
    half_m = 40.0 * HALF * cos(radians(36.5)) / cos(radians(56.5))
    assert window.row == int(100.0 + near_m)
    assert window.row + window.rows == int(100.0 + far_m) + 1
    assert window.column == int(90.0 - half_m)
    assert window.column + window.columns == int(90.0 + half_m) + 1


def test_a_camera_that_sees_the_horizon_reaches_as_far_as_rays_are_believed() -> None:
    assert window_of(pose_of(20.0, 0.5, 0.5, pitch=60.0), 45.0) == Window(80, 70, 41, 41)


def test_a_sampled_ramp_is_the_ramp_on_the_ground() -> None:
    """North is up and east is right in the picture of a level camera that heads north."""
    pose, size = pose_of(100.0, 3.0, -2.0), 352
    grid = GroundGrid(-30.0, -40.0, 0.5, 140, 150)
    rows, columns = np.mgrid[0:size, 0:size]
    north = -30.0 + 0.5 * (np.arange(140) + 0.5)
    east = -40.0 + 0.5 * (np.arange(150) + 0.5)
    px_per_m = CAMERA.focal_px / 100.0
    middle = (size - 1) / 2
    v, u = middle - (north - 3.0) * px_per_m, middle + (east + 2.0) * px_per_m
    for picture, truth in (
        (rows, np.broadcast_to(v[:, None], (140, 150))),
        (columns, np.broadcast_to(u[None, :], (140, 150))),
    ):
        safety = np.minimum(picture, 255).astype(np.uint8)
        sampled, kind = project(safety, (safety % 2 + 1).astype(np.uint8), CAMERA, pose, grid)
        assert sampled.shape == kind.shape == (140, 150)
        counts = truth < 250.0
        assert np.abs(sampled - truth)[counts].max() < 0.6
        assert set(np.unique(kind)) == {1, 2}, 'kinds are never mixed'


def test_ground_that_is_not_in_view_has_no_kind() -> None:
    pose = pose_of(20.0, 0.0, 0.0)
    grid = GroundGrid(-30.0, -30.0, 1.0, 60, 60)
    ones = np.ones((100, 100), np.uint8)
    _, kind = project(ones, ones, CAMERA.resized(100, 100), pose, grid)
    seen = np.argwhere(kind)
    assert seen.min(axis=0) == pytest.approx([15, 15], abs=1)
    assert seen.max(axis=0) == pytest.approx([44, 44], abs=1)


def test_the_worst_part_of_a_cell_counts() -> None:
    safety = np.full((40, 50), 255, np.uint8)
    safety[20, 30] = 0
    found = worst_part(safety, (6.0, 6.0))
    np.testing.assert_array_equal(np.unique(found), [227, 255])  # 8/9 of 255
    worst = np.argwhere(found == 227)
    assert worst.min(axis=0) == pytest.approx([18, 28], abs=1)
    assert np.ptp(worst, axis=0).tolist() == [5, 5]


def test_the_border_of_a_picture_is_repeated() -> None:
    safety = np.full((40, 50), 255, np.uint8)
    safety[0, 0] = 0
    assert worst_part(safety, (6.0, 6.0))[0, 0] == 142  # 5/9 of 255


@pytest.mark.parametrize(('pixels_per_cell', 'worst'), [(1.5, 192), (4.0, 192), (5.2, 227)])
def test_half_a_cell_is_two_pixels_at_least(pixels_per_cell: float, worst: int) -> None:
    safety = np.full((40, 50), 255, np.uint8)
    safety[20, 30] = 0
    assert worst_part(safety, (pixels_per_cell, pixels_per_cell)).min() == worst


def test_cells_of_about_a_pixel_are_read_as_they_are() -> None:
    safety = np.full((4, 4), 255, np.uint8)
    assert worst_part(safety, (1.4, 1.4)) is safety


@pytest.mark.parametrize('size_wh', [(352, 352), (200, 120)])
@pytest.mark.parametrize('limit_deg', [60.0, 25.0])
@pytest.mark.parametrize('place', [(0.0, 0.0), (13.2, -17.9), (1500.3, -2100.7)])
def test_a_frame_reaches_what_it_shows_without_its_border(
    place: tuple[float, float], limit_deg: float, size_wh: tuple[int, int]
) -> None:
    parameters = MapParameters(map_size_m=120.0, off_nadir_limit_deg=limit_deg)
    safety_map, altitude_m = SafetyMap(parameters), 50.0
    width, height = size_wh
    heatmap = Heatmap(np.full((height, width), 0.9, np.float32), S)
    count = safety_map.add(heatmap, CAMERA, pose_of(altitude_m, *place))
    looks = safety_map.layers(S).looks
    assert count == np.count_nonzero(looks)
    layers = safety_map.layers(S)
    north, east = layers.distances_m(*place)
    px_per_m = CAMERA.focal_px / altitude_m
    v = (175.5 - north * px_per_m + 0.5) * height / 352 - 0.5
    u = (175.5 + east * px_per_m + 0.5) * width / 352 - 0.5
    border_u, border_v = round(0.03 * width), round(0.03 * height)
    inside_v = np.minimum(v - border_v + 0.5, height - border_v - 0.5 - v)
    inside_u = np.minimum(u - border_u + 0.5, width - border_u - 0.5 - u)
    slant = altitude_m * tan(radians(limit_deg)) - np.hypot(north, east)
    depth = np.minimum(np.minimum(inside_v, inside_u), slant)
    clear = np.abs(depth) > 0.05
    assert np.count_nonzero(~clear) < 0.02 * clear.size
    assert np.array_equal((looks > 0)[clear], (depth > 0.0)[clear])


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_window_moves_once_the_vehicle_has_left_its_middle(sign: float) -> None:
    """By more than a twelfth of its 40 cells."""
    safety_map = SafetyMap(MapParameters(map_size_m=20.0))
    for axis in ('north_m', 'east_m'):
        safety_map.clear()

        def edge(number: int, place_m: float, axis: str = axis) -> float:
            heatmap = Heatmap(np.full((352, 352), 0.9, np.float32), number * S)
            place = {'north_m': 0.0, 'east_m': 0.0, axis: place_m}
            safety_map.add(heatmap, CAMERA, pose_of(20.0, **place))
            layers = safety_map.layers(number * S)
            return layers.south_m if axis == 'north_m' else layers.west_m

        assert edge(1, 0.0) == -10.0
        assert edge(2, sign * 1.5) == -10.0
        assert edge(3, sign * 2.0) == -10.0 + sign * 2.0
        assert edge(4, sign * 0.5) == -10.0 + sign * 2.0
        assert edge(5, 0.0) == -10.0


@pytest.mark.parametrize(('moved_m', 'follows'), [(2.0, False), (3.0, True)])
def test_a_small_window_has_little_slack(moved_m: float, follows: bool) -> None:
    """A twelfth of its 24 cells."""
    safety_map = SafetyMap(MapParameters(map_size_m=24.0, map_cell_m=1.0))
    for number, place_m in enumerate((0.0, moved_m)):
        heatmap = Heatmap(np.full((32, 32), 0.9, np.float32), number)
        safety_map.add(heatmap, CAMERA, pose_of(20.0, place_m, 0.0))
    assert (safety_map.layers(1).south_m == -12.0 + moved_m) == follows


def test_ground_that_a_window_reaches_anew_is_new() -> None:
    moved, fresh = (SafetyMap(MapParameters(map_size_m=20.0)) for _ in range(2))
    heatmap = Heatmap(np.full((32, 32), 0.7, np.float32), S)
    moved.add(heatmap, CAMERA, pose_of(3.0, -8.0, 8.0))
    later = Heatmap(heatmap.safety, 9 * S)
    for each in (moved, fresh):
        each.add(later, CAMERA, pose_of(60.0, 0.0, 0.0))
    known, expected = moved.layers(9 * S), fresh.layers(9 * S)
    new = np.s_[20:, :20]
    np.testing.assert_array_equal(known.score[new], expected.score[new])
    np.testing.assert_array_equal(known.looks[new], expected.looks[new])


def test_a_camera_that_shows_nothing_of_the_window_reaches_no_cell() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=20.0, tilt_limit_deg=80.0))
    heatmap = Heatmap(np.full((32, 32), 0.7, np.float32), S)
    assert safety_map.add(heatmap, CAMERA, pose_of(200.0, 0.0, 0.0, pitch=50.0)) == 0
    layers = safety_map.layers(S)
    assert not layers.looks.any()
    assert np.all(layers.score == 0.0)
    assert np.all(np.isinf(layers.age_s))
    assert layers.score.dtype == layers.age_s.dtype == np.float32
    assert layers.looks.dtype == np.uint16


def test_a_window_that_moved_holds_everything_it_knew(pose_at) -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    rng = np.random.default_rng(7)
    safety = rng.uniform(0.3, 0.9, (12, 12)).astype(np.float32)
    for number in range(2):
        heatmap = Heatmap(np.kron(safety, np.ones((30, 30), np.float32)), (number + 1) * S)
        safety_map.add(heatmap, CAMERA, pose_of(20.0, 0.0, 0.0))
    before = safety_map.layers(2 * S)
    # Too small a picture to reach more than the cells below, far from what is compared.
    far = Heatmap(np.full((352, 352), 0.9, np.float32), 2 * S + 1)
    safety_map.add(far, CAMERA, pose_of(2.0, 6.0, -8.0))
    after = safety_map.layers(2 * S)
    assert (after.south_m, after.west_m) == (before.south_m + 6.0, before.west_m - 8.0)
    old, new = (slice(12, 30), slice(20, 60)), (slice(0, 18), slice(36, 76))
    np.testing.assert_allclose(after.score[new], before.score[old], atol=1e-6)
    np.testing.assert_array_equal(after.looks[new], before.looks[old])
    np.testing.assert_allclose(after.age_s[new], before.age_s[old], atol=1e-6)
    assert np.all(after.looks[62:, :30] == 0)
    assert np.all(np.isinf(after.age_s[62:, :30]))


def test_what_is_known_grows_less_when_the_map_loses_accuracy() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    safety = np.full((352, 352), 0.9, np.float32)
    safety[176:178, 176:178] = 0.35  # one cell of doubt in the middle
    safety_map.add(Heatmap(safety, S), CAMERA, pose_of(20.0, 0.0, 0.0))
    before = safety_map.layers(S)
    doubt = before.score < 0.7
    known = before.looks > 0
    safety_map.widen_unsafe(0.6)  # two cells
    after = safety_map.layers(S)
    rows, columns = np.nonzero((after.score < 0.7) & (after.looks > 0))
    was_rows, was_columns = np.nonzero(doubt & known)
    assert rows.min() == was_rows.min() - 2
    assert rows.max() == was_rows.max() + 2
    assert columns.min() == was_columns.min() - 2
    assert columns.max() == was_columns.max() + 2
    edge = np.nonzero(known.any(axis=1))[0]
    assert np.nonzero((after.looks > 0).any(axis=1))[0].min() == edge.min() + 2
    assert np.array_equal(np.isinf(after.age_s), after.looks == 0)
    safety_map.widen_unsafe(0.0)
    assert np.array_equal(safety_map.layers(S).looks, after.looks)


def test_what_is_unsafe_grows_round_and_by_one_cell_at_least() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    safety = np.full((352, 352), 0.9, np.float32)
    safety[170:174, 170:174] = 0.3
    safety_map.add(Heatmap(safety, S), CAMERA, pose_of(20.0, 0.0, 0.0))

    def doubtful() -> np.ndarray:
        layers = safety_map.layers(S)
        return (layers.score < 0.7) & (layers.looks > 0)

    rows, columns = (slice(each.min() - 3, each.max() + 4) for each in np.nonzero(doubtful()))
    before = doubtful()[rows, columns].astype(np.uint8)
    safety_map.widen_unsafe(0.1)
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
    once = cv2.dilate(before, cross)
    assert np.array_equal(doubtful()[rows, columns], once)
    safety_map.widen_unsafe(0.9)
    disc = np.ones((5, 5), np.uint8)
    disc[np.ix_([0, 4], [0, 1, 3, 4])] = 0
    assert np.array_equal(doubtful()[rows, columns], cv2.dilate(once, disc))


def test_a_map_that_loses_accuracy_does_not_know_what_it_saw_last() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    safety = np.full((352, 352), 0.9, np.float32)
    safety_map.add(Heatmap(safety, S), CAMERA, pose_of(20.0, 0.0, 0.0))
    safety_map.add(Heatmap(safety, 3 * S), CAMERA, pose_of(10.0, 0.0, 0.0))

    def fresh_rows() -> tuple[int, int]:
        rows = np.nonzero((safety_map.layers(3 * S).age_s < 1.0).any(axis=1))[0]
        return int(rows.min()), int(rows.max())

    low, high = fresh_rows()
    safety_map.widen_unsafe(1.5)
    assert fresh_rows() == (low + 3, high - 3)


def test_a_square_of_the_layers_holds_every_cell_that_it_touches() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    safety_map.add(Heatmap(np.full((8, 8), 0.9, np.float32), 0), CAMERA, pose_of(60.0, 0, 0))
    square = safety_map.layers(0, (3.1, -4.2, 1.0))
    assert (square.south_m, square.west_m) == (2.0, -5.5)
    assert square.score.shape == (5, 5)
    corner = safety_map.layers(0, (-19.6, 19.6, 1.0))
    assert (corner.south_m, corner.west_m) == (-20.0, 18.5)
    assert corner.score.shape == (3, 3)
    assert safety_map.layers(0, (-25.0, 0.0, 1.0)).score.shape[0] == 0
    assert safety_map.layers(0, (0.0, 25.0, 1.0)).score.shape[1] == 0


@pytest.mark.parametrize(
    ('place', 'radius_m', 'known'),
    [
        ((0.0, 0.0), 3.0, True),
        ((-17.4, 0.0), 2.5, True),
        ((-17.6, 0.0), 2.5, False),
        ((17.4, 0.0), 2.5, True),
        ((17.5, 0.0), 2.5, False),
        ((0.0, -17.4), 2.5, True),
        ((0.0, -17.6), 2.5, False),
        ((0.0, 17.4), 2.5, True),
        ((0.0, 17.5), 2.5, False),
    ],
)
def test_a_disc_that_leaves_the_window_is_unknown(
    place: tuple[float, float], radius_m: float, known: bool
) -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    safety_map.add(Heatmap(np.full((352, 352), 0.9, np.float32), S), CAMERA, pose_of(60.0, 0, 0))
    score, age_s = safety_map.score_around(*place, radius_m, 3 * S)
    assert (score > 0.5) == known
    assert age_s == (pytest.approx(2.0, abs=1e-3) if known else float('inf'))


def test_a_disc_scores_as_its_worst_cell_and_is_as_old_as_its_oldest() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    safety = np.full((352, 352), 0.9, np.float32)
    safety[:, 200:] = 0.6
    safety_map.add(Heatmap(safety, S), CAMERA, pose_of(60.0, 0, 0))
    east_m = (200 - 175.5) / CAMERA.focal_px * 60.0
    left, right = (
        safety_map.score_around(0.0, east, 1.0, S)[0] for east in (east_m - 2.0, east_m + 2.0)
    )
    assert left > 0.75
    assert 0.65 > right > 0.55
    assert safety_map.score_around(0.0, east_m - 0.5, 1.0, S)[0] == pytest.approx(right, abs=1e-4)
    corner = SafetyMap(MapParameters(map_size_m=40.0))
    safety = np.full((352, 352), 0.9, np.float32)
    safety[:140, :140] = 0.6
    corner.add(Heatmap(safety, S), CAMERA, pose_of(60.0, 0, 0))
    edge_m = (175.5 - 140.0) / CAMERA.focal_px * 60.0
    for aside_m, score in ((2.4, left), (1.8, right)):
        found = corner.score_around(edge_m - aside_m, aside_m - edge_m, 3.0, S)
        assert found[0] == pytest.approx(score, abs=1e-4)
    tiny = safety_map.score_around(0.25, 0.25, 0.0, S)
    assert tiny[0] == pytest.approx(left, abs=1e-4)


@pytest.mark.parametrize(
    ('pose', 'fate'),
    [
        (pose_of(0.99, 0.0, 0.0), 'taken too low above ground'),
        (pose_of(30.0, float('nan'), 0.0), 'taken at an impossible place'),
        (pose_of(30.0, 0.0, float('inf')), 'taken at an impossible place'),
        (pose_of(30.0, -1e20, 0.0), 'taken at an impossible place'),
        (pose_of(1e300, 0.0, 0.0), 'taken at an impossible place'),
        (pose_of(30.0, 0.0, 0.0, roll=40.1), 'taken at too much tilt'),
    ],
)
def test_the_reason_of_a_refusal_is_told_in_a_few_words(pose: Pose, fate: str) -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=40.0))
    with pytest.raises(RefusedLookError) as refused:
        safety_map.add(Heatmap(np.full((8, 8), 0.9, np.float32), S), CAMERA, pose)
    assert refused.value.fate == fate
    sentence = 'off the vertical' if 'tilt' in fate else 'or more above ground to project'
    assert sentence in str(refused.value)
    assert safety_map.stamp_ns is None


@pytest.mark.parametrize(
    ('angles', 'tilt_deg'),
    [
        ({}, 0.0),
        ({'yaw': 130.0}, 0.0),
        ({'roll': 20.0}, 20.0),
        ({'pitch': -30.0, 'yaw': 50.0}, 30.0),
        ({'roll': 120.0}, 120.0),
    ],
)
def test_tilt_is_the_angle_off_the_vertical(angles: dict[str, float], tilt_deg: float) -> None:
    assert degrees(tilt_rad(pose_of(30.0, 0.0, 0.0, **angles))) == pytest.approx(tilt_deg)


def test_an_inaccurate_quaternion_upside_down_has_a_tilt() -> None:
    pose = replace(pose_of(30.0, 0.0, 0.0), quaternion_ned_frd=(0.0, 1.005, 0.0, 0.0))
    assert tilt_rad(pose) == pi
