# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a bundle calls safe in drawn scenes that training never sees, by threshold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from peace_ros.core.domain import Frame, Label, Prompt, is_safe
from peace_ros.core.inference import Bundle
from peace_ros.core.pipeline import segmentation_of
from peace_ros.core.presets import load_preset
from peace_ros.core.segmentation import Segmenter, create_segmenter, load_terms
from peace_ros.lab.training.arrays import Image, Points
from peace_ros.lab.training.sources import FRAME_PX, VALIDATION_SEED, load_drawn

PROMPT = Prompt('A view of {term} in summer.', 0)

Example = tuple[Image, Image]
"""RGB image [H, W, 3] and labels [H, W] of a frame."""


@dataclass(frozen=True)
class ThresholdRow:
    """What is called safe from a threshold on; shares, 0 to 1."""

    threshold: float
    miou: float
    """Mean of the IoU of safe and of unsafe ground."""
    recall: float
    """Share of the safe ground called safe."""
    false_safe: float
    """Share of the ground called safe that is unsafe."""
    unsafe_called_safe: float
    """Share of the unsafe ground called safe."""
    persons: float
    """Share of the persons' pixels called safe."""


def drawn_examples(cache: Path, count: int) -> list[Example]:
    """Return frames of scenes that training never sees."""
    seeds = range(VALIDATION_SEED, VALIDATION_SEED + count)
    sources = load_drawn(cache, seeds, size_px=FRAME_PX, workers=1)
    return [(source.images_rgb[0], source.classes[0]) for source in sources]


def open_segmenter(folder: Path, preset: str, threads: int = 2) -> Segmenter:
    """Return a bundle ready to run, with the shipped terms and the parameters of a preset."""
    family = Bundle.load(folder).manifest.family
    parameters, own = segmentation_of(
        load_preset(preset), family=family, bundle=str(folder), threads=threads
    )
    return create_segmenter(parameters, own, terms=load_terms())


def sweep(
    folder: Path,
    preset: str,
    examples: Sequence[Example],
    thresholds: Sequence[float],
    prompt: Prompt = PROMPT,
) -> list[ThresholdRow]:
    """Run a bundle over frames as a preset does and return a row per threshold."""
    segmenter = open_segmenter(folder, preset)
    counts = np.zeros((len(thresholds), 2, len(Label)))
    for image_rgb, labels in examples:
        safety = segmenter.segment(Frame(image_rgb, 0), prompt).safety
        truth = cv2.resize(labels, safety.shape[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
        for row, threshold in enumerate(thresholds):
            keys = truth.ravel() + len(Label) * (safety >= threshold).ravel()
            counts[row] += np.bincount(keys, minlength=2 * len(Label)).reshape(2, -1)
    return [_row(threshold, each) for threshold, each in zip(thresholds, counts, strict=True)]


def _row(threshold: float, counts: Points) -> ThresholdRow:
    """``counts``: pixels by answer (unsafe, safe) and label."""
    safe = is_safe(np.arange(len(Label), dtype=np.uint8))
    (missed, hit), (_, people) = counts[:, safe].sum(axis=1), counts[:, Label.PERSON]
    right, false = counts[:, ~safe].sum(axis=1) - counts[:, Label.UNLABELED]
    iou_safe = hit / max(hit + missed + false, 1.0)
    iou_unsafe = right / max(right + missed + false, 1.0)
    return ThresholdRow(
        threshold,
        miou=float(iou_safe + iou_unsafe) / 2.0,
        recall=float(hit / max(hit + missed, 1.0)),
        false_safe=float(false / max(hit + false, 1.0)),
        unsafe_called_safe=float(false / max(false + right, 1.0)),
        persons=float(people / max(counts[:, Label.PERSON].sum(), 1.0)),
    )
