# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the segmenter's predictions hold: boxes, how sure they are, and coefficients of masks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOST_CANDIDATES = 4096
"""Boxes that enter the suppression; the surest ones."""
MOST_DETECTIONS = 300
"""Boxes that leave it, as in the reference implementation."""


@dataclass(frozen=True)
class Detections:
    """N detected segments, the surest first."""

    boxes: NDArray[np.float32]
    """[N, 4]: left, top, right, bottom in pixels of the network's input, each of some area."""
    confidences: NDArray[np.float32]
    """[N], 0 to 1."""
    coefficients: NDArray[np.float32]
    """[N, K]: weights of the mask prototypes."""


def detect(
    predictions: NDArray[np.float32], *, min_confidence: float, max_overlap: float
) -> Detections:
    """Return the sure boxes that are not told twice.

    Of two boxes whose intersection over union exceeds max_overlap, the less sure one goes
    (non-maximum suppression). At most MOST_DETECTIONS are returned.

    Args:
        predictions: float32 [5 + K, A]; per anchor the box's centre x, y, width and height in
            pixels of the network's input, its confidence and K coefficients. Finite.
        min_confidence: boxes must be surer than this, 0 to 1.
        max_overlap: 0 to 1.
    """
    sides = predictions[2:4]
    candidates = (predictions[4] > min_confidence) & (sides > 0.0).all(axis=0)
    chosen = predictions[:, candidates].T
    chosen = chosen[np.argsort(-chosen[:, 4], kind='stable')[:MOST_CANDIDATES]]
    half = chosen[:, 2:4] / np.float32(2.0)
    boxes = np.concatenate([chosen[:, :2] - half, chosen[:, :2] + half], axis=1)
    kept = _suppress(boxes, max_overlap)
    return Detections(boxes[kept], chosen[kept, 4], np.ascontiguousarray(chosen[kept, 5:]))


def _suppress(boxes: NDArray[np.float32], max_overlap: float) -> NDArray[np.intp]:
    """Return the indices of the boxes, best first, that no better kept one overlaps too much."""
    areas = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    kept: list[np.intp] = []
    left = np.arange(len(boxes))
    while left.size and len(kept) < MOST_DETECTIONS:
        best, rest = left[0], left[1:]
        kept.append(best)
        low = np.maximum(boxes[best, :2], boxes[rest, :2])
        high = np.minimum(boxes[best, 2:], boxes[rest, 2:])
        shared = np.maximum(high - low, np.float32(0.0)).prod(axis=1)
        left = rest[shared <= max_overlap * (areas[best] + areas[rest] - shared)]
    return np.array(kept, np.intp)
