# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a class raster to instances, and which anchor predicts which of them.

FastSAM segments everything, so ground consists of instances too: each connected part of a class is
one, a car or a meadow.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.lab.training.arrays import Image, Rng
from peace_ros.lab.training.instances.networks import CELL_PX, STRIDES

LEAST_PX = 6
"""Smaller parts need not be found."""
MOST_INSTANCES = 72
IGNORED, NOTHING = -1, 0
"""Owners of anchors: not part of the loss, and no instance."""
_SIDES_PX = ((0, 96), (48, 208), (128, 1 << 20))
"""Longest side of the boxes that a level predicts; where they overlap, the better anchor counts."""
_SMALL_PX = 160
_FEATHER = 3
_THINGS = (Label.VEHICLE, Label.PERSON, Label.OBSTACLE)


@dataclass(frozen=True)
class Instances:
    """The instances of one view."""

    ids: NDArray[np.int32]
    """H x W: 1 + index of the instance, 0 where it is unknown or too small."""
    classes: Image
    """[G]: label or partial class."""
    boxes: NDArray[np.float32]
    """[G, 4]: left, top, right, bottom in pixels."""
    areas_px: NDArray[np.int64]
    """[G]."""

    def __len__(self) -> int:
        return len(self.classes)


def find_instances(
    classes: Image, *, least_px: int = LEAST_PX, most: int = MOST_INSTANCES
) -> Instances:
    """Divide a class raster [H, W] into connected instances; 0 (unlabeled) is no instance.

    When there are more than ``most``, the smallest that are no vehicle, person or obstacle are
    dropped first.
    """
    parts: list[tuple[int, int, NDArray[np.int32], tuple[int, int, int, int, int]]] = []
    for value in np.unique(classes).tolist():
        if value == Label.UNLABELED:
            continue
        mask = np.asarray(classes == value, np.uint8)
        count, marks, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
        grid = np.asarray(marks, np.int32)
        for part in range(1, count):
            left, top, width, height, area = (int(number) for number in stats[part])
            if area >= least_px:
                parts.append((value, part, grid, (left, top, width, height, area)))
    parts.sort(key=lambda each: (each[0] not in _THINGS and each[3][4] < _SMALL_PX, -each[3][4]))
    del parts[most:]
    ids = np.zeros(classes.shape, np.int32)
    for index, (_, part, marks, (left, top, width, height, _)) in enumerate(parts):
        window = slice(top, top + height), slice(left, left + width)
        ids[window][marks[window] == part] = index + 1
    boxes = [(x, y, x + width, y + height) for _, _, _, (x, y, width, height, _) in parts]
    return Instances(
        ids,
        np.array([each[0] for each in parts], np.uint8),
        np.array(boxes, np.float32).reshape(-1, 4),
        np.array([each[3][4] for each in parts], np.int64),
    )


def depths(instances: Instances) -> NDArray[np.float32]:
    """Return how deep inside of its instance each pixel lies, 0 to 1 at the deepest; H x W."""
    ids = instances.ids
    padded = np.pad(ids, 1, constant_values=-1)
    middle = padded[1:-1, 1:-1]
    inner = (middle == padded[:-2, 1:-1]) & (middle == padded[2:, 1:-1])
    inner &= (middle == padded[1:-1, :-2]) & (middle == padded[1:-1, 2:])
    depth = cv2.distanceTransform(inner.astype(np.uint8), cv2.DIST_L2, 3) + np.float32(1.0)
    deepest = np.ones(len(instances) + 1, np.float32)
    np.maximum.at(deepest, ids.ravel(), depth.ravel())
    return np.asarray(depth / deepest[ids], np.float32)


@dataclass(frozen=True)
class Duties:
    """What each of the A anchors of a view must predict."""

    owners: NDArray[np.int64]
    """[A]: 1 + index of an instance, NOTHING or IGNORED."""
    priors: NDArray[np.float32]
    """[A]: how deep inside of its instance the anchor lies, 0 to 1."""


