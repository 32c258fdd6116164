# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a camera moved between two pictures of the ground, measured in the pictures alone.

Both pictures are projected onto level ground with their own attitude and altitude, which removes
rotation, tilt and scale; what remains is a shift, found by phase correlation (Kuglin and Hines,
1975). A shift counts only when the pictures have texture, one peak stands out, and the pictures
agree after it; otherwise the result is a reason.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from math import hypot, isfinite, radians
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import footprint_m, ground_to_camera
from peace_ros.core.mapping.projection import tilt_rad
from peace_ros.core.optics import pixels, sample

PATCH_PX = 128
"""Edge of the patches of ground that are compared."""
_PATCH_PARTS = (0.9, 0.75, 0.6, 0.45)
"""Edges of patches to try, in footprints of the lower camera."""
_RIM = np.array(
    [[0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.5]]
)
_RIM = np.vstack((_RIM * (PATCH_PX - 1.0), np.ones(8)))
"""Corners and middles of the sides of a patch: column, row, 1."""
_LARGEST_ALTITUDE_RATIO = 1.6
_LARGEST_TILT_RAD = radians(45.0)
_LARGEST_SHIFT = 0.35
"""Of the patch; beyond, too little overlaps."""
_LEAST_TEXTURE = 3.0
"""Standard deviation in grey levels."""
_LEAST_CROSS_TEXTURE = 0.03
"""Ratio of the gradients across and along the main direction: stripes do not show motion along."""
_LEAST_PEAK_RATIO = 1.6
"""Ratio of the best peak to the second best: ploughed rows and car parks repeat themselves."""
_LEAST_CORRELATION = 0.5
_PEAK_RADIUS_PX = 6
_PASSBAND = 0.2
"""Cycles per pixel at which the weight of a frequency has fallen to 0.6: above is noise."""
_ERROR_PX = 0.3
_ERROR_PER_ALTITUDE = 0.005
"""Error of the attitude between two pictures: 0.3 deg."""
_ERROR_PER_DISTANCE = 0.02
"""Error of the altitude, and with it of the scale: 2 %."""
VIEW_PX = 256
"""Longer edge of the pictures that are kept."""


@dataclass(frozen=True)
class View:
    """A small grey picture and how the camera was turned."""

    grey: NDArray[np.uint8]
    """Height x width; the whole frame."""
    pose: Pose
    """Attitude and altitude count, position does not."""


@dataclass(frozen=True)
class Displacement:
    """How far the camera moved, in the local NED frame."""

    north_m: float
    east_m: float
    error_m: float
    """One standard deviation, by the resolution, the altitude and the distance."""
    correlation: float
    """How well the pictures agree after the shift, up to 1."""


class Mismatch(Enum):
    """Why two pictures do not show how far the camera moved."""

    SAME = 'the camera gave the same picture twice'
    ALTITUDE = 'the altitudes of the pictures differ too much'
    HORIZON = 'the camera leans too far for level ground'
    TEXTURE = 'the ground has too little texture'
    AMBIGUOUS = 'the ground looks alike in several places'
    FAR = 'too little of the ground is in both pictures'
    DIFFERENT = 'the pictures do not agree'


