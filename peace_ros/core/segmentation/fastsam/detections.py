# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the segmenter's predictions hold: boxes, their confidences, and coefficients of masks."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_CANDIDATES = 4096
"""Boxes that enter the suppression: those of the highest confidence."""
MOST_DETECTIONS = 300
"""Boxes that leave it, as in the reference implementation."""


@dataclass(frozen=True)
class Detections:
    """N detected segments, by falling confidence."""

    boxes: NDArray[np.float32]
    """[N, 4]: left, top, right, bottom in pixels of the network's input, each of some area."""
    confidences: NDArray[np.float32]
    """[N], 0 to 1."""
    coefficients: NDArray[np.float32]
    """[N, K]: weights of the mask prototypes."""


def detect(
    predictions: NDArray[np.float32], *, min_confidence: float, max_overlap: float
) -> Detections:
    """Return the confident boxes without duplicates.

    Of two boxes whose intersection over union exceeds max_overlap, the one of lower confidence is
    dropped (non-maximum suppression, by OpenCV). At most MOST_DETECTIONS are returned.

    Args:
        predictions: float32 [5 + K, A]; per anchor the box's centre x, y, width and height in
            pixels of the network's input, its confidence and K coefficients. Finite.
        min_confidence: boxes need a higher confidence than this, 0 to 1.
        max_overlap: 0 to 1.
    """
    candidates = (predictions[4] > min_confidence) & (predictions[2:4] > 0.0).all(axis=0)
    chosen = predictions[:, candidates].T
    half = chosen[:, 2:4] / np.float32(2.0)
    low, high = chosen[:, :2] - half, chosen[:, :2] + half
    kept = cv2.dnn.NMSBoxes(
        np.hstack([low, high - low]).tolist(),
        chosen[:, 4],
        min_confidence,
        max_overlap,
        top_k=MOST_CANDIDATES,
    )
    best = np.asarray(kept, np.intp)[:MOST_DETECTIONS]
    boxes = np.hstack([low[best], high[best]])
    return Detections(boxes, chosen[best, 4], np.ascontiguousarray(chosen[best, 5:]))
