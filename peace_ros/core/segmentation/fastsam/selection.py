# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which segments CLIP gets to see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.segmentation.fastsam.masks import Segment
from peace_ros.core.segmentation.fastsam.parameters import FastSamParameters

UNKNOWN = 0
"""Label of pixels that no scored segment covers."""


@dataclass(frozen=True)
class Selection:
    """The segments of a frame that matter."""

    scored: list[Segment]
    """The largest ones, largest first: CLIP tells what they are."""
    unknown: list[Segment]
    """Too small, or beyond the cap: something is there, and nobody looks what it is."""

    def paint(self, order: Sequence[int], height_px: int, width_px: int) -> NDArray[np.int32]:
        """Return per pixel 1 + the index of the scored segment that decides for it, or UNKNOWN.

        Where segments overlap, the last one in order decides. Segments that were not scored come
        after all others: what they show is not known.

        Args:
            order: indices of all scored segments.
            height_px: of the frame at the resolution of the segments.
            width_px: likewise.
        """
        labels = np.zeros((height_px, width_px), np.int32)
        for segment, label in (
            *((self.scored[index], index + 1) for index in order),
            *((segment, UNKNOWN) for segment in self.unknown),
        ):
            labels[segment.slices][segment.mask] = label
        return labels


def select(segments: list[Segment], frame_px: int, parameters: FastSamParameters) -> Selection:
    """Divide the segments; an unstable one of any size worth scoring is noise and left out.

    Args:
        segments: of one frame.
        frame_px: pixels of the frame at the resolution of the segments.
        parameters: fastsam_max_segments, fastsam_min_area and fastsam_min_stability are used.
    """
    least_px = parameters.fastsam_min_area * frame_px
    largest_first = sorted(segments, key=lambda each: (-each.area_px, -each.confidence))
    # A small mask is mostly outline: its stability says nothing, so its size is judged first.
    small = [each for each in largest_first if each.area_px < least_px]
    stable = [
        each
        for each in largest_first
        if each.area_px >= least_px and each.stability >= parameters.fastsam_min_stability
    ]
    most = parameters.fastsam_max_segments
    return Selection(stable[:most], stable[most:] + small)
