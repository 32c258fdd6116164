# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a map of safe ground knows at one moment."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

_Cell = TypeVar('_Cell', bound=np.generic)


@dataclass(frozen=True)
class MapLayers:
    """Layers of one size; rows grow to the north, columns to the east, in the local NED frame."""

    score: NDArray[np.float32]
    """Safety score, 0 to 1; 0 where nothing is known and where a veto stands."""
    age_s: NDArray[np.float32]
    """Age of the newest look; infinite where nothing is known."""
    looks: NDArray[np.uint16]
    """Number of frames that saw the cell."""
    cell_m: float
    south_m: float
    """North coordinate of the southern edge of row 0."""
    west_m: float
    """East coordinate of the western edge of column 0."""
    unsafe_age_s: NDArray[np.float32]
    """Seconds since the look that set the veto on a cell; infinite where no veto stands."""

    def centre_of(self, row: int, column: int) -> tuple[float, float]:
        """Return (north, east) metres of the middle of a cell."""
        return (
            self.south_m + (row + 0.5) * self.cell_m,
            self.west_m + (column + 0.5) * self.cell_m,
        )

    def cell_at(self, north_m: float, east_m: float) -> tuple[int, int] | None:
        """Return (row, column) of the cell around a point, None outside of the window."""
        row = floor((north_m - self.south_m) / self.cell_m)
        column = floor((east_m - self.west_m) / self.cell_m)
        rows, columns = self.score.shape
        return (row, column) if 0 <= row < rows and 0 <= column < columns else None

    def distances_m(
        self, north_m: float, east_m: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return north offsets (rows x 1) and east offsets (1 x columns) of all cell centres."""
        rows, columns = self.score.shape
        north = self.south_m + (np.arange(rows) + 0.5) * self.cell_m - north_m
        east = self.west_m + (np.arange(columns) + 0.5) * self.cell_m - east_m
        return north.astype(np.float32)[:, None], east.astype(np.float32)[None, :]

    def disc(self, north_m: float, east_m: float, radius_m: float) -> NDArray[np.bool_]:
        """Return the cells whose centres lie within a circle; rows x columns."""
        north, east = self.distances_m(north_m, east_m)
        inside: NDArray[np.bool_] = north * north + east * east <= radius_m * radius_m
        return inside


def shifted(array: NDArray[_Cell], d_row: int, d_column: int, fill: float) -> NDArray[_Cell]:
    """Return the array as seen from a window moved by whole cells; new cells hold ``fill``."""
    rows, columns = array.shape
    moved = np.full_like(array, fill)
    if abs(d_row) < rows and abs(d_column) < columns:
        target = moved[
            max(0, -d_row) : rows - max(0, d_row), max(0, -d_column) : columns - max(0, d_column)
        ]
        target[...] = array[
            max(0, d_row) : rows - max(0, -d_row), max(0, d_column) : columns - max(0, -d_column)
        ]
    return moved
