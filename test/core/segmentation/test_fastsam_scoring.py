# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scores of segments are shares among the terms, whatever the length of the embeddings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from peace_ros.core.segmentation.fastsam.scoring import is_usable, term_shares

_VALUES = st.floats(2**-10, 8.0, width=32) | st.floats(-8.0, -(2**-10), width=32)


def vectors(rows: int) -> st.SearchStrategy:
    return npst.arrays(np.float32, (rows, 5), elements=_VALUES)


@settings(max_examples=60, deadline=None)
@given(vectors(4), vectors(3), st.floats(1.0, 100.0))
def test_shares_add_up_and_the_nearest_term_leads(
    segments: np.ndarray, terms: np.ndarray, scale: float
) -> None:
    shares = term_shares(segments, terms, scale)
    assert shares.dtype == np.float32
    assert shares.min() >= 0.0
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-5)
    unit = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (segments, terms)]
    nearest = (unit[0] @ unit[1].T).argmax(axis=1)
    np.testing.assert_allclose(shares[range(4), nearest], shares.max(axis=1), atol=1e-3)


@settings(max_examples=30, deadline=None)
@given(vectors(4), vectors(3), st.floats(0.01, 100.0))
def test_length_means_nothing_and_segments_do_not_see_each_other(
    segments: np.ndarray, terms: np.ndarray, factor: float
) -> None:
    shares = term_shares(segments, terms, 20.0)
    longer = term_shares(segments * np.float32(factor), terms, 20.0)
    np.testing.assert_allclose(longer, shares, atol=1e-3)
    alone = term_shares(segments[1:2], terms, 20.0)
    np.testing.assert_allclose(alone[0], shares[1], atol=1e-5)


def test_equal_terms_share_equally_and_a_lead_of_a_hundredth_is_worth_e() -> None:
    equal = term_shares(np.ones((1, 4), np.float32), np.ones((5, 4), np.float32), 100.0)
    np.testing.assert_allclose(equal, 0.2, atol=1e-6)
    angles = np.arccos(np.array([0.30, 0.29]))
    terms = np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)
    first, second = term_shares(np.float32([[1.0, 0.0]]), terms, 100.0)[0]
    assert first / second == pytest.approx(np.e, rel=1e-3)


@pytest.mark.parametrize('bad', [0.0, np.nan, np.inf])
def test_vectors_without_a_direction_are_known(bad: float) -> None:
    rows = np.ones((3, 4), np.float32)
    assert is_usable(rows)
    rows[1] = bad
    assert not is_usable(rows)
