# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The threshold that keeps a false-safe budget, and its way into the bundle."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.core.inference.bundle import MANIFEST_NAME
from peace_ros.core.inference.manifest import THRESHOLDS
from peace_ros.lab.evaluation.segmentation.bootstrap import LEVEL, Bootstrap
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.histograms import BINS, MIDDLE, edges
from peace_ros.lab.evaluation.segmentation.metrics import Areas, Array, ratio
from peace_ros.lab.evaluation.segmentation.run import Tally

_LEAST_GAIN = 0.002
"""Of recall; less is not worth another threshold."""


@dataclass(frozen=True)
class RiskBudget:
    """What a threshold must keep, at the upper end of the 95 % interval over frames."""

    false_safe: float
    """Share of the ground called safe that may be unsafe."""
    persons: float | None = None
    """Share of the pixels of people that may be called safe; None: no limit of its own."""


@dataclass(frozen=True)
class Choice:
    """A threshold and what it does on the frames that it was chosen on."""

    threshold: float
    """The network's own score."""
    false_safe: float
    false_safe_limit: float
    """Upper end of the interval."""
    recall: float
    miou: float
    persons: float | None
    persons_limit: float | None


def choose_threshold(cores: Cores, tally: Tally, budget: RiskBudget) -> Choice:
    """Return the threshold of the highest recall of safe ground that keeps the budget.

    The upper end of the interval must keep it, not the figure itself: a budget that is kept only
    on average is broken on every other set of images. Few frames make wide intervals, and so
    strict thresholds.

    Raises DatasetError when no threshold keeps it.
    """
    counts = np.stack(tally.counts)
    bootstrap = Bootstrap(tally.frames)
    total, drawn = counts.sum(0, dtype=np.float64), bootstrap.sums(counts)
    areas = Areas(total, None)
    limits = _upper(Areas(drawn, None).false_safe)
    fits = (areas.safe_called > 0) & (limits <= budget.false_safe)
    persons, persons_limits = _persons(total), _upper(_persons(drawn))
    if budget.persons is not None:
        # Where nobody is in sight there is nothing to hold against a threshold.
        fits &= ~(persons_limits > budget.persons)
    # What calls every pixel safe has seen nothing, whatever the budget.
    fits &= (areas.safe_missed + areas.unsafe_kept > 0) & _usable(cores)
    if not fits.any():
        raise DatasetError(_refusal(areas, limits, budget, tally.frames))
    recall = np.nan_to_num(areas.recall)
    at = int(np.flatnonzero(fits)[recall[fits].argmax()])
    if fits[MIDDLE] and recall[at] - recall[MIDDLE] < _LEAST_GAIN:
        at = MIDDLE  # that of the bundle, so that choosing again changes nothing
    return Choice(
        cores.own_score(float(edges()[at])),
        float(areas.false_safe[at]),
        float(limits[at]),
        float(areas.recall[at]),
        float(areas.miou[at]),
        float(persons[at]) if np.isfinite(persons[at]) else None,
        float(persons_limits[at]) if np.isfinite(persons_limits[at]) else None,
    )


def _usable(cores: Cores) -> NDArray[np.bool_]:
    """Return which edges of the bins are thresholds that a bundle may recommend."""
    low, high = THRESHOLDS
    usable = [low <= cores.own_score(float(each)) <= high for each in edges()[1:]]
    return np.array([False, *usable], np.bool_)


def _persons(counts: NDArray[np.float64]) -> Array:
    people = counts[..., int(Label.PERSON), :]
    called = np.cumsum(people[..., ::-1], axis=-1)[..., ::-1]
    return ratio(called, called[..., :1])


def _upper(values: Array) -> Array:
    """Return the upper end of the interval of [replicates, BINS], NaN where it has no value."""
    limits = np.full(BINS, np.nan)
    some = np.isfinite(values).any(axis=0)
    limits[some] = np.nanquantile(values[:, some], (1.0 + LEVEL) / 2.0, axis=0)
    return limits


def _refusal(areas: Areas, limits: Array, budget: RiskBudget, frames: int) -> str:
    limited = np.where(areas.safe_called > 0, limits, np.nan)
    if not np.isfinite(limited[1:]).any():
        return 'no threshold keeps the budget: no safe ground is called safe at any'
    best = int(np.nanargmin(limited[1:])) + 1
    persons = '' if budget.persons is None else f' with persons at most {budget.persons:.2%}'
    return (
        f'no threshold keeps false-safe at most {budget.false_safe:.2%}{persons} on these {frames} '
        f'frames: the best has {areas.false_safe[best]:.2%}, up to {limits[best]:.2%} within the '
        f'95 % interval, at a recall of {areas.recall[best]:.2%}; allow more, evaluate more frames '
        'or use a better model'
    )


def save_threshold(cores: Cores, choice: Choice, budget: RiskBudget) -> Path:
    """Write the threshold into the bundle's manifest, with its budget; return the file.

    Raises DatasetError when the bundle's threshold does not apply to this configuration or the
    file cannot be written.
    """
    parameters = cores.segmentation
    if parameters.family != 'clipseg' or parameters.fusion != 'set_difference':
        raise DatasetError(
            f'{cores.name} (family {parameters.family}, fusion {parameters.fusion}): bundles '
            'recommend a threshold only for clipseg with set_difference; leave --save out'
        )
    path = cores.bundle.folder / MANIFEST_NAME
    manifest = json.loads(path.read_text(encoding='utf-8'))
    manifest['recommended'] = {
        **manifest.get('recommended', {}),
        'threshold': round(choice.threshold, 4),
        'max_false_safe': budget.false_safe,
    }
    # Only a whole manifest takes the place of the old one.
    partial = path.with_suffix('.part')
    try:
        partial.write_text(json.dumps(manifest, indent=2) + '\n', encoding='utf-8')
        partial.replace(path)
    except OSError as error:
        raise DatasetError(
            f'{path} cannot be written ({error.strerror}): copy the bundle'
        ) from error
    return path
