# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Histograms give the rates that counting pixels by hand gives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from peace_ros.core.domain import Label, is_safe
from peace_ros.lab.evaluation.segmentation.bootstrap import Bootstrap
from peace_ros.lab.evaluation.segmentation.histograms import (
    BINS,
    LABELS,
    MIDDLE,
    bin_from,
    bins_of,
    count_labels,
    count_terms,
    edges,
)
from peace_ros.lab.evaluation.segmentation.metrics import (
    HAZARDS,
    Areas,
    average_precision,
    calibration_error,
    reliability,
    share_called_safe,
    term_iou,
)
from peace_ros.lab.evaluation.segmentation.tiles import WHOLE, tiles_of

SIDE = 24
labels_and_scores = st.tuples(
    hnp.arrays(np.uint8, (SIDE, SIDE), elements=st.integers(0, LABELS - 1)),
    hnp.arrays(np.float32, (SIDE, SIDE), elements=st.floats(0, 1, width=32)),
)


@given(labels_and_scores, st.integers(1, BINS - 1))
@settings(max_examples=30, deadline=None)
def test_rates_are_those_of_the_pixels(drawn: tuple[np.ndarray, np.ndarray], at: int) -> None:
    labels, scores = drawn
    areas = Areas(count_labels(labels, scores), at)
    known = labels != Label.UNLABELED
    safe = is_safe(labels) & known
    called = (bins_of(scores) >= at) & known
    hit, union = (safe & called).sum(), (safe | called).sum()
    if union:
        assert areas.iou_safe == pytest.approx(hit / union)
    if called.any():
        assert areas.false_safe == pytest.approx(1.0 - hit / called.sum())
    else:
        assert np.isnan(areas.false_safe)
    if safe.any():
        assert areas.recall == pytest.approx(hit / safe.sum())
    for label in HAZARDS.values():
        of_kind = labels == label
        if of_kind.any():
            share = share_called_safe(count_labels(labels, scores), label, at)
            assert share == pytest.approx((called & of_kind).sum() / of_kind.sum())


def test_one_half_is_called_safe_and_what_lies_below_is_not() -> None:
    scores = np.array([0.5, np.nextafter(np.float32(0.5), np.float32(0)), 0.49, 0, 1], np.float32)
    assert (bins_of(scores) >= MIDDLE).tolist() == [True, False, False, False, True]
    assert bin_from(0.5) == MIDDLE
    assert edges()[MIDDLE] == 0.5
    assert (np.diff(edges()) > 0).all()


def test_calling_everything_unsafe_scores_the_baseline() -> None:
    labels = np.full((4, 4), Label.WATER, np.uint8)
    labels[0] = Label.GRASS
    areas = Areas(count_labels(labels, np.zeros((4, 4), np.float32)), MIDDLE)
    assert areas.baseline_miou == pytest.approx(0.75 / 2)
    assert areas.miou == pytest.approx(areas.baseline_miou)
    assert np.isnan(areas.false_safe)


def test_all_thresholds_at_once_agree_with_one_by_one() -> None:
    rng = np.random.default_rng(1)
    labels = rng.integers(0, LABELS, (50, 50)).astype(np.uint8)
    counts = count_labels(labels, rng.random((50, 50), np.float32))
    every = Areas(counts, None)
    for at in (1, 100, MIDDLE, 200):
        assert every.miou[at] == pytest.approx(float(Areas(counts, at).miou))


def test_scores_that_tell_the_truth_have_no_calibration_error() -> None:
    rng = np.random.default_rng(2)
    scores = rng.random((400, 400), np.float32)
    honest = np.where(rng.random((400, 400)) < scores, Label.GRASS, Label.WATER)
    counts = count_labels(honest.astype(np.uint8), scores)
    assert calibration_error(counts) < 0.01
    score, share, pixels = reliability(counts)
    assert np.allclose(score, share, atol=0.03)
    assert pixels.sum() == honest.size
    sure = count_labels(honest.astype(np.uint8), np.ones_like(scores))
    assert calibration_error(sure) == pytest.approx(0.5, abs=0.02)


def test_a_perfect_order_of_scores_has_an_average_precision_of_one() -> None:
    labels = np.array([[Label.GRASS, Label.BARE_GROUND, Label.TREE, Label.PERSON]], np.uint8)
    scores = np.array([[0.9, 0.7, 0.4, 0.1]], np.float32)
    assert average_precision(count_labels(labels, scores)) == pytest.approx(1.0)
    backwards = average_precision(count_labels(labels, scores[:, ::-1].copy()))
    assert backwards < 0.6


def test_a_term_is_scored_against_all_that_it_means() -> None:
    labels = np.array([[Label.GRASS, Label.GRASS, Label.WATER, Label.UNLABELED]], np.uint8)
    maps = np.array([[[0.9, 0.2, 0.8, 0.9]]], np.float32)
    meanings = np.zeros((1, LABELS), bool)
    meanings[0, Label.GRASS] = True
    counts = count_terms(labels, maps, meanings)
    assert counts.sum() == 3
    assert term_iou(counts)[0, MIDDLE] == pytest.approx(1 / 3)


@given(st.integers(16, 90), st.integers(16, 90), st.sampled_from([None, WHOLE, 16, 37, 200]))
@settings(max_examples=60, deadline=None)
def test_every_pixel_belongs_to_one_tile_and_tiles_are_square(
    height: int, width: int, tile_px: int | None
) -> None:
    labels = np.random.default_rng(0).integers(1, LABELS, (height, width)).astype(np.uint8)
    counts = np.zeros(LABELS, int)
    for tile in tiles_of(height, width, tile_px):
        own = tile.labels_of(labels)
        counts += np.bincount(own.ravel(), minlength=LABELS)
        if tile_px != WHOLE:
            assert own.shape[0] == own.shape[1] <= min(height, width)
    assert np.array_equal(counts[1:], np.bincount(labels.ravel(), minlength=LABELS)[1:])


def test_intervals_hold_the_figure_are_repeatable_and_shrink_with_frames() -> None:
    rng = np.random.default_rng(3)
    widths = []
    for frames in (10, 160):
        hits = rng.random(frames)
        pairs = np.stack([hits, np.ones(frames)], axis=1)
        limits = []
        for _ in range(2):
            bootstrap = Bootstrap(frames)
            sums = bootstrap.sums(pairs)
            limits.append(bootstrap.interval(sums[:, 0] / sums[:, 1]))
        assert limits[0] == limits[1]
        assert limits[0] is not None
        low, high = limits[0]
        assert low < hits.mean() < high
        widths.append(high - low)
    assert widths[1] < widths[0] / 2
    assert Bootstrap(1).interval(np.ones(10)) is None
