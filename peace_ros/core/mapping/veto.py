# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ground that looks clearly unsafe once is closed at once, whatever it was before.

Accumulated evidence is slow on purpose, too slow for a person who steps onto ground that was seen
safe fifty times. So a veto works beside the log-odds: one clearly unsafe look sets it; several safe
looks and some time lift it.
"""

from __future__ import annotations

from math import sqrt
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.mapping.layers import shifted
from peace_ros.core.mapping.parameters import MapParameters
from peace_ros.core.mapping.projection import Window

WHOLE_VIEW = 0.8
"""When more than this part of the safe ground in view turns unsafe within one frame, the frame has
changed (light, prompt, a model error), not the ground: nothing that moves covers so much."""
WHOLE_VIEW_LEAST_M2 = 100.0
"""Less safe ground than this can be covered completely by something that moves."""
_FEWEST_PIXELS = 2
"""A blob is this many pixels wide at least: a single one is noise."""
_MOST_STRIKES = 5
"""Number of clearly unsafe looks that make the wait longer."""
_NEVER_S = np.float32(-1e9)


def blobs(
    safety: NDArray[np.uint8],
    pixel_wh_m: tuple[float, float],
    cell_m: float,
    parameters: MapParameters,
) -> NDArray[np.uint8] | None:
    """Return the clearly unsafe blobs of a heatmap, None when there are none.

    Blobs are grown by half a cell, so that sampling at the middles of cells misses none.

    :param safety: height x width, 0 to 255.
    :param pixel_wh_m: width and height of a pixel on the ground below the camera.
    :param cell_m: edge of a cell of the map.
    :return: same shape, 255 inside of blobs, else 0.
    """
    if sqrt(pixel_wh_m[0] * pixel_wh_m[1]) > parameters.veto_pixel_m:
        return None
    unsafe = cv2.inRange(safety, 0, round(parameters.veto_score * 255.0))
    width, height = (
        max(_FEWEST_PIXELS, round(parameters.veto_blob_m / each)) for each in pixel_wh_m
    )
    kernel = np.ones((height, width), np.uint8)
    # Opening; the anchors are opposite corners, or else an even kernel would shift the blobs.
    opened = cv2.erode(unsafe, kernel, anchor=(0, 0))
    opened = cv2.dilate(opened, kernel, anchor=(width - 1, height - 1))
    if not opened.any():
        return None
    across, down = (2 * round(cell_m / each / 2.0) + 1 for each in pixel_wh_m)
    return cast('NDArray[np.uint8]', cv2.dilate(opened, np.ones((down, across), np.uint8)))


class Veto:
    """Which cells are closed, and what it takes to open them."""

    def __init__(self, parameters: MapParameters, cells: int) -> None:
        self._p = parameters
        self._cells = cells
        self.clear()

    def clear(self) -> None:
        """Open every cell."""
        shape = (self._cells, self._cells)
        self._looks_due = np.zeros(shape, np.uint8)
        self._strikes = np.zeros(shape, np.uint8)
        self._until_s = np.full(shape, _NEVER_S, np.float32)
        self._seen_s = np.full(shape, _NEVER_S, np.float32)

    def shift(self, d_row: int, d_column: int) -> None:
        """Follow the window of the map by whole cells."""
        self._looks_due = shifted(self._looks_due, d_row, d_column, 0)
        self._strikes = shifted(self._strikes, d_row, d_column, 0)
        self._until_s = shifted(self._until_s, d_row, d_column, float(_NEVER_S))
        self._seen_s = shifted(self._seen_s, d_row, d_column, float(_NEVER_S))

    def widen(self, kernel: NDArray[np.uint8]) -> None:
        """Let closed cells close those around them."""
        self._looks_due = cast('NDArray[np.uint8]', cv2.dilate(self._looks_due, kernel))
        self._strikes = cast('NDArray[np.uint8]', cv2.dilate(self._strikes, kernel))
        self._until_s = cast('NDArray[np.float32]', cv2.dilate(self._until_s, kernel))
        self._seen_s = cast('NDArray[np.float32]', cv2.dilate(self._seen_s, kernel))

    def closed(self, rows: slice, columns: slice, now_s: float) -> NDArray[np.bool_]:
        """Return which cells are closed at a time since the epoch of the map."""
        closed: NDArray[np.bool_] = self._looks_due[rows, columns] > 0
        return closed | (self._until_s[rows, columns] > now_s)

    def age_s(self, rows: slice, columns: slice, now_s: float) -> NDArray[np.float32]:
        """Return the seconds since the clearly unsafe look that closed each cell.

        Infinite where no cell is closed.
        """
        age_s: NDArray[np.float32] = np.float32(now_s) - self._seen_s[rows, columns]
        age_s[~self.closed(rows, columns, now_s)] = np.inf
        return age_s

    def take(
        self,
        window: Window,
        unsafe: NDArray[np.bool_],
        clear: NDArray[np.bool_],
        was_safe: NDArray[np.bool_],
        now_s: float,
    ) -> None:
        """Take one look at the cells of a window.

        :param unsafe: cells that look clearly unsafe.
        :param clear: cells that look safe, as finely as they were ever seen lately.
        :param was_safe: cells in view that were more likely safe than unsafe before.
        """
        part = window.slices
        due, until_s, strikes = self._looks_due[part], self._until_s[part], self._strikes[part]
        np.subtract(due, 1, out=due, where=clear & ~unsafe & (due > 0))
        np.copyto(strikes, 0, where=(due == 0) & (until_s <= now_s))
        if not unsafe.any():
            return
        np.copyto(self._seen_s[part], np.float32(now_s), where=unsafe)
        if self._is_whole_view(unsafe, was_safe):
            np.maximum(due, 1, out=due, where=unsafe)
            return
        np.copyto(due, self._p.veto_looks, where=unsafe)
        np.add(strikes, 1, out=strikes, where=unsafe & (strikes < _MOST_STRIKES))
        wait_s = np.float32(self._p.veto_s) * strikes
        np.copyto(until_s, np.float32(now_s) + wait_s, where=unsafe)

    def _is_whole_view(self, unsafe: NDArray[np.bool_], was_safe: NDArray[np.bool_]) -> bool:
        safe_before = int(np.count_nonzero(was_safe))
        if safe_before * self._p.map_cell_m**2 < WHOLE_VIEW_LEAST_M2:
            return False
        turned = int(np.count_nonzero(unsafe & was_safe))
        return turned > WHOLE_VIEW * safe_before
