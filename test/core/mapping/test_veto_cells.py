# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Blobs and vetoes in numbers."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, ConfigurationError, Heatmap, Pose
from peace_ros.core.mapping import MapParameters, SafetyMap
from peace_ros.core.mapping.projection import Window
from peace_ros.core.mapping.veto import Veto, blobs

CELLS = 30
ALL = Window(0, 0, CELLS, CELLS)
PARAMETERS = MapParameters(veto_looks=3, veto_s=2.0, map_cell_m=0.5)
NOTHING = np.zeros((CELLS, CELLS), np.bool_)


def at(*cells: tuple[int, int]) -> np.ndarray:
    found = NOTHING.copy()
    for cell in cells:
        found[cell] = True
    return found


def picture(value: int, rows: slice, columns: slice) -> np.ndarray:
    safety = np.full((30, 40), 200, np.uint8)
    safety[rows, columns] = value
    return safety


@pytest.mark.parametrize(('value', 'found'), [(0, True), (64, True), (65, False)])
def test_a_blob_is_clearly_unsafe(value: int, found: bool) -> None:
    safety = picture(value, slice(10, 13), slice(20, 23))
    assert (blobs(safety, (0.1, 0.1), 0.1, PARAMETERS) is not None) == found


@pytest.mark.parametrize(
    ('pixel_m', 'per_cell', 'px', 'grown'),
    [
        (0.1, 1.0, 3, 0),
        (0.1, 4.0, 3, 2),
        (0.1, 5.9, 4, 3),
        (0.35, 1.0, 2, 0),
        (0.05, 2.0, 6, 1),
    ],
)
def test_blobs_stay_where_they_are_and_grow_by_half_a_cell(
    pixel_m: float, per_cell: float, px: int, grown: int
) -> None:
    safety = picture(30, slice(10, 10 + px), slice(20, 20 + px))
    found = blobs(safety, (pixel_m, pixel_m), per_cell * pixel_m, PARAMETERS)
    assert found is not None
    expected = np.zeros_like(safety)
    expected[10 - grown : 10 + px + grown, 20 - grown : 20 + px + grown] = 255
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(('pixel_m', 'px'), [(0.1, 2), (0.05, 5), (0.3, 1), (0.36, 9)])
def test_smaller_blobs_and_coarser_pictures_are_none(pixel_m: float, px: int) -> None:
    safety = picture(30, slice(10, 10 + px), slice(20, 20 + px))
    assert blobs(safety, (pixel_m, pixel_m), pixel_m, PARAMETERS) is None


class Looks:
    """A veto and the looks it takes; ten metres of other ground are always safe."""

    def __init__(self, parameters: MapParameters = PARAMETERS) -> None:
        self.veto = Veto(parameters, CELLS)

    def take(self, time_s: float, unsafe=NOTHING, clear=NOTHING, was_safe=~NOTHING) -> None:
        self.veto.take(ALL, unsafe=unsafe, clear=clear, was_safe=was_safe, now_s=time_s)

    def closed(self, time_s: float) -> list[tuple[int, int]]:
        found = self.veto.closed(slice(0, CELLS), slice(0, CELLS), time_s)
        return [(int(row), int(column)) for row, column in np.argwhere(found)]


def test_a_cell_is_closed_for_a_time_and_until_it_looked_clear() -> None:
    looks = Looks()
    assert looks.closed(0.0) == []
    looks.take(1.0, unsafe=at((4, 5)))
    assert looks.closed(1.0) == [(4, 5)]
    for number in range(3):
        looks.take(1.1 + 0.1 * number, clear=at((4, 5), (9, 9)))
    assert looks.closed(2.9) == [(4, 5)]
    assert looks.closed(3.1) == []
    looks.take(5.0, unsafe=at((4, 5)))
    for number in range(2):
        looks.take(8.0 + number, clear=at((4, 5)))
        assert looks.closed(9.0) == [(4, 5)]
    looks.take(10.0, unsafe=at((4, 5)), clear=at((4, 5)))
    assert looks.closed(11.9) == [(4, 5)]
    for number in range(3):
        assert looks.closed(20.0) == [(4, 5)]
        looks.take(13.0 + number, clear=at((4, 5)))
    assert looks.closed(20.0) == []
    looks.take(30.0, clear=at((4, 5)))
    assert looks.closed(30.0) == [], 'there is nothing to count down'


