# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a flight sees: by the networks, or by the labels with a stated error rate."""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from peace_ros.core.domain import Frame, Heatmap, ImageError, is_safe
from peace_ros.core.pipeline import Pipeline
from peace_ros.simulation.camera import CameraView
from peace_ros.simulation.drawing import apply_condition

_SAFE, _UNSAFE = 0.9, 0.1
_ERROR_SIZE_PX = 4.0
"""Standard deviation of the blur that makes errors patches instead of single pixels."""
_HEATMAP_PX = 176
"""Side of a heatmap made from labels."""


class Eyes(Protocol):
    """Makes a heatmap from a view."""

    def see(self, view: CameraView, stamp_ns: int) -> Heatmap | None:
        """Return the heatmap; None where a working node would reject the picture."""


class ModelEyes:
    """The cores of a configuration: prompts and segmentation, as in flight.

    Args:
        pipeline: of the configuration; a new sequence of frames begins.
        condition: weather, light or image quality, one of CONDITIONS.
        seed: of the condition, which stays the same during a flight.
    """

    def __init__(self, pipeline: Pipeline, condition: str = 'clear', seed: int = 0) -> None:
        pipeline.reset()
        self._pipeline = pipeline
        self._condition, self._seed = condition, seed

    def see(self, view: CameraView, stamp_ns: int) -> Heatmap | None:
        """See :class:`Eyes`."""
        image = apply_condition(
            view.image_rgb, self._condition, np.random.default_rng(self._seed), labels=view.labels
        )
        try:
            return self._pipeline.look(Frame(image, stamp_ns)).heatmap
        except ImageError:
            return None


class TruthEyes:
    """Heatmaps from the labels, so that errors are those of the landing.

    Args:
        error_rate: share of the ground that each heatmap shows wrongly, 0 to below 0.5.
        seed: of the errors, which are new in each heatmap.
    """

    def __init__(self, error_rate: float, seed: int) -> None:
        self._random = np.random.default_rng([seed, 0xE7E5])
        self._limit = float(norm.ppf(error_rate))

    def see(self, view: CameraView, stamp_ns: int) -> Heatmap | None:
        """See :class:`Eyes`; unlabelled ground is unsafe."""
        if view.labels is None:
            return None
        size = (_HEATMAP_PX, _HEATMAP_PX)
        safe = cv2.resize(is_safe(view.labels).astype(np.uint8), size, None, 0, 0, cv2.INTER_AREA)
        noise = cv2.GaussianBlur(self._random.standard_normal(size), (0, 0), _ERROR_SIZE_PX)
        wrong = noise / noise.std() < self._limit
        seen: NDArray[np.bool_] = (safe > 0) != wrong
        return Heatmap(np.where(seen, _SAFE, _UNSAFE).astype(np.float32), stamp_ns)
