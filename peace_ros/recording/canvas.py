# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dark sheets that matplotlib draws on, measured in pixels; pictures are RGB uint8 arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from peace_ros.core.domain import RecordingError
from peace_ros.recording.run_folder import write_whole

Image = NDArray[np.uint8]

INK, FAINT, PAPER = '#ebebeb', '#a0a0a5', '#181a1e'
_DPI = 100


def sheet(width_px: int, height_px: int) -> Figure:
    """Return an empty sheet."""
    return Figure((width_px / _DPI, height_px / _DPI), dpi=_DPI, facecolor=PAPER)


def window(figure: Figure, left: int, top: int, width: int, height: int) -> Axes:
    """Return axes without frame on a rectangle of a sheet, pixels from its upper left corner."""
    wide, high = (round(each * _DPI) for each in figure.get_size_inches())
    axes = figure.add_axes((left / wide, 1.0 - (top + height) / high, width / wide, height / high))
    axes.set_axis_off()
    return axes


def write(figure: Figure, left: int, baseline: int, text: str, size: float, **style: Any) -> None:
    """Write lines; the first one stands on a baseline, pixels from the upper left corner."""
    wide, high = (round(each * _DPI) for each in figure.get_size_inches())
    for number, line in enumerate(text.splitlines()):
        below = baseline + round(number * 2.0 * size)
        figure.text(left / wide, 1.0 - below / high, line, size=size, **{'color': INK, **style})


def pixels(figure: Figure) -> Image:
    """Return what was drawn, height x width x 3."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba(), np.uint8)[..., :3])


def save_picture(image: Image, path: Path) -> None:
    """Write an RGB or one-channel picture as PNG or JPEG by its suffix, whole or not at all.

    Raises:
        RecordingError: the place cannot be written to.
    """
    stored = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    done, data = cv2.imencode(path.suffix, stored)
    if not done:
        raise RecordingError(f'picture {path} cannot be encoded: give .png or .jpg')
    write_whole(path, data.tobytes(), 'picture')
