# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Counts of a configuration -> its figures with their intervals, as ``--json`` writes them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from peace_ros.lab.evaluation.segmentation.bootstrap import Bootstrap, known, rounded
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.histograms import BINS, bin_from, edges
from peace_ros.lab.evaluation.segmentation.metrics import (
    HAZARDS,
    Areas,
    Array,
    average_precision,
    best_bin,
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
        tally: its counts.
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
        'threshold': rounded(cores.own_score(float(edges()[at]))),
    }

    def put(name: str, value: Array, drawn_values: Array) -> None:
        figures[name] = known(value)
        figures[f'{name}_interval'] = bootstrap.interval(drawn_values)

    areas, drawn_areas = Areas(total, at), Areas(drawn, at)
    for name in _AREA_RATES:
        put(name, getattr(areas, name), getattr(drawn_areas, name))
    put('ece', calibration_error(total), calibration_error(drawn))
    put('average_precision', average_precision(total), average_precision(drawn))
    speed = np.stack([np.array(tally.tiles, float), np.array(tally.seconds)], axis=1)
    put('hz', ratio(*speed.sum(0)), ratio(*bootstrap.sums(speed).T))
    figures['false_safe_by_hazard'] = {
        name: known(share_called_safe(total, label, at)) for name, label in HAZARDS.items()
    }
    figures['false_safe_by_hazard_interval'] = {
        name: bootstrap.interval(share_called_safe(drawn, label, at))
        for name, label in HAZARDS.items()
    }
    figures |= _term_figures(tally, bootstrap)
    figures['curve'] = _curve(cores, total)
    figures['reliability'] = _reliability(total)
    figures['model'] = _model(cores)
    figures['prompts'] = dict(tally.prompts.most_common(10))
    figures['per_frame'] = _per_frame(tally, at)
    figures['skipped'] = [asdict(each) for each in outcome.skipped]
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
    for place, term in enumerate(tally.terms if counts.any() else ()):
        each = counts[:, place]
        total = each.sum(0, dtype=np.float64)
        best = best_bin(term_iou(total))
        drawn = bootstrap.sums(np.stack([each[..., best:].sum(-1), each[..., :best].sum(-1)], -1))
        called, missed, wrong = drawn[:, 1, 0], drawn[:, 1, 1], drawn[:, 0, 0]
        limits = bootstrap.interval(ratio(called, called + missed + wrong))
        there = total[1].sum() > 0
        figures['iou_by_term'][term] = known(term_iou(total)[best]) if there else None
        figures['iou_by_term_interval'][term] = limits if there else None
        figures['term_threshold'][term] = rounded(edges()[best]) if there else None
    return figures


def _curve(cores: Cores, total: Array) -> list[Figures]:
    areas = Areas(total, None)
    rates = {
        'recall': areas.recall,
        'precision': 1.0 - areas.false_safe,
        'false_safe': areas.false_safe,
        'miou': areas.miou,
        'called_safe': areas.called_safe,
    }
    return [
        {
            'threshold': rounded(cores.own_score(float(edges()[place]))),
            **{name: known(rate[place]) for name, rate in rates.items()},
        }
        for place in range(_CURVE_EVERY, BINS, _CURVE_EVERY)
    ]


def _reliability(total: Array) -> list[Figures]:
    scores, shares, pixels = reliability(total)
    parts = pixels / max(1.0, pixels.sum())
    return [
        {'score': known(score), 'safe': known(share), 'share_of_pixels': known(part)}
        for score, share, part in zip(scores, shares, parts, strict=True)
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
            'miou': known(areas.miou[place]),
            'recall': known(areas.recall[place]),
            'unsafe_called_safe_area': known(wrong[place]),
        }
        for place, name in enumerate(tally.names)
    ]


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
