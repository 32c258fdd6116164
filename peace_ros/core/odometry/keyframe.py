# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A picture that later ones are compared with, and how its corners are found in them.

A later picture is first warped: it is seen as the key frame would have been from the place where
the camera is believed to be. What a corner has moved in the warped picture is then small, and its
surroundings look alike, whatever the vehicle turned meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians, tan
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera
from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.odometry.plane import Array, RelativePose, view_of
from peace_ros.core.optics import pixels, sample

Grey = NDArray[np.uint8]

_CORNERS = 120
_CORNER_DISTANCE_PX = 12
_CORNER_QUALITY = 0.002
_WINDOW_PX = 15
"""Edge of the surroundings of a corner that are compared."""
_MARGIN_PX = 10
"""A corner nearer to the border of a picture is not looked for: its surroundings are cut."""
_ALIKE_LEVELS = 20.0
"""Mean difference of the surroundings of a corner, in grey levels."""
_PLANE_PX = 2.0
"""A corner agrees with the motion of a plane within this distance."""
_STRONGER_THAN_NOISE = 3.0
"""Gradients of a corner in its weaker direction, over those of the noise alone: without this
stripes and blank ground would have corners, made of noise."""
_FARTHEST = tan(radians(65.0))
"""Tangent of the slant up to which points of the ground are used."""
_LEAST_CONTRAST = 2.0
"""Standard deviation in grey levels, for pictures of another exposure to be matched."""
_AROUND = np.array([[u, v] for u in (-5, 0, 5) for v in (-5, 0, 5)], np.float32)
"""Pixels around a corner whose grey levels are compared."""
_GRADIENT = (255.0 / 2.0) ** 2
"""OpenCV's scale of the eigenvalues of a corner to the mean square of grey levels per pixel."""
_GRADIENT_OF_NOISE = 0.19
"""Mean square of the gradient, per variance of the noise: a 3 x 3 Sobel kernel over 8."""


@dataclass(frozen=True)
class Keyframe:
    """Corners of a picture, as points of the level ground."""

    camera: Camera
    """Of its picture: without distortion."""
    grey: Grey
    corners_px: NDArray[np.float32]
    """N x 2: u, v."""
    ground: Array
    """N x 3: north, east, down of the camera, in heights of the camera above the ground."""
    ground_from_pixel: Array
    """3 x 3: (u, v, 1) to (north, east, 1) times a factor."""

    def only(self, which: NDArray[np.bool_]) -> Keyframe:
        """Return the key frame with these of its corners."""
        return replace(self, corners_px=self.corners_px[which], ground=self.ground[which])


@dataclass(frozen=True)
class Matches:
    """Corners of a key frame that were found in another picture."""

    which: NDArray[np.intp]
    """M, indices of the corners."""
    directions: Array
    """3 x M, in which the camera sees them: right, down, along the view."""
    expected: int
    """So many of the corners must be in the picture."""


@dataclass(frozen=True)
class Readout:
    """How the rows of a picture were read one after another (rolling shutter)."""

    span_s: float
    """From the first row to the last; 0: all at once. The stamp is that of the middle."""
    rates_rad_s: Array
    """(3,) angular velocity about the axes of the camera."""
    velocity: Array
    """(3,) north, east, down; heights of the key frame per second."""

    def at_once(self, camera: Camera, directions: Array) -> tuple[Array, Array]:
        """Return directions (3 x N) as seen by the middle row, and where the camera was then.

        :return: and N x 3: place of the camera when each was read, from that of the middle.
        """
        if self.span_s == 0.0:
            return directions, np.zeros((directions.shape[1], 3))
        row = pixels(camera, directions)[1]
        lag_s = self.span_s * (row / (camera.height_px - 1) - 0.5)
        turned = directions + lag_s * np.cross(self.rates_rad_s, directions.T).T
        return turned, np.outer(lag_s, self.velocity)


def build_keyframe(
    grey: Grey, camera: Camera, quaternion: Quaternion, mount: Array, readout: Readout
) -> Keyframe:
    """Find corners in a picture.

    Args:
        grey: Height x width.
        camera: Of this size, with its distortion.
        quaternion: Attitude of the vehicle, NED from FRD.
        mount: 3 x 3, axes of the camera from those of the vehicle.
        readout: In heights of this frame.
    """
    pinhole = replace(camera, distortion=None)
    view = view_of(RelativePose(quaternion, np.zeros(2), 1.0), mount)
    to_direction = np.asarray(np.linalg.inv(pinhole.matrix), np.float64)
    to_ground = np.asarray(np.linalg.inv(view), np.float64)
    straight = grey
    if camera.distortion is not None:
        straight = _warped(grey, camera, to_direction)
    corners = _corners(straight)
    directions = to_direction @ _homogeneous(corners)
    inside = _is_inside(camera, directions) & _is_inside(pinhole, directions)
    corners, directions = corners[inside], directions[:, inside]
    directions, moved = readout.at_once(camera, directions)
    north, east, height = to_ground @ directions
    near = (height > 0.0) & (np.hypot(north, east) <= _FARTHEST * height)
    over = np.stack((north, east, height))[:, near] / height[near]
    moved = moved[near]
    ground = moved + (1.0 - moved[:, 2:]) * over.T
    return Keyframe(pinhole, straight, corners[near], ground, to_ground @ to_direction)


