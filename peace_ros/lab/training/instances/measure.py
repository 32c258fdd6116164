# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of a fastsam bundle, run as the segmentation node runs it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from peace_ros.core.domain import Frame, Label, Prompt, is_safe
from peace_ros.core.inference import Bundle
from peace_ros.core.pipeline import segmentation_of
from peace_ros.core.presets import load_preset
from peace_ros.core.segmentation import load_terms
from peace_ros.core.segmentation.fastsam import FastSamSegmenter
from peace_ros.lab.training.measure import Example
from peace_ros.lab.training.sources import FRAME_PX, VALIDATION_SEED, load_drawn

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

NAME = 'fastsam-small'
PRESET = 'peace_fs'
THRESHOLDS = (0.2, 0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
MOST_PERSONS = 0.1
"""Share of the persons' pixels that may be called safe: from high up few get a segment."""
MOST_FALSE_SAFE = 0.05
"""Share of what is called safe that may not be."""
CHOICE_SCENES = range(VALIDATION_SEED, VALIDATION_SEED + 40)
REPORT_SCENES = range(VALIDATION_SEED + 1000, VALIDATION_SEED + 1040)
"""Other scenes than those that the threshold was chosen on."""
PROMPT = Prompt('A rendered view of {term} in summer.', 0)


@dataclass(frozen=True)
class InstanceRow:
    """What is called safe from a threshold on; shares, 0 to 1."""

    threshold: float
    miou: float
    """Mean of the IoU of safe and of unsafe ground."""
    recall: float
    false_safe: float
    """Share of the ground called safe that is not."""
    by_class: dict[str, float]
    """Share of each class called safe."""


@dataclass(frozen=True)
class InstanceReport:
    """Figures over some frames."""

    rows: tuple[InstanceRow, ...]
    covered: float
    """Share of the frames that scored segments speak for."""
    segments: float
    """Scored segments per frame, mean."""
    unsafe_miou: float
    """What calling everything unsafe would get."""


def drawn_frames(cache: Path, seeds: range) -> list[Example]:
    """Return frames of scenes that training never sees."""
    sources = load_drawn(cache, seeds, size_px=FRAME_PX, workers=1)
    return [Example(source.images_rgb[0], source.classes[0]) for source in sources]


def open_segmenter(bundle: Bundle, threads: int = 1) -> FastSamSegmenter:
    """Return the bundle ready to run, with the shipped terms and the parameters of its preset."""
    parameters, own = segmentation_of(load_preset(PRESET), threads=threads)
    return FastSamSegmenter(bundle, load_terms(), parameters, own)


def measure(folder: Path, examples: Sequence[Example], *, threads: int = 1) -> InstanceReport:
    """Run a bundle over frames as :func:`open_segmenter` opens it."""
    segmenter = open_segmenter(Bundle.load(folder), threads)
    counts = np.zeros((len(THRESHOLDS), 2, len(Label)), np.int64)
    covered, segments = [], []
    for example in examples:
        frame = Frame(example.image_rgb, 0)
        safety = segmenter.segment(frame, PROMPT).safety
        truth = _at(example.classes, safety.shape)
        for row, threshold in enumerate(THRESHOLDS):
            called = safety >= threshold
            for answer in (0, 1):
                kinds = truth[called == bool(answer)]
                counts[row, answer] += np.bincount(kinds, minlength=len(Label))[: len(Label)]
        covered.append(float((safety > 0.0).mean()))
        segments.append(len(segmenter.segments(frame).scored))
    rows = tuple(_row(threshold, each) for threshold, each in zip(THRESHOLDS, counts, strict=True))
    known = counts[0].sum(axis=0)
    known[Label.UNLABELED] = 0
    safe = is_safe(np.arange(len(Label), dtype=np.uint8))
    unsafe_miou = 0.5 * float(known[~safe].sum()) / max(1.0, float(known.sum()))
    return InstanceReport(rows, float(np.mean(covered)), float(np.mean(segments)), unsafe_miou)


def merit(row: InstanceRow) -> tuple[float, float]:
    """Return what better rows have more of: both budgets kept, or nearly; then mIoU."""
    persons = row.by_class.get('PERSON', 0.0) / MOST_PERSONS
    return -max(1.0, persons, row.false_safe / MOST_FALSE_SAFE), row.miou


def best_row(report: InstanceReport) -> InstanceRow:
    """Return the row of the highest merit."""
    return max(report.rows, key=merit)


def _at(classes: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    rows = (np.arange(shape[0]) + 0.5) * classes.shape[0] / shape[0]
    columns = (np.arange(shape[1]) + 0.5) * classes.shape[1] / shape[1]
    return np.asarray(classes[np.ix_(rows.astype(int), columns.astype(int))])


def _row(threshold: float, counts: np.ndarray) -> InstanceRow:
    """``counts``: pixels by answer (unsafe, safe) and label."""
    safe = is_safe(np.arange(len(Label), dtype=np.uint8))
    hazard = ~safe
    hazard[Label.UNLABELED] = False
    hit, missed = float(counts[1, safe].sum()), float(counts[0, safe].sum())
    false, right = float(counts[1, hazard].sum()), float(counts[0, hazard].sum())
    iou_safe = hit / max(hit + missed + false, 1.0)
    iou_unsafe = right / max(right + missed + false, 1.0)
    by_class = {
        label.name: float(counts[1, label]) / float(counts[:, label].sum())
        for label in Label
        if label != Label.UNLABELED and counts[:, label].sum() > 0
    }
    return InstanceRow(
        threshold,
        0.5 * (iou_safe + iou_unsafe),
        hit / max(hit + missed, 1.0),
        false / max(hit + false, 1.0),
        by_class,
    )
