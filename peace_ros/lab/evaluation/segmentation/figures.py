# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Counts of a configuration -> its figures with their intervals, as ``--json`` writes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from peace_ros.lab.evaluation.segmentation.bootstrap import Bootstrap
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.histograms import BINS, bin_from, edges
from peace_ros.lab.evaluation.segmentation.metrics import (
    HAZARDS,
    Areas,
    Array,
    average_precision,
    calibration_error,
    ratio,
    reliability,
    share_called_safe,
    term_iou,
)
from peace_ros.lab.evaluation.segmentation.run import Outcome, Tally

Figures = dict[str, Any]
_CURVE_EVERY = 4
_AREA_RATES = (
    'miou',
    'iou_safe',
    'iou_unsafe',
    'false_safe',
    'recall',
    'called_safe',
    'unsafe_called_safe',
    'baseline_miou',
)


def figures_of(
    cores: Cores, tally: Tally, outcome: Outcome, own_threshold: float | None = None
) -> Figures:
    """Return the figures of one configuration.

    Rates are shares, 0 to 1; ``<name>_interval`` is [low, high] of 95 %, over frames; None: there
    is nothing to take a rate of.

    Args:
        cores: the configuration.
        tally: what it was found to do.
        outcome: of the run.
        own_threshold: the network's score from which ground is called safe; None: the one that
            the bundle recommends.
    """
    score = 0.5 if own_threshold is None else cores.heatmap_score(own_threshold)
    at = bin_from(score)
    counts = np.stack(tally.counts)
    bootstrap = Bootstrap(tally.frames)
    total, drawn = counts.sum(0, dtype=np.float64), bootstrap.sums(counts)
    figures: Figures = {
        'configuration': cores.name,
        'frames': tally.frames,
        'tiles': int(sum(tally.tiles)),
        'threshold': _rounded(cores.own_score(float(edges()[at]))),
    }

    areas, drawn_areas = Areas(total, at), Areas(drawn, at)
    for name in _AREA_RATES:
        values = getattr(areas, name), getattr(drawn_areas, name)
        figures |= _with_interval(name, *values, bootstrap)
    for name, rate in (('ece', calibration_error), ('average_precision', average_precision)):
        figures |= _with_interval(name, rate(total), rate(drawn), bootstrap)
    figures |= _hazard_figures(total, drawn, at, bootstrap)
    figures |= _term_figures(tally, bootstrap)
    figures |= _speed(tally, bootstrap)
    figures['curve'] = _curve(cores, total)
    figures['reliability'] = _reliability(total)
    figures['model'] = _model(cores)
    figures['prompts'] = dict(sorted(tally.prompts.items(), key=lambda item: -item[1])[:10])
    figures['per_frame'] = _per_frame(tally, at)
    figures['skipped'] = [{'name': each.name, 'reason': each.reason} for each in outcome.skipped]
    return figures


def _with_interval(name: str, value: Array, drawn: Array, bootstrap: Bootstrap) -> Figures:
    return {
        name: _number(float(value)),
        f'{name}_interval': _pair(bootstrap.interval(drawn)),
    }


def _hazard_figures(total: Array, drawn: Array, at: int, bootstrap: Bootstrap) -> Figures:
    key = 'false_safe_by_hazard'
    figures: Figures = {key: {}, f'{key}_interval': {}}
    for name, label in HAZARDS.items():
        figures[key][name] = _number(float(share_called_safe(total, label, at)))
        limits = bootstrap.interval(share_called_safe(drawn, label, at))
        figures[f'{key}_interval'][name] = _pair(limits)
    return figures


