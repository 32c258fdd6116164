# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which segment decides for each pixel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.segmentation.fastsam.masks import Segment
from peace_ros.core.segmentation.fastsam.selection import Selection

UNKNOWN = 0
"""Label of pixels that no scored segment covers."""


def paint(
    selection: Selection, order: Sequence[int], height_px: int, width_px: int
) -> NDArray[np.int32]:
    """Return per pixel 1 + the index of the scored segment that decides for it, or UNKNOWN.

    Where segments overlap, the last one in order decides. Segments that were not scored come
    after all others: what they show is not known.

    Args:
        selection: of one frame.
        order: indices of all scored segments.
        height_px: of the frame at the resolution of the segments.
        width_px: likewise.
    """
    labels = np.zeros((height_px, width_px), np.int32)
    for index in order:
        _put(labels, selection.scored[index], index + 1)
    for segment in selection.unknown:
        _put(labels, segment, UNKNOWN)
    return labels


def _put(labels: NDArray[np.int32], segment: Segment, label: int) -> None:
    labels[segment.rows, segment.columns][segment.mask] = label
