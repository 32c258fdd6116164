# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Properties that make the fused score safe."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from peace_ros.core.segmentation.fusion import FUSIONS, calibrated, set_difference, soft_difference

SCORES = arrays(np.float32, (3, 4), elements=st.floats(0.0, 1.0, width=32))
Maps = NDArray[np.float32]


@given(SCORES, SCORES)
def test_never_safer_than_the_positives_or_than_the_negatives_allow(sp: Maps, sn: Maps) -> None:
    for fuse in (set_difference, soft_difference):
        sf = fuse(sp, sn)
        assert sf.dtype == np.float32
        assert (sf <= sp).all()
        assert (sf <= np.float32(1.0) - sn).all()
        assert (sf >= 0.0).all()


@given(SCORES, SCORES, SCORES)
def test_more_for_never_lowers_and_more_against_never_raises(
    sp: Maps, sn: Maps, more: Maps
) -> None:
    for fuse in (set_difference, soft_difference):
        assert (fuse(np.maximum(sp, more), sn) >= fuse(sp, sn)).all()
        assert (fuse(sp, np.maximum(sn, more)) <= fuse(sp, sn)).all()


@given(SCORES, SCORES)
def test_the_product_is_the_stricter_one(sp: Maps, sn: Maps) -> None:
    assert (soft_difference(sp, sn) <= set_difference(sp, sn)).all()


def test_crisp_sets_give_equation_two_of_the_paper() -> None:
    sp = np.array([[0, 0, 1, 1]], np.float32)
    sn = np.array([[0, 1, 0, 1]], np.float32)
    for fuse in (set_difference, soft_difference):
        assert fuse(sp, sn).tolist() == [[0, 0, 1, 0]]


def test_each_fusion_names_the_outputs_it_needs() -> None:
    assert {name: fusion.outputs for name, fusion in FUSIONS.items()} == {
        'set_difference': ('positive', 'negative'),
        'soft': ('positive', 'negative'),
        'softmax': ('softmax_positive',),
    }


@given(SCORES, st.floats(0.05, 0.95))
def test_calibration_moves_the_threshold_to_one_half_and_keeps_the_order(
    scores: Maps, threshold: float
) -> None:
    moved = calibrated(scores, threshold)
    assert moved.dtype == np.float32
    assert ((moved >= 0.0) & (moved <= 1.0)).all()
    assert (np.diff(moved.ravel()[np.argsort(scores.ravel())]) >= 0.0).all()
    assert abs(float(calibrated(np.float32([[threshold]]), threshold)[0, 0]) - 0.5) < 1e-5
    assert calibrated(np.float32([[0.0, 1.0]]), threshold).tolist() == [[0.0, 1.0]]
