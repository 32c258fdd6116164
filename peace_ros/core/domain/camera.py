# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The camera: its picture, its lens, and how it is mounted on the vehicle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite, pi, radians, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain.errors import ConfigurationError

Quaternion = tuple[float, float, float, float]

EQUIDISTANT = 'equidistant'
"""Distortion model of fisheye lenses."""
DISTORTION_SIZES = {
    'plumb_bob': (4, 5),
    'rational_polynomial': (8, 12, 14),
    EQUIDISTANT: (4,),
}
"""Distortion models of sensor_msgs/CameraInfo, and how many coefficients each may have."""
UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
"""The identity as a 3 x 3 matrix, row by row."""


@dataclass(frozen=True)
class Distortion:
    """How a lens deviates from a pinhole, as sensor_msgs/CameraInfo has it in ``d``."""

    model: str
    """A key of :data:`DISTORTION_SIZES`."""
    coefficients: tuple[float, ...]
    """In the order of OpenCV: k1, k2, p1, p2, ... or, for equidistant, k1, k2, k3, k4."""

    def __post_init__(self) -> None:
        sizes = DISTORTION_SIZES.get(self.model)
        if sizes is None:
            raise ConfigurationError(
                f'distortion model {self.model!r}: use one of {", ".join(DISTORTION_SIZES)}'
            )
        if len(self.coefficients) not in sizes or not all(map(isfinite, self.coefficients)):
            raise ConfigurationError(
                f'distortion {self.model} with coefficients {self.coefficients}: it takes '
                f'{" or ".join(map(str, sizes))} finite numbers'
            )


@dataclass(frozen=True)
class Camera:
    """Size of a picture and the lens that took it.

    The axes of the camera are those of REP-103 for optical frames: x to the right of the picture,
    y down in it, z along the view. Pixel centres are whole numbers.
    """

    width_px: int
    height_px: int
    focal_xy_px: tuple[float, float]
    """Focal lengths along the rows and along the columns, fx and fy."""
    centre_px: tuple[float, float]
    """Principal point (u, v), cx and cy."""
    distortion: Distortion | None = None
    """None: none, as in a rectified picture."""
    rectification: tuple[float, ...] = UPRIGHT
    """3 x 3 by rows: from the axes of the camera to those of a rectified picture."""

    def __post_init__(self) -> None:
        if self.width_px < 1 or self.height_px < 1:
            raise ConfigurationError(
                f'camera size {self.width_px} x {self.height_px} px: both must be 1 or more'
            )
        numbers = (*self.focal_xy_px, *self.centre_px, *self.rectification)
        if not all(map(isfinite, numbers)) or min(self.focal_xy_px) <= 0.0:
            raise ConfigurationError(
                f'camera with focal lengths {self.focal_xy_px} px and centre {self.centre_px} px: '
                'all must be finite, focal lengths above 0; calibrate the camera'
            )

    @classmethod
    def from_degrees(cls, width_px: int, height_px: int, fov_x_deg: float) -> Camera:
        """Build a pinhole with square pixels from its full horizontal field of view in degrees.

        DOVESEI has 73 degrees.
        """
        if not 0.0 < radians(fov_x_deg) < pi:
            raise ConfigurationError(
                f'camera field of view {fov_x_deg:.1f} deg must lie between 0 and 180'
            )
        focal_px = width_px / (2.0 * tan(radians(fov_x_deg) / 2.0))
        centre_px = (width_px - 1) / 2.0, (height_px - 1) / 2.0
        return cls(width_px, height_px, (focal_px, focal_px), centre_px)

    @property
    def focal_px(self) -> float:
        """Mean focal length (geometric): a pixel covers 1 / focal_px**2 steradian in the middle."""
        return sqrt(self.focal_xy_px[0] * self.focal_xy_px[1])

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The 3 x 3 camera matrix K of the lens without its distortion."""
        (fx, fy), (cu, cv) = self.focal_xy_px, self.centre_px
        return np.array([[fx, 0.0, cu], [0.0, fy, cv], [0.0, 0.0, 1.0]])

    def resized(self, width_px: int, height_px: int) -> Camera:
        """Return the camera whose picture is this one's, stretched to another size.

        Distortion acts on directions, before they become pixels: it stays as it is.
        """
        sx, sy = width_px / self.width_px, height_px / self.height_px
        (fx, fy), (cu, cv) = self.focal_xy_px, self.centre_px
        centre_px = (cu + 0.5) * sx - 0.5, (cv + 0.5) * sy - 0.5
        return replace(
            self,
            width_px=width_px,
            height_px=height_px,
            focal_xy_px=(fx * sx, fy * sy),
            centre_px=centre_px,
        )


@dataclass(frozen=True)
class Mount:
    """How the camera sits on the vehicle; the default is in its middle, looking straight down.

    A camera looks straight down (nadir) when its view is body-down, and the top of its picture
    points to the nose.
    """

    quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Rotates the vehicle's axes (forward, right, down) into those of the camera: the top of its
    picture, the right of it, its view. The unit quaternion is nadir."""
    offset_frd_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the camera is: metres forward, right and down of the origin of the vehicle."""

    def __post_init__(self) -> None:
        length_sq = sum(part * part for part in self.quaternion)
        if not 0.98 < length_sq < 1.02 or not all(map(isfinite, self.offset_frd_m)):
            raise ConfigurationError(
                f'mount of the camera with quaternion {self.quaternion} and offset '
                f'{self.offset_frd_m} m: give a unit quaternion and finite metres'
            )


NADIR = Mount()