def small_grey(image_rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a height x width x 3 RGB image as a grey one whose longer edge is VIEW_PX at most."""
    grey = cv2.cvtColor(image_rgb, cv2.COLOR_RGB2GRAY)
    height, width = grey.shape
    scale = VIEW_PX / max(height, width)
    if scale < 1.0:
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    return cast('NDArray[np.uint8]', grey)


def register(before: View, after: View, camera: Camera) -> Displacement | Mismatch:
    """Return how far the camera moved from one view to the other, or why that is unknown.

    :param camera: that of the full frames.
    """
    if before.grey.shape == after.grey.shape and np.array_equal(before.grey, after.grey):
        return Mismatch.SAME
    altitudes_m = before.pose.altitude_agl_m, after.pose.altitude_agl_m
    lower_m = min(altitudes_m)
    known = all(isfinite(each) and each > 0.0 for each in altitudes_m)
    if not known or max(altitudes_m) > _LARGEST_ALTITUDE_RATIO * lower_m:
        return Mismatch.ALTITUDE
    if max(tilt_rad(before.pose), tilt_rad(after.pose)) > _LARGEST_TILT_RAD:
        return Mismatch.HORIZON
    width_m = min(footprint_m(camera, lower_m))
    first_middle, second_middle = _middle(before, camera), _middle(after, camera)
    if first_middle is None or second_middle is None:
        return Mismatch.HORIZON
    shared = 0.5 * (first_middle + second_middle)
    # Around the same point seen from the vehicle only its motion is left to be found.
    for first_at, second_at in ((shared, shared), (first_middle, second_middle)):
        for part in _PATCH_PARTS:
            edge_m = part * width_m
            first = _patch(before, camera, first_at, edge_m)
            second = _patch(after, camera, second_at, edge_m)
            if first is not None and second is not None:
                return _compare(first, second, first_at - second_at, edge_m, lower_m)
    return Mismatch.HORIZON


def _seen_by(view: View, camera: Camera) -> tuple[Camera, Pose]:
    """Return the camera of the small picture, and its pose above the origin."""
    height, width = view.grey.shape
    return camera.resized(width, height), replace(view.pose, north_m=0.0, east_m=0.0)


def _middle(view: View, camera: Camera) -> NDArray[np.float64] | None:
    """Return (north, east) metres of the ground in the middle of the picture, None above it."""
    small, pose = _seen_by(view, camera)
    middle = np.linalg.inv(ground_to_camera(small, pose)) @ np.array([0.0, 0.0, 1.0])
    if not middle[2] > 0.0:
        return None
    ground: NDArray[np.float64] = middle[:2] / middle[2]
    return ground


def _patch(
    view: View, camera: Camera, middle: NDArray[np.float64], edge_m: float
) -> NDArray[np.float32] | None:
    """Cut a square of level ground, north up, out of the picture; None when not all is in view.

    :param middle: (north, east) metres of its middle, from the point below the camera.
    :return: PATCH_PX x PATCH_PX grey levels.
    """
    small, pose = _seen_by(view, camera)
    north_m, east_m = float(middle[0]), float(middle[1])
    cell_m, half = edge_m / PATCH_PX, 0.5 * (PATCH_PX - 1)
    ground_from_patch = np.array(
        [
            [0.0, -cell_m, north_m + half * cell_m],
            [cell_m, 0.0, east_m - half * cell_m],
            [0.0, 0.0, 1.0],
        ]
    )
    directions = ground_to_camera(small, pose) @ ground_from_patch
    rim = directions @ _RIM
    if not np.all(rim[2] > 0.0):
        return None
    u, v = pixels(small, rim)
    # A comparison with NaN is false, so directions that cannot be seen are refused too.
    if not (
        min(u.min(), v.min()) >= 0.0
        and u.max() <= small.width_px - 1
        and v.max() <= small.height_px - 1
    ):
        return None
    (ground,), _ = sample([(view.grey, cv2.INTER_LINEAR)], small, directions, (PATCH_PX, PATCH_PX))
    smooth = cv2.GaussianBlur(ground.astype(np.float32), (0, 0), 1.0)
    return cast('NDArray[np.float32]', smooth)


def _compare(
    first: NDArray[np.float32],
    second: NDArray[np.float32],
    apart: NDArray[np.float64],
    edge_m: float,
    altitude_m: float,
) -> Displacement | Mismatch:
    """Compare two patches; apart: by how many metres (north, east) the first lies ahead."""
    if min(first.std(), second.std()) < _LEAST_TEXTURE:
        return Mismatch.TEXTURE
    if min(_cross_texture(first), _cross_texture(second)) < _LEAST_CROSS_TEXTURE:
        return Mismatch.AMBIGUOUS
    down_px, right_px, ratio = _shift(first, second)
    if hypot(down_px, right_px) > _LARGEST_SHIFT * PATCH_PX:
        return Mismatch.FAR
    if ratio < _LEAST_PEAK_RATIO:
        return Mismatch.AMBIGUOUS
    agreement = _agreement(first, second, round(down_px), round(right_px))
    if agreement < _LEAST_CORRELATION:
        return Mismatch.DIFFERENT
    # The same ground lies in both: camera + middle of its patch + place in the patch.
    cell_m = edge_m / PATCH_PX
    north_m = float(apart[0]) - down_px * cell_m
    east_m = float(apart[1]) + right_px * cell_m
    error_m = (
        _ERROR_PX * cell_m
        + _ERROR_PER_ALTITUDE * altitude_m
        + _ERROR_PER_DISTANCE * hypot(north_m, east_m)
    )
    return Displacement(north_m, east_m, error_m, agreement)


def _cross_texture(ground: NDArray[np.float32]) -> float:
    """Return the smaller over the larger eigenvalue of the structure tensor, 0 to 1."""
    down, right = np.gradient(ground)
    mixed = float((down * right).mean())
    tensor = np.array(
        [[float((down * down).mean()), mixed], [mixed, float((right * right).mean())]]
    )
    small, large = np.linalg.eigvalsh(tensor)
    return float(small / max(large, 1e-9))


@lru_cache(maxsize=1)
def _window() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the taper of a patch, and the weight of each frequency."""
    taper = cv2.createHanningWindow((PATCH_PX, PATCH_PX), cv2.CV_32F)
    down, right = np.fft.fftfreq(PATCH_PX), np.fft.rfftfreq(PATCH_PX)
    weight = np.exp(-(np.add.outer(down**2, right**2)) / (2.0 * _PASSBAND**2))
    weight[0, 0] = 0.0
    return cast('NDArray[np.float32]', taper), weight.astype(np.float32)


def _shift(first: NDArray[np.float32], second: NDArray[np.float32]) -> tuple[float, float, float]:
    """Return rows and columns by which the second is ahead, and how far one peak stands out.

    What lies at (row, column) of the second lies at (row + rows, column + columns) of the first.
    """
    taper, weight = _window()
    spectra = [np.fft.rfft2((each - each.mean()) * taper) for each in (first, second)]
    cross = spectra[0] * np.conj(spectra[1])
    cross *= weight / np.maximum(np.abs(cross), 1e-9)
    surface = np.fft.fftshift(np.fft.irfft2(cross, s=first.shape))
    row, column = (int(each) for each in np.unravel_index(int(surface.argmax()), surface.shape))
    best = float(surface[row, column])
    rest = surface.copy()
    near = _PEAK_RADIUS_PX
    rest[max(0, row - near) : row + near + 1, max(0, column - near) : column + near + 1] = 0.0
    ratio = best / max(float(rest.max()), 1e-9)
    down = row + _vertex(surface[:, column], row) - PATCH_PX // 2
    right = column + _vertex(surface[row], column) - PATCH_PX // 2
    return down, right, ratio


def _vertex(values: NDArray[np.float64], at: int) -> float:
    """Return where the parabola through a peak and its two neighbours is highest, -0.5 to 0.5."""
    before, peak, after = (float(values[(at + step) % values.size]) for step in (-1, 0, 1))
    curvature = before - 2.0 * peak + after
    return 0.0 if curvature >= 0.0 else 0.5 * (before - after) / curvature


def _agreement(
    first: NDArray[np.float32], second: NDArray[np.float32], down_px: int, right_px: int
) -> float:
    """Return the correlation of the ground that is in both patches, -1 to 1."""
    one = first[_shared(down_px), _shared(right_px)]
    other = second[_shared(-down_px), _shared(-right_px)]
    one, other = one - one.mean(), other - other.mean()
    size = float(np.sqrt((one * one).sum() * (other * other).sum()))
    return 0.0 if size < 1e-6 else float((one * other).sum()) / size


def _shared(ahead_px: int) -> slice:
    """Return the pixels of a patch that lie in the other one too, which is ahead by so many."""
    return slice(max(0, ahead_px), PATCH_PX + min(0, ahead_px))
