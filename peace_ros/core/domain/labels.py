# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ten ground-truth classes that worlds, training and evaluation share."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Label(IntEnum):
    """Pixel class of a label raster (uint8)."""

    UNLABELED = 0
    """Unknown: ignored by every score, never counted as unsafe or as safe."""
    GRASS = 1
    """Grass, lawn, field, low vegetation."""
    BARE_GROUND = 2
    PAVED = 3
    BUILDING = 4
    TREE = 5
    WATER = 6
    VEHICLE = 7
    PERSON = 8
    OBSTACLE = 9
    """Fences, walls, poles, containers and other things that a rotor must not meet."""


SAFE_LABELS: frozenset[Label] = frozenset({Label.GRASS, Label.BARE_GROUND})
"""Where a landing hurts nobody. Paved ground is not among them: people and cars use it."""

_IS_SAFE = np.array([label in SAFE_LABELS for label in Label], dtype=bool)


def is_safe(labels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Tell safe pixels of a label raster, same shape; UNLABELED is False (mask it out apart)."""
    return _IS_SAFE[labels]
