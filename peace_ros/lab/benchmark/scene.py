# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every way of running the networks gets: the same frames, terms and prompts."""

from __future__ import annotations

import cv2
import numpy as np

from peace_ros.core.domain import Frame
from peace_ros.core.segmentation import Terms

WIDTH_PX, HEIGHT_PX = 640, 480
FRAME_PERIOD_NS = 200_000_000
"""Of the stamps; the camera's 5 frames/s."""

_POSITIVE = ('grass', 'lawn', 'field', 'park', 'bare ground')
_NEGATIVE = ('building', 'roof', 'road', 'car', 'person', 'tree', 'water', 'fence')
_MORE = (
    'house', 'shed', 'garage', 'terrace', 'dome', 'canopy', 'bush', 'lake', 'river', 'pool',
    'crowd', 'vehicle', 'train', 'lamp-post', 'wall', 'hedgerow', 'street', 'avenue', 'highway',
    'lane', 'stairs', 'steps', 'crane', 'boat', 'tower', 'bridge',
)  # fmt: skip
TERMS_13 = Terms(_POSITIVE, _NEGATIVE)
IS_POSITIVE_13 = np.array([1.0] * len(_POSITIVE) + [0.0] * len(_NEGATIVE), np.float32)
TERMS_39 = Terms(_POSITIVE, _NEGATIVE + _MORE)


def draw_frames(count: int) -> list[Frame]:
    """Return camera frames with structure at every scale, a new one each time; seeded."""
    rng = np.random.default_rng(3)
    frames = []
    for index in range(count):
        image = np.full((HEIGHT_PX, WIDTH_PX, 3), 110.0, np.float32)
        for cells in (5, 20, 80):
            patches = rng.normal(0.0, 40.0, (cells, cells, 3)).astype(np.float32)
            image += cv2.resize(patches, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
        # Light and haze change on the way, so that the words in use do too.
        image = 110.0 + (image - 110.0) * rng.uniform(0.2, 1.5) + rng.uniform(-80.0, 80.0)
        frames.append(Frame(np.clip(image, 0.0, 255.0).astype(np.uint8), index * FRAME_PERIOD_NS))
    return frames
