# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A person who walks over the ground: painted where the camera sees them, known to the judge."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, pi, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import ground_to_image

SHOULDERS_M = 0.52
DEPTH_M = 0.32
HEAD_M = 0.22
SHADOW_M = 1.1
_CLOTHES_RGB = (168, 42, 48)
_HAIR_RGB = (52, 38, 30)
_SHADOW = 0.45
"""What is left of the light in the shadow."""
_UNSAFE_M = 0.8
"""A good model calls the ground unsafe this far from the middle of a person."""
_FINER = 4


@dataclass(frozen=True)
class Walker:
    """Walks along a line from a moment on, and stops at its end."""

    begin_ns: int
    """Stamp of the first step."""
    start: tuple[float, float]
    """North, east of the local frame, metres."""
    end: tuple[float, float]
    speed_m_s: float = 1.4

    def place(self, at_ns: int) -> tuple[float, float]:
        """Return north and east at a stamp."""
        north, east = self.end[0] - self.start[0], self.end[1] - self.start[1]
        length_m = hypot(north, east)
        walked_m = max(0.0, (at_ns - self.begin_ns) * 1e-9) * self.speed_m_s
        share = 1.0 if length_m == 0.0 else min(1.0, walked_m / length_m)
        return self.start[0] + share * north, self.start[1] + share * east

    def distance_m(self, pose: Pose, at_ns: int) -> float:
        """Return how far the person is from the point below the vehicle."""
        north, east = self.place(at_ns)
        return hypot(pose.north_m - north, pose.east_m - east)

    def paint(
        self, image_rgb: NDArray[np.uint8], camera: Camera, pose: Pose, at_ns: int
    ) -> NDArray[np.uint8]:
        """Return a copy of the picture with shadow, shoulders and head, true to size."""
        north, east = self.place(at_ns)
        shade = self._coverage(
            image_rgb, camera, pose, _ellipse(north - 0.5, east + 0.5, SHADOW_M, DEPTH_M, pi * 0.75)
        )
        painted = image_rgb.astype(np.float32) * (1.0 - (1.0 - _SHADOW) * shade[..., None])
        for length_m, width_m, colour in (
            (SHOULDERS_M, DEPTH_M, _CLOTHES_RGB),
            (HEAD_M, HEAD_M, _HAIR_RGB),
        ):
            shape = _ellipse(north, east, length_m, width_m, self._heading() + pi / 2)
            alpha = self._coverage(image_rgb, camera, pose, shape)[..., None]
            painted += (np.asarray(colour, np.float32) - painted) * alpha
        return np.asarray(np.rint(painted), np.uint8)

    def darken(self, levels: NDArray[np.uint8], camera: Camera, pose: Pose, at_ns: int) -> None:
        """Set the pixels of a heatmap around the person to zero, in place."""
        north, east = self.place(at_ns)
        size_m = 2.0 * _UNSAFE_M
        shape = _ellipse(north, east, size_m, size_m, 0.0)
        levels[self._coverage(levels, camera, pose, shape) > 0.0] = 0

    def _heading(self) -> float:
        return float(np.arctan2(self.end[1] - self.start[1], self.end[0] - self.start[0]))

    def _coverage(
        self,
        image: NDArray[np.uint8],
        camera: Camera,
        pose: Pose,
        ground: NDArray[np.float64],
    ) -> NDArray[np.float32]:
        """Return which part of each pixel a shape on the ground (N, 2) covers, 0 to 1."""
        height, width = image.shape[:2]
        mapped = np.c_[ground, np.ones(len(ground))] @ ground_to_image(camera, pose).T
        if (mapped[:, 2] <= 0.0).any():
            return np.zeros((height, width), np.float32)
        pixels = mapped[:, :2] / mapped[:, 2:]
        large = np.zeros((height * _FINER, width * _FINER), np.uint8)
        points = np.rint((pixels + 0.5) * _FINER - 0.5).clip(-1e6, 1e6).astype(np.int32)
        cv2.fillPoly(large, [points], 255)
        small = cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA)
        return np.asarray(small.astype(np.float32) / 255.0, np.float32)


def _ellipse(
    north_m: float, east_m: float, length_m: float, width_m: float, turn_rad: float
) -> NDArray[np.float64]:
    """Return the outline (32, 2) of an ellipse on the ground: north, east."""
    angle = np.linspace(0.0, 2.0 * pi, 32, endpoint=False)
    along, across = 0.5 * length_m * np.cos(angle), 0.5 * width_m * np.sin(angle)
    c, s = cos(turn_rad), sin(turn_rad)
    return np.stack((north_m + c * along - s * across, east_m + s * along + c * across), axis=1)