def test_each_look_makes_the_wait_longer_up_to_five() -> None:
    looks = Looks()
    for number in range(7):
        now_s = 1.0 + 0.1 * number
        looks.take(now_s, unsafe=at((4, 5)))
        wait_s = 2.0 * min(number + 1, 5)
        for each in range(3):
            looks.take(now_s + 0.01 * (each + 1), clear=at((4, 5)))
        assert looks.closed(now_s + wait_s - 0.01) == [(4, 5)]
        assert looks.closed(now_s + wait_s + 0.01) == []


def test_a_wait_that_ends_after_the_last_clear_look_is_forgotten_too() -> None:
    looks = Looks()
    for begun_s in (0.0, 4.0):
        looks.take(begun_s, unsafe=at((4, 5)))
        for number in range(3):
            looks.take(begun_s + 0.1 * (number + 1), clear=at((4, 5)))
        assert looks.closed(begun_s + 1.9) == [(4, 5)]
        assert looks.closed(begun_s + 2.1) == []
        looks.take(begun_s + 3.0)


def test_what_closes_one_cell_prolongs_no_other() -> None:
    looks = Looks()
    looks.take(1.0, unsafe=at((4, 5)))
    looks.take(2.0, unsafe=at((20, 20)))
    for number in range(3):
        looks.take(2.1 + 0.1 * number, clear=at((4, 5), (20, 20)))
    assert looks.closed(2.9) == [(4, 5), (20, 20)]
    assert looks.closed(3.1) == [(20, 20)]


def test_once_open_the_wait_is_short_again() -> None:
    looks = Looks()
    for number in range(3):
        looks.take(1.0 + 0.1 * number, unsafe=at((4, 5)))
    for number in range(3):
        looks.take(7.0 + number, clear=at((4, 5)))
    looks.take(7.3 + 3.0, unsafe=at((4, 5)))
    for number in range(3):
        looks.take(10.4 + 0.1 * number, clear=at((4, 5)))
    assert looks.closed(12.2) == [(4, 5)]
    assert looks.closed(12.4) == []
    early = Looks()
    for number in range(3):
        early.take(1.0 + 0.1 * number, unsafe=at((4, 5)))
        for _ in range(3):
            early.take(1.05 + 0.1 * number, clear=at((4, 5)))
    assert early.closed(7.1) == [(4, 5)], 'clear looks alone make no wait short'


@pytest.mark.parametrize(('turned', 'whole'), [(320, False), (321, True)])
def test_a_frame_that_turns_more_than_four_fifths_unsafe_is_closed_for_one_look(
    turned: int, whole: bool
) -> None:
    looks = Looks()
    safe, unsafe = NOTHING.copy(), NOTHING.copy()
    safe.flat[:400] = True  # 100 m2
    unsafe.flat[:turned] = True
    looks.take(1.0, unsafe=unsafe, was_safe=safe)
    assert len(looks.closed(1.0)) == turned
    looks.take(1.1, clear=~NOTHING)
    assert len(looks.closed(1.1)) == (0 if whole else turned)


def test_less_safe_ground_than_100_m2_may_be_somebody() -> None:
    looks = Looks()
    safe = NOTHING.copy()
    safe.flat[:399] = True
    looks.take(1.0, unsafe=safe, was_safe=safe)
    looks.take(1.1, clear=~NOTHING)
    assert len(looks.closed(1.1)) == 399


def test_a_bad_frame_shortens_no_wait() -> None:
    looks = Looks()
    looks.take(1.0, unsafe=at((4, 5)))
    looks.take(1.1, unsafe=~NOTHING)
    looks.take(4.0, clear=~NOTHING)
    assert looks.closed(4.0) == [(4, 5)]
    assert len(looks.closed(2.9)) == 1


def test_vetoes_move_with_the_window_and_new_cells_are_open() -> None:
    looks = Looks()
    looks.take(1.0, unsafe=at((4, 5), (0, 0)))
    looks.veto.shift(1, -2)
    assert looks.closed(1.0) == [(3, 7)]
    looks.take(1.5, unsafe=at((3, 7), (29, 0)))
    for number in range(3):
        looks.take(1.6 + 0.1 * number, clear=~NOTHING)
    assert looks.closed(3.4) == [(3, 7), (29, 0)]
    assert looks.closed(3.6) == [(3, 7)], 'a new cell has no earlier looks'
    assert looks.closed(5.6) == []


def test_vetoes_widen_with_their_waits() -> None:
    looks = Looks()
    for number in range(2):
        looks.take(1.0 + 0.1 * number, unsafe=at((4, 5)))
    looks.veto.widen(np.ones((1, 3), np.uint8))
    around = [(4, 4), (4, 5), (4, 6)]
    assert looks.closed(1.2) == around
    for number in range(3):
        looks.take(1.2 + 0.1 * number, clear=~NOTHING)
    assert looks.closed(5.0) == around
    assert looks.closed(5.2) == []
    looks.take(2.0, unsafe=at((4, 6)))
    assert looks.veto.closed(slice(4, 5), slice(6, 7), 7.9)[0, 0], 'the third look'
    looks.veto.clear()
    assert looks.closed(2.0) == []


