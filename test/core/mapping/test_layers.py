# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cells and metres, and windows that move by whole cells."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.mapping.layers import MapLayers, shifted

ROWS, COLUMNS = 6, 9
LAYERS = MapLayers(
    score=np.zeros((ROWS, COLUMNS), np.float32),
    age_s=np.zeros((ROWS, COLUMNS), np.float32),
    looks=np.zeros((ROWS, COLUMNS), np.uint16),
    cell_m=0.5,
    south_m=10.0,
    west_m=-4.0,
    unsafe_age_s=np.full((ROWS, COLUMNS), np.inf, np.float32),
)


def test_a_cell_has_a_middle_and_is_found_by_any_of_its_points() -> None:
    assert LAYERS.centre_of(0, 0) == (10.25, -3.75)
    assert LAYERS.centre_of(3, 8) == (11.75, 0.25)
    assert LAYERS.cell_at(10.0, -4.0) == (0, 0)
    assert LAYERS.cell_at(11.99, 0.49) == (3, 8)
    assert LAYERS.cell_at(12.99, -3.51) == (5, 0)


@pytest.mark.parametrize(
    ('north_m', 'east_m'), [(9.99, 0.0), (13.0, 0.0), (11.0, -4.01), (11.0, 0.5)]
)
def test_outside_of_the_window_there_is_no_cell(north_m: float, east_m: float) -> None:
    assert LAYERS.cell_at(north_m, east_m) is None


def test_distances_are_those_of_the_middles() -> None:
    north, east = LAYERS.distances_m(11.0, -3.0)
    assert north.shape == (ROWS, 1)
    assert east.shape == (1, COLUMNS)
    assert north.dtype == east.dtype == np.float32
    assert north[:, 0] == pytest.approx([-0.75, -0.25, 0.25, 0.75, 1.25, 1.75])
    assert east[0, :3] == pytest.approx([-0.75, -0.25, 0.25])


def test_a_disc_holds_the_cells_whose_middles_are_no_farther() -> None:
    disc = LAYERS.disc(11.25, -2.75, 0.5)
    found = {tuple(map(int, cell)) for cell in np.argwhere(disc)}
    assert found == {(2, 2), (1, 2), (3, 2), (2, 1), (2, 3)}
    assert np.count_nonzero(LAYERS.disc(11.25, -2.75, 0.49)) == 1


@pytest.mark.parametrize('d_row', range(-ROWS - 1, ROWS + 2))
def test_a_window_that_moves_keeps_what_it_still_covers(d_row: int) -> None:
    array = np.arange(1, ROWS * COLUMNS + 1, dtype=np.int16).reshape(ROWS, COLUMNS)
    for d_column in range(-COLUMNS - 1, COLUMNS + 2):
        moved = shifted(array, d_row, d_column, -7)
        assert moved.dtype == array.dtype
        for row in range(ROWS):
            for column in range(COLUMNS):
                was_row, was_column = row + d_row, column + d_column
                inside = 0 <= was_row < ROWS and 0 <= was_column < COLUMNS
                assert moved[row, column] == (array[was_row, was_column] if inside else -7)