def _term_figures(tally: Tally, bootstrap: Bootstrap) -> Figures:
    """Return IoU by term, each at the threshold that is best for it on these frames.

    That is how zero-shot segmenters are compared (CLIPSeg, Lueddecke and Ecker 2022, "best"):
    networks differ in how sure their scores are, and no single threshold is fair to all.
    """
    figures: Figures = {
        'iou_by_term': {}, 'iou_by_term_interval': {}, 'term_threshold': {},
        'unscored_terms': list(tally.unscored_terms),
    }  # fmt: skip
    counts = np.stack(tally.term_counts)
    if not counts.any():
        return figures
    for place, term in enumerate(tally.terms):
        each = counts[:, place]
        total = each.sum(0, dtype=np.float64)
        curve = np.nan_to_num(term_iou(total), nan=-1.0)
        best = int(curve[1:].argmax()) + 1
        known = total[1].sum() > 0
        figures['iou_by_term'][term] = _number(float(curve[best])) if known else None
        drawn = bootstrap.sums(np.stack([each[..., best:].sum(-1), each[..., :best].sum(-1)], -1))
        called, missed, wrong = drawn[:, 1, 0], drawn[:, 1, 1], drawn[:, 0, 0]
        limits = bootstrap.interval(ratio(called, called + missed + wrong)) if known else None
        figures['iou_by_term_interval'][term] = _pair(limits)
        figures['term_threshold'][term] = _rounded(float(edges()[best])) if known else None
    return figures


def _speed(tally: Tally, bootstrap: Bootstrap) -> Figures:
    pairs = np.stack([np.array(tally.tiles, float), np.array(tally.seconds)], axis=1)
    drawn = bootstrap.sums(pairs)
    tiles, seconds = pairs.sum(0)
    return {
        'hz': _number(float(ratio(tiles, seconds))),
        'hz_interval': _pair(bootstrap.interval(ratio(drawn[:, 0], drawn[:, 1]))),
    }


def _curve(cores: Cores, total: Array) -> list[Figures]:
    areas = Areas(total, None)
    return [
        {
            'threshold': _rounded(cores.own_score(float(edges()[place]))),
            'recall': _number(float(areas.recall[place])),
            'precision': _number(float(1.0 - areas.false_safe[place])),
            'false_safe': _number(float(areas.false_safe[place])),
            'miou': _number(float(areas.miou[place])),
            'called_safe': _number(float(areas.called_safe[place])),
        }
        for place in range(_CURVE_EVERY, BINS, _CURVE_EVERY)
    ]


def _reliability(total: Array) -> list[Figures]:
    scores, shares, pixels = reliability(total)
    return [
        {
            'score': _number(float(score)),
            'safe': _number(float(share)),
            'share_of_pixels': _number(float(part / max(1.0, pixels.sum()))),
        }
        for score, share, part in zip(scores, shares, pixels, strict=True)
    ]


def _model(cores: Cores) -> Figures:
    return {
        'family': cores.segmentation.family,
        'bundle': cores.bundle.manifest.name,
        'precision': cores.bundle.manifest.precision,
        'checksum': cores.bundle.checksum,
        'recommended_threshold': cores.standing,
        'fusion': cores.segmentation.fusion,
        'terms': cores.segmentation.terms,
        'template': cores.prompting.template,
        'clip': '' if cores.prompting.is_static else cores.prompting.bundle,
        'threads': cores.segmentation.threads,
    }


def _per_frame(tally: Tally, at: int) -> list[Figures]:
    areas = Areas(np.stack(tally.counts), at)
    labelled = areas.safe_called + areas.safe_missed + areas.unsafe_called + areas.unsafe_kept
    wrong = ratio(areas.unsafe_called, labelled)
    return [
        {
            'name': name,
            'miou': _number(float(areas.miou[place])),
            'recall': _number(float(areas.recall[place])),
            'unsafe_called_safe_area': _number(float(wrong[place])),
        }
        for place, name in enumerate(tally.names)
    ]


def _number(value: float) -> float | None:
    return _rounded(value) if np.isfinite(value) else None


def _rounded(value: float) -> float:
    return round(value, 5)


def _pair(limits: tuple[float, float] | None) -> list[float] | None:
    return None if limits is None else [_rounded(limits[0]), _rounded(limits[1])]


def together(named: dict[str, Figures], outcome: Outcome) -> Figures:
    """Return what ``--json`` holds: the first configuration, and by name all of several."""
    figures: Figures = {
        'unit': 'shares are 0 to 1, intervals cover 95 % over frames',
        'source': outcome.source.title,
        'remarks': list(outcome.source.remarks),
        **next(iter(named.values())),
    }
    if len(named) > 1:
        figures['configurations'] = named
    return figures