def test_looks_are_counted_only_where_a_veto_has_widened_to() -> None:
    looks = Looks()
    for number in range(2):
        looks.take(1.0 + 0.1 * number, unsafe=at((4, 5)))
    looks.veto.widen(np.ones((1, 3), np.uint8))
    looks.take(1.2, unsafe=at((3, 5), (4, 6)))
    for number in range(3):
        looks.take(1.3 + 0.1 * number, clear=~NOTHING)
    assert (3, 5) not in looks.closed(3.3), 'its first look'
    assert (4, 6) in looks.closed(7.1), 'its third one'


def test_a_window_is_a_part_of_the_map() -> None:
    looks = Looks()
    unsafe = np.array([[False, True], [False, False], [False, False]])
    window = Window(10, 20, 3, 2)
    looks.veto.take(window, unsafe=unsafe, clear=~unsafe, was_safe=unsafe, now_s=1.0)
    assert looks.closed(1.0) == [(10, 21)]
    assert looks.veto.closed(slice(10, 12), slice(20, 22), 1.0).tolist() == [
        [False, True],
        [False, False],
    ]


S = 1_000_000_000
CAMERA = Camera.from_degrees(64, 64, 73.0)
ABOVE = Pose(0, 0.0, 0.0, -10.0, (1.0, 0.0, 0.0, 0.0), 10.0)


def pixels(safety_map: SafetyMap) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the picture at the middles of cells."""
    north, east = safety_map.layers(0).distances_m(0.0, 0.0)
    px_per_m = CAMERA.focal_px / 10.0
    return 31.5 - north * px_per_m + 0.0 * east, 31.5 + east * px_per_m + 0.0 * north


@pytest.mark.parametrize(
    ('rows', 'columns'), [(slice(20, 28), slice(36, 44)), (slice(0, 9), slice(30, 40))]
)
def test_a_blob_closes_the_ground_that_it_shows_and_no_border(rows: slice, columns: slice) -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=20.0))
    safety = np.full((64, 64), 0.9, np.float32)
    for number in range(2):
        safety_map.add(Heatmap(safety, number * S), CAMERA, ABOVE)
    before = safety_map.layers(S)
    safety[rows, columns] = 0.05
    count = safety_map.add(Heatmap(safety, 2 * S), CAMERA, ABOVE)
    after = safety_map.layers(2 * S)
    assert count == np.count_nonzero(after.looks == 3)
    assert np.array_equal(after.looks > 0, before.looks > 0), 'the border is not believed'
    v, u = pixels(safety_map)
    # Grown by a pixel, which is half a cell.
    depth = np.minimum(
        np.minimum(v - (rows.start - 1.5), rows.stop + 0.5 - v),
        np.minimum(u - (columns.start - 1.5), columns.stop + 0.5 - u),
    )
    clear = (np.abs(depth) > 0.1) & (after.looks > 0)
    closed = after.score == 0.0
    assert np.array_equal(closed[clear], (depth > 0.0)[clear])
    assert np.count_nonzero(closed & (after.looks > 0)) > 10
    assert after.score[(depth < -3.0) & (after.looks > 0)].min() > 0.8


def test_closed_ground_grows_round_with_the_map() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=20.0))
    safety = np.full((64, 64), 0.9, np.float32)
    safety_map.add(Heatmap(safety, 0), CAMERA, ABOVE)
    safety[30:34, 30:34] = 0.05
    safety_map.add(Heatmap(safety, S), CAMERA, ABOVE)
    known = slice(12, 28), slice(12, 28)
    before = (safety_map.layers(S).score[known] == 0.0).astype(np.uint8)
    assert before.any()
    safety_map.widen_unsafe(1.0)
    disc = np.ones((5, 5), np.uint8)
    disc[np.ix_([0, 4], [0, 1, 3, 4])] = 0
    after = safety_map.layers(S).score[known] == 0.0
    assert np.array_equal(after, cv2.dilate(before, disc) > 0)


def test_ground_that_was_called_unsafe_cannot_count_as_clear():
    assert MapParameters(neutral_score=0.6, clear_score=0.6).clear_score == 0.6
    with pytest.raises(ConfigurationError, match='clear_score'):
        MapParameters(neutral_score=0.8)
