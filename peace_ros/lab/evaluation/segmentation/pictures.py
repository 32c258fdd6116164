# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a configuration did on one image: image, truth, heatmap, called safe."""

from __future__ import annotations

import base64

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Heatmap, Label
from peace_ros.core.images import jpeg_from_rgb
from peace_ros.core.segmentation import draw_overlay
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.run import looks
from peace_ros.lab.evaluation.segmentation.samples import Pair, nearest

PANELS = ('image', 'truth', 'heatmap', 'called safe')
LABEL_COLOURS: dict[Label, tuple[int, int, int]] = {
    Label.UNLABELED: (235, 235, 235),
    Label.GRASS: (120, 190, 90),
    Label.BARE_GROUND: (216, 196, 130),
    Label.PAVED: (140, 140, 150),
    Label.BUILDING: (170, 70, 60),
    Label.TREE: (20, 95, 50),
    Label.WATER: (50, 110, 190),
    Label.VEHICLE: (240, 140, 20),
    Label.PERSON: (230, 20, 160),
    Label.OBSTACLE: (110, 60, 150),
}
_PALETTE = np.array([LABEL_COLOURS[label] for label in Label], np.uint8)
_PANEL_PX = 320
_QUALITY = 80


def panels(pair: Pair, cores: Cores, tile_px: int | None, score: float) -> list[str]:
    """Return PANELS as JPEG data URIs.

    Args:
        pair: image and labels.
        cores: the configuration.
        tile_px: see :func:`tiles_of`.
        score: of the heatmap, from which ground is called safe.
    """
    image, labels = pair
    height, width = image.shape[:2]
    scale = min(1.0, _PANEL_PX / width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    safety = _safety(image, cores, tile_px, size)
    small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    levels = np.rint(safety * 255.0).astype(np.uint8)
    coloured = cv2.cvtColor(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS), cv2.COLOR_BGR2RGB)
    drawn = (
        small,
        _PALETTE[nearest(labels, *size)],
        np.asarray(coloured, np.uint8),
        draw_overlay(Frame(small, 0), Heatmap(safety, 0), score),
    )
    return [_data_uri(each) for each in drawn]


def _safety(
    image: NDArray[np.uint8], cores: Cores, tile_px: int | None, size: tuple[int, int]
) -> NDArray[np.float32]:
    """Return the heatmap of the whole image, from its tiles, at the size (width, height)."""
    height, width = image.shape[:2]
    safety = np.zeros((size[1], size[0]), np.float32)
    for look in looks(image, cores, tile_px):
        tile = look.tile
        top, bottom = (
            round(y * size[1] / height) for y in (tile.own_rows.start, tile.own_rows.stop)
        )
        left, right = (
            round(x * size[0] / width) for x in (tile.own_columns.start, tile.own_columns.stop)
        )
        if bottom == top or right == left:
            continue
        own = np.ascontiguousarray(look.safety[tile.own])
        safety[top:bottom, left:right] = cv2.resize(
            own, (right - left, bottom - top), interpolation=cv2.INTER_AREA
        )
    return safety


def _data_uri(picture: NDArray[np.uint8]) -> str:
    encoded = base64.b64encode(jpeg_from_rgb(picture, _QUALITY)).decode('ascii')
    return f'data:image/jpeg;base64,{encoded}'
