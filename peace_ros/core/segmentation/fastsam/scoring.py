# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Embeddings of segments and terms -> how each segment divides among the terms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def is_usable(vectors: NDArray[np.float32]) -> bool:
    """Tell whether every row is finite and has a direction."""
    lengths = np.linalg.norm(vectors, axis=1)
    return bool(np.isfinite(lengths).all() and (lengths > 0.0).all())


def term_shares(
    segments: NDArray[np.float32], terms: NDArray[np.float32], logit_scale: float
) -> NDArray[np.float32]:
    """Return how likely each segment shows each term, [N, T] float32; rows sum to 1.

    The softmax of the scaled cosine similarities runs over the terms of one segment, as in
    zero-shot classification with CLIP (Radford et al. 2021, figure 3). FastSAM's text prompt runs
    it over the segments of one text, to pick the single best one: that always finds a segment,
    even when nothing of the kind is in sight, and its numbers of two terms cannot be compared.

    Args:
        segments: [N, D] image embeddings, of any length but zero.
        terms: [T, D] text embeddings, likewise.
        logit_scale: of the CLIP model.
    """
    cosines = _unit(segments) @ _unit(terms).T
    odds = np.exp(np.float32(logit_scale) * (cosines - cosines.max(axis=1, keepdims=True)))
    shares: NDArray[np.float32] = (odds / odds.sum(axis=1, keepdims=True)).astype(np.float32)
    return shares


def _unit(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    lengths: NDArray[np.float32] = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / lengths
