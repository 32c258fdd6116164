# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Histograms -> rates. Every function takes [..., LABELS, BINS] and keeps the leading axes.

A rate of nothing (no pixel of that kind) is NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import SAFE_LABELS, Label
from peace_ros.lab.evaluation.segmentation.histograms import middles

Array = NDArray[np.float64]

SAFE = tuple(sorted(int(label) for label in SAFE_LABELS))
UNSAFE = tuple(
    int(label) for label in Label if label != Label.UNLABELED and label not in SAFE_LABELS
)
HAZARDS: Mapping[str, Label] = MappingProxyType(
    {
        'person': Label.PERSON,
        'vehicle': Label.VEHICLE,
        'water': Label.WATER,
        'building': Label.BUILDING,
        'road': Label.PAVED,
        'tree': Label.TREE,
        'obstacle': Label.OBSTACLE,
    }
)
CALIBRATION_BINS = 10


def ratio(part: Array, whole: Array) -> Array:
    """Return part / whole, NaN where whole is 0."""
    part, whole = np.broadcast_arrays(np.asarray(part, float), np.asarray(whole, float))
    out = np.full(part.shape, np.nan)
    np.divide(part, whole, out=out, where=whole > 0)
    return out


class Areas:
    """Labelled ground by what it is and what it is called, in pixels, at one or all thresholds.

    Each field has the leading axes of the histograms, and a last axis of BINS when no threshold
    is given: entry k is for calling safe what lies in bin k and above.
    """

    def __init__(self, counts: NDArray[np.generic], threshold_bin: int | None) -> None:
        wide = np.asarray(counts, np.float64)
        safe, unsafe = wide[..., SAFE, :].sum(-2), wide[..., UNSAFE, :].sum(-2)
        self.safe_called, self.safe_missed = _split(safe, threshold_bin)
        self.unsafe_called, self.unsafe_kept = _split(unsafe, threshold_bin)
        all_safe = self.safe_called + self.safe_missed
        all_unsafe = self.unsafe_called + self.unsafe_kept
        called = self.safe_called + self.unsafe_called
        self.iou_safe = ratio(self.safe_called, all_safe + self.unsafe_called)
        """Intersection over union of safe ground."""
        self.iou_unsafe = ratio(self.unsafe_kept, all_unsafe + self.safe_missed)
        """Intersection over union of unsafe ground."""
        self.miou = (self.iou_safe + self.iou_unsafe) / 2.0
        """Mean of both."""
        self.false_safe = ratio(self.unsafe_called, called)
        """Share of the ground called safe that is unsafe."""
        self.recall = ratio(self.safe_called, all_safe)
        """Share of safe ground that is called safe."""
        self.called_safe = ratio(called, all_safe + all_unsafe)
        """Share of all labelled ground that is called safe."""
        self.unsafe_called_safe = ratio(self.unsafe_called, all_unsafe)
        """Share of unsafe ground that is called safe."""
        baseline = ratio(all_unsafe, all_safe + all_unsafe) / 2.0
        self.baseline_miou = np.where(all_safe > 0, baseline, np.nan)
        """Mean IoU of an answer that calls everything unsafe."""


def _split(counts: Array, threshold_bin: int | None) -> tuple[Array, Array]:
    called = np.cumsum(counts[..., ::-1], axis=-1)[..., ::-1]
    missed = called[..., :1] - called
    if threshold_bin is None:
        return called, missed
    return called[..., threshold_bin], missed[..., threshold_bin]


def best_bin(rates: Array) -> int:
    """Return the threshold, 1 to BINS - 1, at which a rate, [BINS], is highest."""
    return int(np.nan_to_num(rates, nan=-1.0)[1:].argmax()) + 1


def share_called_safe(counts: NDArray[np.generic], label: Label, threshold_bin: int) -> Array:
    """Return the share of a label's pixels that is called safe."""
    of_label = np.asarray(counts, np.float64)[..., int(label), :]
    return ratio(of_label[..., threshold_bin:].sum(-1), of_label.sum(-1))


def reliability(counts: NDArray[np.generic]) -> tuple[Array, Array, Array]:
    """Return mean score, share of safe ground and pixels, each [..., CALIBRATION_BINS]."""
    wide = np.asarray(counts, np.float64)
    safe = wide[..., SAFE, :].sum(-2)
    every = safe + wide[..., UNSAFE, :].sum(-2)
    groups = np.minimum((middles() * CALIBRATION_BINS).astype(np.intp), CALIBRATION_BINS - 1)
    member = np.eye(CALIBRATION_BINS)[groups]
    pixels = every @ member
    return ratio((every * middles()) @ member, pixels), ratio(safe @ member, pixels), pixels


def calibration_error(counts: NDArray[np.generic]) -> Array:
    """Return the expected calibration error (Naeini et al. 2015) over CALIBRATION_BINS bins."""
    scores, shares, pixels = reliability(counts)
    gaps = np.where(pixels > 0, np.abs(np.nan_to_num(scores) - np.nan_to_num(shares)), 0.0)
    return ratio((gaps * pixels).sum(-1), pixels.sum(-1))


def average_precision(counts: NDArray[np.generic]) -> Array:
    """Return the area under precision over recall of safe ground, by steps."""
    areas = Areas(counts, None)
    # From strict to lenient, so that recall grows.
    recall = np.nan_to_num(areas.recall)[..., ::-1]
    precision = np.nan_to_num(1.0 - areas.false_safe, nan=1.0)[..., ::-1]
    steps = np.diff(recall, axis=-1, prepend=0.0)
    some = areas.safe_called[..., 0] + areas.safe_missed[..., 0] > 0
    return np.where(some, (steps * precision).sum(-1), np.nan)


def term_iou(counts: NDArray[np.generic]) -> Array:
    """Return the IoU of a term at each threshold, [..., BINS], from [..., 2, BINS]."""
    wide = np.asarray(counts, np.float64)
    called, missed = _split(wide[..., 1, :], None)
    wrong, _ = _split(wide[..., 0, :], None)
    return ratio(called, called + missed + wrong)
