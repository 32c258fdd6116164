# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seeded batches of views with their instances, and of segments cut out of views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from peace_ros.core.domain import Label
from peace_ros.core.inference.manifest import InputSpec
from peace_ros.core.segmentation.fastsam.crops import Cutter
from peace_ros.core.segmentation.fastsam.letterbox import BORDER_LEVEL, Placement
from peace_ros.core.segmentation.fastsam.masks import Segment
from peace_ros.lab.training.annotations import PIXEL_CLASS_COUNT
from peace_ros.lab.training.arrays import Image, Rng
from peace_ros.lab.training.backbone import MEAN, STD
from peace_ros.lab.training.batches import (
    BatchT,
    Maker,
    encode,
    pixel_class_table,
    to_pixels,
    wanted_labels,
)
from peace_ros.lab.training.instances import targets
from peace_ros.lab.training.instances.networks import CROP_PX
from peace_ros.lab.training.sources import TrainingSource
from peace_ros.lab.training.text import sample_prompt

CROP_INPUT = InputSpec(CROP_PX, CROP_PX, 'letterbox', MEAN, STD)
_SHARES = {'drawn': 0.6, 'satellite': 0.1, 'drone': 0.3}
_CROPS_PER_VIEW = 16
_LEAST_CROP_PX = 40
_MIXED_CHANCE = 0.12
_HAZARD_RULES = 0.1
"""Share of hazards from which a mixed segment is one, whatever else lies in it."""


@dataclass(frozen=True)
class InstanceBatch:
    """Views with what their anchors and masks must say."""

    pixels: Tensor
    """Float32 [B, 3, S, S], normalised."""
    classes: Tensor
    """Int64 [B, S, S]: labels and partial classes."""
    owners: Tensor
    """Int64 [B, A], see :mod:`targets`."""
    priors: Tensor
    """Float32 [B, A]."""
    boxes: tuple[Tensor, ...]
    """Per view float32 [G, 4]: left, top, right, bottom."""
    masks: tuple[Tensor, ...]
    """Per view uint8 [G, h, w]: coverage of the cells, 0 to 255."""
    kinds: tuple[Tensor, ...]
    """Per view int64 [G]: class of each instance."""


@dataclass(frozen=True)
class CropBatch:
    """Segments and prompts."""

    pixels: Tensor
    """Float32 [N, 3, 64, 64]."""
    labels: Tensor
    """Float32 [N, 9]: 1 for each label that the segment may be."""
    known: Tensor
    """Float32 [N]: 1 where exactly one label is right, 0 where it is one of several."""
    input_ids: Tensor
    attention_mask: Tensor
    wanted: Tensor
    """Float32 [T, 9]: labels that each prompt stands for."""


class _BorderedMaker(Maker[BatchT]):
    """Views, at times with the borders of a wide frame."""

    def _bordered(self, rng: Rng) -> tuple[Image, Image]:
        """Return image and classes of a view."""
        view = self._view(rng)
        image, classes = view.image_rgb, view.classes
        if rng.random() < 0.25:
            border = int(rng.uniform(0.06, 0.22) * self._view_px)
            image, classes = image.copy(), classes.copy()
            for rows in (slice(0, border), slice(-border, None)):
                image[rows], classes[rows] = BORDER_LEVEL, Label.UNLABELED
        return image, classes


class InstanceMaker(_BorderedMaker[InstanceBatch]):
    """Batches for the segmenter."""

    def __init__(self, sources: list[TrainingSource], seed: int, **size: int) -> None:
        """``size``: batch_size and view_px."""
        super().__init__(sources, _SHARES, seed, condition_chance=0.15, salt=(21,), **size)

    def _draw(self, rng: Rng) -> InstanceBatch:
        views = [self._bordered(rng) for _ in range(self._batch_size)]
        found = [targets.find_instances(classes) for _, classes in views]
        duties = [targets.assign(each) for each in found]
        return InstanceBatch(
            to_pixels([image for image, _ in views]),
            torch.from_numpy(np.stack([classes for _, classes in views]).astype(np.int64)),
            torch.from_numpy(np.stack([each.owners for each in duties])),
            torch.from_numpy(np.stack([each.priors for each in duties])),
            tuple(torch.from_numpy(each.boxes) for each in found),
            tuple(torch.from_numpy(targets.cell_masks(each)) for each in found),
            tuple(torch.from_numpy(each.classes.astype(np.int64)) for each in found),
        )


