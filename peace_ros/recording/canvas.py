# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small drawing helpers on RGB uint8 arrays (OpenCV only): text, scale bar, arrow, colours."""

from __future__ import annotations

from math import floor, log10
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import RecordingError

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]
Point = tuple[int, int]

INK: Colour = (235, 235, 235)
FAINT: Colour = (160, 160, 165)
PAPER: Colour = (24, 26, 30)
GOOD: Colour = (90, 220, 110)
BAD: Colour = (255, 80, 70)
WARN: Colour = (255, 190, 60)

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_AROUND = tuple((dx, dy) for dx in (-2, 0, 2) for dy in (-2, 0, 2) if dx or dy)


def blank(width_px: int, height_px: int) -> Image:
    """Return a dark sheet."""
    return np.full((height_px, width_px, 3), PAPER, np.uint8)


def ascii_only(text: str) -> str:
    """Replace what OpenCV's font cannot draw."""
    return text.replace('\u2019', "'").encode('ascii', 'replace').decode('ascii')


def text_width(text: str, scale: float, thickness: int = 1) -> int:
    """Return the width in pixels that :func:`put_text` needs."""
    return int(cv2.getTextSize(ascii_only(text), _FONT, scale, thickness)[0][0])


def put_text(
    image: Image,
    text: str,
    at: Point,
    *,
    scale: float = 0.5,
    colour: Colour = INK,
    thickness: int = 1,
    outline: bool = False,
) -> None:
    """Write one line; ``at`` is its lower left corner. An outline keeps it legible on pictures."""
    drawn = ascii_only(text)
    if outline:
        # Shifted copies: OpenCV 5 no longer draws letters fatter by their thickness.
        for dx, dy in _AROUND:
            beside = (at[0] + dx, at[1] + dy)
            cv2.putText(image, drawn, beside, _FONT, scale, (0, 0, 0), thickness, cv2.LINE_AA)
    cv2.putText(image, drawn, at, _FONT, scale, colour, thickness, cv2.LINE_AA)


def wrap(text: str, width_px: int, scale: float) -> list[str]:
    """Break a text into lines that fit a width; a longer single word is left whole."""
    lines: list[str] = []
    for word in text.split():
        if lines and text_width(f'{lines[-1]} {word}', scale) <= width_px:
            lines[-1] = f'{lines[-1]} {word}'
        else:
            lines.append(word)
    return lines


def fitted(image: NDArray[np.uint8], longest_px: int, interpolation: int = cv2.INTER_AREA) -> Image:
    """Return a picture scaled so that its longer side has a length."""
    height, width = image.shape[:2]
    factor = longest_px / max(height, width)
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return np.asarray(cv2.resize(image, size, interpolation=interpolation), np.uint8)


def altitude_colours(
    altitude_m: NDArray[np.float64], low_m: float, high_m: float
) -> NDArray[np.uint8]:
    """Return an N x 3 RGB colour for N altitudes: blue low, red high (turbo)."""
    span = max(high_m - low_m, 1e-6)
    level = np.clip((altitude_m - low_m) / span, 0.0, 1.0) * 255.0
    grey = level.astype(np.uint8).reshape(-1, 1)
    bgr = np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_TURBO), np.uint8).reshape(-1, 3)
    return bgr[:, ::-1]


def heat_colours(safety: NDArray[np.uint8]) -> Image:
    """Colour a height x width heatmap (0 to 255): red unsafe, yellow doubtful, green safe."""
    level = safety.astype(np.float32) / 255.0
    red = np.clip(2.0 - 2.0 * level, 0.0, 1.0) * 215.0
    green = np.clip(2.0 * level, 0.0, 1.0) * 185.0
    return np.stack([red, green, np.full_like(red, 40.0)], axis=-1).astype(np.uint8)


def nice_length_m(at_most_m: float) -> float:
    """Return the largest of 1, 2, 5 x 10^n metres that fits."""
    power = 10.0 ** floor(log10(max(at_most_m, 1e-3)))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= at_most_m * 1.0001)


def scale_bar(image: Image, at: Point, m_per_px: float, longest_px: int) -> None:
    """Draw a bar with its length in metres; ``at`` is its left end."""
    length_m = nice_length_m(longest_px * m_per_px)
    length_px = round(length_m / m_per_px)
    x, y = at
    cv2.rectangle(image, (x - 2, y - 2), (x + length_px + 2, y + 8), (0, 0, 0), -1)
    cv2.rectangle(image, (x, y), (x + length_px, y + 6), (255, 255, 255), -1)
    cv2.rectangle(image, (x, y), (x + length_px // 2, y + 6), (120, 120, 120), -1)
    put_text(image, f'{length_m:g} m', (x, y - 8), scale=0.6, outline=True, thickness=2)


def north_arrow(image: Image, at: Point, size_px: int = 44) -> None:
    """Draw an arrow to the top of the picture with an N; ``at`` is the middle of its foot."""
    x, y = at
    tip = (x, y - size_px)
    shape = np.array([tip, (x + size_px // 3, y), (x, y - size_px // 5), (x - size_px // 3, y)])
    cv2.fillPoly(image, [shape.astype(np.int32)], (255, 255, 255), cv2.LINE_AA)
    cv2.polylines(image, [shape.astype(np.int32)], True, (0, 0, 0), 2, cv2.LINE_AA)
    put_text(image, 'N', (x - 8, y - size_px - 6), scale=0.7, thickness=2, outline=True)


def outlined_circle(image: Image, at: Point, radius_px: int, colour: Colour) -> None:
    """Draw a circle that shows on light and dark ground."""
    cv2.circle(image, at, radius_px, (0, 0, 0), 5, cv2.LINE_AA)
    cv2.circle(image, at, radius_px, colour, 2, cv2.LINE_AA)


def cross(image: Image, at: Point, size_px: int, colour: Colour) -> None:
    """Draw an x-shaped cross that shows on light and dark ground."""
    cv2.drawMarker(image, at, (0, 0, 0), cv2.MARKER_TILTED_CROSS, size_px + 4, 6, cv2.LINE_AA)
    cv2.drawMarker(image, at, colour, cv2.MARKER_TILTED_CROSS, size_px, 3, cv2.LINE_AA)


def save_picture(image: Image, path: Path) -> None:
    """Write an RGB or one-channel picture as PNG or JPEG by its suffix, whole or not at all.

    Raises:
        RecordingError: the place cannot be written to.

    """
    stored = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    done, data = cv2.imencode(path.suffix, stored)
    if not done:
        raise RecordingError(f'picture {path} cannot be encoded: give .png or .jpg')
    partial = path.with_name(f'.{path.name}.partial')
    try:
        partial.write_bytes(data.tobytes())
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise RecordingError(
            f'picture {path} cannot be written ({error}): give a folder that is writable'
        ) from error
