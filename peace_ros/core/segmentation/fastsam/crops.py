# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Segments cut out of the frame, their surroundings blanked, as one batch for CLIP."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.inference.manifest import InputSpec
from peace_ros.core.inference.preprocess import normalisation
from peace_ros.core.segmentation.fastsam.letterbox import Placement, fitted
from peace_ros.core.segmentation.fastsam.masks import Segment


class Cutter:
    """Cuts segments out of a frame into the image encoder's input.

    The box of the segment is scaled to fit and centred; everything that is not the segment is
    the mean colour of the encoder's normalisation, which the network sees as zero. (FastSAM's
    authors blank with white and ultralytics with black, and both then lose the ends of long
    segments in CLIP's square crop.)
    """

    def __init__(self, spec: InputSpec, most: int) -> None:
        """Prepare for up to most segments of a frame."""
        self._spec = spec
        # 1 x 256 x RGB, as OpenCV takes a table; indexing it by the image would take longer.
        self._table = np.stack(normalisation(spec), axis=-1)[None]
        self._buffer = np.zeros((most, 3, spec.height, spec.width), np.float32)

    def blank(self) -> NDArray[np.float32]:
        """Return the largest batch, without a segment in it."""
        self._buffer.fill(0.0)
        return self._buffer

    def __call__(
        self, image_rgb: NDArray[np.uint8], segments: Sequence[Segment], frame: Placement
    ) -> NDArray[np.float32]:
        """Return float32 [N, 3, H, W]; the array is overwritten by the next call.

        Args:
            image_rgb: the frame, height x width x 3 uint8.
            segments: of that frame, N of them.
            frame: the frame at the resolution of the segments.
        """
        batch = self._buffer[: len(segments)]
        batch.fill(0.0)
        height, width = image_rgb.shape[:2]
        scale_x, scale_y = width / frame.width_px, height / frame.height_px
        for cut, segment in zip(batch, segments, strict=True):
            mask_height, mask_width = segment.mask.shape
            left, top = int(segment.left_px * scale_x), int(segment.top_px * scale_y)
            right = min(width, max(left + 1, ceil((segment.left_px + mask_width) * scale_x)))
            bottom = min(height, max(top + 1, ceil((segment.top_px + mask_height) * scale_y)))
            self._fill(cut, image_rgb[top:bottom, left:right], segment.mask)
        return batch

    def _fill(
        self, cut: NDArray[np.float32], part: NDArray[np.uint8], mask: NDArray[np.bool_]
    ) -> None:
        """Write one part of the frame, masked, into the middle of a 3 x H x W array of zeros."""
        place = fitted(part.shape[1], part.shape[0], self._spec)
        size = (place.width_px, place.height_px)
        shrinks = min(self._spec.width / part.shape[1], self._spec.height / part.shape[0]) < 1.0
        # Averaging keeps a shrunk image free of aliases; CLIP's own scaling is bicubic otherwise.
        method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
        scaled = cv2.resize(np.ascontiguousarray(part), size, interpolation=method)
        shown = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 0.5
        rows, columns = place.slices
        levels = cv2.LUT(scaled, self._table)
        np.multiply(levels.transpose(2, 0, 1), shown, out=cut[:, rows, columns])
