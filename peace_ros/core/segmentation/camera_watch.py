# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frames that no working camera takes: of one colour, overexposed, or of another shape than before.

A network has an answer to any picture, also to that of a covered lens. Such pictures are refused
before it runs, so that there is no heatmap, and the landing holds because it has none.
"""

from __future__ import annotations

import numpy as np

from peace_ros.core.domain import Frame, ImageError

_GRID = 128
"""Pixels looked at along each side; more would not change the answer."""
_LEAST_SPREAD = 0.5
"""Standard deviation of brightness, of 255. Fog over a field has 5 and more, the sensor's own noise
or a lawn seen from the ground more than 1."""
_MOST_SATURATED = 0.9
_ASPECT_TOLERANCE = 0.01


class CameraWatch:
    """Checks the frames of one camera; remembers its shape."""

    def __init__(self) -> None:
        self._aspect: float | None = None

    def check(self, frame: Frame) -> None:
        """Accept a frame.

        Raises:
            ImageError: it shows nothing, or has another shape than the first one.
        """
        height, width = frame.image_rgb.shape[:2]
        step = max(1, min(height, width) // _GRID)
        grey = frame.image_rgb[::step, ::step].astype(np.float32).mean(axis=2)
        spread = float(grey.std())
        if spread < _LEAST_SPREAD:
            raise ImageError(
                f'the picture is of one colour (brightness {grey.mean():.0f} of 255, spread '
                f'{spread:.1f}, at least {_LEAST_SPREAD}): uncover the lens or check the camera'
            )
        for name, share in (
            ('white', float((grey >= 254.0).mean())),
            ('black', float((grey <= 1.0).mean())),
        ):
            if share > _MOST_SATURATED:
                raise ImageError(
                    f'{100 * share:.0f} % of the picture is {name} (at most '
                    f'{100 * _MOST_SATURATED:.0f} %): check the exposure of the camera'
                )
        aspect = width / height
        if self._aspect is None:
            self._aspect = aspect
        elif abs(aspect / self._aspect - 1.0) > _ASPECT_TOLERANCE:
            raise ImageError(
                f'the picture is {width} x {height}, its sides {aspect:.2f} : 1 where the camera '
                f'began with {self._aspect:.2f} : 1: restore the camera or restart the node'
            )
