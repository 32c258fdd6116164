# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the segmenter answers -> boxes -> masks at the resolution of the network's input."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.segmentation.fastsam.letterbox import Placement

MOST_CANDIDATES = 4096
"""Boxes that enter the suppression: those of the highest confidence."""
MOST_DETECTIONS = 300
"""Boxes that leave it, as in the reference implementation."""
STABILITY_OFFSET = 1.0
"""How far the mask's logit is moved up and down to see whether its outline stays (as SAM does)."""
_MARGIN_CELLS = 2
"""Prototype cells around a box that bilinear scaling reads."""


@dataclass(frozen=True)
class Detections:
    """N detected segments, by falling confidence."""

    boxes: NDArray[np.float32]
    """[N, 4]: left, top, right, bottom in pixels of the network's input, each of some area."""
    confidences: NDArray[np.float32]
    """[N], 0 to 1."""
    coefficients: NDArray[np.float32]
    """[N, K]: weights of the mask prototypes."""


@dataclass(frozen=True)
class Segment:
    """One segment of a frame."""

    left_px: int
    top_px: int
    """Corner of its mask, in pixels of the frame as the network sees it, without the borders."""
    mask: NDArray[np.bool_]
    """h x w, from that corner on."""
    area_px: int
    """True pixels of the mask, one or more."""
    confidence: float
    """0 to 1."""
    stability: float
    """Area of the mask with its logit STABILITY_OFFSET lower over that with it higher, 0 to 1."""

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns of the mask."""
        height, width = self.mask.shape
        return (
            slice(self.top_px, self.top_px + height),
            slice(self.left_px, self.left_px + width),
        )


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


def assemble(
    detections: Detections, prototypes: NDArray[np.float32], cell_px: int, frame: Placement
) -> list[Segment]:
    """Return the segments with at least one pixel, in the order of the detections.

    A mask is where the weighted sum of the prototypes, scaled bilinearly to the network's input,
    is positive, inside the box and the frame. Only the part of it in the box is computed.

    Args:
        detections: boxes and coefficients.
        prototypes: float32 [K, h, w], finite.
        cell_px: pixels of the network's input per prototype cell, along both axes.
        frame: where the frame lies in the network's input.
    """
    count, height, width = prototypes.shape
    logits = detections.coefficients @ prototypes.reshape(count, -1)
    logits = logits.reshape(-1, height, width)
    corners = _corners(detections.boxes, frame)
    segments = []
    for index, (left, top, right, bottom) in enumerate(corners):
        if right <= left or bottom <= top:
            continue
        patch = _upscaled(logits[index], (left, top, right, bottom), cell_px)
        mask = patch > 0.0
        area = int(np.count_nonzero(mask))
        if area == 0:
            continue
        segments.append(
            Segment(
                left - frame.left_px,
                top - frame.top_px,
                mask,
                area,
                float(detections.confidences[index]),
                _stability(patch),
            )
        )
    return segments


def _corners(boxes: NDArray[np.float32], frame: Placement) -> list[list[int]]:
    """Return the whole pixels x with left <= x < right of each box, within the frame."""
    low = [frame.left_px, frame.top_px] * 2
    high = [frame.left_px + frame.width_px, frame.top_px + frame.height_px] * 2
    corners: list[list[int]] = np.clip(np.ceil(boxes), low, high).astype(np.int64).tolist()
    return corners


def _upscaled(
    logits: NDArray[np.float32], box: tuple[int, int, int, int], cell_px: int
) -> NDArray[np.float32]:
    """Return a box (in input pixels) of the logits scaled to the network's input."""
    left, top, right, bottom = box
    # Whole cells with a margin: inside the box, scaling the part equals scaling everything.
    column = max(0, left // cell_px - _MARGIN_CELLS)
    row = max(0, top // cell_px - _MARGIN_CELLS)
    part = logits[
        row : ceil(bottom / cell_px) + _MARGIN_CELLS,
        column : ceil(right / cell_px) + _MARGIN_CELLS,
    ]
    height, width = part.shape
    scaled: NDArray[np.float32] = cv2.resize(
        np.ascontiguousarray(part),
        (width * cell_px, height * cell_px),
        interpolation=cv2.INTER_LINEAR,
    )
    x, y = left - column * cell_px, top - row * cell_px
    return scaled[y : y + bottom - top, x : x + right - left]


def _stability(logits: NDArray[np.float32]) -> float:
    wide = int(np.count_nonzero(logits > -STABILITY_OFFSET))
    narrow = int(np.count_nonzero(logits > STABILITY_OFFSET))
    return narrow / wide
