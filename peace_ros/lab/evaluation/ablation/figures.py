# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Counts of variants -> figures that do not depend on one threshold, and their differences."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.lab.evaluation.ablation.run import Counted, Key
from peace_ros.lab.evaluation.ablation.variants import DEFAULT, VOCABULARY
from peace_ros.lab.evaluation.segmentation.bootstrap import Bootstrap, known
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.histograms import BINS, MIDDLE, edges
from peace_ros.lab.evaluation.segmentation.metrics import (
    Areas,
    average_precision,
    best_bin,
    share_called_safe,
)

Figures = dict[str, Any]
RECALL = 0.30
"""Recall at which false-safe rates are compared."""
_THRESHOLD_EVERY = 8


def ablation_figures(counted: Counted, cores: Cores) -> Figures:
    """Return the figures of every variant, the thresholds of the default, and what is best.

    Rates are shares, 0 to 1. ``best_miou`` is at the threshold that is best for the variant on
    these frames; ``difference`` is its difference from the default's, with an interval from
    drawing the same frames again for both.
    """
    fusion = cores.segmentation.fusion
    default: Key = (VOCABULARY, DEFAULT, fusion)
    bootstrap = Bootstrap(len(counted.frames))
    base = _best(counted.counts[default], bootstrap)
    rows = [
        {
            **dict(zip(('group', 'variant', 'fusion'), key, strict=True)),
            'is_default': key == default,
            **_row(counts, base, bootstrap),
        }
        for key, counts in counted.counts.items()
    ]
    return {
        'frames': len(counted.frames),
        'image_encodings': counted.image_encodings,
        'configuration': cores.name,
        'bundle': cores.bundle.manifest.name,
        'fusion': fusion,
        'variants': rows,
        'thresholds': _thresholds(counted.counts[default], cores),
        'skipped': [asdict(each) for each in counted.skipped],
    }


def _best(counts: NDArray[np.uint32], bootstrap: Bootstrap) -> tuple[float, NDArray[np.float64]]:
    """Return the mIoU at the threshold that is best on all frames, and [replicates] of it."""
    total = counts.sum(0, dtype=np.float64)
    best = best_bin(Areas(total, None).miou)
    return float(Areas(total, best).miou), Areas(bootstrap.sums(counts), best).miou


def _row(
    counts: NDArray[np.uint32], base: tuple[float, NDArray[np.float64]], bootstrap: Bootstrap
) -> Figures:
    total = counts.sum(0, dtype=np.float64)
    every = Areas(total, None)
    best, drawn = _best(counts, bootstrap)
    # The strictest threshold that still finds so much safe ground.
    enough = np.flatnonzero(np.nan_to_num(every.recall) >= RECALL)
    at_recall = every.false_safe[enough[-1]] if enough.size and enough[-1] > 0 else np.nan
    shipped = Areas(total, MIDDLE)
    return {
        'best_miou': known(best),
        'best_miou_interval': bootstrap.interval(drawn),
        'difference': known(best - base[0]),
        'difference_interval': bootstrap.interval(drawn - base[1]),
        'average_precision': known(average_precision(total)),
        'false_safe_at_recall': known(at_recall),
        'miou': known(shipped.miou),
        'false_safe': known(shipped.false_safe),
        'recall': known(shipped.recall),
    }


def _thresholds(counts: NDArray[np.uint32], cores: Cores) -> list[Figures]:
    """Return what the default does over thresholds."""
    total = counts.sum(0, dtype=np.float64)
    every = Areas(total, None)
    scores = edges()
    rows = []
    for place in range(_THRESHOLD_EVERY, BINS, _THRESHOLD_EVERY):
        if every.safe_called[place] + every.unsafe_called[place] == 0:
            break
        own = cores.own_score(float(scores[place]))
        if 0.05 <= own <= 0.99:
            rows.append(
                {
                    'threshold': round(own, 4),
                    'is_default': place == MIDDLE,
                    'miou': known(every.miou[place]),
                    'false_safe': known(every.false_safe[place]),
                    'recall': known(every.recall[place]),
                    'person': known(share_called_safe(total, Label.PERSON, place)),
                }
            )
    return rows
