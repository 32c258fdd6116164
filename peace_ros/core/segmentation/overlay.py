# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The heatmap over the frame, for people."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Heatmap

_SAFE_RGB = np.array([40, 220, 60], np.float32)
_UNSAFE_RGB = np.array([230, 40, 40], np.float32)
_TINT = 0.45
"""Share of the tint where the score is 0 or 1; the picture below stays visible."""


def draw_overlay(frame: Frame, heatmap: Heatmap, threshold: float = 0.5) -> NDArray[np.uint8]:
    """Return the frame, tinted green where it is safe and red where it is not.

    The tint fades towards the threshold, and a white line with a dark rim runs along it, so that
    the border reads without telling red from green.

    Args:
        frame: the camera image.
        heatmap: scores of that frame, of any resolution.
        threshold: score from which a pixel counts as safe, 0 to 1.

    Returns:
        RGB uint8, height x width x 3 of the frame.
    """
    height, width = frame.image_rgb.shape[:2]
    safety = np.asarray(
        cv2.resize(heatmap.safety, (width, height), interpolation=cv2.INTER_LINEAR), np.float32
    )
    is_safe = safety >= threshold
    span = np.where(is_safe, max(1.0 - threshold, 1e-6), max(threshold, 1e-6))
    sureness = np.clip(np.abs(safety - threshold) / span, 0.0, 1.0)
    share = (_TINT * (0.35 + 0.65 * sureness)).astype(np.float32)[:, :, None]
    tint = np.where(is_safe[:, :, None], _SAFE_RGB, _UNSAFE_RGB)
    mixed = frame.image_rgb * (np.float32(1.0) - share) + tint * share
    picture = np.ascontiguousarray(np.rint(mixed).astype(np.uint8))
    _draw_border(picture, is_safe)
    return picture


def _draw_border(picture: NDArray[np.uint8], is_safe: NDArray[np.bool_]) -> None:
    thickness = max(1, round(min(picture.shape[:2]) / 350))
    # Beyond the picture the mask goes on, so that no line runs along the picture's own edge.
    beyond = thickness + 3
    mask = np.pad(is_safe.astype(np.uint8), beyond, mode='edge')
    contours, _ = cv2.findContours(
        mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE, offset=(-beyond, -beyond)
    )
    cv2.drawContours(picture, contours, -1, (20, 20, 20), thickness + 2, cv2.LINE_AA)
    cv2.drawContours(picture, contours, -1, (255, 255, 255), thickness, cv2.LINE_AA)
