# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A frame of more pixels than the network takes: seen whole, and closer in parts.

From 100 m a person is one pixel of a frame that was shrunk to 352 x 352, and three of the camera's.
So the frame is also cut into parts, which the network sees at the resolution of the camera; the
whole frame shows what the parts belong to. A wide frame is cut in halves, because a network that
was trained on squares sees less in a squeezed picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]

_OVERLAP = 0.05
"""How far a part reaches beyond what it answers for, in sides of that: things at its edge are seen
whole."""
_HALVED, _WIDE = 1.8, 1.25
"""A frame this much longer than the network's input, and this much longer than wide, is halved."""
_SHARE_OF_WHOLE = 0.2
"""Weight of the whole frame in the log-odds of the score."""
_CAUTION = 0.15
"""Taken from the log-odds of what is seen in parts: from high up people are few pixels even there.
On 240 drawn scenes at most 0.7 % of them are then called safe (models/README.md)."""
_SUREST = 1e-6
"""Scores are taken to lie this far from 0 and 1, so that they have log-odds."""


@dataclass(frozen=True)
class Part:
    """A part of a frame, in pixels; all four are within the frame."""

    rows: slice
    columns: slice
    own_rows: slice
    """What the part answers for; each pixel of the frame belongs to one part."""
    own_columns: slice

    def of(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return what the network is to see, contiguous."""
        return np.ascontiguousarray(image[self.rows, self.columns])


def parts_of(
    image_wh: tuple[int, int], input_wh: tuple[int, int], max_looks: int
) -> tuple[Part, ...]:
    """Return the parts to see beside the whole frame, by rows; none where the whole shows it all.

    Args:
        image_wh: width and height of the frame in pixels.
        input_wh: of the network's input. No part's own ground is smaller, so none is enlarged; only
            the halves of a wide frame may be, a little.
        max_looks: at most, the one at the whole frame included.
    """
    across, down = (image_wh[axis] / input_wh[axis] for axis in (0, 1))
    columns, rows = max(1, int(across)), max(1, int(down))
    if columns == rows == 1 and max(across, down) >= max(_HALVED, _WIDE * min(across, down)):
        columns, rows = (2, 1) if across > down else (1, 2)
    while columns * rows > max(1, max_looks - 1):
        # The direction that is seen more sharply can spare it.
        is_wider = image_wh[0] * rows * input_wh[1] > image_wh[1] * columns * input_wh[0]
        if columns > 1 and (rows == 1 or not is_wider):
            columns -= 1
        else:
            rows -= 1
    if columns * rows == 1:
        return ()
    return tuple(
        Part(row, column, own_row, own_column)
        for row, own_row in _cuts(image_wh[1], rows)
        for column, own_column in _cuts(image_wh[0], columns)
    )


def _cuts(length: int, count: int) -> list[tuple[slice, slice]]:
    """Return for each part what it sees and what is its own."""
    edges = [round(length * at / count) for at in range(count + 1)]
    reach = round(_OVERLAP * length / count)
    return [
        (slice(max(0, low - reach), min(length, high + reach)), slice(low, high))
        for low, high in pairwise(edges)
    ]


def joined(whole: Array, answers: Sequence[Array], parts: Sequence[Part]) -> Array:
    """Return the scores of a frame from those of the whole and of its parts.

    Args:
        whole: h x w, 0 to 1, of the whole frame.
        answers: of each part, the same shape.
        parts: as :func:`parts_of` returned them.

    Returns:
        (rows * h) x (columns * w) of the parts; the whole itself without any.
    """
    if not parts:
        return whole
    height, width = whole.shape
    columns = sum(part.own_rows.start == 0 for part in parts)
    rows = len(parts) // columns
    closer = np.empty((rows * height, columns * width), np.float32)
    for index, (part, answer) in enumerate(zip(parts, answers, strict=True)):
        top, left = index // columns * height, index % columns * width
        closer[top : top + height, left : left + width] = _own(answer, part)
    far = cv2.resize(whole, closer.shape[::-1], interpolation=cv2.INTER_LINEAR)
    mixed = (1.0 - _SHARE_OF_WHOLE) * _log_odds(closer) + _SHARE_OF_WHOLE * _log_odds(far)
    mixed -= _CAUTION
    # tanh never overflows, where exp would.
    scores: Array = 0.5 * np.tanh(0.5 * mixed, dtype=np.float32) + np.float32(0.5)
    return scores


def _own(answer: Array, part: Part) -> Array:
    """Return the part's own ground out of its answer, at the size of the whole answer."""
    height, width = answer.shape
    matrix = np.zeros((2, 3))
    for axis, (size, seen, own) in enumerate(
        ((width, part.columns, part.own_columns), (height, part.rows, part.own_rows))
    ):
        scale = (own.stop - own.start) / (seen.stop - seen.start)
        shift = (own.start - seen.start) / (seen.stop - seen.start) * size
        # Pixel centres are whole numbers.
        matrix[axis, axis], matrix[axis, 2] = scale, shift + 0.5 * scale - 0.5
    return np.asarray(
        cv2.warpAffine(
            answer,
            matrix,
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.float32,
    )


def _log_odds(scores: Array) -> Array:
    inside = np.clip(scores, np.float32(_SUREST), np.float32(1.0 - _SUREST))
    odds: Array = np.log(inside / (np.float32(1.0) - inside))
    return odds
