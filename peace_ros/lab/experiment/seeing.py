# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How right the heatmaps of a flight were, by the ground truth in view."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from peace_ros.core.domain import Heatmap, Label, is_safe
from peace_ros.simulation.camera import CameraView

SAFE_FROM = 0.5
"""Score of a heatmap from which ground is called safe; the segmenters calibrate theirs to it."""


@dataclass
class SeenGround:
    """Pixels of all heatmaps of a flight, by what they called the ground and what it was."""

    safe_called_safe: int = 0
    safe_called_unsafe: int = 0
    unsafe_called_safe: int = 0
    unsafe_called_unsafe: int = 0

    def add(self, heatmap: Heatmap, view: CameraView) -> None:
        """Count the pixels of a heatmap; unlabelled ones do not count."""
        if view.labels is None:
            return
        size = (heatmap.safety.shape[1], heatmap.safety.shape[0])
        labels = cv2.resize(view.labels, size, interpolation=cv2.INTER_NEAREST)
        called, safe = heatmap.safety >= SAFE_FROM, is_safe(labels)
        known = labels != Label.UNLABELED
        self.safe_called_safe += int(np.count_nonzero(safe & called))
        self.safe_called_unsafe += int(np.count_nonzero(safe & ~called))
        self.unsafe_called_safe += int(np.count_nonzero(known & ~safe & called))
        self.unsafe_called_unsafe += int(np.count_nonzero(known & ~safe & ~called))

    @property
    def miou(self) -> float | None:
        """Mean over safe and unsafe of intersection over union, 0 to 1; None without labels."""
        wrong = self.safe_called_unsafe + self.unsafe_called_safe
        shares = [
            right / (right + wrong)
            for right in (self.safe_called_safe, self.unsafe_called_unsafe)
            if right + wrong
        ]
        return sum(shares) / len(shares) if shares else None