def find(
    key: Keyframe, grey: Grey, camera: Camera, place: RelativePose, mount: Array, levels: int
) -> Matches:
    """Find the corners of a key frame in a picture that was taken near a place.

    Args:
        key: With its corners.
        grey: Height x width.
        camera: Of this size, with its distortion.
        place: Where the camera is believed to be.
        mount: 3 x 3, axes of the camera from those of the vehicle.
        levels: The search begins at the resolution that is halved so many times: each doubles
            how far from the place corners are found.
    """
    directions = view_of(place, mount) @ key.ground_from_pixel
    inside = np.flatnonzero(_is_inside(camera, directions @ _homogeneous(key.corners_px)))
    if not len(inside):
        return Matches(inside, np.empty((3, 0)), 0)
    warped = _warped(grey, camera, directions)
    corners = key.corners_px[inside].reshape(-1, 1, 2)
    found, kept = _followed(key.grey, _alike(warped, key.grey, corners), corners, levels)
    kept[kept] = _moves_as_a_plane(corners[kept], found[kept])
    which = inside[kept]
    seen = directions @ _homogeneous(found[kept].reshape(-1, 2))
    return Matches(which, seen, len(inside))


def _warped(grey: Grey, camera: Camera, directions: Array) -> Grey:
    """Return a picture as a camera without distortion sees it, 0 where nothing is seen.

    :param directions: 3 x 3, from (column, row, 1) of the result to axes of the camera.
    """
    size = camera.width_px, camera.height_px
    (warped,), _ = sample([(grey, cv2.INTER_LINEAR)], camera, directions, size)
    return warped


def _homogeneous(points: NDArray[np.float32]) -> Array:
    return np.vstack((points.T.astype(np.float64), np.ones(len(points))))


def _is_inside(camera: Camera, directions: Array) -> NDArray[np.bool_]:
    """Return which directions (3 x N) a picture shows with all of their surroundings."""
    front = directions[2] > 0.0
    u, v = pixels(camera, np.where(front, directions, [[0.0], [0.0], [1.0]]))
    inside: NDArray[np.bool_] = (np.minimum(u, v) >= _MARGIN_PX) & front
    inside &= u <= camera.width_px - 1 - _MARGIN_PX
    inside &= v <= camera.height_px - 1 - _MARGIN_PX
    return inside


def _corners(grey: Grey) -> NDArray[np.float32]:
    """Return N x 2 corners (u, v) that are more than noise."""
    found = cv2.goodFeaturesToTrack(grey, _CORNERS, _CORNER_QUALITY, _CORNER_DISTANCE_PX)
    if found is None:
        return np.empty((0, 2), np.float32)
    corners = np.reshape(found, (-1, 2)).astype(np.float32)
    weaker = cv2.cornerMinEigenVal(grey, _WINDOW_PX)
    column, row = np.round(corners).astype(int).T
    noise = _GRADIENT_OF_NOISE * _noise_variance(grey)
    strong = weaker[row, column] * _GRADIENT > _STRONGER_THAN_NOISE * max(noise, 0.1)
    return cast('NDArray[np.float32]', corners[strong])


def _noise_variance(grey: Grey) -> float:
    """Estimate the variance of the noise of a picture (Immerkaer, 1996), by the median."""
    kernel = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
    curved = cv2.filter2D(grey[::2], cv2.CV_32F, kernel)
    return (1.4826 * float(np.median(np.abs(curved[:, ::4]))) / 6.0) ** 2


def _alike(warped: Grey, key: Grey, corners: NDArray[np.float32]) -> Grey:
    """Return a picture with brightness and contrast of the key frame: exposures change.

    Around corners (N x 1 x 2) both pictures show the same ground.
    """
    at = np.round(corners + _AROUND).astype(int)
    here, there = (each[at[..., 1], at[..., 0]] for each in (warped, key))
    if min(here.std(), there.std()) < _LEAST_CONTRAST:
        return warped
    gain = there.std() / here.std()
    levels = gain * (np.arange(256) - here.mean()) + there.mean()
    return cast('Grey', cv2.LUT(warped, np.clip(np.round(levels), 0, 255).astype(np.uint8)))


def _followed(
    before: Grey, after: Grey, corners: NDArray[np.float32], levels: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return where corners (N x 1 x 2) are in another picture, and whether it looks alike there."""
    found, there, off_levels = cv2.calcOpticalFlowPyrLK(
        before,
        after,
        corners,
        corners.copy(),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=levels,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return found, (there.ravel() > 0) & (off_levels.ravel() <= _ALIKE_LEVELS)


def _moves_as_a_plane(
    corners: NDArray[np.float32], found: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Return which corners (N x 1 x 2) moved as most of them did."""
    none = np.zeros(len(corners), np.bool_)
    if len(corners) < 4:
        return none
    _, agrees = cv2.findHomography(corners, found, cv2.USAC_MAGSAC, _PLANE_PX)
    return none if agrees is None else np.asarray(agrees.ravel() > 0)
