# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Layers of a window that moves by whole cells."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

_Cell = TypeVar('_Cell', bound=np.generic)


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