def assign(instances: Instances) -> Duties:
    """Give each anchor the instance it lies in, where its level predicts boxes of that size.

    An instance that no anchor lies in gets the anchor nearest to its deepest pixel.
    """
    depth = depths(instances)
    side_px = instances.ids.shape[0]
    sides = np.zeros(len(instances) + 1, np.float32)
    if len(instances):
        sides[1:] = (instances.boxes[:, 2:] - instances.boxes[:, :2]).max(axis=1)
    owners, priors, first = [], [], [0]
    for stride, (low, high) in zip(STRIDES, _SIDES_PX, strict=True):
        centres = np.arange(side_px // stride) * stride + stride // 2
        grid = np.ix_(centres, centres)
        owner = instances.ids[grid].astype(np.int64).ravel()
        fits = (sides[owner] >= low) & (sides[owner] < high)
        owners.append(np.where(owner == 0, IGNORED, np.where(fits, owner, NOTHING)))
        priors.append(depth[grid].ravel())
        first.append(first[-1] + owner.size)
    duties = Duties(np.concatenate(owners), np.concatenate(priors).astype(np.float32))
    _adopt(instances, depth, duties, sides, first)
    return duties


def _adopt(
    instances: Instances,
    depth: NDArray[np.float32],
    duties: Duties,
    sides: NDArray[np.float32],
    first: list[int],
) -> None:
    """Find anchors for instances without one, the smallest last, so that they keep theirs."""
    side_px = instances.ids.shape[0]
    lone = sorted(
        set(range(1, len(instances) + 1)) - set(duties.owners.tolist()),
        key=lambda index: -instances.areas_px[index - 1],
    )
    for index in lone:
        left, top, right, bottom = instances.boxes[index - 1].astype(int).tolist()
        window = slice(top, bottom), slice(left, right)
        inside = np.where(instances.ids[window] == index, depth[window], np.float32(0.0))
        row, column = divmod(int(inside.argmax()), right - left)
        level = next(n for n, (_, high) in enumerate(_SIDES_PX) if sides[index] < high)
        stride, across = STRIDES[level], side_px // STRIDES[level]
        anchor = first[level] + (top + row) // stride * across + (left + column) // stride
        duties.owners[anchor], duties.priors[anchor] = index, 1.0


def cell_masks(instances: Instances) -> Image:
    """Return how much of each prototype cell an instance covers: [G, h, w], 0 to 255.

    Small things are widened by a pixel first, or they would vanish from the cells.
    """
    side = instances.ids.shape[0] // CELL_PX
    masks = np.zeros((len(instances), side, side), np.uint8)
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    for index, box in enumerate(instances.boxes):
        # Whole cells around the box, so that averaging them is averaging the whole raster.
        left, top = (int(value) // CELL_PX * CELL_PX for value in box[:2] - 1)
        left, top = max(left, 0), max(top, 0)
        right, bottom = (-(-int(value + 1) // CELL_PX) * CELL_PX for value in box[2:])
        part = instances.ids[top:bottom, left:right] == index + 1
        mask = part.astype(np.uint8) * np.uint8(255)
        if instances.areas_px[index] < _SMALL_PX:
            mask = np.asarray(cv2.dilate(mask, cross), np.uint8)
        rows, columns = mask.shape[0] // CELL_PX, mask.shape[1] // CELL_PX
        small = cv2.resize(mask, (columns, rows), interpolation=cv2.INTER_AREA)
        y, x = top // CELL_PX, left // CELL_PX
        masks[index, y : y + rows, x : x + columns] = small
    return masks


def roughened(
    mask: NDArray[np.bool_], rng: Rng
) -> NDArray[np.bool_]:  # fmt: skip
    """Return a mask h x w as a network draws it: in cells, off by a little; the same if lost."""
    height, width = mask.shape
    cells = (max(1, round(width / CELL_PX)), max(1, round(height / CELL_PX)))
    coarse = cv2.resize(mask.astype(np.float32), cells, interpolation=cv2.INTER_AREA)
    coarse = coarse + np.asarray(rng.normal(0.0, 0.1, coarse.shape), np.float32)
    coarse = cv2.GaussianBlur(coarse, (_FEATHER, _FEATHER), 0)
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    rough = fine > rng.uniform(0.3, 0.6)
    return np.asarray(rough if rough.any() else mask, np.bool_)
