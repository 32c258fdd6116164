# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ground that a heatmap calls clearly unsafe: water, vehicles, people and trees may move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera
from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import rotation_matrix
from peace_ros.core.odometry.plane import Array
from peace_ros.core.optics import pixels


@dataclass(frozen=True)
class ScoredView:
    """A heatmap, and from where the camera saw it."""

    safety: NDArray[np.float32]
    """Height x width, 0 to 1."""
    camera: Camera
    """Of its size."""
    mount: Array
    """3 x 3, axes of the camera from those of the vehicle."""
    quaternion: Quaternion
    position_m: Array
    """(3,) of the camera: north, east, down."""

    def is_below(self, ground_m: Array, limit: float) -> NDArray[np.bool_]:
        """Return which points have less safety than a limit; one that is not in view has not.

        Args:
            ground_m: N x 3: north, east, down.
            limit: 0 to 1.
        """
        directions = (
            self.mount @ rotation_matrix(self.quaternion).T @ (ground_m - self.position_m).T
        )
        front = directions[2] > 0.0
        at = pixels(self.camera, np.where(front, directions, [[0.0], [0.0], [1.0]]))
        column, row = np.round(np.nan_to_num(at, nan=-1.0)).astype(int)
        height, width = self.safety.shape
        seen = front & (column >= 0) & (row >= 0) & (column < width) & (row < height)
        below = np.zeros(len(ground_m), np.bool_)
        # A comparison with NaN is false: what is not known may move.
        below[seen] = ~(self.safety[row[seen], column[seen]] >= limit)
        return below
