# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scores and labels -> counts per label and score: every figure derives from these.

The bins are even in log-odds, 0.05 wide, so that they resolve sure scores as finely as doubtful
ones, and so that a model's threshold, a shift in log-odds, is a shift of bins. Bin 128 begins at
a score of one half.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label

BINS = 256
LABELS = len(Label)
MIDDLE = BINS // 2
STEP = 0.05
_LEVELS = 65535


def _bin_table() -> NDArray[np.uint8]:
    scores = np.arange(_LEVELS + 1) / _LEVELS
    with np.errstate(divide='ignore'):
        log_odds = np.log(scores) - np.log1p(-scores)
    bins = np.floor(log_odds / STEP + MIDDLE)
    return np.clip(bins, 0, BINS - 1).astype(np.uint8)


_BIN_OF_LEVEL = _bin_table()


def bins_of(scores: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the bin of each score, same shape; scores are float32, 0 to 1."""
    levels = np.rint(scores * np.float32(_LEVELS)).astype(np.uint16)
    bins: NDArray[np.uint8] = _BIN_OF_LEVEL[levels]
    return bins


def edges() -> NDArray[np.float64]:
    """Return the score at which each bin begins, [BINS]; the first is 0."""
    log_odds = (np.arange(BINS) - MIDDLE) * STEP
    scores: NDArray[np.float64] = 1.0 / (1.0 + np.exp(-log_odds))
    scores[0] = 0.0
    return scores


def middles() -> NDArray[np.float64]:
    """Return the score that stands for each bin, [BINS]."""
    log_odds = (np.arange(BINS) - MIDDLE + 0.5) * STEP
    return np.asarray(1.0 / (1.0 + np.exp(-log_odds)))


def bin_from(score: float) -> int:
    """Return the bin whose beginning is nearest to a score, 1 to BINS - 1."""
    return int(np.argmin(np.abs(edges()[1:] - score))) + 1


def count_labels(labels: NDArray[np.uint8], scores: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the pixels per label and bin, [LABELS, BINS].

    Args:
        labels: h x w of Label.
        scores: h x w, 0 to 1.
    """
    keys = labels.astype(np.uint16) * BINS + bins_of(scores)
    counts = np.bincount(keys.ravel(), minlength=LABELS * BINS)
    return counts.reshape(LABELS, BINS).astype(np.uint32)


def count_terms(
    labels: NDArray[np.uint8], maps: NDArray[np.float32], meanings: NDArray[np.bool_]
) -> NDArray[np.uint32]:
    """Return the labelled pixels per term, without and with the term's meaning, and bin.

    Args:
        labels: h x w of Label.
        maps: [T, h, w] scores of the terms, 0 to 1.
        meanings: [T, LABELS], which labels each term means.

    Returns:
        [T, 2, BINS].
    """
    known = labels != Label.UNLABELED
    kinds = labels[known]
    bins = bins_of(np.clip(maps[:, known], 0.0, 1.0))
    counts = np.zeros((len(maps), 2, BINS), np.uint32)
    for term, each in enumerate(bins):
        keys = meanings[term][kinds].astype(np.uint16) * BINS + each
        counts[term] = np.bincount(keys, minlength=2 * BINS).reshape(2, BINS)
    return counts
