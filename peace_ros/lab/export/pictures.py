# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Images and sentences on which an export is measured and checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, Frame
from peace_ros.core.inference.manifest import InputSpec
from peace_ros.core.inference.preprocess import Preprocessor

_SIDE_PX = 480
_SUFFIXES = ('.jpg', '.jpeg', '.png')

TEXTS = (
    'A rendered image of grass in spring.',
    'A blurred picture of road, street in a foggy night.',
    "A bird's eye view of a building, in game screenshot, bad graphics, shade, shadows.",
    'A photo of water.',
    'A 3D screenshot of people, crowd in winter.',
)
"""Sentences as the prompt templates write them."""
IS_POSITIVE = (True, False, False, True, False)


_DRAWN_TO_MEASURE, _DRAWN_TO_CHECK = 12, 3
_CHECKED_OF = 4
"""One photo in so many is kept for the check."""


def divide_pictures(frames: Sequence[Frame] | None) -> tuple[list[Frame], list[Frame]]:
    """Return the pictures to measure scales on and others to check them with.

    Values beyond a measured range are clipped, and light and colours differ between pictures: drawn
    ones widen the ranges of few photos, and only pictures that were not measured show whether the
    ranges are wide enough.

    Args:
        frames: photos; None: all pictures are drawn.
    """
    drawn = draw_pictures(_DRAWN_TO_MEASURE + _DRAWN_TO_CHECK)
    measured, checked = drawn[:_DRAWN_TO_MEASURE], drawn[_DRAWN_TO_MEASURE:]
    if frames:
        measured += [each for index, each in enumerate(frames) if index % _CHECKED_OF]
        checked = list(frames[::_CHECKED_OF])
    return measured, checked


def read_pictures(folder: Path, most: int = 16) -> list[Frame]:
    """Read the first images of a folder in the order of their names; raises ConfigurationError."""
    if not folder.is_dir():
        raise ConfigurationError(f'{folder}: no such folder; give a folder of photos')
    files = sorted(each for each in folder.glob('*') if each.suffix.lower() in _SUFFIXES)[:most]
    frames = []
    for file in files:
        image = cv2.imread(str(file), cv2.IMREAD_COLOR)
        if image is None:
            raise ConfigurationError(
                f'{file}: not a readable image; remove it or give another folder'
            )
        frames.append(Frame(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8), 0))
    if not frames:
        raise ConfigurationError(
            f'{folder}: no {", ".join(_SUFFIXES)} in it; give a folder of photos'
        )
    return frames


def draw_pictures(count: int, seed: int = 0) -> list[Frame]:
    """Draw stand-ins for aerial photos: textured ground, a road, roofs with shadows, water."""
    return [Frame(_draw(np.random.default_rng([seed, index])), index) for index in range(count)]


def plain_pixels(frames: Sequence[Frame], side_px: int) -> list[NDArray[np.float32]]:
    """Return each frame without normalisation: float32 [1, 3, side, side], RGB 0 to 1."""
    preprocess = Preprocessor(InputSpec(side_px, side_px, 'stretch', (0.0,) * 3, (1.0,) * 3))
    return [preprocess(each.image_rgb).copy() for each in frames]


def _draw(rng: np.random.Generator) -> NDArray[np.uint8]:
    side = _SIDE_PX
    image = np.zeros((side, side, 3), np.float32)
    for octave in (4, 16, 64, side):
        patches = rng.normal(0.0, 60.0 / octave**0.3, (octave, octave, 3)).astype(np.float32)
        image += cv2.resize(patches, (side, side), interpolation=cv2.INTER_CUBIC)
    image += rng.uniform(60.0, 160.0, 3).astype(np.float32)
    ends = rng.integers(0, side, (2, 2)).tolist()
    cv2.line(image, ends[0], ends[1], rng.uniform(70, 150, 3).tolist(), int(rng.integers(15, 45)))
    for _ in range(int(rng.integers(4, 10))):
        centre, size = rng.integers(0, side, 2).tolist(), rng.integers(20, 110, 2).tolist()
        box = cv2.boxPoints((centre, size, float(rng.uniform(0, 90))))
        shadow = (box + rng.integers(4, 14, 2)).astype(np.int32)
        cv2.fillPoly(image, [shadow], (25.0, 25.0, 30.0))
        cv2.fillPoly(image, [box.astype(np.int32)], rng.uniform(40, 230, 3).tolist())
    centre, radii = rng.integers(0, side, 2).tolist(), rng.integers(30, 120, 2).tolist()
    cv2.ellipse(image, centre, radii, float(rng.uniform(0, 180)), 0, 360, (40.0, 80.0, 120.0), -1)
    noisy = image + rng.normal(0.0, 6.0, image.shape)
    return np.clip(noisy, 0.0, 255.0).astype(np.uint8)