class CropMaker(_BorderedMaker[CropBatch]):
    """Batches for the pair that names segments."""

    def __init__(
        self, sources: list[TrainingSource], seed: int, *, prompts: int, **size: int
    ) -> None:
        """``size``: batch_size (in views) and view_px."""
        super().__init__(sources, _SHARES, seed, condition_chance=0.15, salt=(22,), **size)
        self._prompts = prompts
        self._table = pixel_class_table().numpy()

    def _draw(self, rng: Rng) -> CropBatch:
        cutter = Cutter(CROP_INPUT, _CROPS_PER_VIEW)
        place = Placement(0, 0, self._view_px, self._view_px)
        pixels: list[NDArray[np.float32]] = []
        labels: list[NDArray[np.float32]] = []
        for _ in range(self._batch_size):
            image, classes = self._bordered(rng)
            segments, truths = self._segments(classes, rng)
            pixels.append(cutter(image, segments, place).copy())
            labels += truths
        may_be = torch.from_numpy(np.array(labels, np.float32).reshape(-1, self._table.shape[1]))
        prompts = [sample_prompt(rng) for _ in range(self._prompts)]
        return CropBatch(
            torch.from_numpy(np.concatenate(pixels)),
            may_be,
            (may_be.sum(dim=1) == 1.0).to(torch.float32),
            *encode([prompt.text for prompt in prompts]),
            wanted_labels(prompts),
        )

    def _segments(
        self, classes: Image, rng: Rng
    ) -> tuple[list[Segment], list[NDArray[np.float32]]]:
        """Draw segments of a view with the labels that each may be."""
        found = targets.find_instances(classes, least_px=_LEAST_CROP_PX)
        segments, truths = [], []
        for index in _pick(found, rng):
            if rng.random() < _MIXED_CHANCE:
                segment, truth = _mixed(found, index, classes, rng, self._table)
            else:
                segment, truth = _cut(found, index, rng), self._table[found.classes[index]]
            if truth.any():
                segments.append(segment)
                truths.append(truth)
        return segments, truths


def _pick(found: targets.Instances, rng: Rng) -> list[int]:
    """Choose instances of every class alike, large ones more often."""
    if not len(found):
        return []
    _, kind, counts = np.unique(found.classes, return_inverse=True, return_counts=True)
    weight = np.sqrt(found.areas_px) / np.sqrt(counts[kind])
    count = min(len(found), _CROPS_PER_VIEW)
    return list(rng.choice(len(found), count, replace=False, p=weight / weight.sum()))


def _cut(found: targets.Instances, index: int, rng: Rng) -> Segment:
    """Return an instance as the segmenter would find it."""
    left, top, right, bottom = found.boxes[index].astype(int).tolist()
    mask = targets.roughened(found.ids[top:bottom, left:right] == index + 1, rng)
    return Segment(left, top, mask, int(mask.sum()), 1.0, 1.0)


def _mixed(
    found: targets.Instances, index: int, classes: Image, rng: Rng,
    table: NDArray[np.float32],
) -> tuple[Segment, NDArray[np.float32]]:  # fmt: skip
    """Return a rectangle around an instance, of whatever lies in it, as a bad mask would be."""
    left, top, right, bottom = found.boxes[index].astype(int).tolist()
    grow = rng.uniform(0.0, 0.5, 4) * min(right - left, bottom - top)
    left, top = max(0, int(left - grow[0])), max(0, int(top - grow[1]))
    right = min(classes.shape[1], int(right + grow[2]))
    bottom = min(classes.shape[0], int(bottom + grow[3]))
    mask = np.ones((bottom - top, right - left), np.bool_)
    counts = np.bincount(classes[top:bottom, left:right].ravel(), minlength=PIXEL_CLASS_COUNT)
    counts[Label.UNLABELED] = 0
    hazards = counts * (table[:, :2].sum(axis=1) == 0.0)
    ruling = hazards if hazards.sum() >= _HAZARD_RULES * max(counts.sum(), 1) else counts
    present = ruling >= 0.25 * max(ruling.sum(), 1)
    present &= ruling > 0
    truth = table[present].max(axis=0) if present.any() else np.zeros(table.shape[1], np.float32)
    return Segment(left, top, mask, mask.size, 1.0, 1.0), truth
