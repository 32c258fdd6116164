# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Squares out of large images, so that the network sees ground without distortion."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np
from numpy.typing import NDArray

WHOLE = 0
"""Tile size that stands for the whole frame, stretched to the network's input."""


@dataclass(frozen=True)
class Tile:
    """What the network sees, and the part of it that counts."""

    rows: slice
    columns: slice
    own_rows: slice
    """Within the image: nearer to this tile's middle than to any other's; each pixel of the image
    belongs to one tile."""
    own_columns: slice

    @property
    def own(self) -> tuple[slice, slice]:
        """Rows and columns that count, within the tile."""
        return _within(self.own_rows, self.rows), _within(self.own_columns, self.columns)

    def labels_of(self, labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the labels of the tile; what other tiles count is UNLABELED."""
        own = np.zeros(
            (self.rows.stop - self.rows.start, self.columns.stop - self.columns.start), np.uint8
        )
        own[self.own] = labels[self.own_rows, self.own_columns]
        return own


def tiles_of(height_px: int, width_px: int, tile_px: int | None) -> list[Tile]:
    """Return squares, evenly spread, that cover the image; neighbours may overlap.

    Args:
        height_px: of the image.
        width_px: likewise.
        tile_px: side of the squares, at most the shorter side of the image; None: the shorter
            side; WHOLE: one tile, the whole image.
    """
    if tile_px == WHOLE:
        whole = slice(0, height_px), slice(0, width_px)
        return [Tile(*whole, *whole)]
    side = min(height_px, width_px, tile_px or max(height_px, width_px))
    return [
        Tile(rows, columns, own_rows, own_columns)
        for rows, own_rows in _spread(height_px, side)
        for columns, own_columns in _spread(width_px, side)
    ]


def _spread(length: int, side: int) -> list[tuple[slice, slice]]:
    count = ceil(length / side)
    starts = np.linspace(0, length - side, count).round().astype(int).tolist()
    # Two neighbours share what both see: the border lies midway.
    borders = [0, *((a + side + b) // 2 for a, b in pairwise(starts)), length]
    return [
        (slice(start, start + side), slice(borders[i], borders[i + 1]))
        for i, start in enumerate(starts)
    ]


def _within(part: slice, whole: slice) -> slice:
    return slice(part.start - whole.start, part.stop - whole.start)
