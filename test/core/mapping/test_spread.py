# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How depth becomes rough and flat cells, step by step."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from peace_ros.core.domain import Camera, DepthImage, Pose
from peace_ros.core.domain.geometry import quaternion_from_euler
from peace_ros.core.mapping import MapParameters, SafetyMap
from peace_ros.core.mapping import flatness as steps
from peace_ros.core.mapping import safety_map as mapped
from peace_ros.core.mapping.flatness import rough_and_flat
from peace_ros.core.mapping.projection import GroundGrid

CAMERA = Camera.from_degrees(352, 352, 73.0)
LEVEL = Pose(0, 3.0, -2.0, -10.0, (1.0, 0.0, 0.0, 0.0), 10.0)


def depth_of(values: np.ndarray) -> DepthImage:
    return DepthImage(values.astype(np.float32), 0)


@pytest.mark.parametrize(
    ('shape', 'step'), [((100, 120), 1), ((160, 90), 1), ((161, 90), 2), ((200, 480), 3)]
)
def test_large_pictures_are_read_at_every_second_or_third_pixel(
    shape: tuple[int, int], step: int
) -> None:
    height, width = shape
    rows, columns = np.arange(step // 2, height, step), np.arange(step // 2, width, step)
    offsets, known = steps._points(depth_of(np.full(shape, 10.0)), CAMERA, LEVEL, 20.0)
    assert offsets.shape == (3, len(rows), len(columns))
    assert known.all()
    camera = CAMERA.resized(width, height)
    u, v = (columns - (width - 1) / 2), (rows - (height - 1) / 2)
    fx, fy = camera.focal_xy_px
    np.testing.assert_allclose(offsets[0], np.tile(-v / fy * 10, (len(u), 1)).T)
    np.testing.assert_allclose(offsets[1], np.tile(u / fx * 10, (len(v), 1)))
    np.testing.assert_allclose(offsets[2], 10.0)


def test_points_are_turned_with_the_camera() -> None:
    yaw = quaternion_from_euler(0.0, 0.0, radians(90.0))
    turned = Pose(0, 0.0, 0.0, -10.0, yaw, 10.0)
    level, _ = steps._points(depth_of(np.full((40, 60), 8.0)), CAMERA, LEVEL, 20.0)
    offsets, _ = steps._points(depth_of(np.full((40, 60), 8.0)), CAMERA, turned, 20.0)
    np.testing.assert_allclose(offsets[0], -level[1], atol=1e-9)
    np.testing.assert_allclose(offsets[1], level[0], atol=1e-9)


def test_only_what_was_measured_is_known() -> None:
    values = np.full((4, 4), 0.4)
    values[0] = [0.0, -1.0, np.nan, np.inf]
    values[1] = [19.99, 20.0, 21.0, -np.inf]
    offsets, known = steps._points(depth_of(values), CAMERA, LEVEL, 20.0)
    expected = np.ones((4, 4), np.bool_)
    expected[0] = False
    expected[1, 1:] = False
    assert np.array_equal(known, expected)
    assert np.all(offsets[:, ~known] == 0.0)
    assert offsets.dtype == np.float64


def test_windows_are_as_wide_as_asked_across_and_along() -> None:
    north = np.repeat(0.25 * np.arange(24.0)[:, None], 16, axis=1)
    east = np.repeat(0.5 * np.arange(16.0)[None, :], 24, axis=0)
    offsets = np.stack((north, east, np.full((24, 16), 9.0)))
    everything = np.ones((24, 16), np.bool_)
    assert steps._window_px(offsets, everything, 3.0) == (6, 12)
    assert steps._window_px(offsets, everything, 0.5) == (3, 3)
    pairs = everything.copy()
    pairs[:, 2::4] = pairs[:, 3::4] = False
    pairs[2::4] = pairs[3::4] = False
    holes = np.where(pairs, offsets, 0.0)
    assert steps._window_px(holes, pairs, 3.0) == (6, 12)


def test_a_single_point_has_the_smallest_window() -> None:
    alone = np.zeros((5, 5), np.bool_)
    alone[2, 2] = True
    assert steps._window_px(np.ones((3, 5, 5)), alone, 3.0) == (3, 3)
    everything = np.ones((5, 5), np.bool_)
    assert steps._window_px(np.ones((3, 5, 5)), everything, 3.0) == (3000, 3000)


def test_heights_spread_as_their_standard_deviation_over_the_known() -> None:
    rng = np.random.default_rng(3)
    down = rng.normal(50.0, 2.0, (12, 15))
    known = rng.random((12, 15)) > 0.45
    spread, enough = steps._spread_m(down, known, (3, 5))
    for row in range(12):
        for column in range(15):
            window = (slice(max(0, row - 2), row + 3), slice(max(0, column - 1), column + 2))
            inside, values = known[window], down[window][known[window]]
            share = np.count_nonzero(inside) / inside.size
            if abs(share - 0.5) > 1e-6:
                assert enough[row, column] == (share > 0.5)
            if len(values):
                assert spread[row, column] == pytest.approx(values.std(), abs=1e-6)
    far, _ = steps._spread_m(down + 1e6, known, (3, 5))
    np.testing.assert_allclose(far, spread, atol=1e-6)
    half = np.zeros((2, 1), np.bool_)
    half[0] = True
    assert steps._spread_m(np.ones((2, 1)), half, (1, 2))[1][1, 0], 'half is enough'


PARAMETERS = MapParameters(map_size_m=20.0, depth_smoothness_m=0.5)
GRID = GroundGrid(-2.0, -7.0, 0.5, 20, 20)


def test_rough_cells_grow_by_one_and_what_was_not_measured_is_neither(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    north, east = np.mgrid[0:10, 0:10] * 0.5 - 2.5 + 0.25
    points = np.stack((north, east, np.full((10, 10), 10.0)))
    known = np.ones((10, 10), np.bool_)
    enough, spread = known.copy(), np.zeros((10, 10))
    known[0, 0] = enough[9, 9] = False
    spread[4, 6] = 0.6
    spread[0, 0] = spread[9, 9] = 9.0
    spread[2, 2] = 0.5
    monkeypatch.setattr(steps, '_points', lambda *_: (points, known))
    monkeypatch.setattr(steps, '_spread_m', lambda *_: (spread, enough))
    rough, flat = rough_and_flat(depth_of(np.ones((1, 1))), CAMERA, LEVEL, GRID, PARAMETERS)
    # The vehicle at (3, -2) is ten cells off the corner of the grid either way.
    expected = np.zeros((20, 20), np.bool_)
    expected[8:11, 10:13] = True
    assert np.array_equal(rough, expected)
    measured = np.zeros((20, 20), np.bool_)
    measured[5:15, 5:15] = True
    measured[5, 5] = measured[14, 14] = False
    assert np.array_equal(flat, measured & ~expected)


@pytest.mark.parametrize('shift', [(-4.0, 0.0), (4.0, 0.0), (0.0, -4.0), (0.0, 4.0)])
def test_points_beyond_the_grid_are_left_out(shift: tuple[float, float]) -> None:
    depth = depth_of(np.full((60, 60), 10.0))
    _, whole = rough_and_flat(
        depth, CAMERA, LEVEL, GroundGrid(-20.0, -20.0, 0.5, 90, 90), PARAMETERS
    )
    south, west = 1.0 + shift[0], -4.0 + shift[1]
    grid = GroundGrid(south, west, 0.5, 8, 8)
    rough, flat = rough_and_flat(depth, CAMERA, LEVEL, grid, PARAMETERS)
    row, column = round((south + 20.0) / 0.5), round((west + 20.0) / 0.5)
    assert not rough.any()
    assert flat.any()
    assert np.array_equal(flat, whole[row : row + 8, column : column + 8])


def test_the_last_measurement_of_a_cell_counts_and_the_rest_stays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=20.0))
    depth = depth_of(np.full((4, 4), 8.0))
    rough, flat, nothing = (np.zeros((40, 40), np.bool_) for _ in range(3))
    measured = [(rough, nothing), (nothing, flat), (nothing, nothing)]
    monkeypatch.setattr(mapped, 'rough_and_flat', lambda *_: measured.pop(0))
    rough[1, 2] = rough[3, 0] = flat[3, 0] = True
    safety_map.add_depth(depth, CAMERA, LEVEL)
    safety_map.add_depth(depth, CAMERA, LEVEL)
    assert np.argwhere(safety_map._rough).tolist() == [[1, 2]]
    away = replace(LEVEL, north_m=LEVEL.north_m - 2.5, east_m=LEVEL.east_m - 3.0)
    safety_map.add_depth(depth, CAMERA, away)
    assert np.argwhere(safety_map._rough).tolist() == [[6, 8]], 'five and six cells further'
    safety_map.clear()
    assert not safety_map._rough.any()
