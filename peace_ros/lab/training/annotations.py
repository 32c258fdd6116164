# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rough polygons drawn by hand over real images without labels: ``config/annotations/NAME.yaml``.

A file holds the origin of the picture of that name, its licence and scale, whether it is kept for
validation (``split: val``), and lines of ``class x,y x,y ...`` in percent of width and height;
``+`` continues a line. Later polygons cover earlier ones; pixels outside of all polygons stay
unlabeled. Some pixels are known only in part (a block of yards, a gravel lot): they have one of the
partial classes below.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from peace_ros.core.domain import ConfigurationError, Label
from peace_ros.core.resources import config_dir
from peace_ros.lab.training.arrays import Image, Points

VEGETATION = 10
"""Grass or tree: the datasets that do not part them."""
LOOSE_SURFACE = 11
"""Bare ground or paved: gravel tracks and lots."""
OPEN_GROUND = 12
"""Grass or bare ground: stubble and dry meadows."""
NOT_SAFE = 13
"""Anything but grass and bare ground."""
PIXEL_CLASS_COUNT = 14

PARTIAL_CLASSES: dict[int, frozenset[Label]] = {
    VEGETATION: frozenset({Label.GRASS, Label.TREE}),
    LOOSE_SURFACE: frozenset({Label.BARE_GROUND, Label.PAVED}),
    OPEN_GROUND: frozenset({Label.GRASS, Label.BARE_GROUND}),
    NOT_SAFE: frozenset(Label) - {Label.UNLABELED, Label.GRASS, Label.BARE_GROUND},
}
"""Partial pixel class -> labels that it may be."""

_NAMES = {label.name.lower(): int(label) for label in Label} | {
    '-': int(Label.UNLABELED),
    'bare': int(Label.BARE_GROUND),
    'loose': LOOSE_SURFACE,
    'open': OPEN_GROUND,
    'unsafe': NOT_SAFE,
}


@dataclass(frozen=True)
class Annotation:
    """What is known about one real image."""

    name: str
    """Of the image file, without suffix."""
    origin: str
    licence: str
    gsd_m: float
    """Metres per pixel at nadir, estimated; it only sizes what training pastes in."""
    frame_px: tuple[float, float]
    """Smallest and largest side of a view cut from it."""
    is_validation: bool
    """Its place is kept out of training."""
    polygons: tuple[tuple[int, Points], ...]
    """Pixel class and corners (float64 [N, 2], percent of width and height), in drawing order."""


def load_annotations() -> list[Annotation]:
    """Read every annotation that ships with the package, by name.

    Raises:
        ConfigurationError: a file does not have the form above.
    """
    return [_load(path) for path in sorted((config_dir() / 'annotations').glob('*.yaml'))]


def _load(path: Path) -> Annotation:
    try:
        content: dict[str, Any] = yaml.safe_load(path.read_text(encoding='utf-8'))
        low, high = content['frame_px']
        lines = content['polygons'].replace('\n+', '').splitlines()
        return Annotation(
            path.stem,
            content['origin'],
            content['licence'],
            float(content['gsd_m']),
            (float(low), float(high)),
            content.get('split') == 'val',
            tuple(_polygon(line) for line in lines),
        )
    except (yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise ConfigurationError(
            f'{path}: not an annotation ({error!r}); compare it with the other files there'
        ) from error


def _polygon(line: str) -> tuple[int, Points]:
    kind, *points = line.split()
    corners = np.array([[float(part) for part in point.split(',')] for point in points])
    if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2:
        raise ValueError(f'{line!r}: at least three corners x,y are needed')
    return _NAMES[kind], corners


def rasterise(annotation: Annotation, width_px: int, height_px: int) -> Image:
    """Return the pixel classes of an annotated image, uint8 height x width."""
    classes = np.zeros((height_px, width_px), dtype=np.uint8)
    for kind, corners in annotation.polygons:
        scaled = np.round(corners * (width_px, height_px) / 100.0).astype(np.int32)
        cv2.fillPoly(classes, [scaled], kind)
    return classes
